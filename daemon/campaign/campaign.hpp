#pragma once

#include <algorithm>
#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "daemon/campaign/excitation.hpp"
#include "daemon/campaign/pace.hpp"
#include "daemon/campaign/ports.hpp"
#include "daemon/campaign/settings.hpp"
#include "daemon/campaign/stop_monitor.hpp"
#include "daemon/domain/commands.hpp"
#include "daemon/interlock/interlock.hpp"
#include "daemon/rt/dwell_order.hpp"
#include "daemon/rt/stage_feed.hpp"
#include "daemon/status/status.hpp"
#include "drivers/gimbal/gimbal.hpp"
#include "drivers/gimbal/torquer.hpp"
#include "drivers/shaker/shaker.hpp"

namespace vibrig::campaign {

class Dwelling;
class GravityWatch;
class Levelling;
class LoopCheck;
class LoopChecking;
class Opening;
class SmallLevel;
class Stage;
class StopProof;
class Waiting;
class ZeroCalibration;
class Zeroing;
class ZeroRun;

/// A self-test's argument: the opening check alone.
inline constexpr std::string_view kRestCheck = "rest";

/// Why the stages of these settings cannot work; empty: they can. Throws drivers::BindingError.
[[nodiscard]] std::string check_stages(const Settings& settings, const proto::Dbc& dbc,
                                       drivers::CanPort& port);
/// How long the stages at rest take, if they go well; of those that are not asked for 0. Throws as
/// the stages do, where check_stages() says why.
struct StageTimes {
    double levelling_s = 0;  ///< before each position
    double closing_s = 0;    ///< after the last one: zeros again
    double opening_s = 0;    ///< before the first one
    double look_s = 1.5;     ///< before each ramp a whole still second, wherever seconds begin
};
[[nodiscard]] StageTimes stage_times(const Settings& settings);
[[nodiscard]] rt::StageFeedSettings stage_feed_settings(const Settings& settings);

/// The campaign as a state machine: zeros of the accelerometers, then for each run and position
/// slew, level, ramp, settle, record, rest; in the end the zeros again.
/// Moved on by step(), which never waits. The shaker moves only between a named person's arm() and
/// the end of that campaign; gimbals slew only while it is at rest. Control thread only.
class Campaign {
  public:
    Campaign(const Settings& settings, const Ports& ports);

    /// Before the first step(): positions that an interrupted campaign has done. Nothing moves
    /// until a person arms and resumes it. False if they are not the first of the list; of an
    /// adaptive campaign `stops` says what was chosen; the last one when it began.
    bool offer(std::vector<estimator::DwellSummary> done, std::vector<StopDone> stops = {});
    /// Before the first step(): what the newest loop check of an earlier life found out of band.
    /// No campaign is armed until another one is in band.
    void take_over_loop_check(const std::string& out_of_band);
    /// Likewise: what earlier lives have proved of stopping.
    void take_over_proofs(std::vector<ProofRecord> history);
    /// What is latched, in words. `unseen`, before the first step(): by an earlier life, and nobody
    /// has seen rest since, of the highest level that this configuration may be armed for.
    void take_over_trip(const std::string& causes, bool unseen = false);
    /// Before the first step(): what an earlier life may have left torqued. It is ended, and no
    /// torque is heeded but this one's own, until it is commissioned again.
    void take_over_torque();
    /// That one is over: zero was commanded, and for a second the platform has said that it is not
    /// torqued, where it can say so.
    [[nodiscard]] bool torque_ended(drivers::Time now) const;
    /// The next proof goes up from 0.03 g, each rung held against the command before the next:
    /// nobody has seen yet what this shaker makes of a number.
    void climb_next_proof(bool climbs) noexcept { climbs_ = climbs; }
    /// Before the first step(): nothing but a stop is written to the shaker's controller in this
    /// life.
    void hold_writes() noexcept;
    CommandReply command(const CommandRequest& request, drivers::Time now);
    /// The highest level that the arming is for, peak at the table; of random vibration the peaks
    /// that it hardly goes beyond.
    [[nodiscard]] double highest_level() const;
    /// So many times more the platform may show of it than by the reference frequency's
    /// transmission: a plan's other vibration may get through better. 1 or above.
    [[nodiscard]] double platform_ratio() const { return platform_ratio_; }
    /// Why an arming or an acknowledgement would be refused now; empty: it would not, or it is
    /// another command.
    [[nodiscard]] std::string refusal(const CommandRequest& request, drivers::Time now) const;
    /// What an arming is for: unit, plan, highest level, duration.
    [[nodiscard]] std::string arming_text(const CommandRequest& request) const;
    /// The person who has armed; empty: nobody.
    [[nodiscard]] const std::string& armed_by() const { return armed_by_; }
    /// From now on gimbals move as commissioning says (daemon/commission/), while the shaker rests;
    /// an abort, a trip and a shaker that does not rest end it. Why not, else empty.
    [[nodiscard]] std::string begin_commissioning(const std::string& by, drivers::Time now);
    void end_commissioning(drivers::Time now);
    [[nodiscard]] bool checking() const { return state_ == CampaignState::checking; }
    [[nodiscard]] bool commissioning() const { return state_ == CampaignState::commissioning; }
    /// Does what is due at `now`; returns when to be called next at the latest.
    drivers::Time step(drivers::Time now);
    void on_dwell_done(const estimator::DwellSummary& summary);
    /// What was played in the newest dwell is still to be read: Dwells::played().
    [[nodiscard]] bool psd_awaited() const { return psd_due_; }
    /// An interlock has ordered the stop; latches until acknowledged.
    void on_trip(const std::string& cause, drivers::Time now);
    /// Ramps down and ends; step() goes on until done() is true.
    void shut_down(drivers::Time now);
    /// After shut_down(): ended, and nothing moves.
    [[nodiscard]] bool done(drivers::Time now) const;
    /// Any thread: a stop is ordered and rest not measured since. Nobody feeds the watchdog then.
    [[nodiscard]] bool stopping() const noexcept { return stop_.stopping(); }
    /// What is not at rest, or not known to be; empty: nothing.
    [[nodiscard]] std::string what_moves(drivers::Time now) const { return stop_.what_moves(now); }
    void fill(StatusData& status, drivers::Time now) const;
    /// What has been proved of stopping, for the recording; JSON, empty: nothing.
    [[nodiscard]] std::string proofs_json() const { return proof_.recording_json(); }
    [[nodiscard]] const SafetyProof& proof() const { return proof_; }
    /// The identity that the shaker's controller reports.
    void shaker_is(const std::string& device) { proof_.device_is(device); }
    /// Adds the zeros' share of the amplitudes' uncertainty.
    void qualify(estimator::Result& result) const;
    /// The verdict on the dwells so far has become "not valid"; run and position of the dwell that
    /// it names, 0: none.
    void doubted(const std::string& why, int run = 0, int position = 0) {
        doubted_ = Doubt{why, run, position};
    }
    /// Why the campaign is marked; empty: it is not.
    [[nodiscard]] const std::string& mark() const { return mark_; }

  private:
    /// The zeroing that is under way, its levelling included.
    enum class ZeroingAt : std::uint8_t { none, start, end };

    struct Doubt {
        std::string why;
        int run = 0, position = 0;
    };

    /// A stop and what the estimator and people call it, from 1. Of one that is repeated the
    /// position is a number that no other has.
    struct NumberedStop {
        Stop stop;
        int run = 1, position = 1;
    };

    struct StateRow;
    [[nodiscard]] static const StateRow& row_of(CampaignState state);
    drivers::Time step_once(drivers::Time now);
    /// This machine stood still, and nobody read the shaker meanwhile. Where nothing is excited or
    /// torqued a fresh look is waited for, for a bounded time; nothing goes on before it.
    [[nodiscard]] bool awaits_look(drivers::Time now) const;
    // One for each state; each returns when to be called next at the latest.
    drivers::Time stand_by(drivers::Time now);
    drivers::Time wait(drivers::Time now);
    drivers::Time pause(drivers::Time now);
    drivers::Time give_way(drivers::Time now);
    drivers::Time wait_for_platform(drivers::Time now);
    drivers::Time slew(drivers::Time now);
    drivers::Time zeroing(drivers::Time now);
    void fail_zeroing(const std::string& why, drivers::Time now);
    void leave_zeroing(drivers::Time now);
    void begin_levelling(drivers::Time now);
    drivers::Time levelling(drivers::Time now);
    [[nodiscard]] bool for_zeroing() const { return zeroing_ != ZeroingAt::none; }
    [[nodiscard]] std::string not_fit_to_check(drivers::Time now) const;
    CommandReply begin_check(const CommandRequest& request, drivers::Time now);
    drivers::Time check(drivers::Time now);
    void prove_refusals(drivers::Time now);
    [[nodiscard]] bool checks_at_zero() const;
    void end_check(CampaignState state, const std::string& why, drivers::Time now);
    void conclude_check(drivers::Time now);
    [[nodiscard]] std::int64_t utc_ns() const { return ports_.log.utc_ns(); }
    void make_stages();
    [[nodiscard]] bool opening() const;      ///< it is being held against the rig at rest
    [[nodiscard]] bool opens_alone() const;  ///< likewise, without a campaign
    [[nodiscard]] std::string check_under_way() const;
    [[nodiscard]] std::string not_fit_to_move(drivers::Time now) const;
    [[nodiscard]] std::string not_fit_to_open(drivers::Time now) const;
    CommandReply begin_rest_check(const CommandRequest& request, drivers::Time now);
    void conclude_rest_check(const std::string& refused, const std::string& warned,
                             const std::vector<std::string>& suspects, drivers::Time now);
    void begin_opening(drivers::Time now);
    drivers::Time open(drivers::Time now);
    void conclude_opening(drivers::Time now);
    [[nodiscard]] const ZeroCalibration* zeros() const;  ///< null: none are taken
    void begin_zeroing(bool at_end, drivers::Time now);
    /// It is left by leave_stage() at the latest.
    void begin(Stage& stage, CampaignState state, drivers::Time now);
    void leave_stage();
    void insist_on_zero_torque(drivers::Time now);
    void fill_stages(StatusData& status) const;
    void fill_rest(StatusData& status, drivers::Time now) const;
    void begin_dwell(drivers::Time now);
    drivers::Time dwell(drivers::Time now);
    drivers::Time rest(drivers::Time now);
    void enter(CampaignState state, drivers::Time now);
    void next_position(drivers::Time now);
    // campaign_psd.cpp
    [[nodiscard]] bool asks_for_psd(const estimator::DwellSummary& summary) const;
    [[nodiscard]] bool psd_settled(drivers::Time now);
    void close_psd(ReportedPsd reported);
    void count_rejected(const estimator::DwellSummary& summary);
    void start_position(drivers::Time now);
    void abort(const std::string& why, drivers::Time now);
    void end(CampaignState state, const std::string& why, drivers::Time now);
    void watch_gravity();
    /// Before a ramp: not yet, or not at all.
    [[nodiscard]] bool gravity_holds(drivers::Time now);
    void pause_at_rest(const std::string& why, drivers::Time now);
    /// Two or so in a row: it pauses. True: it has.
    [[nodiscard]] bool too_many_rejected(drivers::Time now);
    [[nodiscard]] bool vibration_was_off(drivers::Time now);
    /// At rest: repeats the dwell that the verdict names, if that is asked for.
    void repeat_doubted();
    /// After an interruption of hours: a dwell of before, once more.
    void repeat_after_interruption();
    /// Next, before what is left. False: it was repeated before.
    bool repeat_stop(std::size_t of, const std::string& why);
    [[nodiscard]] bool is_repeat(const NumberedStop& stop) const {
        return !settings_.adaptive && stop.position > static_cast<int>(planned_);
    }
    /// True: it has paused, since that is asked for.
    [[nodiscard]] bool not_valid_so_far(drivers::Time now);
    [[nodiscard]] static double ratio_at_platform(const Settings& settings);
    void watch_stop(drivers::Time now);
    void watch_gimbals(drivers::Time now);
    void begin(const std::string& by, drivers::Time now);
    void conclude(drivers::Time now);
    void finish(drivers::Time now);
    CommandReply resume_interrupted(const CommandRequest& request, drivers::Time now);
    [[nodiscard]] std::string resume_offer() const;
    [[nodiscard]] std::string not_fit_to_excite(drivers::Time now) const;
    [[nodiscard]] std::string not_at_rest(drivers::Time now) const;
    [[nodiscard]] std::string not_fit_to_arm(drivers::Time now) const;
    [[nodiscard]] std::string not_fit_to_resume(drivers::Time now) const;
    /// Paused for so long that the arming has ended: it may be armed where it is.
    [[nodiscard]] bool paused_disarmed() const;
    void arm(const CommandRequest& request, drivers::Time now);
    CommandReply resume(const CommandRequest& request, drivers::Time now);
    [[nodiscard]] std::string not_fit_to_acknowledge(drivers::Time now) const;
    CommandReply acknowledge(const CommandRequest& request, drivers::Time now);
    void watch_arming(drivers::Time now);
    void plan_stops();
    [[nodiscard]] bool put_first(const std::vector<estimator::DwellSummary>& done);
    /// Runs and positions per run of a list; of a plan the levels and all its stops.
    [[nodiscard]] std::size_t runs() const {
        return listed() ? settings_.table_g.size() : std::max<std::size_t>(levels_.size(), 1);
    }
    [[nodiscard]] std::size_t positions() const {
        return listed() ? settings_.positions_deg.size() : expected_;
    }
    [[nodiscard]] bool listed() const { return settings_.stops.empty() && !settings_.adaptive; }
    void add_stop(const Stop& stop);
    enum class Choice : std::uint8_t { more, end, thinking };
    /// At rest: whether there is one more stop.
    [[nodiscard]] Choice choose_next(drivers::Time now);
    /// Time that the campaign has used, s, a life before a restart included.
    [[nodiscard]] double used_s(drivers::Time now) const {
        return used_before_s_ + drivers::to_seconds(now - started_);
    }
    /// Time of one position, from levelling to rest.
    [[nodiscard]] double nominal_stop_s() const {
        return times_.levelling_s + times_.look_s + settings_.dwell_s + settings_.settle_s +
               2 * settings_.ramp_s;
    }
    /// And with the slews between the stops.
    [[nodiscard]] double expected_stop_s() const;
    [[nodiscard]] const NumberedStop& here() const { return stops_[at_]; }
    void watch_power();
    [[nodiscard]] double table_g() const { return here().stop.table_g; }
    [[nodiscard]] bool active() const;

    Settings settings_;
    const double platform_ratio_ = ratio_at_platform(settings_);
    StageTimes times_;
    Ports ports_;
    StopMonitor stop_;
    Excitation excitation_;
    CampaignState state_ = CampaignState::idle;
    drivers::Time entered_ = 0;  ///< when state_ began
    drivers::Time started_ = 0;  ///< when the campaign began
    drivers::Time stepped_ = 0;  ///< the last time that step() was called
    drivers::Time awake_ = 0;    ///< since it was not for longer than it ever sleeps; 0: never
    Pace pace_;
    std::vector<NumberedStop> stops_;
    std::size_t at_ = 0;        ///< the stop that is being done
    std::size_t expected_ = 0;  ///< stops in all, as far as can be foreseen
    std::size_t planned_ = 0;   ///< of them by the plan: not adaptive, no repeats
    /// Table g and Hz, one run each, in order of appearance.
    std::vector<std::pair<double, double>> levels_;
    int repeats_ = 0;  ///< of the present stop, after flagged dwells
    std::string armed_by_;
    std::string armed_for_, started_by_;
    drivers::Time armed_steady_ = 0;   ///< when it was armed, by the steady clock
    drivers::Time paused_steady_ = 0;  ///< likewise, when the newest pause began
    std::string reason_;
    bool pause_asked_ = false;
    bool shutting_down_ = false;
    bool writes_held_ = false;
    bool slew_ordered_ = false;            ///< within slew()
    drivers::Time gimbals_off_since_ = 0;  ///< not left to drift while it shakes; 0: they are
    std::size_t positions_done_ = 0;
    double used_before_s_ = 0;  ///< of the campaign, before a restart
    std::vector<estimator::DwellSummary> offer_;
    std::vector<StopDone> offered_stops_;
    std::optional<StopDone> offered_last_;
    std::vector<estimator::DwellSummary> dwells_;
    // shared: their types are known where they are made
    std::shared_ptr<Waiting> waiting_;
    std::shared_ptr<Levelling> level_;
    std::shared_ptr<Zeroing> zero_;
    std::shared_ptr<Dwelling> dwelling_;
    std::shared_ptr<LoopCheck> loop_;
    std::shared_ptr<SmallLevel> small_level_;
    std::shared_ptr<ZeroRun> zero_run_;
    std::shared_ptr<LoopChecking> checking_;
    std::shared_ptr<StopProof> proving_;
    std::shared_ptr<GravityWatch> gravity_;
    std::shared_ptr<Opening> opening_;
    Stage* stage_ = nullptr;          ///< of them the one under way
    drivers::Time second_from_ = -1;  ///< the newest second that was judged
    bool gravity_warned_ = false;
    drivers::Time vibration_off_since_ = -1;  ///< -1: it is vertical
    std::string vibration_off_;               ///< in words, and nothing done about it yet
    int rejected_in_a_row_ = 0;               ///< dwells, the newest included
    std::string rejected_for_;
    std::optional<Doubt> doubted_;  ///< and nothing done about it yet
    SafetyProof proof_;
    /// A random dwell that is over, until the controller has reported what it played.
    struct Unread {
        estimator::DwellInfo info;
        StopDone stop;
        double measured_g_rms = 0, power_ratio = 1;
        std::uint64_t request = 0;  ///< of the shaker; 0: not asked yet
        drivers::Time until = 0;
    };
    std::optional<Unread> unread_;
    bool psd_due_ = false;  ///< of the dwell done last
    bool climbs_ = false;   ///< the next proof goes up a ladder
    ZeroingAt zeroing_ = ZeroingAt::none;
    bool zeroed_ = false;  ///< in this campaign, before the first dwell
    bool opened_ = false;  ///< likewise, the opening check
    RestCheckStatus rest_check_;
    drivers::Time torque_sent_ = 0;
    bool torque_left_ = false;  ///< by an earlier life, while it commissioned
    std::string mark_;          ///< why the campaign is marked
    /// Run, and variance of the relative level, of each dwell in which zeros were in force.
    std::vector<std::pair<int, double>> level_variances_;
};

}  // namespace vibrig::campaign
