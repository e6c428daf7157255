#pragma once

#include <cstddef>
#include <limits>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "daemon/archive/entry.hpp"

namespace vibrig::archive {

/// 1 in so many campaigns is called one that its unit's history does not allow, though it does.
inline constexpr double kFalseAlarm = 1e-3;
/// A longer pause between two campaigns is taken for a shutdown, h.
inline constexpr double kShutdownAfterH = 4;

/// A standard deviation that campaigns have beyond what their measurement explains, and its F test.
struct Instability {
    bool tested = false;
    double value = 0;  ///< 0: nothing beyond
    double f = 0, dof = 0, dof_of_error = 0;
    double p = 1;  ///< that F is so large or larger without it
};

struct TrendPoint {
    std::size_t campaign = 0;  ///< in Trend::campaigns
    Coefficient of;
    double u = 0;  ///< of what differs between these campaigns
    /// From what the others allow, in units of Student's t; NaN: too few others.
    double t = std::numeric_limits<double>::quiet_NaN(), p = 1;
    bool outlier = false;
};

struct CoefficientTrend {
    std::size_t position = 0;     ///< in parameter_names()
    std::optional<double> at_hz;  ///< Coefficient::at_hz of all points
    std::vector<TrendPoint> points;
    double mean = 0, mean_low = 0, mean_high = 0;  ///< 95 %
    Instability operating, shutdown;
};

struct Trend {
    std::vector<Entry> campaigns;   ///< by time, "not valid" ones left out
    std::vector<std::size_t> turn;  ///< of each campaign: in which turn-on, from 0
    std::size_t left_out = 0;       ///< not valid, or without a result
    bool simulated = false;         ///< on simulated rigs, or on real ones
    std::size_t elsewhere = 0;      ///< left out: on the other ones
    /// Of which vibration quadratic coefficients are compared, in words; of which others there are,
    /// and of how many campaigns quadratic ones are left out for that.
    std::set<std::string> vibrations, other_vibrations;
    std::size_t of_other_vibration = 0;
    std::vector<CoefficientTrend> coefficients;  ///< those with points
    bool several_rigs = false;
};

/// Trend of one unit's campaigns, by time: those on simulated rigs, or those on real ones.
/// Quadratic coefficients depend on the vibration: compared are those of the same as `like` has,
/// and where it has none, as the newest campaign that determines them.
[[nodiscard]] Trend trend_of(std::vector<Entry> campaigns, double shutdown_after_h, bool simulated,
                             const Coefficients& like = {});

/// Of which vibration quadratic coefficients are, and how many campaigns are left out for that;
/// empty: there are none.
[[nodiscard]] std::string vibration_words(const Trend& trend);

/// Analysis of variance of values with known standard uncertainties in groups: within the groups
/// against the uncertainties, and between the groups against within (or the uncertainties, where no
/// group has two).
struct Variance {
    Instability within, between;
    double mean = 0, mean_sigma = 0;
    double mean_dof = std::numeric_limits<double>::infinity();  ///< of mean_sigma
};
[[nodiscard]] Variance analyse_variance(const std::vector<double>& value,
                                        const std::vector<double>& u,
                                        const std::vector<std::size_t>& group);

/// A value against those before it: their scatter, beyond their uncertainties, is what it may have.
struct Judgement {
    double expected = 0, sigma = 0;  ///< of the difference
    double t = 0, dof = 0, p = 1;
};
/// Nothing with fewer than two before.
[[nodiscard]] std::optional<Judgement> judge(double value, double u,
                                             const std::vector<double>& before,
                                             const std::vector<double>& before_u);

/// A coefficient that a campaign moves by more than its unit's history allows.
struct Moved {
    std::size_t position = 0;
    double value = 0;
    Judgement by;
};
/// At 1 in 1000 campaigns, all coefficients together; `history`: the same unit's, earlier.
/// Quadratic ones against those of the same vibration.
[[nodiscard]] std::vector<Moved> moved(const Entry& campaign, const std::vector<Entry>& history);

}  // namespace vibrig::archive
