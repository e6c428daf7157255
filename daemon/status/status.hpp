#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "daemon/domain/campaign_state.hpp"
#include "daemon/domain/latch.hpp"
#include "daemon/domain/positions.hpp"
#include "daemon/domain/services.hpp"
#include "daemon/interlock/rest_monitor.hpp"
#include "daemon/noise/noise_status.hpp"
#include "daemon/rt/frame_latency.hpp"
#include "drivers/annunciator/annunciator.hpp"
#include "drivers/can/can_port.hpp"
#include "drivers/sample/assembler.hpp"
#include "drivers/sample/sample.hpp"
#include "drivers/shaker/shaker.hpp"
#include "estimator/filter/settings.hpp"
#include "estimator/identification/identification.hpp"

namespace vibrig {

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
    /// Tilt of x and y towards the axis of the slews as the gyros see it, rad; sigma 0: not
    /// separated.
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

/// What a check measured, and its band.
struct CheckRow {
    std::string name, unit;
    double value = 0, low = 0, high = 0;
    [[nodiscard]] bool passed() const { return value >= low && value <= high; }
};

/// The newest loop check.
struct LoopCheckStatus {
    const char* verdict = "";  ///< none, running, in band, out of band, not completed
    std::string by;
    std::string message;  ///< what is out of band, or why it was not completed
    std::vector<CheckRow> rows;
};

/// The newest opening check that was made alone.
struct RestCheckStatus {
    const char* verdict = "";  ///< none, running, right, told, refused, not completed
    std::string by;
    std::int64_t utc_ns = 0;            ///< of its end
    std::string message;                ///< what is off, or why it was not completed
    std::vector<std::string> suspects;  ///< keys that alone, changed, would explain it; best first
};

/// The newest proof of the safe state, and whether it lets a campaign be armed.
struct ProofStatus {
    bool demanded = false;
    std::string refusal;  ///< why no campaign is armed; empty: as far as this goes it may be
    std::string advice;   ///< what should be proved before long
    std::string by;       ///< of the newest, passed or not; empty: there is none
    std::int64_t utc_ns = 0;
    bool passed = false;
    std::string message;
    std::vector<CheckRow> rows;
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

/// What can be believed of the campaign so far, by the dwells up to one not long ago.
struct VerdictStatus {
    std::uint32_t dwells = 0;  ///< it rests on; 0: too few for any
    int level = 0;             ///< 0 valid, 1 doubtful, 2 not valid
    std::string word, sentence;
    double widening = 1;    ///< of the uncertainty over that of noise alone, median
    bool complete = false;  ///< of the whole campaign, which is over
    /// Residual of a dwell's drift, by gyro, deg/h.
    struct Residual {
        int run = 0, position = 0;
        double time_h = 0;
        std::array<double, 3> value{}, sigma{};
    };
    std::shared_ptr<const std::vector<Residual>> residuals = {};  ///< null: none
    /// As in the result, in the order of parameter_names(); not finite: not determined.
    struct Coefficient {
        double value = 0, u = 0;
    };
    std::shared_ptr<const std::array<Coefficient, estimator::kParameters>> coefficients = {};
    /// What is determined of those that are not.
    struct Combination {
        std::vector<std::pair<std::string, double>> weights;
        double value = 0, u = 0;
    };
    std::shared_ptr<const std::vector<Combination>> combinations = {};
};

/// What shakes on a rig with several kinds of vibration: as it is commanded, read back and seen. g
/// are the table's, peak of a sine, rms of random vibration; negative: not known.
struct VibrationStatus {
    std::string kind;         ///< "rest", "sine", "sweep", "random"; empty: a rig with one sine
    double frequency_hz = 0;  ///< of a sine, and where a sweep is
    std::string profile;      ///< of random vibration
    int number = 0;           ///< of the profile in the controller
    double level_db = 0;      ///< about it
    std::string control;      ///< what the controller reports of random vibration
    double commanded_g = 0, controller_g = -1;
    double table_g = -1,
           platform_g = -1;  ///< by the accelerometers, the platform's as at the table
    /// Random: beyond them the interlock stops the shaker once its windows know it.
    double low_g = -1, high_g = -1;
    /// PSD of the profile as it stands, Hz and g^2/Hz, and where: "table" or "platform".
    std::vector<std::pair<double, double>> psd;
    std::string psd_at;
    double from_hz = 0, to_hz = 0;  ///< of a sweep
    /// Words for what has no one frequency: a sweep, random vibration.
    std::string words;
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
    /// The accelerometers against the command: platform and table, g peak at the table;
    /// negative: not known.
    std::array<double, 2> witness_g{-1, -1};
    VibrationStatus vibration;

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
    RestCheckStatus rest_check;
    ProofStatus proof;
    bool simulated = false;  ///< the rig is a program
};

}  // namespace vibrig
