#pragma once

#include <array>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "daemon/configuration/configuration.hpp"
#include "daemon/record/campaign_file.hpp"
#include "daemon/record/replay.hpp"
#include "daemon/report/compensation.hpp"
#include "daemon/results/spectrum_result.hpp"
#include "estimator/allan/deviation.hpp"
#include "estimator/uncertainty/assessment.hpp"

namespace vibrig::report {

/// Standard deviations either way that hold 95 %.
inline constexpr double k95 = 1.959963984540054;

/// Drift of one gyro in a dwell on which the coefficients were not fitted.
struct HeldOut {
    int run = 0, position = 0;
    double table_g = 0;
    std::array<double, 3> before_dph{};  ///< Earth's rate taken out, nothing compensated
    std::array<double, 3> after_dph{};   ///< with the coefficients of the other positions
    std::array<double, 3> sigma_dph{};   ///< expected of after: coefficients and noise
    bool determined = true;              ///< by the other positions
};

/// Innovations of the whole campaign, thinned for the eye; statistics over all.
struct Innovations {
    std::vector<double> time_s;                      ///< since the first sample
    std::array<std::vector<double>, 3> arcsec;       ///< outer, inner, azimuth
    std::array<std::vector<double>, 3> correlation;  ///< by lag, from 0; between used neighbours
    std::array<double, 3> deviation_arcsec{};
    std::size_t count = 0;
};

/// Of which vibration each quadratic coefficient of a result is, Hz; 0: static; NaN: of none.
using Frequencies = std::array<double, estimator::kParameters>;
[[nodiscard]] Frequencies frequencies_of(const tool::Assessed& found,
                                         const estimator::Settings& settings);

struct Analysis {
    record::ReplayResult replayed;
    Coefficients coefficients;                    ///< of a constant bias, sigma of noise alone
    estimator::uncertainty::Assessment assessed;  ///< over frequency, where there are several
    std::optional<tool::SpectrumResult> spectrum;
    /// Where the recording's own result is not what the replay gives; empty: nowhere.
    std::string not_as_recorded;
    Frequencies at_hz{};
    std::string anew_with;  ///< the settings' file; empty: those of the recording
    estimator::Settings settings;
    Innovations innovations;
    std::vector<HeldOut> held_out;
    /// Overlapping Allan deviation of each gyro's residual rate, deg/h, mean over the dwells.
    std::array<std::vector<estimator::allan::Point>, 3> allan;
    std::array<double, estimator::kParameters> expected_sigma{};  ///< of the plan; infinite: none
    std::string journal;  ///< journal_verdict() of its daemon's journal
    /// What an archive has of the unit: a table with heads, and in words; empty: none was asked.
    std::vector<std::vector<std::string>> history;
    std::string history_note;
};

using Progress = std::function<void(double fraction)>;

/// Replays the campaign, and identifies it several times more without some of its positions.
/// Throws.
[[nodiscard]] Analysis analyse(const record::Campaign& campaign,
                               const configuration::Configuration& rig, const Progress& progress);

/// The coefficients at the reference frequency do not rest on such a dwell.
[[nodiscard]] bool apart(const estimator::Settings& settings, const record::Order& order);
/// Of its first sample, on the daemon's clock; 0: there is none.
[[nodiscard]] double origin_s(const record::Campaign& campaign);
/// As it lies in the recording, its noise that which was found.
[[nodiscard]] configuration::Configuration rig_of(const record::Campaign& campaign);
/// Coefficients of a campaign's result.
[[nodiscard]] Coefficients final_coefficients(const std::string& path,
                                              const record::ReplayResult& replayed);
/// Coefficients after the last dwell of the recording, as shown live; throws without one.
[[nodiscard]] Coefficients final_coefficients(const std::string& path,
                                              const std::vector<record::Dwell>& dwells);

}  // namespace vibrig::report
