#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <iosfwd>
#include <string>
#include <utility>
#include <vector>

#include "tests/plant/sensors.hpp"
#include "tests/plant/truth.hpp"

namespace vibrig::plant {

/// A campaign to be simulated without any bus: one run per table amplitude, one dwell per position.
struct CampaignPlan {
    std::vector<Vec3> positions_deg = table1();  ///< outer, inner, azimuth, as the encoders count
    std::vector<double> table_g{9, 7};           ///< peak at the table, 0 for a run at rest
    std::vector<double> frequency_hz{15};        ///< one for all runs, or one each
    /// Random vibration of this number in the truth, table_g its rms (to 0.1 dB); one each, 0 for
    /// sine. Empty: sines.
    std::vector<std::uint16_t> profile{};
    /// A sweep from its first to its second frequency, Hz, over a dwell; one each, zeros for none.
    /// Empty: none.
    std::vector<std::array<double, 2>> sweep{};
    double dwell_s = 100;
    double ramp_s = 2;
    double settle_s = 3;  ///< after the ramp, not recorded
    /// Dwells in their order as run and position, both from 1; empty: run by run, each position
    /// once.
    std::vector<std::pair<std::size_t, std::size_t>> order{};

    /// Table 1 of Tang et al. 2009.
    [[nodiscard]] static std::vector<Vec3> table1();
    [[nodiscard]] std::uint16_t profile_of(std::size_t run) const {
        return profile.empty() ? std::uint16_t{0} : profile[run - 1];
    }
    /// Zeros: none.
    [[nodiscard]] std::array<double, 2> sweep_of(std::size_t run) const {
        return sweep.empty() ? std::array<double, 2>{} : sweep[run - 1];
    }
    /// Run from 1.
    [[nodiscard]] double hz_of(std::size_t run) const {
        return frequency_hz[frequency_hz.size() == 1 ? 0 : run - 1];
    }
};

/// "9.1,11.2,...": position 9 in run 1, then position 11 in run 2; for CampaignPlan::order. Throws
/// PlantError.
[[nodiscard]] std::vector<std::pair<std::size_t, std::size_t>> parse_order(const std::string& text);

/// "20:120", Hz; "-": none. Throws PlantError.
[[nodiscard]] std::array<double, 2> parse_sweep(const std::string& text);

/// CSV with the columns alpha_deg, beta_deg, gamma_deg; "table1" is the built-in list. Throws
/// PlantError naming the line.
[[nodiscard]] std::vector<Vec3> read_positions(const std::string& name_or_path);

/// A sample of a simulated campaign.
struct PlannedSample {
    std::size_t run = 1, position = 1;  ///< from 1
    double time_s = 0;
    const Readings& readings;
    double hz = 0;  ///< of a sweep at this moment; 0: no sweep
    /// In truth and at this moment, with all drift.
    const std::array<GyroCoefficients, 3>& coefficients;
};

/// Simulates the plan, dwell by dwell, without any bus or file. Returns the number of samples.
/// `progress` hears of every finished dwell.
std::uint64_t simulate(const Truth& truth, const CampaignPlan& plan,
                       const std::function<void(const PlannedSample&)>& sink,
                       const std::function<void(std::size_t done, std::size_t all)>& progress = {});

/// Writes the recording as CSV (time_s, run, position, alpha_deg ... az_g, and with a frequency for
/// each run frequency_hz, and where one is random profile, its number or 0, and level_db; last the
/// mark `simulated`, as proto::write_recording() has it). Returns the number of samples. `progress`
/// hears of every finished dwell. `mean` becomes the coefficients' mean over all samples.
std::uint64_t record(const Truth& truth, const CampaignPlan& plan, std::ostream& out,
                     std::array<GyroCoefficients, 3>* mean = nullptr,
                     const std::function<void(std::size_t done, std::size_t all)>& progress = {});

}  // namespace vibrig::plant
