#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "estimator/identification/dwell_row.hpp"
#include "estimator/identification/identification.hpp"

namespace vibrig::estimator {

struct RunAmplitude {
    int run = 0;
    double amplitude_g = 0, kappa = 1, sigma_g = 0;
    double frequency_hz = 0;  ///< 0: at rest, random, or no line near the nominal one

    [[nodiscard]] bool at_rest() const noexcept;
};

/// A determined combination of coefficients that are not determined one by one.
struct Combination {
    std::vector<std::pair<std::string, double>> weights;
    double value = 0, sigma = 0;
};

/// Agreement of the filter with an independent batch least squares over the same readings.
struct CrossCheck {
    static constexpr double kLimit = 0.05;  ///< of a standard deviation
    bool done = false;
    double largest = 0;       ///< difference of all that is determined, in standard deviations
    std::string coefficient;  ///< where: a name, or the first of a combination

    [[nodiscard]] bool agrees() const noexcept { return largest <= kLimit; }
};

struct Result {
    std::array<double, kParameters> value{};
    std::array<double, kParameters> sigma{};
    std::array<bool, kParameters> observable{};
    /// Rows in the order of parameter_names(); rows of what is not observable are NaN
    /// (null in JSON).
    std::array<std::array<double, kParameters>, kParameters> covariance{};
    std::vector<RunAmplitude> amplitudes;
    std::vector<Combination> combinations;
    double nis_per_dof = 0;
    std::uint64_t samples = 0, rejected = 0;
    std::vector<DwellSummary> dwells;
    std::vector<DwellRow> rows;  ///< of the dwells kept, in their order; none that is apart
    CrossCheck cross_check;
    std::vector<std::string> warnings;
};

/// Adds what uncertain zeros of the accelerometers do to the runs' amplitudes. `level_variances`:
/// for each dwell with known zeros its run and the variance of the vertical force, relative. The
/// zeros are the same in every dwell: they do not average out.
void widen_amplitudes(Result& result, const std::vector<std::pair<int, double>>& level_variances);

}  // namespace vibrig::estimator
