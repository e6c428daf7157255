#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "daemon/rt/dwell_order.hpp"
#include "daemon/rt/frame_record.hpp"
#include "drivers/sample/sample.hpp"
#include "estimator/filter/coefficients.hpp"
#include "estimator/filter/vibration_moment.hpp"
#include "estimator/identification/identification.hpp"

namespace vibrig::estimator {
struct DwellRow;
}

namespace vibrig::record {

using rt::FrameRecord;

/// What the head of a campaign's file says.
struct Head {
    std::string name, started_by;
    std::int64_t utc_ns = 0;
    std::int64_t utc_offset_ns = 0;  ///< UTC of the beginning minus the daemon's clock, whole us
    std::string clock;               ///< "real" or "rig"
    bool simulated = false;          ///< the rig was a program: nothing here was measured
    std::string version, compiler, instruction_set;
    std::string configuration;  ///< effective, TOML
    std::string configuration_hash;
    std::string dbc;
    std::string plan;   ///< JSON: positions and levels; empty when chosen one by one
    std::string proof;  ///< JSON: of the safe state, before the campaign; empty: none
    std::string interface;
    std::string interlocks;  ///< JSON: rows of the interlock's table, as in ConditionRow
    std::size_t interlock_rows = 0;
    std::string campaign;           ///< its folder's name when it began: the same in all parts
    int part = 1;                   ///< a campaign's files, in order
    bool restart = false;           ///< this part goes on after the daemon's restart
    std::size_t dwells_before = 0;  ///< that the filter then had
    std::string journal_head;       ///< signed, as it was when this was last written; empty: none
};

/// A dwell as it was ordered from the estimator.
struct Order {
    drivers::Time announced = 0;
    drivers::Time from = 0, to = 0;
    int run = 0, position = 0;
    double table_g = 0;
    bool cancel = false;
    std::array<double, 3> zero_g{};  ///< taken off the raw specific force
    double level_sigma_g = 0;
    estimator::NoiseLevels noise{};  ///< that the filter takes in it; angle 0: not known
    /// Since the campaign's first dwell, a restart included; NaN: not known.
    double begin_s = std::numeric_limits<double>::quiet_NaN();
    bool power_lost = false;              ///< the gyros were without power since the dwell before
    double frequency_hz = 0;              ///< commanded; 0: the configuration's
    bool held_out = false;                ///< for verification
    estimator::RandomVibration random{};  ///< in place of a sine
    estimator::SweptSine sweep{};         ///< likewise
    /// Under random vibration what was played, as the controller reports it: known after the dwell,
    /// and its PSD at the table, Hz and g^2/Hz, as it came.
    std::optional<estimator::PlayedRandom> played{};
    std::vector<std::array<double, 2>> psd{};
    [[nodiscard]] estimator::DwellInfo dwell() const {
        return {run,      position, table_g, begin_s, power_lost, frequency_hz,
                held_out, random,   {},      sweep,   played};
    }
};

/// What became of asking what was played in a random dwell.
struct Played {
    drivers::Time from = 0;  ///< of its order
    std::int32_t run = 0, position = 0;
    estimator::PlayedRandom random;
    std::vector<std::array<double, 2>> psd;
};

/// What the controller reports of its frequency in a sweep.
struct SweptRow {
    drivers::Time time = 0;
    std::int32_t run = 0, position = 0;
    double frequency_hz = 0;
};

/// Rows of one sweep.
using Swept = std::vector<SweptRow>;

template <std::size_t N>
constexpr std::array<double, N> not_known() {
    std::array<double, N> values;
    values.fill(std::numeric_limits<double>::quiet_NaN());
    return values;
}

/// What a dwell says of the coefficients, all in numbers. NaN: left out.
struct DwellNumbers {
    double middle_s = not_known<1>()[0];
    std::array<double, 3> rate = not_known<3>();
    std::array<double, 9> rate_covariance = not_known<9>();  ///< 3 x 3
    std::array<double, estimator::kParameters> rate_regressors =
        not_known<estimator::kParameters>();  ///< 3 x 10
    std::array<double, 3> ramp = not_known<3>(), ramp_sigma = not_known<3>();
    estimator::LevelTensor gamma = not_known<6>();
    double sync_arcsec = not_known<1>()[0];
};
[[nodiscard]] DwellNumbers numbers_of(const estimator::DwellRow& row);
/// Of the dwell that ended last.
[[nodiscard]] DwellNumbers numbers_after(const estimator::Identification& identification,
                                         const estimator::DwellSummary& summary);

/// A dwell that is over, and what was known after it.
struct Dwell {
    drivers::Time time = 0;
    estimator::DwellSummary summary;
    std::string reason;  ///< of the summary's flag
    std::array<double, estimator::kParameters> value{}, sigma{};
    std::array<bool, estimator::kParameters> observable{};
    std::vector<double> covariance;       ///< 30 x 30, row-major
    std::optional<DwellNumbers> numbers;  ///< nothing: an older recording has none
};

/// How a campaign ended.
struct Ended {
    std::string state, reason;
    std::string mark;  ///< why the campaign is marked; empty: it is not
    std::string result_json;
    std::int64_t utc_ns = 0;
    std::uint64_t journal_entry = 0;  ///< that says so in the journal; 0: none does
    std::string journal_head = {};    ///< signed, with that entry; empty: no journal is kept
};

/// The state of the filter, about once a second.
struct EstimateRow {
    drivers::Time time = 0;
    double amplitude_g = 0, frequency_hz = 0, kappa = 1, nis_per_dof = 0;
    std::array<double, 3> innovation_arcsec{};
    std::array<double, estimator::kParameters> value{}, sigma{};
};

/// Around the measurement, once a second, whether samples come or not. NaN: not known then.
struct ConditionRow {
    drivers::Time time = 0;
    double temperature_c = 0;  ///< inner element
    std::array<double, drivers::kTemperatureSensors.size()> sensor_c{};
    double command_g = 0, command_hz = 0;      ///< what the campaign wants, peak at the table
    double set_point_g = 0, set_point_hz = 0;  ///< read back from the shaker's controller
    double measured_g = 0;                     ///< by the controller, peak at the table
    double witness_platform_g = 0, witness_table_g = 0;  ///< accelerometers, peak at the table
    std::int32_t shaker_state = -1;                      ///< register, -1: not known
    /// 1: yes, 0: no, -1: not known.
    std::int8_t shaker_running = -1, emergency_stop_open = -1;
    std::int8_t ready = -1, loop_closed = -1, gyros_at_speed = -1, fault = -1, in_position = -1,
                slewing = -1;
    std::vector<double> interlock_value;  ///< as many as Head::interlocks
    std::vector<std::uint8_t> interlock_raised;
};

/// Something that should be in the recording and is not.
struct Gap {
    drivers::Time from = 0, to = 0;
    std::string stream;  ///< "samples", "frames", "sent frames", ...
    std::uint64_t lost = 0;
    std::string reason;
};

}  // namespace vibrig::record
