#include "daemon/papers/reproduce_zha2019_vehicle.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <string>

#include "daemon/results/text_line.hpp"
#include "estimator/filter/angles.hpp"

namespace vibrig::tool::zha2019::drives {

using namespace estimator::levelling;
using estimator::kDegPerHour;
using estimator::kRadPerArcmin;

namespace {

constexpr std::uint64_t kSeeds = 6;

double deviation(const SimulatedStart& run, std::size_t channel) {
    double sum = 0, squares = 0;
    const auto n = static_cast<double>(run.trace.size());
    for (const TracePoint& point : run.trace) {
        sum += point.tilt[channel] / n;
        squares += point.tilt[channel] * point.tilt[channel] / n;
    }
    return std::sqrt(std::max(0.0, squares - sum * sum)) / kRadPerArcmin;
}

/// East and north, arcmin.
using Deviations = std::array<double, 2>;

std::array<Deviations, kSeeds> six_drives(const Way& way, const Gains& gains) {
    std::array<Deviations, kSeeds> found{};
    for (std::size_t k = 0; k < kSeeds; ++k) {
        const SimulatedStart run = simulate(drive(way, gains, k + 1));
        for (std::size_t i = 0; i < 2; ++i) found[k][i] = deviation(run, i);
    }
    return found;
}

Deviations mean_of(const std::array<Deviations, kSeeds>& drives) {
    Deviations mean{};
    for (const Deviations& one : drives) {
        for (std::size_t i = 0; i < 2; ++i) mean[i] += one[i] / double{kSeeds};
    }
    return mean;
}

/// A line of Table 1 or 2: without network, conventional, fast.
void add_line(Reproduction& table, const std::string& item, const char* published,
              const std::array<double, 3>& found) {
    table.add(item, published, printed("%.3f' %.3f' %.4f'", found[0], found[1], found[2]), {}, "",
              {{"none", found[0]}, {"conventional", found[1]}, {"fast", found[2]}});
}

void add_tables(Reproduction& table) {
    std::array<std::array<Deviations, kSeeds>, kWays.size()> found;
    std::transform(kWays.begin(), kWays.end(), found.begin(),
                   [](const Way& way) { return six_drives(way, kPrinted); });
    constexpr std::array kPublished{"2.872 1.394 0.1105", "1.551 1.490 0.1060"};
    constexpr std::array kNames{"Table 1, east", "Table 2, north"};
    for (std::size_t i = 0; i < 2; ++i) {
        for (std::size_t k = 0; k < kSeeds; ++k) {
            add_line(table, printed("%s, drive %zu of 6", kNames[i], k + 1), "-",
                     {found[0][k][i], found[1][k][i], found[2][k][i]});
        }
        add_line(table, printed("%s, means of six", kNames[i]), kPublished[i],
                 {mean_of(found[0])[i], mean_of(found[1])[i], mean_of(found[2])[i]});
    }
}

}  // namespace

Scenario start(const Way& way, const Gains& gains, double tilt_arcmin, double duration_s) {
    Scenario scenario;
    scenario.network = way.network;
    scenario.internal = way.internal;
    scenario.loop.fast = gains;
    scenario.loop.settling_s = 600;
    scenario.loop.period_s = 1;
    scenario.tilt = {tilt_arcmin * kRadPerArcmin, tilt_arcmin * kRadPerArcmin};
    scenario.duration_s = duration_s;
    return scenario;
}

Scenario drive(const Way& way, const Gains& gains, std::uint64_t seed) {
    constexpr double kManoeuvre = 20, kFastest = 15;
    Scenario scenario = start(way, gains, 2.6, kDrive_s);
    scenario.loop.noise.reference_mps = 0.2;
    scenario.drift = {0.01 * kDegPerHour, -0.01 * kDegPerHour};
    scenario.seed = seed;
    std::mt19937_64 random(1000 + seed);
    std::uniform_real_distribution<double> pause(300, 900), wanted(-kFastest, kFastest);
    Pair velocity{};
    for (double t = pause(random); t + kManoeuvre < kDrive_s; t += kManoeuvre + pause(random)) {
        Manoeuvre m{t, t + kManoeuvre, {}};
        for (std::size_t i = 0; i < 2; ++i) {
            const double next = wanted(random);
            m.acceleration_mps2[i] = (next - velocity[i]) / kManoeuvre;
            velocity[i] = next;
        }
        scenario.motion.push_back(m);
    }
    return scenario;
}

void add_vehicle(Reproduction& table) {
    add_tables(table);
    const auto designed = mean_of(six_drives(kWays[2], gains_of(0.0088, 0.7)));
    table.add("means of the six drives, fast network, gains by eqs. 11-14", "-",
              printed("east %.4f', north %.4f'", designed[0], designed[1]), {}, {},
              {{"east", designed[0]}, {"north", designed[1]}});
    const auto internal = mean_of(six_drives({"", Network::bare, true}, kPrinted));
    table.add("the same without a reference (internal damping, eq. 1)", "-",
              printed("east %.1f', north %.1f'", internal[0], internal[1]), {}, {},
              {{"east", internal[0]}, {"north", internal[1]}});
    Scenario still = start(kWays[2], {kPrinted.k1, kPrinted.k2, 0}, 0, 2 * 3600);
    still.drift = {0.1 * kDegPerHour, 0};
    const double tilt = simulate(still).trace.back().tilt[0] / kRadPerArcmin;
    const double theory = steady_tilt(still.loop.fast, still.drift[0], 0) / kRadPerArcmin;
    table.add("K3 = 0: tilt that a drift of 0.1 deg/h leaves (eq. 8)", "-", printed("%.4f'", tilt),
              std::abs(tilt - theory) <= 1e-3 * std::abs(theory), printed("%.4f'", theory),
              {{"computed", tilt}, {"theory", theory}});
}

}  // namespace vibrig::tool::zha2019::drives
