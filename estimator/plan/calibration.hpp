#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "estimator/plan/evaluation.hpp"

namespace vibrig::estimator::plan {

/// Largest input and output, and range of sigmas, in any unit that a sensor has. Their squares and
/// quotients are squared on the way, which has to stay far from what a double can hold.
inline constexpr double kLargestInput = 1e12, kLargestOutput = 1e30;
inline constexpr double kSmallestSigma = 1e-30, kLargestSigma = 1e30;
inline constexpr double kMostMeant = 1e12;  ///< readings that one is the mean of

/// One reading of a turntable or centrifuge test.
struct Reading {
    Vec3 input{};  ///< on input, output and spin axis; the input's unit, for instance g or deg/s
    double output = 0;  ///< the sensor's unit
    double sigma = 0;   ///< 1 sigma of `output`; 0: the same unknown one for all readings
};

/// A test of chi-square or F: how likely so large a value is when the model holds.
struct ResidualTest {
    double statistic = 0;
    double probability = 1;
    double degrees = 0;        ///< of the numerator
    double error_degrees = 0;  ///< of repeated readings; 0: sigma was stated
};

/// Least squares of D0 + sum Di xi + sum Dii xi^2 + sum Dij xi xj (docs/theory/dplan.md).
struct SensorCalibration {
    Evaluation plan;  ///< rank, null vectors and condition of the inputs as they were
    Row value{};      ///< meaningful where `sigma` is finite
    Row sigma{};      ///< 1 sigma; infinite where not determined, 0 for terms not in the model
    Eigen::MatrixXd covariance;  ///< of the model's terms, in their order; NaN if rank deficient
    double noise = 0;  ///< 1 sigma of a reading, stated (their root mean square) or estimated
    std::size_t degrees = 0;           ///< readings less rank
    std::vector<double> residual;      ///< output less model, one a reading
    std::vector<double> standardised;  ///< over its own 1 sigma; NaN where the model must fit
    std::optional<ResidualTest> test;  ///< nothing when neither sigma nor repeated readings tell
    std::string untested;              ///< why there is none; empty: there is
};

/// Weighted by 1 / sigma^2. With stated sigmas the sum of squared residuals over sigma^2 follows
/// chi-square(degrees); without, readings repeated at one input tell the noise apart from lack of
/// fit: F of the two. Repeated readings that agree exactly tell of no noise: those of a coarse
/// converter do, whose steps are in the residuals. Throws PlanError for fewer readings than
/// coefficients, an input, output or sigma beyond the limits above, sigmas of which some but not
/// all are 0, and inputs that excite no term.
[[nodiscard]] SensorCalibration calibrate(const std::vector<Reading>& readings,
                                          const Terms& terms = kAllTerms);

}  // namespace vibrig::estimator::plan
