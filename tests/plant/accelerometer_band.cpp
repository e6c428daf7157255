#include "tests/plant/accelerometer_band.hpp"

#include <cmath>
#include <cstddef>
#include <numbers>

namespace vibrig::plant {

AccelerometerBand::AccelerometerBand(double bandwidth_hz, int order, double step_s) {
    const double omega = 2 * std::numbers::pi * bandwidth_hz;
    std::vector<Complex> at;
    for (int k = 0; k < order; ++k)
        at.push_back(std::polar(omega, std::numbers::pi * (2 * k + order + 1) / (2 * order)));
    for (std::size_t k = 0; k < at.size(); ++k) {
        Complex residue = 1;
        for (std::size_t i = 0; i < at.size(); ++i)
            residue *= i == k ? -at[k] : -at[i] / (at[k] - at[i]);
        const Complex p = at[k], decay = std::exp(p * step_s);
        poles_.push_back({residue,
                          decay,
                          (decay - 1.0) / p,
                          (decay - 1.0 - p * step_s) / (p * p * step_s),
                          {},
                          {}});
    }
}

Shake AccelerometerBand::shown() const noexcept {
    Shake out;
    for (const Pole& pole : poles_) {
        out.in_phase += (pole.part * pole.up).real();
        out.quadrature += (pole.part * pole.ahead).real();
    }
    return out;
}

void AccelerometerBand::follow(std::span<const Shake> motion, std::span<Shake> shown) noexcept {
    shown[0] = this->shown();
    for (std::size_t i = 1; i < motion.size(); ++i) {
        const Shake &from = motion[i - 1], &to = motion[i];
        for (Pole& pole : poles_) {
            pole.up = pole.decay * pole.up + pole.held * from.in_phase +
                      pole.risen * (to.in_phase - from.in_phase);
            pole.ahead = pole.decay * pole.ahead + pole.held * from.quadrature +
                         pole.risen * (to.quadrature - from.quadrature);
        }
        shown[i] = this->shown();
    }
}

void AccelerometerBand::rest() noexcept {
    for (Pole& pole : poles_) pole.up = pole.ahead = 0;
}

}  // namespace vibrig::plant
