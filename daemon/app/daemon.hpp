#pragma once

#include <atomic>
#include <boost/asio/io_context.hpp>
#include <condition_variable>
#include <deque>
#include <future>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>

#include "daemon/app/campaign_forecast.hpp"
#include "daemon/archive/outbox.hpp"
#include "daemon/campaign/campaign.hpp"
#include "daemon/commission/procedure.hpp"
#include "daemon/commission/progress.hpp"
#include "daemon/configuration/configuration.hpp"
#include "daemon/domain/status.hpp"
#include "daemon/dwells/anew.hpp"
#include "daemon/fleet/publisher.hpp"
#include "daemon/interlock/interlock.hpp"
#include "daemon/journal/journal.hpp"
#include "daemon/log/log_queue.hpp"
#include "daemon/noise/noise_monitor.hpp"
#include "daemon/plan/aside.hpp"
#include "daemon/record/pre_trip.hpp"
#include "daemon/record/recorder.hpp"
#include "daemon/rt/acquisition.hpp"
#include "daemon/rt/estimator_stage.hpp"
#include "daemon/rt/real_clock.hpp"
#include "daemon/rt/real_time.hpp"
#include "daemon/rt/rig_clock.hpp"
#include "daemon/rt/stirred_waiter.hpp"
#include "daemon/serve/event_log.hpp"
#include "daemon/watch/guard_link.hpp"
#include "estimator/identification/result.hpp"
#include "estimator/uncertainty/assessment.hpp"

namespace vibrig {

[[nodiscard]] std::int64_t utc_now();

/// A fixed-size event from a thread that may not format; the control thread turns it into words.
struct RtEvent {
    Severity severity = Severity::info;
    std::array<char, 16> source{};
    std::array<char, 128> text{};
    std::uint32_t dropped_before = 0;
};

/// Joins the rooms: owns the stages, the rings between them and their threads.
///   acquisition (io_context) -> ring -> estimator -> snapshot -> server;  control -> gimbal,
///   shaker
class Daemon final : public StatusSource {
  public:
    /// Throws ConfigurationError, BindingError, CanError, ShakerError, std::system_error.
    /// `log_queue`: where its words go, to be watched; null: nobody asks.
    explicit Daemon(configuration::Loaded loaded, const log::LogQueue* log_queue = nullptr);
    /// Throws DbcError, or ConfigurationError that names each message that cannot be bound; opens
    /// nothing.
    static void check_bindings(const configuration::Loaded& loaded);
    /// Throws ConfigurationError unless results can be kept where they are to be.
    static void check_results(const configuration::Configuration& configuration);
    /// What the campaign's positions and levels would leave undetermined; empty if nothing.
    [[nodiscard]] static std::vector<std::string> check_plan(
        const configuration::Configuration& configuration);
    ~Daemon() override;

    /// Starts the threads; throws CanError.
    void start();
    /// Asks for a clean end: shaker ramped down, dwell closed. Any thread.
    void shut_down() noexcept;
    /// After shut_down(): true once everything is at rest, false when `wall_seconds` have passed.
    [[nodiscard]] bool wait_for_end(double wall_seconds);
    /// After shut_down(): what is not at rest, or what nobody can tell of.
    [[nodiscard]] std::string what_moves() const { return campaign_.what_moves(clock_.now()); }
    /// Longest orderly end: ramp, stop, watchdog.
    [[nodiscard]] double longest_end_s() const;
    /// Ends the threads, orderly or not.
    void join();

    /// The stages that measure or act and have ceased to; empty: all go on. Any one thread.
    [[nodiscard]] std::string stuck_stage();

    [[nodiscard]] StatusData status() const override;
    [[nodiscard]] std::vector<EventRecord> events(std::uint64_t after_id,
                                                  std::size_t at_most) const override;
    [[nodiscard]] estimator::Result result() const override;
    [[nodiscard]] std::string effective_configuration() const override;
    CommandReply command(const CommandRequest& request) override;
    [[nodiscard]] PlanData plan() const override { return plan_; }
    [[nodiscard]] std::string unit_history() const override {
        return outbox_ ? outbox_->history() : std::string();
    }
    void refused(const std::string& who, const std::string& what, const std::string& why) override;
    StatusData serving(const ServerStatus& server) override;
    void told(Severity severity, const std::string& text) override;

  private:
    struct WaitingCommand {
        CommandRequest request;
        std::promise<CommandReply> reply;
        /// Whoever asked no longer waits: it must not happen later.
        std::shared_ptr<std::atomic<bool>> abandoned;
    };

    [[nodiscard]] static proto::Dbc load_dbc(const std::string& path);
    /// False where the simulated rig owns the time: it waits, and nothing is late.
    [[nodiscard]] bool in_real_time() const noexcept;
    [[nodiscard]] rt::MemoryLock lock_memory() const;
    void start_threads();
    void control_loop();
    void take_commands(drivers::Time now);
    void answer(WaitingCommand& waiting, const CommandReply& reply);
    /// An arming is accepted once the journal has it on disk; nobody waits for that but who asked.
    void begin_arming(WaitingCommand waiting, drivers::Time now);
    /// What commissioning asks, tells and records (daemon_commission.cpp).
    void commission(WaitingCommand waiting, drivers::Time now);
    [[nodiscard]] CommandReply do_commission(const CommandRequest& request,
                                             const commission::Json& what, drivers::Time now);
    [[nodiscard]] CommandReply enter_in_record(const CommandRequest& request,
                                               const commission::Json& what, drivers::Time now);
    [[nodiscard]] CommandReply begin_commissioning(const CommandRequest& request,
                                                   const commission::Json& what, drivers::Time now);
    [[nodiscard]] commission::Progress progress() const;
    [[nodiscard]] CommandReply accept_commissioning(const CommandRequest& request,
                                                    const std::string& second,
                                                    const configuration::Loaded& file);
    [[nodiscard]] CommandReply record_parts(const CommandRequest& request,
                                            const std::string& second,
                                            const std::vector<commission::Part>& parts,
                                            const commission::Json& evidence,
                                            const configuration::Loaded& as);
    [[nodiscard]] std::unique_ptr<commission::Procedure> make_procedure();
    /// Returns when to be called next at the latest.
    [[nodiscard]] drivers::Time step_commissioning(drivers::Time now);
    void finish_arming(drivers::Time now);
    void give_up_arming(const std::string& why);
    /// Answers who acknowledged, once that is on disk; at the end of the daemon, all of them.
    void finish_acknowledging(bool at_once);
    /// Likewise with a certificate that was issued (daemon_certificates.cpp).
    void begin_certificate(WaitingCommand waiting);
    void finish_certificates(bool at_once);
    void watch_arming();
    void end_arming(const std::string& why);
    [[nodiscard]] std::string journal_being_verified() const;
    [[nodiscard]] std::string not_fit_to_arm(const CommandRequest& request,
                                             drivers::Time now) const;
    void take_over_latches();
    void judge_first_reading(drivers::Time now);
    void watch_emergency_stop(drivers::Time now);
    void latch(Latch latch);
    CommandReply acknowledge(const CommandRequest& request, drivers::Time now);
    void on_port_state(drivers::PortState state, const char* text) noexcept;
    /// An alarm is for the pager, too.
    void log(Severity severity, const std::string& source, const std::string& text);
    void enter(Severity severity, const std::string& source, const std::string& text);
    void tell_log();
    /// Accepted if it was for an alarm; a trip is the campaign's.
    CommandReply acknowledge_alarm(const CommandRequest& request);
    /// Why there is nothing of the name it gives; empty: there is, or it gives none.
    [[nodiscard]] std::string unknown_to_acknowledge(const CommandRequest& request) const;
    void tell_alarms();
    void tell_controller();
    void tell_watchdog();
    void tell_journal();
    void tell_recorder();
    void open_outbox();
    void watch_onlookers();
    [[nodiscard]] InterlockStatus interlock_status(std::vector<Latch> latches) const;
    /// What vibrig-guard is told of this daemon.
    [[nodiscard]] proto::DaemonWord word_for_guard();
    /// Of what is armed, peak at the table; 0: nothing is.
    [[nodiscard]] double highest_level() const;
    void tell_campaign(Severity severity, const std::string& text);
    void on_disobeyed(bool disobeyed);
    void watch_outside();
    void show_state();
    /// Why the guard lets nothing be armed; empty: it does.
    [[nodiscard]] std::string guard_refuses(const CommandRequest& request) const;
    [[nodiscard]] RealTimeStatus real_time_status(const rt::AcquisitionView& acquired,
                                                  const rt::EstimatorView& estimated) const;
    void take_done_dwells();
    void take_noise(estimator::DwellSummary& dwell);
    /// What is to be made of the dwells at the end: they are in the journal.
    struct Again {
        noise::Found found;
        std::string journal;
        std::uint64_t configuration_hash = 0;
    };
    /// What can be believed of the dwells, or of the same identified anew.
    struct Judged {
        estimator::uncertainty::Assessment assessed;
        std::optional<estimator::Result> anew;
        std::shared_ptr<const dwells::Live> live;  ///< what `anew` replaces
        std::string not_anew;                      ///< why not, though it should be
    };
    [[nodiscard]] std::optional<Again> again() const;
    [[nodiscard]] static Judged judge(const estimator::Settings& settings,
                                      const estimator::Result& result,
                                      const std::optional<Again>& again,
                                      estimator::uncertainty::Stage stage);
    [[nodiscard]] bool verdict_wanted();
    void keep(estimator::Result result);
    [[nodiscard]] estimator::Result whole_result() const;
    /// What can be believed of the dwells so far; the verdict on all of them writes the result.
    void take_verdict();
    [[nodiscard]] static Severity severity_of(estimator::uncertainty::Level level);
    void tell_verdict(const estimator::uncertainty::Assessment& assessed);
    void write_result(const Judged& judged);
    void take_anew(const Judged& judged);
    void write_result_file(const std::string& text, bool complete);
    [[nodiscard]] std::optional<campaign::Next> next_dwell(const std::array<double, 3>& here_deg,
                                                           double elapsed_s);
    void open_journal();
    [[nodiscard]] std::vector<journal::Anchor> journal_anchors() const;
    /// Everything that results depend on; not where things are kept or how one talks to the daemon.
    [[nodiscard]] std::string result_configuration() const;
    [[nodiscard]] std::unique_ptr<record::Recorder> make_recorder();
    [[nodiscard]] std::unique_ptr<record::PreTrip> make_pre_trip();
    void on_trip(const rt::Tripped& tripped, drivers::Time now);
    /// The bus, by way of the recorder if there is one.
    [[nodiscard]] drivers::CanPort& sending_port() noexcept;
    void record_begin(const std::string& by, std::size_t dwells_before);
    /// Around the measurement, as it is now. The recorder's thread.
    [[nodiscard]] record::ConditionRow conditions() const;
    /// Instruments whose certificate has run out, for whoever arms.
    std::string tell_overdue();
    void record_dwell(const estimator::DwellSummary& summary, const estimator::Result& result);
    void offer_unfinished(journal::Unfinished& campaign);
    [[nodiscard]] std::string resume_gate() const;
    /// Why rig and daemon have no time in common; empty: they have.
    [[nodiscard]] std::string clock_misfit() const;
    /// Why the samples do not come at the configured rate; empty: they do.
    [[nodiscard]] std::string rate_misfit() const;
    void tell_clock_misfit();
    void check_balance(drivers::Time now);
    [[nodiscard]] bool may_feed() const noexcept;

    configuration::Loaded loaded_;
    const configuration::Configuration& configuration_;
    const log::LogQueue* const log_queue_;
    const rt::MemoryLock memory_lock_;  ///< before any thread
    std::unique_ptr<rt::RigClock> rig_clock_;
    std::unique_ptr<rt::RealClock> real_clock_;
    drivers::Clock& clock_;
    proto::Dbc dbc_;
    boost::asio::io_context io_{1};
    std::unique_ptr<drivers::CanPort> port_;
    std::unique_ptr<drivers::Shaker> shaker_;
    std::unique_ptr<rt::StirredWaiter> control_waiter_;
    std::unique_ptr<drivers::Waiter> estimator_waiter_;
    rt::Interlock interlock_;
    rt::Ring<drivers::Sample> estimator_ring_{4096};
    rt::Ring<RtEvent> port_events_{64};    ///< acquisition to control
    rt::Ring<RtEvent> shaker_events_{64};  ///< shaker to control
    estimator::Identification identification_;
    /// As they were when the campaign was interrupted; until it is resumed.
    struct Interrupted {
        estimator::Identification identification;
        noise::NoiseMonitor noise;
        std::int64_t id = 0;
    };
    std::optional<Interrupted> interrupted_;
    rt::EstimatorStage estimator_stage_;
    noise::NoiseMonitor noise_monitor_;  ///< control thread
    std::unique_ptr<drivers::Waiter> recorder_waiter_;
    std::unique_ptr<record::Recorder> recorder_;  ///< null: nothing is recorded
    std::unique_ptr<record::SentTap> sent_tap_;
    std::unique_ptr<record::PreTrip> pre_trip_;  ///< null: results are kept nowhere
    rt::StageFeed stage_feed_;
    rt::RestMonitor rest_;
    rt::Acquisition acquisition_;
    drivers::Gimbal gimbal_;
    std::unique_ptr<drivers::Torquer> torquer_;  ///< null: no levelling
    std::optional<plan::AdaptivePlan> adaptive_;
    plan::Aside<plan::AdaptivePlan::Decision> planning_{
        [this] { control_waiter_->notify(); }};  ///< what the control thread may not wait for
    const PlanData plan_;
    campaign::Campaign campaign_;
    commission::Book book_{loaded_};                     ///< control thread
    std::unique_ptr<commission::Procedure> procedure_;   ///< made when it is asked for; likewise
    const std::unique_ptr<fleet::Publisher> publisher_;  ///< null: no broker

    journal::Latches latches_;  ///< control thread
    /// An arming that the journal is writing.
    struct Arming {
        WaitingCommand waiting;
        std::uint64_t entry = 0;
        drivers::Time since_wall = 0;
    };
    std::optional<Arming> arming_;  ///< control thread
    /// What was acknowledged and is not answered yet: "acknowledged" outlives a power cut.
    struct Acknowledging {
        WaitingCommand waiting;
        CommandReply reply;
        std::uint64_t entry = 0;
        drivers::Time since_wall = 0;
    };
    std::vector<Acknowledging> acknowledging_;    ///< control thread
    std::vector<Acknowledging> certifying_;       ///< certificates that are not answered yet
    std::uint64_t entry_of_acknowledgement_ = 0;  ///< the newest; 0: none
    std::string armed_by_;                        ///< as last looked at; control thread
    /// As the shaker's controller was before the stop at the start, which clears its faults.
    drivers::ShakerReading first_reading_;
    std::atomic<bool> first_reading_known_{false};
    bool first_reading_judged_ = false;       ///< control thread
    std::optional<bool> emergency_was_open_;  ///< as last judged; control thread

    std::atomic<bool> shut_down_{false};
    std::atomic<bool> give_up_{false};
    std::atomic<bool> starving_{false};    ///< the proof does not let the watchdog be fed
    std::atomic<bool> excitation_{false};  ///< the campaign is between ramp and rest
    int dwells_with_estimator_ = 0;        ///< ordered, not yet reported done; control thread
    /// Tens of milliseconds, with hundreds of dwells seconds.
    plan::Aside<Judged> assessing_{[this] { control_waiter_->notify(); }};
    bool verdict_due_ = false;  ///< on the dwells so far; control thread
    bool concluding_ = false;   ///< the last verdict is asked for; control thread
    std::string verdict_told_;  ///< control thread
    enum class ToWrite : std::uint8_t { nothing, partial, complete } to_write_ = ToWrite::nothing;
    std::string imbalance_;  ///< as last looked at
    drivers::ControllerState controller_told_ = drivers::ControllerState::active;
    bool watchdog_was_changed_ = false;          ///< as told
    std::array<bool, rt::kMostRules> raised_{};  ///< alarms already told of
    drivers::Time balance_checked_ = 0;
    std::atomic<drivers::Time> control_beat_{0};
    std::atomic<std::int64_t> serving_wall_ns_{0};  ///< 0: there is no server
    drivers::Time started_ = 0;
    serve::EventLog event_log_;
    std::unique_ptr<journal::Journal> journal_;     ///< null: none is kept
    std::unique_ptr<archive::Outbox> outbox_;       ///< start() makes it; null: no archive
    bool journal_was_running_ = true;               ///< control thread
    bool recorder_was_stuck_ = false;               ///< control thread
    std::string misfit_told_;                       ///< thread of stuck_stage()
    bool log_was_blocked_ = false;                  ///< control thread
    std::unique_ptr<watch::GuardLink> guard_link_;  ///< start() makes it; null: there is no guard
    std::unique_ptr<drivers::Annunciator> annunciator_;           ///< made by start()
    std::atomic<drivers::Annunciator*> paging_{nullptr};          ///< it, while there are threads
    bool guard_was_heard_ = false, guard_was_disobeyed_ = false;  ///< control thread
    bool disobeyed_ = false;                ///< by the table, now; control thread
    std::uint64_t guard_finding_ = 0;       ///< the one that tripped; control thread
    std::atomic<bool> armed_{false};        ///< by a named person
    std::atomic<double> armed_g_{0};        ///< its highest level
    std::array<std::uint64_t, 2> marks_{};  ///< guard link's thread
    mutable std::mutex mutex_;  ///< guards what follows; never taken by acquisition or estimator
    std::deque<WaitingCommand> commands_;
    StatusData campaign_status_;
    ServerStatus server_status_;
    estimator::Result result_;  ///< without its rows
    bool ended_ = false;
    rt::ThreadSetup acquisition_setup_, estimator_setup_;
    std::condition_variable ended_changed_;

    /// How far each stage was when it last went on, for stuck_stage().
    struct Progress {
        std::uint64_t mark = 0;
        std::int64_t since_ns = 0;  ///< wall
    };
    std::array<Progress, 4> progress_{};

    std::thread acquisition_thread_;
    std::thread estimator_thread_;
    std::thread control_thread_;
};

}  // namespace vibrig
