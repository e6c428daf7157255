#pragma once

#include <array>
#include <cstddef>
#include <stdexcept>
#include <vector>

namespace vibrig::estimator::plan {

/// A plan that cannot be had; the message says why and what would help.
class PlanError : public std::runtime_error {
  public:
    using std::runtime_error::runtime_error;
};

/// One gyro: D0 + sum Di xi + sum Dii xi^2 + sum Dij xi xj.
inline constexpr std::size_t kTerms = 10;
inline constexpr std::array<const char*, kTerms> kTermNames{"D0",  "D1",  "D2",  "D3",  "D11",
                                                            "D22", "D33", "D12", "D13", "D23"};
using Row = std::array<double, kTerms>;
using Terms = std::array<bool, kTerms>;  ///< which of them the model has
inline constexpr Terms kAllTerms{true, true, true, true, true, true, true, true, true, true};
using Vec3 = std::array<double, 3>;

/// Averaged vibration along the vertical multiplies the quadratic terms (Tang et al. 2009):
/// 1 + a^2 / 2, a the peak at the platform in g.
[[nodiscard]] double kappa_of(double level_g) noexcept;
/// Regressor on a turntable, x the rates on the gyro's three axes.
[[nodiscard]] Row turntable_row(const Vec3& x) noexcept;
/// Regressor on the vibration rig, `up` the unit vector of the vertical in platform axes.
[[nodiscard]] Row vibration_row(const Vec3& up, double level_g) noexcept;

/// A run that a plan may hold, as often as it likes.
struct Point {
    Row f{};
    double noise = 1;  ///< standard deviation of one run's result, relative
    double cost = 1;   ///< of one run; all 1: a plan is compared per run, else per unit of time
};

struct Problem {
    std::vector<Point> points;
    Terms terms = kAllTerms;

    [[nodiscard]] std::size_t size() const noexcept { return points.size(); }
    [[nodiscard]] std::size_t coefficients() const noexcept;
};

/// Effort spent on each point: numbers of runs, or shares of the time. `Point::noise` is that of
/// one unit.
using Effort = std::vector<double>;

}  // namespace vibrig::estimator::plan
