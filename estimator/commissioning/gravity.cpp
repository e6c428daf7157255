#include "estimator/commissioning/gravity.hpp"

#include <algorithm>
#include <cmath>
#include <random>
#include <stdexcept>

#include "estimator/commissioning/gravity_fit.hpp"
#include "estimator/filter/angles.hpp"
#include "estimator/filter/kinematics.hpp"
#include "estimator/filter/text.hpp"

namespace vibrig::estimator::commissioning {

namespace {

constexpr double kKeptUnits = 60;
constexpr std::array<const char*, 3> kAccelerometers{"x", "y", "z"};

double spread(const std::vector<Stop>& stops, std::size_t axis) {
    const auto [low, high] = std::ranges::minmax_element(
        stops, {}, [axis](const Stop& stop) { return stop.force[axis]; });
    return high->force[axis] - low->force[axis];
}

void check_stops(const std::vector<Stop>& stops) {
    if (stops.size() < 8)
        throw std::invalid_argument("commissioning: got " + std::to_string(stops.size()) +
                                    " stops, expected 8 at least");
    std::array<int, 3> sweeps{};
    for (const Stop& stop : stops) {
        for (std::size_t i = 0; i < 3; ++i)
            if (!std::isfinite(stop.reading[i]) || !std::isfinite(stop.force[i]))
                throw std::invalid_argument("commissioning: a reading or a force is not finite");
        if (stop.swept >= 0 && stop.swept < 3) ++sweeps[static_cast<std::size_t>(stop.swept)];
    }
    for (std::size_t i = 0; i < 3; ++i)
        if (sweeps[i] < 3)
            throw std::invalid_argument("commissioning: channel " + std::to_string(i) + " has " +
                                        std::to_string(sweeps[i]) +
                                        " stops of a sweep of its own, expected 3 at least");
}

std::vector<Stop> sweep_of(const std::vector<Stop>& stops, std::size_t channel) {
    std::vector<Stop> sweep;
    for (const Stop& stop : stops)
        if (stop.swept == static_cast<int>(channel)) sweep.push_back(stop);
    return sweep;
}

/// Within its own sweep it moves hardly more than while others are swept.
bool stands_still(const std::vector<Stop>& stops, std::size_t channel) {
    std::array<double, 2> low{HUGE_VAL, HUGE_VAL}, high{-HUGE_VAL, -HUGE_VAL};
    for (const Stop& stop : stops) {
        if (stop.swept < 0) continue;
        const std::size_t own = stop.swept == static_cast<int>(channel) ? 1 : 0;
        low[own] = std::min(low[own], stop.reading[channel]);
        high[own] = std::max(high[own], stop.reading[channel]);
    }
    return high[1] - low[1] <= 10 * (high[0] - low[0]);
}

std::string dead_channel(const std::vector<Stop>& stops, double limit_g) {
    for (std::size_t i = 0; i < 3; ++i) {
        if (spread(stops, i) >= limit_g) continue;
        double mean = 0;
        for (const Stop& stop : stops) mean += stop.force[i] / static_cast<double>(stops.size());
        return text("accelerometer.%s shows %.4f g +- %.4f whatever the attitude",
                    kAccelerometers[i], mean, spread(stops, i) / 2);
    }
    return {};
}

/// Why a description is not to be believed though it fits best; empty: it is.
std::string out_of_bounds(const Description& d, const GravitySettings& s) {
    const Eigen::Matrix3d error =
        d.wiring().transpose() * d.accelerometers - Eigen::Matrix3d::Identity();
    const double gain = error.diagonal().cwiseAbs().maxCoeff();
    Eigen::Matrix3d off = error;
    off.diagonal().setZero();
    const double skew_deg = off.cwiseAbs().maxCoeff() * kDegPerRad;
    const double zero = d.zero_g.cwiseAbs().maxCoeff();
    if (gain > s.gain) return text("gain %.3f off 1, %g at most", gain, s.gain);
    if (skew_deg > s.misalignment_deg)
        return text("accelerometers %.2f deg off the axes, %g at most", skew_deg,
                    s.misalignment_deg);
    if (zero > s.zero_g) return text("zero %.4f g, %g at most", zero, s.zero_g);
    if (std::abs(d.elevation_deg) > s.elevation_deg)
        return text("the outer axis is %.2f deg off level, %g at most: shim the base",
                    d.elevation_deg, s.elevation_deg);
    return {};
}

std::string named(const Hypothesis& h) {
    const auto& c = h.best.channel;
    return text("channels %d %d %d are outer, inner, azimuth, product of the signs %d", c[0] + 1,
                c[1] + 1, c[2] + 1, h.sign_product());
}

void decide(GravityFinding& finding, const GravitySettings& s) {
    if (finding.hypotheses.empty()) {
        finding.verdict = Verdict::refused;
        finding.why = "no description keeps the inner gimbal within 80 deg at every stop";
        return;
    }
    const Hypothesis& best = finding.hypotheses.front();
    if (!(best.rms_g <= s.rms_with_second_g)) {
        finding.verdict = Verdict::refused;
        finding.why = text(
            "no description fits: the best leaves %.1f mg, %.1f at most: gimbals in another order, "
            "not square, or accelerometers askew, two on one axis or in another unit",
            1e3 * best.rms_g, 1e3 * s.rms_with_second_g);
        return;
    }
    if (const auto why = out_of_bounds(best.best, s); !why.empty()) {
        finding.verdict = Verdict::refused;
        finding.why = why;
        return;
    }
    if (finding.hypotheses.size() > 1 && -finding.hypotheses[1].ln_ratio < s.ln_ratio) {
        finding.why =
            "not separated: " + named(best) + "; or " + named(finding.hypotheses[1]) +
            text(" (ln ratio %.1f, %g asked)", -finding.hypotheses[1].ln_ratio, s.ln_ratio);
        return;
    }
    finding.verdict = Verdict::decided;
    if (best.rms_g > s.rms_g) {
        finding.second_person = true;
        finding.why = text("%.1f mg left: gimbals not square, or an encoder eccentric: 12'",
                           1e3 * best.rms_g);
    }
}

}  // namespace

GravityFinding find_by_gravity(const std::vector<Stop>& stops, const GravitySettings& settings) {
    check_stops(stops);
    GravityFinding finding;
    // First: of a gimbal that is stuck an accelerometer may see nothing, and is not dead.
    for (std::size_t channel = 0; channel < 3; ++channel) {
        if (!stands_still(stops, channel)) continue;
        finding.why = text("angle channel %zu does not move: its gimbal is stuck", channel + 1);
        return finding;
    }
    if (auto dead = dead_channel(stops, settings.dead_g); !dead.empty()) {
        finding.verdict = Verdict::refused;
        finding.why = std::move(dead);
        return finding;
    }
    for (std::size_t channel = 0; channel < 3; ++channel) {
        const auto sweep = sweep_of(stops, channel);
        if (std::max({spread(sweep, 0), spread(sweep, 1), spread(sweep, 2)}) < settings.dead_g) {
            finding.verdict = Verdict::refused;
            finding.why = text("gravity does not respond to angle channel %zu: its axis is upright",
                               channel + 1);
            return finding;
        }
        const auto scores = unit_scores(sweep, channel);
        for (std::size_t u = 0; u < scores.size(); ++u)
            if (scores[u] <= kKeptUnits) finding.units[channel].push_back(static_cast<int>(u));
    }
    finding.hypotheses = fit_classes(stops, finding.units, settings);
    decide(finding, settings);
    return finding;
}

Separation separating_position(const Description& a, const Description& b,
                               const std::array<std::array<double, 2>, 3>& limits,
                               std::uint64_t seed) {
    constexpr int kTries = 60;
    std::mt19937_64 random(seed);
    Separation best;
    for (int n = 0; n < kTries; ++n) {
        Vec3 reading{};
        for (std::size_t i = 0; i < 3; ++i)
            reading[i] = limits[i][0] + (limits[i][1] - limits[i][0]) *
                                            std::generate_canonical<double, 53>(random);
        const double by = (a.force(reading) - b.force(reading)).norm();
        if (by > best.by_g) best = {reading, by};
    }
    return best;
}

}  // namespace vibrig::estimator::commissioning
