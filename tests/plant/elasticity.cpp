#include "tests/plant/elasticity.hpp"

#include <algorithm>
#include <numbers>

namespace vibrig::plant {

Elasticity::Elasticity(const Truth& truth) noexcept
    : any_(truth.elastic_share != Vec3{}),
      share_(truth.elastic_share),
      hz_(truth.elastic_resonance_hz),
      damping_(truth.elastic_damping) {}

void Elasticity::prepare(double step_s) noexcept {
    step_s_ = step_s;
    for (std::size_t j = 0; j < 3; ++j) {
        const double w = 2 * std::numbers::pi * hz_[j], loss = 2 * damping_[j] * w;
        using State = std::array<double, 2>;
        const auto slope = [&](const State& x, double force) {
            return State{x[1], w * w * (force - x[0]) - loss * x[1]};
        };
        const auto run = [&](const State& x, double begin, double middle, double end) {
            const auto along = [&](const State& k, double part) {
                return State{x[0] + part * step_s * k[0], x[1] + part * step_s * k[1]};
            };
            const State a = slope(x, begin), b = slope(along(a, 0.5), middle);
            const State c = slope(along(b, 0.5), middle), d = slope(along(c, 1), end);
            State out{};
            for (std::size_t i = 0; i < 2; ++i)
                out[i] = x[i] + step_s / 6 * (a[i] + 2 * b[i] + 2 * c[i] + d[i]);
            return out;
        };
        const State first = run({1, 0}, 0, 0, 0), second = run({0, 1}, 0, 0, 0);
        step_[j] = {{{{first[0], second[0]}, {first[1], second[1]}}},
                    run({0, 0}, 1, 0, 0),
                    run({0, 0}, 0, 1, 0),
                    run({0, 0}, 0, 0, 1)};
    }
}

std::array<Elasticity::Excess, 3> Elasticity::advance(double dt_s,
                                                      std::span<const Shake> shakes) noexcept {
    std::array<Excess, 3> out{};
    if (shakes.size() < 2) {  // at rest
        mass_ = {};
        return out;
    }
    const std::size_t last = shakes.size() - 1;
    const double step_s = dt_s / static_cast<double>(last);
    if (step_s != step_s_) prepare(step_s);
    for (std::size_t j = 0; j < 3; ++j) {
        if (share_[j] == 0) continue;
        const Step& step = step_[j];
        Mass& mass = mass_[j];
        const auto moved = [&](std::array<double, 2>& x, std::size_t i, double Shake::*force) {
            const double begin = shakes[i - 1].*force, end = shakes[i].*force;
            // Half way by a parabola: a straight line would lose some of the vibration.
            const std::size_t near = std::max<std::size_t>(i, 2);
            const double bend =
                shakes[near].*force - 2 * shakes[near - 1].*force + shakes[near - 2].*force;
            const double middle = (begin + end) / 2 - bend / 8;
            const auto& t = step.transition;
            const std::array<double, 2> before = x;
            for (std::size_t r = 0; r < 2; ++r)
                x[r] = t[r][0] * before[0] + t[r][1] * before[1] + step.begin[r] * begin +
                       step.middle[r] * middle + step.end[r] * end;
        };
        Excess& sum = out[j];
        for (std::size_t i = 0; i <= last; ++i) {
            if (i > 0) {
                moved(mass.in_phase, i, &Shake::in_phase);
                moved(mass.quadrature, i, &Shake::quadrature);
            }
            // Simpson's rule.
            const double weight = (i == 0 || i == last ? 1.0
                                   : i % 2 == 1        ? 4.0
                                                       : 2.0) /
                                  (3 * static_cast<double>(last));
            const double p = shakes[i].in_phase, q = shakes[i].quadrature;
            const double p_more = mass.in_phase[0] - p, q_more = mass.quadrature[0] - q;
            sum.pp += weight * p * p_more;
            sum.pq += weight * 0.5 * (p * q_more + q * p_more);
            sum.qq += weight * q * q_more;
        }
    }
    return out;
}

}  // namespace vibrig::plant
