#include "estimator/levelling/noise_budget.hpp"

#include <cmath>

namespace vibrig::estimator::levelling {

const char* NoiseBudget::dominant() const noexcept {
    if (total == 0) {
        return "none";
    }
    if (reference >= accelerometer && reference >= gyro) {
        return "reference velocity";
    }
    return gyro >= accelerometer ? "gyro random walk" : "accelerometer";
}

double variance_gain(double c2, double c1, double c0, double d2, double d1, double d0) noexcept {
    return (c2 * c2 * d0 * d1 + (c1 * c1 - 2 * c0 * c2) * d0 + c0 * c0 * d2) /
           (2 * d0 * (d1 * d2 - d0));
}

NoiseBudget noise_budget(const Gains& gains, const Noise& noise, double period_s,
                         const Earth& earth) noexcept {
    const double ws2 = earth.schuler_squared();
    const double r = earth.radius_m;
    const double d2 = gains.k1;
    const double d1 = (1 + gains.k2) * ws2;
    const double d0 = gains.k3 * ws2;
    const auto deviation = [&](double density, double c2, double c1, double c0) {
        return std::sqrt(density * variance_gain(c2, c1, c0, d2, d1, d0));
    };
    NoiseBudget budget;
    budget.reference = deviation(noise.reference_mps * noise.reference_mps * period_s,
                                 -gains.k2 / r, (gains.k1 - gains.k3) / r, 0);
    budget.accelerometer = deviation(noise.accelerometer_mps2 * noise.accelerometer_mps2 * period_s,
                                     0, (1 + gains.k2) / r, gains.k3 / r);
    budget.gyro = deviation(noise.gyro_random_walk * noise.gyro_random_walk, 1, gains.k1, 0);
    // z / R as the drift found: K3 s / (R D) from the accelerometer, K3 ws^2 / D from the gyro.
    const double accelerometer_drift = deviation(
        noise.accelerometer_mps2 * noise.accelerometer_mps2 * period_s, 0, gains.k3 / r, 0);
    const double gyro_drift = deviation(noise.gyro_random_walk * noise.gyro_random_walk, 0, 0, d0);
    budget.drift = std::hypot(accelerometer_drift, gyro_drift);
    // w: s^2 / D from the accelerometer, g s / D from the gyro, and from the reference velocity
    // -(s^3 + ws^2 s) / D = -1 + (K1 s^2 + K2 ws^2 s + K3 ws^2) / D.
    const double g = earth.gravity_mps2;
    budget.velocity = std::hypot(
        deviation(noise.reference_mps * noise.reference_mps * period_s, d2, gains.k2 * ws2, d0),
        deviation(noise.accelerometer_mps2 * noise.accelerometer_mps2 * period_s, 1, 0, 0),
        deviation(noise.gyro_random_walk * noise.gyro_random_walk, 0, g, 0));
    budget.total = std::hypot(budget.reference, budget.accelerometer, budget.gyro);
    return budget;
}

}  // namespace vibrig::estimator::levelling
