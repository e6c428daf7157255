#include "daemon/app/daemon.hpp"

#include <pthread.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstring>
#include <filesystem>

#include "daemon/order/campaign_order.hpp"
#include "daemon/results/result_json.hpp"
#include "daemon/serve/one_line.hpp"
#include "daemon/version.hpp"
#include "drivers/sample/signal_binding.hpp"
#include "estimator/identification/plan_report.hpp"

namespace vibrig {

using drivers::Time;

namespace {

// The simulated rig's clock stands still with it: its silence is one of wall time.
constexpr Time kSimulatedSilence = 10 * drivers::kSecond;

template <std::size_t N>
void copy_text(std::array<char, N>& to, const char* from) noexcept {
    std::strncpy(to.data(), from, N - 1);
}

drivers::ShakerSettings shaker_settings(const configuration::Configuration& configuration) {
    auto settings = configuration.shaker;
    if (configuration.clock == configuration::Configuration::ClockKind::rig) {
        // The rig's time stands still meanwhile: a busy machine is slower, not different.
        settings.response_timeout = std::max(settings.response_timeout, 10 * drivers::kSecond);
        settings.stop_ramp_timeout = settings.response_timeout;
    }
    return settings;
}

rt::AmplitudeWitness::Settings witness_settings(const configuration::Configuration& configuration,
                                                const proto::Dbc& dbc) {
    const auto& rig = configuration.estimator;
    const auto& names = configuration.assembler.bindings;
    const auto count = [&dbc](const std::string& name) {
        const auto bound = drivers::bind_signal(dbc, "can.signals", name);
        // A floating-point number has no counts.
        const bool counts = bound && bound.signal->type == proto::ValueType::integer;
        return counts ? std::abs(bound.signal->scale) : 0;
    };
    return {rig.frequency_hz,
            configuration.assembler.sample_period,
            rig.accelerometer_zero_g,
            rig.accelerometer_matrix,
            {count(names.accel_x), count(names.accel_y), count(names.accel_z),
             count(names.table_accel)}};
}

}  // namespace

std::int64_t utc_now() {
    return std::chrono::duration_cast<std::chrono::nanoseconds>(
               std::chrono::system_clock::now().time_since_epoch())
        .count();
}

Daemon::Daemon(configuration::Loaded loaded, const log::LogQueue* log_queue)
    : loaded_(put_in_order(std::move(loaded))),
      configuration_(loaded_.configuration),
      log_queue_(log_queue),
      memory_lock_(lock_memory()),
      rig_clock_(configuration_.clock == configuration::Configuration::ClockKind::rig
                     ? std::make_unique<rt::RigClock>()
                     : nullptr),
      real_clock_(rig_clock_ ? nullptr : std::make_unique<rt::RealClock>()),
      clock_(rig_clock_ ? static_cast<drivers::Clock&>(*rig_clock_) : *real_clock_),
      dbc_(load_dbc(configuration_.dbc)),
      port_(drivers::make_can_port(io_, configuration_.can)),
      shaker_(drivers::make_shaker(clock_, shaker_settings(configuration_))),
      control_waiter_(std::make_unique<rt::StirredWaiter>(clock_.make_waiter())),
      estimator_waiter_(clock_.make_waiter()),
      interlock_(*shaker_, *control_waiter_,
                 {configuration_.campaign.max_acceleration_g, configuration_.gimbal.status_deadline,
                  configuration_.interlock, witness_settings(configuration_, dbc_),
                  configuration_.estimator.transmission}),
      identification_(configuration_.estimator),
      estimator_stage_(estimator_ring_, *estimator_waiter_, *control_waiter_, identification_),
      noise_monitor_(
          configuration_.estimator,
          [this](Severity severity, const std::string& text) { log(severity, "noise", text); }),
      recorder_(make_recorder()),
      sent_tap_(recorder_ ? std::make_unique<record::SentTap>(*port_, clock_, recorder_->sent())
                          : nullptr),
      pre_trip_(make_pre_trip()),
      stage_feed_(dbc_, campaign::stage_feed_settings(configuration_.campaign),
                  control_waiter_.get()),
      rest_(configuration_.campaign.rest, configuration_.assembler.sample_period,
            witness_settings(configuration_, dbc_).count_g),
      acquisition_(
          io_, *port_, dbc_, configuration_.assembler, clock_, rig_clock_.get(),
          {estimator_ring_, *estimator_waiter_, *control_waiter_, interlock_, &stage_feed_,
           recorder_ ? &recorder_->received() : nullptr,
           recorder_ ? &recorder_->samples() : nullptr, pre_trip_ ? &pre_trip_->samples() : nullptr,
           in_real_time()
               ? &estimator_stage_.time_by(clock_, configuration_.assembler.sample_period)
               : nullptr,
           &rest_}),
      gimbal_(dbc_, configuration_.gimbal, sending_port()),
      torquer_(configuration_.campaign.levelling
                   ? std::make_unique<drivers::Torquer>(dbc_, configuration_.campaign.level.torquer,
                                                        sending_port())
                   : nullptr),
      adaptive_(adaptive_plan(configuration_)),
      plan_(plan_data(configuration_)),
      campaign_(
          configuration_.campaign,
          {gimbal_,
           *shaker_,
           [this] { return acquisition_.view().platform; },
           [this](const rt::DwellOrder& order) {
               const bool taken = estimator_stage_.order(order);
               if (taken && !order.cancel) ++dwells_with_estimator_;
               if (taken && recorder_)
                   recorder_->ordered(order, clock_.now(), identification_.noise());
               return taken;
           },
           [this](rt::Guard level) {
               excitation_.store(level == rt::Guard::excitation);
               interlock_.guard(level);
           },
           [this] { return dwells_with_estimator_ == 0 && to_write_ == ToWrite::nothing; },
           [this] {
               planning_.abandon();  // of a campaign that was aborted
               assessing_.abandon();
               identification_ = estimator::Identification(configuration_.estimator);
               noise_monitor_.reset();
               verdict_told_.clear();
               const std::lock_guard lock(mutex_);
               campaign_status_.verdict = {};
               result_ = {};
               for (const std::string& line : check_plan(configuration_))
                   log(Severity::warning, "campaign", line);
           },
           [this](bool complete) {
               to_write_ = complete ? ToWrite::complete : ToWrite::partial;
               noise_monitor_.report();
           },
           [this](Severity severity, const std::string& text) { tell_campaign(severity, text); },
           [this](const std::array<double, 3>& here_deg, double elapsed_s) {
               return next_dwell(here_deg, elapsed_s);
           },
           [this](double table_g, const std::array<double, 3>& position_deg) {
               interlock_.command(table_g, position_deg);
           },
           [this](const estimator::DwellInfo& info, const estimator::DwellSummary& summary,
                  const StopDone& stop) {
               if (journal_) journal_->dwell_done(info, summary, stop);
           },
           [this] { return resume_gate(); },
           [this](const std::string& by) {
               planning_.abandon();
               identification_ = std::move(interrupted_->identification);
               noise_monitor_.continue_from(std::move(interrupted_->noise));
               if (journal_) journal_->campaign_resumed(interrupted_->id, by);
               interrupted_.reset();
               record_begin(by, identification_.result().dwells.size());
               keep(identification_.result());
           },
           torquer_.get(),
           &stage_feed_,
           [this](const LevelDrift& drift) { noise_monitor_.levelled(drift); },
           [this](const std::string& by, const std::string& out_of_band) {
               if (journal_) journal_->loop_checked(by, out_of_band);
           },
           [this](const rt::Ramp& ramp) { interlock_.ramp(ramp); },
           [this](double measured) { interlock_.transmission(measured); },
           [this](Time now) { return rest_.rest(now); },
           [this](bool disobeyed) { on_disobeyed(disobeyed); },
           [this] { interlock_.uncommanded(); },
           [this](campaign::Proving what) {
               starving_.store(what == campaign::Proving::watchdog);
               interlock_.proving(what != campaign::Proving::nothing);
           },
           [this](const campaign::ProofRecord& record) {
               if (journal_) journal_->proved(record.by, campaign::to_json(record));
           },
           utc_now,
           [this] {
               const auto misfit = clock_misfit();
               return misfit.empty() ? rate_misfit() : misfit;
           },
           [this] { return interlock_.second(); }}),
      publisher_(
          configuration_.mqtt.host.empty()
              ? nullptr
              : std::make_unique<fleet::Publisher>(
                    *this, configuration_.mqtt, [this](Severity severity, const std::string& text) {
                        log(severity, "mqtt", text);
                    })) {}

std::optional<campaign::Next> Daemon::next_dwell(const std::array<double, 3>& here_deg,
                                                 double elapsed_s) {
    // Between two dwells the identification is this thread's; the shaker is at rest. It takes
    // tenths of a second, on a busy machine more than this thread may be away. The rig's clock
    // waits for this thread, so that there the time is none.
    std::optional<plan::AdaptivePlan::Decision> decision;
    const auto choose = [this, here_deg, elapsed_s, covariance = identification_.covariance(),
                         result = whole_result()] {
        return adaptive_->next(plan::widened(covariance, configuration_.estimator, result),
                               here_deg, elapsed_s, result.rows.size());
    };
    if (rig_clock_) {
        decision = choose();
    } else if (planning_.asked()) {
        decision = planning_.take();
    } else {
        planning_.ask(choose);
    }
    if (!decision) return {};
    campaign::Next next;
    next.more = decision->verdict == plan::AdaptivePlan::Verdict::go_on;
    next.stop = {decision->run.position_deg, decision->run.table_g};
    next.left = decision->left;
    next.words = decision->words;
    return next;
}

Daemon::~Daemon() {
    shut_down();
    join();
    paging_.store(nullptr);
}

void Daemon::start() {
    started_ = clock_.now();
    if (const auto& folder = configuration_.results; !folder.empty()) {
        std::error_code error;
        std::filesystem::create_directories(folder, error);
        if (::access(folder.c_str(), W_OK) != 0) {
            throw std::runtime_error(
                "campaign.results: found \"" + folder +
                "\", expected a folder that can be written: " + std::strerror(errno));
        }
    }
    open_journal();
    open_outbox();
    if (recorder_) recorder_->start();
    if (pre_trip_) pre_trip_->start();
    annunciator_ = std::make_unique<drivers::Annunciator>(
        configuration_.annunciator, [this](bool good, const std::string& text) {
            log(good ? Severity::info : Severity::alarm, "annunciator", text);
        });
    paging_.store(annunciator_.get());
    if (latches_.tripped())
        annunciator_->announce(drivers::HornPattern::abort,
                               "not acknowledged: " + latches_.causes());
    if (!configuration_.guard_socket.empty())
        guard_link_ = std::make_unique<watch::GuardLink>(configuration_.guard_socket,
                                                         [this] { return word_for_guard(); });
    // A daemon that died may have left it running inside the watchdog's time.
    shaker_->stop_now();
    shaker_->on_reading([this] {
        const auto reading = shaker_->reading();
        if (!first_reading_known_.load()) {
            first_reading_ = reading;
            first_reading_known_.store(true);
        }
        interlock_.check(reading);
        control_waiter_->notify();
    });
    shaker_->on_stop_written([this] { interlock_.stop_written(); });
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
    start_threads();
    if (publisher_) publisher_->start();
    if (guard_link_) guard_link_->start();
}

void Daemon::shut_down() noexcept {
    shut_down_.store(true);
    control_waiter_->notify();
}

bool Daemon::wait_for_end(double wall_seconds) {
    std::unique_lock lock(mutex_);
    return ended_changed_.wait_for(lock, std::chrono::duration<double>(wall_seconds),
                                   [this] { return ended_; });
}

void Daemon::join() {
    if (outbox_) outbox_->stop();
    if (publisher_) publisher_->stop();
    if (guard_link_) guard_link_->stop();
    give_up_.store(true);
    control_waiter_->notify();
    if (control_thread_.joinable()) control_thread_.join();
    shaker_->shut_down();
    estimator_stage_.stop();
    if (estimator_thread_.joinable()) estimator_thread_.join();
    if (acquisition_thread_.joinable()) {
        acquisition_.stop();
        acquisition_thread_.join();
    }
    if (pre_trip_) pre_trip_->stop();
    if (recorder_) recorder_->stop();
    if (journal_) journal_->stop();
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
    enter(severity, source, text);
    // A pager that fails is not told so by itself; of a fit whoever looks in the morning reads.
    drivers::Annunciator* const annunciator = paging_.load();
    if (severity == Severity::alarm && annunciator != nullptr && source != "annunciator" &&
        source != "fit")
        annunciator->announce(drivers::HornPattern::alarm, text);
}

void Daemon::enter(Severity severity, const std::string& source, const std::string& text) {
    EventRecord record;
    record.utc_ns = utc_now();
    record.time = clock_.now();
    record.severity = severity;
    record.source = source;
    // Every event comes through here, and much of what they say comes from outside.
    record.text = serve::one_line(text);
    event_log_.append(record);
    if (journal_) journal_->event(record);
    if (recorder_) recorder_->event(record);
    const auto level = severity == Severity::info      ? spdlog::level::info
                       : severity == Severity::warning ? spdlog::level::warn
                                                       : spdlog::level::err;
    spdlog::log(level, "{}: {}", source, record.text);
}

/// The Identification is this thread's here: no dwell is with the estimator.
void Daemon::take_noise(estimator::DwellSummary& dwell) {
    rt::BlockRecord block;
    while (estimator_stage_.take_block(block)) noise_monitor_.add(block);
    noise_monitor_.conclude(dwell, identification_);
}

void Daemon::take_done_dwells() {
    rt::DwellDone done;
    while (estimator_stage_.take_done(done)) {
        if (--dwells_with_estimator_ == 0) take_noise(done.summary);
        auto result = identification_.result();
        record_dwell(done.summary, result);
        campaign_.on_dwell_done(done.summary);
        campaign_.qualify(result);
        keep(std::move(result));
        verdict_due_ = true;
    }
    take_verdict();
}

void Daemon::control_loop() {
    rt::Tripped handled;
    bool done = false;
    Time next = 0;  // of the campaign
    while (!give_up_.load()) {
        const bool stirred = control_waiter_->take();
        const Time now = clock_.now();
        control_beat_.store(now);
        const auto words = [this](const RtEvent& event) {
            if (event.dropped_before > 0) {
                log(Severity::warning, event.source.data(),
                    fmt::format("{} events lost before the next", event.dropped_before));
            }
            log(event.severity, event.source.data(), event.text.data());
        };
        port_events_.consume(words);
        shaker_events_.consume(words);
        if (const rt::Tripped trip = interlock_.latched(); !(trip == handled)) {
            if (trip) on_trip(trip, now);
            handled = trip;
        }
        if (first_reading_known_.load() && !std::exchange(first_reading_judged_, true))
            judge_first_reading(now);
        watch_emergency_stop(now);
        tell_alarms();
        tell_controller();
        tell_watchdog();
        if (journal_) tell_journal();
        if (recorder_) tell_recorder();
        watch_onlookers();
        tell_log();
        watch_outside();
        interlock_.filter(excitation_.load() ? estimator_stage_.view().estimate.nis_per_dof : 0);
        take_commands(now);
        if (shut_down_.load()) campaign_.shut_down(now);
        take_done_dwells();
        // The journal's wake-ups come when the disk is done: polls that began with them would make
        // a campaign on the rig's clock depend on the machine's load.
        if (stirred || now >= next)
            next = std::min(campaign_.step(now), now + drivers::kSecond / 2);
        const Time commissioning = step_commissioning(now);
        take_done_dwells();
        watch_arming();
        check_balance(now);
        {
            const std::lock_guard lock(mutex_);
            // Nobody is to see "finished" before there is a result.
            if (!concluding_ || to_write_ != ToWrite::complete)
                campaign_.fill(campaign_status_, now);
            if (procedure_ && procedure_->active())
                campaign_status_.reason = procedure_->progress();
            campaign_status_.interlock.latches = latches_.open();
            campaign_status_.noise = noise_monitor_.status();
            armed_.store(!campaign_status_.armed_by.empty());
            armed_g_.store(highest_level());
            done = campaign_.done(now) && to_write_ == ToWrite::nothing;
            if (done) break;
        }
        control_waiter_->wait_until(std::min(next, commissioning));
    }
    if (to_write_ != ToWrite::nothing && dwells_with_estimator_ == 0) {
        assessing_.abandon();
        write_result(judge(configuration_.estimator, whole_result(), again(),
                           estimator::uncertainty::Stage::ended));
    }
    give_up_arming("the daemon is shutting down");
    finish_acknowledging(true);
    if (done) end_arming("the daemon has ended in order");
    const std::lock_guard lock(mutex_);
    ended_ = done;
    ended_changed_.notify_all();
    for (auto& waiting : commands_) waiting.reply.set_value({false, "the daemon is shutting down"});
    commands_.clear();
}

void Daemon::write_result(const Judged& judged) {
    const bool complete = std::exchange(to_write_, ToWrite::nothing) == ToWrite::complete;
    const auto& assessed = judged.assessed;
    take_anew(judged);
    if (!result_.dwells.empty())  // of no data nothing is to be said
        log(severity_of(assessed.verdict.level), "campaign", "result " + assessed.verdict.sentence);
    std::string text;
    {
        const std::lock_guard lock(mutex_);
        if (!campaign_.mark().empty())
            result_.warnings.push_back("campaign marked: " + campaign_.mark());
        text = tool::result_json(result_, assessed, configuration_.simulated(), nullptr,
                                 judged.live.get());
    }
    StatusData ended;
    campaign_.fill(ended, clock_.now());
    write_result_file(text, complete);
    // The journal first: the recording is closed with a head of it.
    if (journal_) journal_->campaign_ended(name_of(ended.state), ended.reason, text);
    if (recorder_)
        recorder_->campaign_ended(
            {name_of(ended.state), ended.reason, campaign_.mark(), text, utc_now()});
}

StatusData Daemon::status() const {
    StatusData status;
    {
        const std::lock_guard lock(mutex_);
        status = campaign_status_;
        status.server = server_status_;
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
    status.stop_pending = campaign_.stopping();
    status.simulated = configuration_.simulated();
    status.can = port_->state();
    status.can_counters = port_->counters();
    status.assembler = acquired.assembler;
    const auto ring = estimator_stage_.ring();
    status.estimator_ring = {ring.pushed, ring.popped, ring.dropped};
    status.latency = acquired.latency;
    status.real_time = real_time_status(acquired, estimated);
    status.rig_ticks = acquired.rig_ticks;
    status.increment_frames = acquired.increments;
    status.estimator_in_dwell = estimated.in_dwell;
    status.estimator_idle = estimated.idle;
    status.sample = acquired.sample;
    for (std::size_t c = 0; c < drivers::kChannels; ++c) {
        status.channel_age_s[c] =
            acquired.last_good[c] == 0 ? -1.0 : drivers::to_seconds(now - acquired.last_good[c]);
    }
    status.channel_deadline_s = drivers::to_seconds(configuration_.assembler.stale_deadline);
    status.platform_deadline_s = drivers::to_seconds(configuration_.gimbal.status_deadline);
    status.silent = rig_clock_ && acquired.last_frames != 0 &&
                    rt::wall_clock() - acquired.last_frames > kSimulatedSilence;
    status.sample_rate_hz = acquired.rate.hz();
    status.rate_misfit = rate_misfit();
    status.clock_misfit = clock_misfit();
    status.witness_g = interlock_.seen_g();
    status.platform = acquired.platform;
    const auto& frame = configuration_.estimator;
    status.frame = {frame.up, frame.encoder_sign, frame.encoder_zero_deg,
                    frame.accelerometer_zero_g, frame.accelerometer_matrix};
    status.estimate = estimated.estimate;
    status.interlock = interlock_status(std::move(status.interlock.latches));
    if (journal_) status.journal = journal_->status();
    if (recorder_) status.recorder = recorder_->status();
    if (outbox_) status.archive = outbox_->status();
    if (publisher_) status.mqtt = publisher_->status();
    if (log_queue_ != nullptr) {
        const auto lines = log_queue_->counts();
        status.log = {lines.taken, lines.written, lines.dropped, lines.waiting, lines.blocked};
    }
    if (guard_link_) status.guard = guard_link_->status();
    if (annunciator_) status.annunciator = annunciator_->status();
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
    const auto abandoned = std::make_shared<std::atomic<bool>>(false);
    std::future<CommandReply> reply;
    {
        const std::lock_guard lock(mutex_);
        if (ended_) return {false, "the daemon is shutting down"};
        reply = commands_.emplace_back(WaitingCommand{request, {}, abandoned}).reply.get_future();
        control_waiter_->notify();
    }
    // Whoever stops is told within 0.2 s that the stop is on its way, whatever holds the rest up.
    // It is not taken back: the campaign ends when the control thread goes on.
    constexpr auto kStopPatience = std::chrono::milliseconds(100);
    if (request.kind == CommandRequest::Kind::abort) {
        if (reply.wait_for(kStopPatience) == std::future_status::ready) return reply.get();
        return {true, "the shaker is told to stop; the campaign has not ended yet"};
    }
    if (reply.wait_for(std::chrono::seconds(5)) != std::future_status::ready &&
        !abandoned->exchange(true)) {
        const CommandReply none{false, "no answer from the control thread within 5 s"};
        if (journal_) journal_->command(request, none, utc_now());
        return none;
    }
    return reply.get();
}

}  // namespace vibrig
