#include "daemon/daemon.hpp"

#include <pthread.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <tuple>

#include "daemon/tool/result_json.hpp"
#include "daemon/version.hpp"

namespace vibrig {

using drivers::Time;

namespace {

// A stage that has made no progress for this long keeps the shaker's watchdog hungry.
constexpr Time kProgressDeadline = drivers::kSecond;

template <std::size_t N>
void copy_text(std::array<char, N>& to, const char* from) noexcept {
    std::strncpy(to.data(), from, N - 1);
}

proto::Dbc load_dbc(const std::string& path) {
    return path.empty() ? proto::parse_dbc(proto::rig_dbc_text(), "rig.dbc")
                        : proto::read_dbc(path);
}

std::int64_t utc_now() {
    return std::chrono::duration_cast<std::chrono::nanoseconds>(
               std::chrono::system_clock::now().time_since_epoch())
        .count();
}

/// Ordinary scheduling when it cannot be had; the reason is returned for the log.
std::string set_fifo(std::thread& thread, int priority) {
    if (priority <= 0) return {};
    const sched_param parameters{.sched_priority = priority};
    const int error = ::pthread_setschedparam(thread.native_handle(), SCHED_FIFO, &parameters);
    return error == 0 ? std::string{} : std::strerror(error);
}

}  // namespace

Daemon::Daemon(configuration::Loaded loaded)
    : loaded_(std::move(loaded)),
      configuration_(loaded_.configuration),
      rig_clock_(configuration_.clock == configuration::Configuration::ClockKind::rig
                     ? std::make_unique<rt::RigClock>()
                     : nullptr),
      real_clock_(rig_clock_ ? nullptr : std::make_unique<rt::RealClock>()),
      clock_(rig_clock_ ? static_cast<drivers::Clock&>(*rig_clock_) : *real_clock_),
      dbc_(load_dbc(configuration_.dbc)),
      port_(drivers::make_can_port(io_, configuration_.can)),
      shaker_(drivers::make_shaker(clock_, configuration_.shaker)),
      control_waiter_(clock_.make_waiter()),
      estimator_waiter_(clock_.make_waiter()),
      interlock_(*shaker_, *control_waiter_, {configuration_.campaign.max_acceleration_g}),
      identification_(configuration_.estimator),
      estimator_stage_(estimator_ring_, *estimator_waiter_, *control_waiter_, identification_),
      acquisition_(io_, *port_, dbc_, configuration_.assembler, clock_, rig_clock_.get(),
                   {estimator_ring_, *estimator_waiter_, *control_waiter_, interlock_}),
      gimbal_(dbc_, configuration_.gimbal, *port_),
      campaign_(configuration_.campaign,
                {gimbal_, *shaker_, [this] { return acquisition_.view().platform; },
                 [this](const rt::DwellOrder& order) { return estimator_stage_.order(order); },
                 [this](bool excitation) { interlock_.watch(excitation); },
                 [this] { identification_ = estimator::Identification(configuration_.estimator); },
                 [this](bool complete) { end_campaign(complete); },
                 [this](Severity severity, const std::string& text) {
                     log(severity, "campaign", text);
                 }}) {}

void Daemon::check_bindings(const configuration::Configuration& configuration) {
    const auto dbc = load_dbc(configuration.dbc);
    const drivers::SampleAssembler assembler(dbc, configuration.assembler,
                                             [](const drivers::Sample&) {});
    boost::asio::io_context io;
    const auto port = drivers::make_can_port(io, configuration.can);
    const drivers::Gimbal gimbal(dbc, configuration.gimbal, *port);
}

Daemon::~Daemon() {
    shut_down();
    join();
}

void Daemon::start() {
    started_ = clock_.now();
    shaker_->on_reading([this] {
        interlock_.check(shaker_->reading());
        control_waiter_->notify();
    });
    acquisition_.start(
        [this](drivers::PortState state, const char* text) { on_port_state(state, text); });
    shaker_->start([this] { return may_feed(); },
                   [this](drivers::LinkState state, const char* text) {
                       RtEvent event;
                       event.severity = state == drivers::LinkState::running ? Severity::info
                                                                             : Severity::warning;
                       copy_text(event.source, "shaker");
                       copy_text(event.text, text);
                       shaker_events_.try_push(event);
                       control_waiter_->notify();
                   });
    control_thread_ = std::thread([this] { control_loop(); });
    estimator_thread_ = std::thread([this] { estimator_stage_.run(); });
    acquisition_thread_ = std::thread([this] { io_.run(); });
    for (const auto& [thread, priority, name] :
         {std::tuple{&acquisition_thread_, configuration_.acquisition_priority, "acquisition"},
          std::tuple{&estimator_thread_, configuration_.estimator_priority, "estimator"}}) {
        if (const auto why = set_fifo(*thread, priority); !why.empty()) {
            log(Severity::warning, name,
                fmt::format("SCHED_FIFO {} could not be had ({}): ordinary scheduling", priority,
                            why));
        }
    }
}

void Daemon::shut_down() noexcept {
    shut_down_.store(true);
    control_waiter_->notify();
}

void Daemon::join() {
    if (control_thread_.joinable()) control_thread_.join();
    if (!acquisition_thread_.joinable()) return;
    shaker_->shut_down();
    estimator_stage_.stop();
    acquisition_.stop();
    estimator_thread_.join();
    acquisition_thread_.join();
}

void Daemon::on_port_state(drivers::PortState state, const char* text) noexcept {
    RtEvent event;
    event.severity = state == drivers::PortState::running ? Severity::info : Severity::warning;
    copy_text(event.source, "can");
    copy_text(event.text, text);
    port_events_.try_push(event);
    if (state != drivers::PortState::running) interlock_.lost_bus();
    control_waiter_->notify();
}

void Daemon::log(Severity severity, const std::string& source, const std::string& text) {
    EventRecord record;
    record.utc_ns = utc_now();
    record.time = clock_.now();
    record.severity = severity;
    record.source = source;
    record.text = text;
    event_log_.append(record);
    const auto level = severity == Severity::info      ? spdlog::level::info
                       : severity == Severity::warning ? spdlog::level::warn
                                                       : spdlog::level::err;
    spdlog::log(level, "{}: {}", source, text);
}

bool Daemon::may_feed() const noexcept {
    const Time now = clock_.now();
    const Time oldest = std::min(
        {acquisition_.view().beat, estimator_stage_.view().sample_time, control_beat_.load()});
    return now - oldest <= kProgressDeadline;
}

void Daemon::take_commands(Time now) {
    std::deque<WaitingCommand> taken;
    {
        const std::lock_guard lock(mutex_);
        taken.swap(commands_);
    }
    for (auto& waiting : taken) {
        if (waiting.request.kind == CommandRequest::Kind::acknowledge) interlock_.acknowledge();
        waiting.reply.set_value(campaign_.command(waiting.request, now));
    }
}

void Daemon::control_loop() {
    rt::Trip handled = rt::Trip::none;
    for (;;) {
        const Time now = clock_.now();
        control_beat_.store(now);
        const auto words = [this](const RtEvent& event) {
            log(event.severity, event.source.data(), event.text.data());
        };
        port_events_.consume(words);
        shaker_events_.consume(words);
        const rt::Trip trip = interlock_.tripped();
        if (trip != rt::Trip::none && handled == rt::Trip::none) {
            campaign_.on_trip(rt::text_of(trip), now);
        }
        handled = trip;
        take_commands(now);
        if (shut_down_.load()) campaign_.shut_down(now);
        rt::DwellDone done;
        while (estimator_stage_.take_done(done)) {
            campaign_.on_dwell_done(done.summary);
            auto result = identification_.result();
            const std::lock_guard lock(mutex_);
            result_ = std::move(result);
        }
        const Time next = campaign_.step(now);
        {
            const std::lock_guard lock(mutex_);
            campaign_.fill(campaign_status_, now);
            ended_ = campaign_.done();
            if (ended_) {
                for (auto& waiting : commands_)
                    waiting.reply.set_value({false, "the daemon is shutting down"});
                commands_.clear();
                break;
            }
        }
        control_waiter_->wait_until(std::min(next, now + drivers::kSecond / 2));
    }
}

void Daemon::end_campaign(bool complete) {
    if (configuration_.results.empty()) return;
    const auto folder = std::filesystem::path(configuration_.results);
    const auto path = folder / "result.json";
    const std::lock_guard lock(mutex_);
    std::error_code error;
    std::filesystem::create_directories(folder, error);
    std::ofstream file(path);
    file << tool::result_json(result_);
    file.close();
    if (!file) {
        log(Severity::alarm, "campaign", "cannot write " + path.string());
    } else {
        log(Severity::info, "campaign",
            fmt::format("{} result in {}", complete ? "complete" : "partial", path.string()));
    }
}

StatusData Daemon::status() const {
    StatusData status;
    {
        const std::lock_guard lock(mutex_);
        status = campaign_status_;
    }
    const auto acquired = acquisition_.view();
    const auto estimated = estimator_stage_.view();
    const Time now = clock_.now();
    status.version = kVersion;
    status.clock = rig_clock_ ? "rig" : "real";
    status.time = now;
    status.utc_ns = utc_now();
    status.uptime = now - started_;
    status.shaker = shaker_->reading();
    status.shaker_link = shaker_->state();
    status.shaker_counters = shaker_->counters();
    status.can = port_->state();
    status.can_counters = port_->counters();
    status.assembler = acquired.assembler;
    const auto ring = estimator_stage_.ring();
    status.estimator_ring = {ring.pushed, ring.popped, ring.dropped};
    status.sample = acquired.sample;
    for (std::size_t c = 0; c < drivers::kChannels; ++c) {
        status.channel_age_s[c] =
            acquired.last_good[c] == 0 ? -1.0 : drivers::to_seconds(now - acquired.last_good[c]);
    }
    status.platform = acquired.platform;
    status.estimate = estimated.estimate;
    return status;
}

std::vector<EventRecord> Daemon::events(std::uint64_t after_id, std::size_t at_most) const {
    return event_log_.after(after_id, at_most);
}

estimator::Result Daemon::result() const {
    const std::lock_guard lock(mutex_);
    return result_;
}

std::string Daemon::effective_configuration() const {
    return configuration::format_effective(loaded_);
}

CommandReply Daemon::command(const CommandRequest& request) {
    // A stop does not wait for the control thread.
    if (request.kind == CommandRequest::Kind::abort) shaker_->stop_now();
    std::future<CommandReply> reply;
    {
        const std::lock_guard lock(mutex_);
        if (ended_) return {false, "the daemon is shutting down"};
        reply = commands_.emplace_back(WaitingCommand{request, {}}).reply.get_future();
        control_waiter_->notify();
    }
    if (reply.wait_for(std::chrono::seconds(5)) != std::future_status::ready) {
        return {false, "no answer from the control thread within 5 s"};
    }
    return reply.get();
}

}  // namespace vibrig
