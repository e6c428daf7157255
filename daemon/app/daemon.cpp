// Who is made, started and ended, in which order.
#include "daemon/app/daemon.hpp"

#include <pthread.h>
#include <spdlog/fmt/fmt.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <future>

#include "daemon/app/campaign_forecast.hpp"
#include "daemon/configuration/warnings.hpp"
#include "daemon/record/journal_anchors.hpp"

namespace vibrig {

namespace {

/// From a thread that may not format; a full ring counts what it has lost.
void tell(rt::Ring<RtEvent>& ring, Severity severity, const char* source,
          const char* text) noexcept {
    RtEvent event;
    event.severity = severity;
    std::strncpy(event.source.data(), source, event.source.size() - 1);
    std::strncpy(event.text.data(), text, event.text.size() - 1);
    ring.try_push(event);
}

/// Of which the campaign's quadratic coefficients will be, Hz; 0: only its result says it.
double one_frequency(const configuration::Configuration& of) {
    const bool several = std::ranges::any_of(of.campaign.stops, [&](const campaign::Stop& stop) {
        return !stop.verify && (stop.random || stop.sweep.any() ||
                                (stop.frequency_hz > 0 &&
                                 !estimator::at_reference(of.estimator, stop.frequency_hz)));
    });
    return several ? 0 : of.estimator.frequency_hz;
}

std::unique_ptr<fleet::Publisher> make_publisher(StatusSource& source, Parts& parts) {
    const auto& mqtt = parts.configuration.mqtt;
    if (mqtt.host.empty()) return nullptr;
    return std::make_unique<fleet::Publisher>(source, mqtt, parts.events.sink("mqtt"));
}

}  // namespace

Daemon::Daemon(configuration::Loaded loaded, const log::LogQueue* log_queue)
    : parts_(std::move(loaded), log_queue),
      supervisor_(parts_, latches_),
      outside_(parts_, supervisor_),
      control_(parts_, latches_, supervisor_, outside_),
      status_(parts_, control_, outside_),
      plan_(plan_data(parts_.configuration)),
      publisher_(make_publisher(*this, parts_)) {}

Daemon::~Daemon() {
    shut_down();
    join();
}

void Daemon::start() {
    parts_.started = parts_.clock.now();
    make_results_folder();
    open_journal();
    parts_.events.log(Severity::info, "configuration", parts_.in_force());
    open_outbox();
    start_recording();
    outside_.open();
    control_.announce_latches();
    // A daemon that died may have left it running inside the watchdog's time.
    parts_.shaker->stop_now();
    control_.hold_untried_registers();
    watch_shaker();
    start_acquisition();
    start_shaker();
    start_threads();
    if (publisher_) publisher_->start();
    outside_.start();
}

void Daemon::join() {
    if (parts_.outbox) parts_.outbox->stop();
    if (publisher_) publisher_->stop();
    outside_.stop();
    control_.give_up();
    if (control_thread_.joinable()) control_thread_.join();
    parts_.shaker->shut_down();
    parts_.estimator_stage.stop();
    if (estimator_thread_.joinable()) estimator_thread_.join();
    if (acquisition_thread_.joinable()) {
        parts_.acquisition.stop();
        acquisition_thread_.join();
    }
    if (parts_.pre_trip) parts_.pre_trip->stop();
    if (parts_.recorder) parts_.recorder->stop();
    if (parts_.journal) parts_.journal->stop();
}

void Daemon::make_results_folder() const {
    const auto& folder = parts_.configuration.results;
    if (folder.empty()) return;
    std::error_code error;
    std::filesystem::create_directories(folder, error);
    if (::access(folder.c_str(), W_OK) == 0) return;
    throw std::runtime_error("campaign.results: found \"" + folder +
                             "\", expected a folder that can be written: " + std::strerror(errno));
}

void Daemon::open_journal() {
    const auto& configuration = parts_.configuration;
    auto path = configuration.journal;
    if (path.empty() && !configuration.results.empty())
        path = (std::filesystem::path(configuration.results) / "journal.sqlite3").string();
    if (path.empty()) return;
    // It has to go through the heads that the newest recordings carry.
    parts_.journal = std::make_unique<journal::Journal>(
        path, journal::configuration_hash(result_configuration(parts_.loaded)),
        [this](double free_mb) { parts_.interlock.disk_free(free_mb); },
        record::journal_anchors(parts_.recordings()));
    auto& journal = *parts_.journal;
    parts_.events.keep_in(&journal);
    control_.take_over();
    journal.on_written([this] { parts_.control_waiter->wake(); });
    parts_.estimator_stage.feed_to(journal.fed());
    journal.start();
}

/// What is recorded is delivered; it goes by the recordings' folder alone.
void Daemon::open_outbox() {
    const auto& configuration = parts_.configuration;
    if (configuration.archive.folder.empty() || !parts_.recorder) return;
    parts_.outbox = std::make_unique<archive::Outbox>(
        configuration.archive, parts_.recordings(),
        archive::Outbox::Unit{
            configuration.paperwork.unit_serial,
            configuration.campaign.type_prior ? configuration.paperwork.unit_type : "",
            configuration.simulated(), one_frequency(configuration)},
        parts_.events.sink("archive"));
    parts_.outbox->start();
}

void Daemon::start_recording() {
    if (auto& recorder = parts_.recorder) {
        recorder->watch([this] { return parts_.estimator_stage.view().estimate; },
                        [this] { return control_.conditions(); });
        recorder->sign_with([this](std::uint64_t entry) {
            return parts_.journal ? parts_.journal->head_with(entry) : std::string();
        });
        recorder->start();
    }
    if (parts_.pre_trip) parts_.pre_trip->start();
}

void Daemon::watch_shaker() {
    parts_.shaker->on_judging([this](const drivers::ShakerReading& reading) {
        control_.first_reading(reading);
        parts_.interlock.check(reading);
    });
    parts_.shaker->on_reading([this] { parts_.control_waiter->notify(); });
    parts_.shaker->on_stop_written([this] { parts_.interlock.stop_written(); });
}

void Daemon::start_acquisition() {
    parts_.acquisition.start([this](drivers::PortState state, const char* text) {
        const bool running = state == drivers::PortState::running;
        tell(parts_.port_events, running ? Severity::info : Severity::warning, "can", text);
        if (!running) parts_.interlock.lost_bus();
        parts_.control_waiter->notify();
    });
}

void Daemon::start_shaker() {
    auto& shaker = *parts_.shaker;
    shaker.start([this] { return supervisor_.may_feed(); },
                 [this](drivers::LinkState state, const char* text) {
                     const bool running = state == drivers::LinkState::running;
                     tell(parts_.shaker_events, running ? Severity::info : Severity::warning,
                          "shaker", text);
                     parts_.control_waiter->notify();
                 });
}

void Daemon::start_threads() {
    const auto& configuration = parts_.configuration;
    const auto begin = [this](std::thread& thread, rt::ThreadSetup& setup, rt::ThreadWishes wishes,
                              auto body) {
        // The rig waits for us where it owns the time: a thread that comes first is only woken for
        // every frame instead of every sample.
        if (!parts_.in_real_time()) wishes = {wishes.name};
        std::promise<rt::ThreadSetup> promise;
        auto ready = promise.get_future();
        thread = std::thread([wishes, body, done = std::move(promise)]() mutable {
            done.set_value(rt::set_up_this_thread(wishes));
            body();
        });
        auto done = ready.get();
        for (const auto& what : done.missing)
            parts_.events.log(Severity::warning, wishes.name, what);
        const std::lock_guard lock(parts_.setups_mutex);
        setup = std::move(done);
    };
    for (const auto& line : configuration::warnings(parts_.loaded))
        parts_.events.log(Severity::warning, "configuration", line);
    if (parts_.in_real_time() && configuration.lock_memory && !parts_.memory_lock.locked)
        parts_.events.log(Severity::warning, "memory", "not locked: " + parts_.memory_lock.cause);
    control_thread_ = std::thread([this] {
        ::pthread_setname_np(::pthread_self(), "control");
        control_.run();
    });
    begin(estimator_thread_, parts_.estimator_setup,
          {"estimator", configuration.estimator_priority, configuration.estimator_cpu}, [this] {
              // Ordinary threads share a CPU with whoever is there: they are not to be held to one.
              if (parts_.configuration.estimator_cpu < 0 && rt::this_thread_is_fifo())
                  parts_.estimator_stage.stay_by_giver();
              parts_.estimator_stage.run();
          });
    begin(acquisition_thread_, parts_.acquisition_setup,
          {"acquisition", configuration.acquisition_priority, configuration.acquisition_cpu},
          [this] { parts_.io.run(); });
}

double Daemon::longest_end_s() const {
    const auto& campaign = parts_.configuration.campaign;
    // The ramp down and its grace, then the stop and its verdict.
    return campaign.ramp_s + 2 * campaign.stop.deadline_s +
           campaign.stop.pads.from_s(campaign.max_acceleration_g) +
           3 * drivers::to_seconds(parts_.configuration.shaker.watchdog_period);
}

StatusData Daemon::status() const {
    auto status = status_.status();
    if (publisher_) status.mqtt = publisher_->status();
    return status;
}

StatusData Daemon::serving(const ServerStatus& server) {
    supervisor_.served();
    status_.serving(server);
    return status();
}

void Daemon::refused(const std::string& who, const std::string& what, const std::string& why) {
    parts_.events.log(Severity::warning, "server",
                      fmt::format("refused {} ({}): {}", what, who, why));
}

void Daemon::log_event(Severity severity, const std::string& text) {
    parts_.events.log(severity, "server", text);
}

}  // namespace vibrig
