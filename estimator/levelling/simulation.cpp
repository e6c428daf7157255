#include "estimator/levelling/simulation.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <random>

namespace vibrig::estimator::levelling {

namespace {

Pair acceleration_at(const Scenario& scenario, double time_s) noexcept {
    Pair sum{};
    for (const Manoeuvre& m : scenario.motion) {
        if (time_s < m.from_s || time_s >= m.until_s) continue;
        for (std::size_t i = 0; i < 2; ++i) sum[i] += m.acceleration_mps2[i];
    }
    return sum;
}

}  // namespace

double SimulatedStart::last_above(double fraction) const noexcept {
    if (trace.empty()) {
        return 0;
    }
    const double limit = fraction * std::abs(trace.front().tilt[0]);
    for (std::size_t i = trace.size(); i-- > 0;) {
        if (std::abs(trace[i].tilt[0]) > limit) {
            return trace[i].time_s;
        }
    }
    return 0;
}

double SimulatedStart::tilt_deviation() const noexcept {
    double sum = 0;
    double squares = 0;
    for (const TracePoint& point : trace) {
        sum += point.tilt[0];
        squares += point.tilt[0] * point.tilt[0];
    }
    const double n = static_cast<double>(trace.size());
    return std::sqrt(std::max(0.0, squares / n - sum * sum / (n * n)));
}

SimulatedStart simulate(const Scenario& scenario) {
    const LevellerSettings& loop = scenario.loop;
    const double t = loop.period_s;
    std::mt19937_64 generator(scenario.seed);
    std::normal_distribution<double> normal;
    std::optional<Leveller> leveller;
    if (scenario.network != Network::bare) leveller.emplace(loop);
    std::array<ConventionalNetwork, 2> conventional{ConventionalNetwork(loop.earth),
                                                    ConventionalNetwork(loop.earth)};
    std::array<FastNetwork, 2> plain{FastNetwork(loop.earth), FastNetwork(loop.earth)};
    SimulatedStart result;
    Pair tilt = scenario.tilt;
    Pair velocity{};
    const auto steps = static_cast<std::size_t>(std::llround(scenario.duration_s / t));
    if (!scenario.until_settled) {
        result.trace.reserve(steps);
    }
    bool tipped = false;
    for (std::size_t k = 0; k < steps; ++k) {
        const double now = static_cast<double>(k) * t;
        if (scenario.step_s >= 0 && now >= scenario.step_s && !tipped) {
            tipped = true;
            for (std::size_t i = 0; i < 2; ++i) tilt[i] += scenario.step[i];
        }
        LevelInput input;
        const Pair acceleration = acceleration_at(scenario, now);
        for (std::size_t i = 0; i < 2; ++i) {
            // The reference is read at the end of the interval whose specific force comes with it.
            velocity[i] += t * acceleration[i];
            input.force[i] = acceleration[i] + loop.earth.gravity_mps2 * tilt[i] +
                             scenario.zero[i] + loop.noise.accelerometer_mps2 * normal(generator);
            const double error =
                (now >= scenario.reference_error_s ? scenario.reference_error[i] : 0) +
                loop.noise.reference_mps * normal(generator);
            input.reference[i] = scenario.internal ? 0 : velocity[i] + error;
        }
        for (std::size_t i = 0; k == 0 && i < 2; ++i) {
            conventional[i].start(input.reference[i] + scenario.start_velocity[i]);
            plain[i].start(input.reference[i] + scenario.start_velocity[i]);
        }
        Pair rate{};
        if (scenario.network == Network::fast) {
            rate = leveller->step(input).rate;
        } else {
            for (std::size_t i = 0; i < 2; ++i) {
                const Gains gains = scenario.network == Network::bare ? loop.fast : Gains{};
                rate[i] = scenario.network == Network::conventional
                              ? conventional[i].step(input.force[i], input.reference[i], t)
                              : plain[i].step(input.force[i], input.reference[i], gains, t);
            }
        }
        if (!scenario.until_settled) {
            result.trace.push_back({now, tilt, rate});
        }
        if (leveller && leveller->settled_s() && result.settled_s < 0) {
            result.settled_s = *leveller->settled_s();
            result.tilt_when_settled = tilt;
            if (scenario.until_settled) {
                break;
            }
        }
        for (std::size_t i = 0; i < 2; ++i) {
            // The vertical of the carrier's place turns with its way.
            tilt[i] += t * (scenario.drift[i] - rate[i] + velocity[i] / loop.earth.radius_m) +
                       loop.noise.gyro_random_walk * std::sqrt(t) * normal(generator);
        }
    }
    if (!leveller) return result;
    result.verdict = leveller->verdict();
    result.drift = leveller->drift();
    result.observables = leveller->observables();
    result.message = leveller->message();
    return result;
}

std::optional<double> declared_within_s(const LevellerSettings& loop, double tilt, double drift) {
    constexpr double kMargin = 3;  // of the four standard deviations that the bands have at least
    const Leveller leveller(loop);
    if (leveller.verdict() == Verdict::cannot_settle) return std::nullopt;
    Scenario start;
    start.loop = loop;
    start.loop.noise = {};
    start.loop.tolerance_rad =
        std::min(leveller.tolerance() - kMargin * leveller.force_noise(),
                 leveller.rate_tolerance() - kMargin * leveller.rate_noise());
    // The loop is linear: what is smaller, of either sign, stays within these two.
    start.tilt = {tilt, tilt};
    start.drift = {drift, -drift};
    start.duration_s = kPatience * loop.settling_s;
    start.until_settled = true;
    const SimulatedStart run = simulate(start);
    const double declared =
        std::max(run.settled_s, loop.settling_s + loop.window_s + 1 / leveller.sigma());
    if (run.verdict != Verdict::settled || 1.05 * declared > start.duration_s) return std::nullopt;
    return declared;
}

}  // namespace vibrig::estimator::levelling
