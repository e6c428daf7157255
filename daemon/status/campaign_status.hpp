#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "daemon/domain/latch.hpp"
#include "daemon/interlock/rest_monitor.hpp"
#include "estimator/filter/settings.hpp"

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
};

}  // namespace vibrig
