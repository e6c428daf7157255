#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "daemon/interlock/rest_monitor.hpp"
#include "daemon/rt/frame_latency.hpp"
#include "drivers/annunciator/annunciator.hpp"
#include "drivers/can/can_port.hpp"
#include "drivers/sample/assembler.hpp"
#include "drivers/sample/sample.hpp"
#include "drivers/shaker/shaker.hpp"
#include "estimator/allan/noise_terms.hpp"
#include "estimator/identification/identification.hpp"

namespace vibrig {

enum class CampaignState : std::uint8_t {
    idle,     ///< measuring; shaker disarmed
    armed,    ///< a named person armed it; nothing moves
    waiting,  ///< for platform ready and steady temperature
    slewing,
    ramping,
    settling,
    recording,
    resting,  ///< ramping down, waiting for rest
    paused,   ///< at rest between positions, by command
    finished,
    aborted,
    tripped,        ///< stopped by an interlock; latched until acknowledged
    zeroing,        ///< azimuth slews at rest, for the accelerometers' zeros
    levelling,      ///< at rest in position
    checking,       ///< the loop, at a small level
    commissioning,  ///< gimbals move by a person's permission, the shaker rests
};
inline constexpr CampaignState kLastCampaignState = CampaignState::commissioning;
[[nodiscard]] const char* name_of(CampaignState state) noexcept;

/// Latched until named persons acknowledge it; kept over restarts.
struct Latch {
    std::string name;          ///< under which it is acknowledged
    std::string cause;         ///< in words
    std::string armed_by;      ///< by whom the shaker was armed then; empty: it was not
    std::string first;         ///< who acknowledged first, where two persons are needed
    bool two_persons = false;  ///< another person than these acknowledges it too
    std::int64_t utc_ns = 0;   ///< when it latched
};

/// The interlock's table as it stands, and how long stops took.
struct InterlockStatus {
    struct Row {
        std::string name, condition, reaction, unit;
        double limit = 0, dwell_s = 0;
        bool has_limit = false, latched = false, raised = false;
        double value = 0;                                           ///< as last judged to be wrong
        double present = std::numeric_limits<double>::quiet_NaN();  ///< NaN: not watched now
        bool below = false;  ///< it is what falls below the limit that is wrong
        /// The part of the limit that is left: 1 far from it, 0 at it or beyond. NaN: unknown.
        [[nodiscard]] double margin() const noexcept;
    };
    std::string tripped;         ///< name of the row, to be acknowledged; empty: none
    std::vector<Latch> latches;  ///< not acknowledged, of an earlier life too
    std::vector<Row> rows;
    std::vector<double> reaction_bounds_ms;  ///< upper ends of the classes but the last
    std::vector<std::uint64_t> reaction_counts;
    double reaction_largest_ms = 0, reaction_sum_ms = 0;
};

struct JournalStatus {
    std::string path;                                   ///< empty: no journal is kept
    bool running = false;                               ///< false: the disk refuses; entries wait
    std::string note;                                   ///< what the disk says
    std::uint64_t taken = 0, written = 0, dropped = 0;  ///< entries; taken = written + waiting
    std::string public_key;                             ///< its head is signed with, Ed25519, hex
    std::string head;        ///< the newest entry of its chain, signed: journal::SignedHead::line
    std::string proof_head;  ///< likewise the newest safe-state proof's entry; empty: none
    std::uint64_t entries = 0;  ///< of the chain
    bool verified = false;      ///< it is what was written into it, as looked at since the start
    double verified_part = 0;   ///< so much of it
    std::string not_watched;    ///< why it cannot be looked at just now; empty: it can
};

/// Recording of the present campaign, or of the last one.
struct RecorderStatus {
    std::string folder;      ///< empty: nothing is recorded
    std::string file;        ///< the campaign's HDF5 file
    bool recording = false;  ///< a campaign is being recorded
    bool good = false;       ///< false: the disk refuses; what comes is lost and counted
    std::string note;        ///< what the disk says
    std::uint64_t samples = 0, samples_lost = 0;  ///< written; not written
    std::uint64_t frames = 0, frames_lost = 0;    ///< of the raw log
    std::uint64_t raw_bytes = 0, segments = 0, gaps = 0;
    std::uint64_t samples_dropped = 0, frames_dropped = 0;  ///< by full rings, since the start
    std::uint64_t entries_dropped = 0;
};

/// The process that watches the daemon from outside.
struct GuardStatus {
    std::string socket;  ///< empty: none is configured
    bool heard = false;  ///< a word came within its deadline
    std::string note;    ///< why not
    std::string cause;   ///< what it found, "none" without; as last heard
    std::string text;    ///< in words
    bool disobeyed = false, sees = false, rest = false, reaches_shaker = false,
         horn_confirms = false;
    double table_g = 0;  ///< peak at the table, by its own measurement
};

/// The broker that watches a fleet of rigs.
struct MqttStatus {
    std::string broker;  ///< "broker.lab:8883"; empty: off
    bool connected = false;
    std::string note;  ///< why it is not
    std::uint64_t connections = 0, births = 0, messages = 0;
    std::uint64_t left_out = 0;  ///< times the broker was too slow to be told
};

/// Campaigns on their way to the archive; nothing is lost of what waits.
struct ArchiveStatus {
    std::string folder;                            ///< empty: nothing is archived
    bool good = false;                             ///< the newest attempt was one
    std::string note;                              ///< why not
    std::string delivering;                        ///< the campaign that is on its way; empty: none
    std::uint64_t waiting = 0, waiting_bytes = 0;  ///< over and not delivered
    std::uint64_t delivered = 0, failures = 0;     ///< attempts since the start
    std::uint64_t removed = 0;                     ///< here, delivered and beyond archive.keep_mb
};

/// Lines of the log on their way to stderr or the file; taken = written + dropped + waiting.
struct LogStatus {
    std::uint64_t taken = 0, written = 0, dropped = 0, waiting = 0;
    bool blocked = false;  ///< whoever reads it does not
};

/// A certificate whose end somebody has to see coming.
struct CertificateStatus {
    std::string whose;         ///< "server", "authority", or who is connected with it
    std::int64_t expires = 0;  ///< s, UTC
    bool own = false;          ///< the rig's: without it nobody gets in from outside
};

/// The ways in, and what ends with a date.
struct ServerStatus {
    struct Door {
        std::string name;     ///< control, status, page, remote
        std::string address;  ///< a path, or "https://0.0.0.0:8443/"
        bool open = true;
        std::string note;             ///< why it is not
        std::uint64_t made_anew = 0;  ///< times its socket was gone
    };
    std::vector<Door> doors;
    std::vector<CertificateStatus> certificates;
};

/// What the threads that a sample passes have of real time.
struct RealTimeStatus {
    struct Thread {
        std::string name;
        int fifo_priority = 0;                             ///< SCHED_FIFO; 0: ordinary scheduling
        std::string cpus;                                  ///< it may run on
        std::uint64_t major_faults = 0, minor_faults = 0;  ///< since it was set up
        std::uint64_t deadline_misses = 0;
        double longest_ms = 0;  ///< of what the deadline is for
    };
    std::vector<Thread> threads;
    bool memory_locked = false;
    double deadline_ms = 0;            ///< a sample period; 0: the rig owns the time, no deadline
    std::vector<std::string> missing;  ///< what could not be had, each with its cause
};

struct RingCounters {
    std::uint64_t pushed = 0, popped = 0, dropped = 0;
};

/// Noise of the gyros as seen in the dwells so far.
struct NoiseStatus {
    struct Gyro {
        std::array<estimator::allan::FittedTerm, estimator::allan::kTerms> terms{};
        double in_force = 0;         ///< N of the filter, deg/sqrt(h)
        double smallest_change = 0;  ///< of N, times, that one dwell shows; 0: not known
        std::vector<estimator::allan::DwellPoint> points;
    };
    struct Alarm {
        int run = 0, position = 0;
        std::size_t gyro = 0;
        double tau_s = 0, ratio = 1, limit = 1;  ///< of a step of the mean in standard deviations
        const char* reading = "";
    };
    /// Of one dwell, those with an alarm too.
    struct Curve {
        int run = 0, position = 0;
        bool alarm = false;
        std::vector<double> tau_s;
        std::array<std::vector<double>, 3> deviation_deg_h;  ///< by gyro
        std::array<std::vector<double>, 3> classical_deg_h;  ///< about the dwell's own mean
    };
    static constexpr std::size_t kMostCurves = 128;
    std::array<Gyro, 3> gyros;
    /// The dynamic surface: the newest dwells, oldest first; never null.
    std::shared_ptr<const std::vector<Curve>> surface =
        std::make_shared<const std::vector<Curve>>();
    double angle_in_force_arcsec = 0;
    double block_s = 0;
    std::uint32_t dwells = 0, dwells_left_out = 0;  ///< left out: flagged, too short or alarmed
    std::uint64_t alarms_total = 0;
    std::vector<Alarm> alarms;  ///< the newest
    /// Drifts found while levelling against what the coefficients say.
    struct Level {
        std::uint32_t samples = 0;
        double mean_square = 0;     ///< of the normalised innovations, 1 when consistent
        int run = 0, position = 0;  ///< of the newest
        std::array<double, 2> innovation_deg_h{}, sigma_deg_h{};
    } level;
};

/// Of a position that is done, what an adaptive campaign needs to go on after a restart.
struct StopDone {
    std::array<double, 3> position_deg{};
    double table_g = 0;
    std::int32_t repeats = 0;  ///< of the position so far, because it was flagged
    double used_s = 0;         ///< of the campaign's time
    /// When its dwell began: since the campaign's first, NaN: not known; and UTC.
    double begin_s = std::numeric_limits<double>::quiet_NaN();
    std::int64_t begun_utc_ns = 0;
    double frequency_hz = 0;  ///< 0: the configuration's
    bool held_out = false;
};

/// What the platform drifted by at the end of a levelling, which torqued it out.
struct LevelDrift {
    int run = 0, position = 0;
    std::array<double, 3> encoder_rad{};
    std::array<std::array<double, 3>, 2> direction{};  ///< platform axes, across the vertical
    std::array<double, 2> rate_deg_h{};                ///< along them, relative to the Earth
    double sigma_deg_h = 0;                            ///< of either
};

/// The levelling of the present position, or the last one.
struct LevellingStatus {
    bool begun = false;
    const char* verdict = "";                ///< settling, settled, not settled, cannot settle
    const char* phase = "";                  ///< fast, ramp, slow, undamped
    double time_s = 0;                       ///< since it began, or until settled
    std::array<double, 2> tilt_arcmin{};     ///< mean specific force, both channels
    std::array<double, 2> to_come_arcmin{};  ///< tilt that the integrator has still to take up
    std::array<double, 2> drift_deg_h{};
    double tolerance_arcmin = 0, noise_arcmin = 0;
    double limit_arcmin = 0;  ///< 1 sigma of the tilt left by the accelerometers' zeros; 0: unknown
    std::uint32_t done = 0;   ///< positions levelled
    std::string message;
};

/// The accelerometers' zeros in force, platform axes, on top of the configuration's.
struct ZeroStatus {
    bool running = false;
    bool known = false;  ///< taken off the samples of the dwells
    double time_s = 0;   ///< of the run that is under way
    std::array<double, 3> zero_mg{}, sigma_mg{};
    std::array<std::array<double, 3>, 3> covariance_mg2{};
    double scale_z = 0, scale_z_sigma = 0;  ///< 0: not separated
    /// Of x and y towards the axis of the slews as the gyros see it, rad; sigma 0: not separated.
    std::array<double, 2> misalignment{}, misalignment_sigma{};
    bool repeated = false;  ///< at the end of the campaign
    std::array<double, 3> change_mg{}, change_sigma_mg{};
    std::string mark;  ///< why the campaign is marked; empty: it is not
    std::string message;
};

/// How the platform sits in its gimbals: of the configuration.
struct FrameStatus {
    estimator::SignedAxis up{1, 1};
    std::array<int, 3> encoder_sign{1, 1, 1};
    std::array<double, 3> encoder_zero_deg{};
    std::array<double, 3> accelerometer_zero_g{};
    std::array<std::array<double, 3>, 3> accelerometer_matrix{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
};

/// Rest as it is measured, and what became of the last stop.
struct RestStatus {
    const char* state = "unknown";  ///< at rest, moving, unknown, stopping, stop not obeyed
    rt::Rest witnesses;
    bool disobeyed = false;  ///< latched until acknowledged at rest
    std::string what;        ///< while stopping: what moves, or what nobody can tell of
};

/// The newest loop check.
struct LoopCheckStatus {
    struct Row {
        const char* name = "";
        const char* unit = "";
        double value = 0, low = 0, high = 0;
        bool passed = false;
    };
    const char* verdict = "";  ///< none, running, in band, out of band, not completed
    std::string by;
    std::string message;  ///< what is out of band, or why it was not completed
    std::vector<Row> rows;
};

/// The newest proof of the safe state, and whether it lets a campaign be armed.
struct ProofStatus {
    struct Row {
        std::string name, unit;
        double value = 0, low = 0, high = 0;
        bool passed = false;
    };
    bool demanded = false;
    std::string refusal;  ///< why no campaign is armed; empty: as far as this goes it may be
    std::string advice;   ///< what should be proved before long
    std::string by;       ///< of the newest, passed or not; empty: there is none
    std::int64_t utc_ns = 0;
    bool passed = false;
    std::string message;
    std::vector<Row> rows;
    std::string asks;  ///< what a person is to do now
    struct Past {
        std::int64_t utc_ns = 0;
        bool passed = false;
        double stop_s = 0, watchdog_s = 0;  ///< to rest; 0: not measured
        double table_s = 0;                 ///< of the table alone
    };
    std::vector<Past> history;  ///< oldest first
    std::string keys_sha256;    ///< of what the newest covers
    double table_g = 0;
    std::string trend;  ///< which stop takes longer than it did; empty: none
};
/// Quality of a channel as it stands now: that of the newest sample while there is one within its
/// deadline.
enum class ChannelState : std::uint8_t {
    good,
    missing,
    flagged,
    out_of_range,
    unbound,
    silent,  ///< no value for longer than its deadline
    never,   ///< no good value since the start, and nothing else to say of it
};
[[nodiscard]] const char* name_of(ChannelState state) noexcept;

/// The whole status at one instant. Filled by the daemon, read by the server; strings only here,
/// not in real-time threads.
/// What can be believed of the campaign so far, by the dwells up to one not long ago.
struct VerdictStatus {
    std::uint32_t dwells = 0;  ///< it rests on; 0: too few for any
    int level = 0;             ///< 0 valid, 1 doubtful, 2 not valid
    std::string word, sentence;
    double widening = 1;    ///< of the uncertainty over that of noise alone, median
    bool complete = false;  ///< of the whole campaign, which is over
    /// Of a dwell's drift, by gyro, deg/h.
    struct Residual {
        int run = 0, position = 0;
        double time_h = 0;
        std::array<double, 3> value{}, sigma{};
    };
    std::shared_ptr<const std::vector<Residual>> residuals = {};  ///< null: none
};

struct StatusData {
    std::string version;
    std::string campaign_name;
    std::string clock;       ///< "real" or "rig"
    drivers::Time time = 0;  ///< of the daemon's clock, ns
    std::int64_t utc_ns = 0;
    drivers::Time uptime = 0;

    CampaignState state = CampaignState::idle;
    std::string reason;  ///< why it is aborted, tripped, waiting; else empty
    std::string armed_by;
    std::string armed_for;     ///< unit, plan, highest level, duration
    double arming_left_s = 0;  ///< until the arming expires; 0: not armed, or started
    std::string started_by;    ///< the campaign in progress, or the last one
    std::string resume_offer;  ///< what can be resumed after a restart; empty: nothing
    int run = 0, runs = 0, position = 0, positions = 0;  ///< from 1; 0: none
    std::array<double, 3> position_deg{};
    double progress = 0;     ///< 0 to 1
    double remaining_s = 0;  ///< estimate

    double command_table_g = 0;
    double command_frequency_hz = 0;
    drivers::ShakerReading shaker;
    drivers::LinkState shaker_link = drivers::LinkState::absent;
    drivers::ShakerCounters shaker_counters;
    InterlockStatus interlock;
    JournalStatus journal;
    RecorderStatus recorder;
    ArchiveStatus archive;
    RealTimeStatus real_time;
    MqttStatus mqtt;
    LogStatus log;
    ServerStatus server;
    GuardStatus guard;
    drivers::AnnunciatorStatus annunciator;
    bool stop_pending = false;  ///< a stop is ordered and rest not measured since
    RestStatus rest;

    drivers::PortState can = drivers::PortState::absent;
    drivers::CanPortCounters can_counters;
    drivers::AssemblerCounters assembler;
    std::uint64_t rig_ticks = 0;         ///< delivered frames that were the simulated rig's time
    std::uint64_t increment_frames = 0;  ///< delivered frames that were increments
    RingCounters estimator_ring;
    rt::FrameLatency latency;                                  ///< of the acquisition, real clock
    std::uint64_t estimator_in_dwell = 0, estimator_idle = 0;  ///< popped = in a dwell + idle
    drivers::Sample sample;                                    ///< the newest
    std::array<double, drivers::kChannels> channel_age_s{};    ///< negative: never good
    double channel_deadline_s = 0.1, platform_deadline_s = 0.5;
    bool silent = false;        ///< nothing has come for seconds, whatever clock the rig has
    double sample_rate_hz = 0;  ///< measured; 0: not yet
    std::string rate_misfit;    ///< why it is not the configured one
    std::string clock_misfit;   ///< why rig and daemon have no time in common
    drivers::PlatformStatus platform;
    /// Of the accelerometers against the command: platform and table, g peak at the table;
    /// negative: not known.
    std::array<double, 2> witness_g{-1, -1};

    [[nodiscard]] ChannelState channel(std::size_t c) const noexcept;
    /// good, silent or never.
    [[nodiscard]] ChannelState platform_state() const noexcept;
    FrameStatus frame;

    estimator::Estimate estimate;
    NoiseStatus noise;
    VerdictStatus verdict;
    std::vector<estimator::DwellSummary> dwells;
    LevellingStatus levelling;
    ZeroStatus zeros;
    LoopCheckStatus loop_check;
    ProofStatus proof;
    bool simulated = false;  ///< the rig is a program
};

enum class Severity : std::uint8_t { info, warning, alarm, trip };
[[nodiscard]] const char* name_of(Severity severity) noexcept;

struct EventRecord {
    std::uint64_t id = 0;
    std::int64_t utc_ns = 0;
    drivers::Time time = 0;
    Severity severity = Severity::info;
    std::string source;  ///< "campaign", "can", "shaker", ...
    std::string text;
};

struct CommandRequest {
    enum class Kind : std::uint8_t {
        arm,
        start,
        pause,
        resume,
        abort,
        acknowledge,
        selftest,
        commission,  ///< argument: what, as JSON
        certificate  ///< one was issued; argument: number, campaign and hashes, as JSON
    } kind = Kind::abort;
    std::string by;        ///< named person
    std::string argument;  ///< what is acknowledged
};
struct CommandReply {
    bool accepted = false;
    std::string message;
};

/// What the campaign does and will know at its end.
struct PlanData {
    struct Stop {
        int run = 1, position = 1;
        std::array<double, 3> position_deg{};
        double table_g = 0;
    };
    std::string name;
    bool adaptive = false;
    double dwell_s = 0, frequency_hz = 0;
    std::vector<Stop> stops;
    /// Order of parameter_names(); not finite: not determined. Targets 0: none.
    std::array<double, estimator::kParameters> sigma{}, target{};
};

/// What the status server asks the daemon for. Any thread; never touches the real-time threads.
class StatusSource {
  public:
    virtual ~StatusSource() = default;
    [[nodiscard]] virtual StatusData status() const = 0;
    [[nodiscard]] virtual std::vector<EventRecord> events(std::uint64_t after_id,
                                                          std::size_t at_most) const = 0;
    /// Final or present result; empty while there is nothing.
    [[nodiscard]] virtual estimator::Result result() const = 0;
    [[nodiscard]] virtual std::string effective_configuration() const = 0;
    /// Takes its time, as the control thread does; but for an abort, which is answered at once.
    virtual CommandReply command(const CommandRequest& request) = 0;
    [[nodiscard]] virtual PlanData plan() const { return {}; }
    /// The unit's earlier campaigns, JSON as of `vibrig trend`; empty: none are known.
    [[nodiscard]] virtual std::string unit_history() const { return {}; }
    /// The server's thread goes on, and this is how its doors are; told twice a second. The status
    /// at that moment is for its history.
    virtual StatusData serving(const ServerStatus& /*server*/) { return {}; }
    /// Something that somebody has to know of the server.
    virtual void told(Severity /*severity*/, const std::string& /*text*/) {}
    /// A command that was not let through: who wanted what, and why not.
    virtual void refused(const std::string& /*who*/, const std::string& /*what*/,
                         const std::string& /*why*/) {}
};

}  // namespace vibrig
