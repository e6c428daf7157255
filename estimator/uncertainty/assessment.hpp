#pragma once

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "estimator/identification/result.hpp"
#include "estimator/uncertainty/budget.hpp"
#include "estimator/uncertainty/fit.hpp"
#include "estimator/uncertainty/freed.hpp"

namespace vibrig::estimator::uncertainty {

inline constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

struct Contribution {
    std::string input, element;
    double sensitivity = 0;   ///< of the coefficient, per unit of the input
    double u = 0;             ///< of the input
    double contribution = 0;  ///< to the coefficient's u
    Shape shape = Shape::normal;
    double dof = std::numeric_limits<double>::infinity();
    bool declared = false;
    /// What correlations add to the coefficient's variance, half of each pair's: those with other
    /// inputs, and with other elements of this one.
    double with_others = 0, with_own = 0;
};

/// NaN: not determined, or not declared.
struct Coefficient {
    double value = kNone;           ///< with a bias that may have moved, its mean over the dwells
    double value_constant = kNone;  ///< with a constant bias
    double sigma = kNone;           ///< noise only, of value_constant
    double noise = kNone;           ///< noise only, of value: no more than u_a
    double u_a = kNone, u_b = kNone, u = kNone;
    double nu_eff = kNone, k = kNone, expanded = kNone;
    double u_use = kNone;              ///< of what it will be after the next switch-on
    std::vector<Contribution> budget;  ///< the largest first
    double correlation = 0;            ///< u^2 less the squares of the budget's parts

    /// Its root; negative: its square comes off those of the parts.
    [[nodiscard]] double correlation_part() const {
        return std::copysign(std::sqrt(std::abs(correlation)), correlation);
    }
};

enum class Level { valid, doubtful, not_valid };
[[nodiscard]] const char* word_of(Level level) noexcept;

struct Reason {
    std::string code, text;
    Level level = Level::doubtful;
    double size = kNone, sigma = kNone;
    std::string unit = {};
    int dwell = 0;  ///< from 1; 0: of none in particular
    double largest_effect_u = kNone;
    std::string coefficient = {};
};

/// What can be believed of a result; the strongest reason first.
struct Verdict {
    Level level = Level::doubtful;
    std::vector<Reason> reasons;
    /// "valid: ...", or the first reason after "doubtful, because" or "not valid, because".
    std::string sentence;
};

struct DwellRate {
    int run = 0, position = 0;
    double level_g = 0;  ///< of the platform
    double time_h = 0;
    std::array<double, 3> rate{}, sigma{}, residual{}, residual_sigma{};  ///< deg/h
};

/// Without what is left of it.
[[nodiscard]] DwellRate rate_of(const DwellRow& row, double time_h);

struct CrossAxis {
    int run = 0;
    LevelTensor gamma = kVertical;  ///< mean over its vibrating dwells
};

/// Of a combination of what is not determined one by one: as Coefficient.
struct Determined {
    double value = kNone, u = kNone;
};

/// Everything that follows from the rows of a campaign's dwells.
struct Assessment {
    bool done = false;            ///< there were rows to work on
    bool over_frequency = false;  ///< coefficients of several frequencies took their place
    std::array<Coefficient, kParameters> coefficients;  ///< order of parameter_names()
    /// Type A, and with the declared inputs: 30 x 30, order of parameter_names().
    Eigen::MatrixXd covariance_a, covariance_combined;
    std::vector<Determined> combinations;  ///< as Result::combinations; over frequency none
    Verdict verdict;
    double chi_square = 0, p = kNone;
    int degrees = 0;
    RampFit ramps;
    double birge = 1, widening = 1;
    std::vector<Evidence> evidence;  ///< the best first
    /// Where a state of the drift is named: the structural ones with that beside them.
    std::vector<Evidence> beside_drift;
    BiasModel model = BiasModel::automatic;
    std::array<DriftAverage, 3> drift;
    std::vector<FreedUnknown> freed;
    bool freed_settled = true;  ///< what is freed could be found
    double worst_step = 1;      ///< largest inflation of a sigma by one free step
    std::vector<CrossAxis> cross_axis;
    double sync_arcsec = 0, sync_bound = 0;  ///< deg/h/g^2
    std::vector<DwellRate> rates;
    bool times_assumed = false;
    /// For the Monte Carlo: gain of the estimator (30 x 3 n), the inputs, and what one unit of each
    /// does to the coefficients (30 x m), filter order.
    Eigen::MatrixXd gain, covariance_type_a, sensitivity;
    std::vector<InputSignature> inputs;
};

/// Largest motion in step with the vibration in these dwells, and what it may do.
void take_sync(std::span<const DwellRow> rows, Assessment& to);

/// Whether dwells are still to come. Then what is not observable yet is no reason of a verdict.
enum class Stage : std::uint8_t { under_way, ended };

/// A pure function of settings and result (its rows, observability, cross-check and dwells): live,
/// resumed, replayed and read from a file it gives the same to the last bit.
[[nodiscard]] Assessment assess(const Settings& settings, const Result& result,
                                Stage stage = Stage::ended);

}  // namespace vibrig::estimator::uncertainty
