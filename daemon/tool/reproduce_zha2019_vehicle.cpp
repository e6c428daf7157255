#include "daemon/tool/reproduce_zha2019_vehicle.hpp"

#include <array>
#include <cmath>
#include <random>

#include "daemon/tool/reproduce_text.hpp"
#include "estimator/levelling/simulation.hpp"

namespace vibrig::tool::zha2019::drives {

namespace {

using namespace estimator::levelling;

constexpr double kHour = 3600;
constexpr double kDrive = 4 * kHour;
constexpr std::uint64_t kSeeds = 6;
constexpr Gains kPrinted{0.0264, 156.063, 0.904};

struct Way {
    const char* name;
    Network network;
    bool internal;
};
constexpr std::array<Way, 3> kWays{{{"no network", Network::undamped, false},
                                    {"conventional network", Network::conventional, false},
                                    {"fast network", Network::bare, false}}};

Scenario start(const Way& way, const Gains& gains, double tilt_arcmin, double duration_s) {
    Scenario scenario;
    scenario.network = way.network;
    scenario.internal = way.internal;
    scenario.loop.fast = gains;
    scenario.loop.settling_s = 600;
    scenario.loop.period_s = 1;
    scenario.tilt = {tilt_arcmin * kArcmin, tilt_arcmin * kArcmin};
    scenario.duration_s = duration_s;
    return scenario;
}

/// A drive: every 5 to 15 minutes the vehicle starts, turns or stops, within 20 s by up to 15 m/s
/// in each direction. The reference is 0.2 m/s noisy at 1 Hz; gyros drift 0.01 deg/h.
Scenario drive(const Way& way, const Gains& gains, std::uint64_t seed) {
    constexpr double kManoeuvre = 20, kFastest = 15;
    Scenario scenario = start(way, gains, 2.6, kDrive);
    scenario.loop.noise.reference_mps = 0.2;
    scenario.drift = {0.01 * kDegPerHour, -0.01 * kDegPerHour};
    scenario.seed = seed;
    std::mt19937_64 random(1000 + seed);
    std::uniform_real_distribution<double> pause(300, 900), wanted(-kFastest, kFastest);
    Pair velocity{};
    for (double t = pause(random); t + kManoeuvre < kDrive; t += kManoeuvre + pause(random)) {
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

double deviation(const SimulatedStart& run, std::size_t channel) {
    double sum = 0, squares = 0;
    const auto n = static_cast<double>(run.trace.size());
    for (const TracePoint& point : run.trace) {
        sum += point.tilt[channel] / n;
        squares += point.tilt[channel] * point.tilt[channel] / n;
    }
    return std::sqrt(std::max(0.0, squares - sum * sum)) / kArcmin;
}

/// Mean deviations of six drives, arcmin, east and north.
std::array<double, 2> six_drives(const Way& way, const Gains& gains) {
    std::array<double, 2> mean{};
    for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
        const SimulatedStart run = simulate(drive(way, gains, seed));
        for (std::size_t i = 0; i < 2; ++i) mean[i] += deviation(run, i) / double{kSeeds};
    }
    return mean;
}

plot::Curve tilt_curve(const std::string& name, const Scenario& scenario, double step_s) {
    plot::Curve curve{name, {}, {}, {}, {}, plot::Look::line};
    double next = 0;
    for (const TracePoint& point : simulate(scenario).trace) {
        if (point.time_s < next) continue;
        next += step_s;
        curve.x.push_back(point.time_s / 60);
        curve.y.push_back(point.tilt[0] / kArcmin);
    }
    return curve;
}

plot::Chart tilt_chart(const std::string& title) {
    plot::Chart chart;
    chart.title = title;
    chart.x = plot::Axis("time [min]");
    chart.y = plot::Axis("tilt [arcmin]");
    return chart;
}

plot::Curve velocity_curve(const Scenario& scenario) {
    plot::Curve curve{"east", {}, {}, {}, {}, plot::Look::line};
    double velocity = 0;
    for (double t = 0; t < kDrive; t += 1) {
        for (const Manoeuvre& m : scenario.motion)
            velocity += t >= m.from_s && t < m.until_s ? m.acceleration_mps2[0] : 0;
        curve.x.push_back(t / 60);
        curve.y.push_back(velocity);
    }
    return curve;
}

}  // namespace

void add_vehicle(Reproduction& table) {
    std::array<std::array<double, 2>, kWays.size()> found{};
    for (std::size_t k = 0; k < kWays.size(); ++k) found[k] = six_drives(kWays[k], kPrinted);
    constexpr std::array kPublished{"2.872 1.394 0.1105", "1.551 1.490 0.1060"};
    constexpr std::array kNames{"Table 1, means of six runs, east",
                                "Table 2, means of six runs, north"};
    for (std::size_t i = 0; i < 2; ++i) {
        table.rows.push_back(
            {kNames[i],
             kPublished[i],
             formatted("six simulated drives: %.3f' %.3f' %.4f'", found[0][i], found[1][i],
                       found[2][i]),
             {},
             {{"none", found[0][i]}, {"conventional", found[1][i]}, {"fast", found[2][i]}}});
    }
    const auto designed = six_drives(kWays[2], gains_of(0.0088, 0.7));
    table.rows.push_back({"the same, fast network, gains by eqs. 11-14",
                          "-",
                          formatted("east %.4f', north %.4f'", designed[0], designed[1]),
                          {},
                          {{"east", designed[0]}, {"north", designed[1]}}});
    const auto internal = six_drives({"", Network::bare, true}, kPrinted);
    table.rows.push_back({"the same without a reference (internal damping, eq. 1)",
                          "-",
                          formatted("east %.1f', north %.1f'", internal[0], internal[1]),
                          {},
                          {{"east", internal[0]}, {"north", internal[1]}}});
    Scenario still = start(kWays[2], {kPrinted.k1, kPrinted.k2, 0}, 0, 2 * kHour);
    still.drift = {0.1 * kDegPerHour, 0};
    const double tilt = simulate(still).trace.back().tilt[0] / kArcmin;
    const double theory = steady_tilt(still.loop.fast, still.drift[0], 0) / kArcmin;
    table.rows.push_back({"K3 = 0: tilt that a drift of 0.1 deg/h leaves (eq. 8)",
                          "-",
                          formatted("%.4f'", tilt),
                          std::abs(tilt - theory) <= 1e-3 * std::abs(theory),
                          {{"computed", tilt}, {"theory", theory}},
                          formatted("%.4f'", theory)});
}

void add_charts(Reproduction& table) {
    const Gains designed = gains_of(0.0088, 0.7);
    plot::Chart starts = tilt_chart("A start from 10 arcmin");
    plot::Chart hours = tilt_chart("Four hours from 2.6 arcmin, gains as printed");
    plot::Chart under_way = tilt_chart("A drive: external damping, gains as printed");
    for (const Way& way : kWays) {
        if (way.network != Network::undamped)
            starts.curves.push_back(tilt_curve(way.name, start(way, designed, 10, 1.5 * kHour), 5));
        hours.curves.push_back(tilt_curve(way.name, start(way, kPrinted, 2.6, kDrive), 20));
        under_way.curves.push_back(tilt_curve(way.name, drive(way, kPrinted, 1), 20));
    }
    starts.curves.push_back(
        tilt_curve("fast, gains as printed", start(kWays[2], kPrinted, 10, 1.5 * kHour), 5));
    plot::Chart internal = tilt_chart("The same drive without a reference velocity");
    internal.curves.push_back(tilt_curve(
        "conventional network", drive({"", Network::conventional, true}, kPrinted, 1), 20));
    internal.curves.push_back(
        tilt_curve("fast network", drive({"", Network::bare, true}, kPrinted, 1), 20));
    plot::Chart velocity;
    velocity.title = "The drive";
    velocity.x = plot::Axis("time [min]");
    velocity.y = plot::Axis("velocity east [m/s]");
    velocity.curves.push_back(velocity_curve(drive(kWays[0], kPrinted, 1)));
    table.charts = {{"start", starts},
                    {"four-hours", hours},
                    {"drive", under_way},
                    {"internal", internal},
                    {"velocity", velocity}};
}

}  // namespace vibrig::tool::zha2019::drives
