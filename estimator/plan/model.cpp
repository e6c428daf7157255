#include "estimator/plan/model.hpp"

#include <algorithm>

namespace vibrig::estimator::plan {

double kappa_of(double level_g) noexcept { return 1 + level_g * level_g / 2; }

namespace {

Row row(const Vec3& x, double quadratic) noexcept {
    return {1.0,
            x[0],
            x[1],
            x[2],
            quadratic * x[0] * x[0],
            quadratic * x[1] * x[1],
            quadratic * x[2] * x[2],
            quadratic * x[0] * x[1],
            quadratic * x[0] * x[2],
            quadratic * x[1] * x[2]};
}

}  // namespace

Row turntable_row(const Vec3& x) noexcept { return row(x, 1); }

Row vibration_row(const Vec3& up, double level_g) noexcept { return row(up, kappa_of(level_g)); }

std::size_t Problem::coefficients() const noexcept {
    return static_cast<std::size_t>(std::count(terms.begin(), terms.end(), true));
}

}  // namespace vibrig::estimator::plan
