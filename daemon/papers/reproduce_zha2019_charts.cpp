#include <cmath>
#include <complex>
#include <numbers>
#include <string>

#include "daemon/papers/reproduce_zha2019_vehicle.hpp"
#include "estimator/filter/angles.hpp"

namespace vibrig::tool::zha2019::drives {

using namespace estimator::levelling;
using estimator::kDegPerHour;
using estimator::kRadPerArcmin;

namespace {

constexpr double kStart_s = 1.5 * 3600;
constexpr Way kFast = kWays[2];

plot::Chart tilt_chart(const std::string& title, std::string note = {}) {
    plot::Chart chart{title, plot::Axis("time [min]"), plot::Axis("tilt [arcmin]")};
    if (!note.empty()) chart.notes.push_back(std::move(note));
    return chart;
}

/// East, every `step_s`.
void add_tilt(plot::Chart& chart, const std::string& name, const Scenario& scenario,
              double step_s) {
    plot::Curve curve{name};
    double next = 0;
    for (const TracePoint& point : simulate(scenario).trace) {
        if (point.time_s < next) continue;
        next += step_s;
        curve.add(point.time_s / 60, point.tilt[0] / kRadPerArcmin);
    }
    chart.curves.push_back(std::move(curve));
}

/// Eq. 3 over frequency: tilt for an error of the reference velocity.
plot::Chart networks_chart(const Gains& designed) {
    using Complex = std::complex<double>;
    plot::Chart chart{"Tilt for an error of the reference velocity (eq. 3)",
                      plot::Axis("period [s]", true), plot::Axis("tilt [arcmin per m/s]", true)};
    chart.notes.emplace_back("Without a network (H = 1) the reference has no part in it.");
    const Earth earth;
    const auto add = [&](const char* name, const auto& network) {
        plot::Curve curve{name};
        for (double period = 10; period < 1e5; period *= 1.05) {
            const Complex s(0, 2 * std::numbers::pi / period);
            const Complex h = network(s);
            const Complex tilt =
                (1.0 - h) * s / (earth.radius_m * (s * s + h * earth.schuler_squared()));
            curve.add(period, std::abs(tilt) / kRadPerArcmin);
        }
        chart.curves.push_back(std::move(curve));
    };
    const auto fast = [](const Gains& g) {
        return [g](Complex s) { return ((1 + g.k2) * s + g.k3) / (s + g.k1); };
    };
    add("conventional network",
        [](Complex s) { return (s + 8.5e-4) * (s + 9.412e-2) / ((s + 8.0e-3) * (s + 1.0e-2)); });
    add("fast network", fast(designed));
    add("fast, gains as printed", fast(kPrinted));
    return chart;
}

plot::Chart starts_chart(const Gains& designed) {
    plot::Chart chart = tilt_chart("A start from 10 arcmin");
    add_tilt(chart, kWays[1].name, start(kWays[1], designed, 10, kStart_s), 5);
    add_tilt(chart, kFast.name, start(kFast, designed, 10, kStart_s), 5);
    add_tilt(chart, "fast, gains as printed", start(kFast, kPrinted, 10, kStart_s), 5);
    return chart;
}

plot::Chart drift_chart() {
    plot::Chart chart = tilt_chart("Gyro drift of 0.1 deg/h (eqs. 8 and 9), gains as printed",
                                   "With K3 the drift is taken up, without it a tilt is left.");
    for (const auto& [name, k3] : {std::pair{"K3 = 0", 0.0}, std::pair{"K3 > 0", kPrinted.k3}}) {
        Scenario scenario = start(kFast, {kPrinted.k1, kPrinted.k2, k3}, 0, kStart_s);
        scenario.drift = {0.1 * kDegPerHour, 0};
        add_tilt(chart, name, scenario, 5);
    }
    return chart;
}

plot::Chart schedule_chart(const Gains& designed) {
    plot::Chart chart = tilt_chart("A start from 10 arcmin, reference 0.2 m/s noisy at 1 Hz",
                                   "Seed 1. Slower gains: after the loop has settled, in 1 min.");
    Scenario scenario = start({"", Network::fast}, designed, 10, kStart_s);
    scenario.loop.noise.reference_mps = 0.2;
    add_tilt(chart, "fast gains", scenario, 5);
    scenario.loop.slow = Gains{7.68e-3, 6.68, 7.68e-3};
    add_tilt(chart, "then slower ones", scenario, 5);
    return chart;
}

plot::Chart hours_chart(double noise_mps) {
    plot::Chart chart =
        noise_mps > 0
            ? tilt_chart("Four hours from 1.9 arcmin, reference 0.5 m/s wrong, 0.2 m/s noisy",
                         "Gains as printed, seed 1.")
            : tilt_chart("Four hours from 2.6 arcmin, gains as printed");
    for (const Way& way : kWays) {
        Scenario scenario = start(way, kPrinted, noise_mps > 0 ? 1.9 : 2.6, kDrive_s);
        scenario.loop.noise.reference_mps = noise_mps;
        if (noise_mps > 0) scenario.reference_error = {0.5, 0};
        add_tilt(chart, way.name, scenario, 20);
    }
    return chart;
}

plot::Chart drive_chart(bool internal) {
    plot::Chart chart = internal ? tilt_chart("The same drive without a reference velocity (eq. 1)",
                                              "Internal damping, the subject of Figure 2.")
                                 : tilt_chart("A drive: external damping, gains as printed");
    for (const Way& way : kWays) {
        if (internal && way.network == Network::undamped) continue;
        add_tilt(chart, way.name, drive({way.name, way.network, internal}, kPrinted, 1), 20);
    }
    return chart;
}

plot::Chart velocity_chart() {
    plot::Chart chart{"The drive (seed 1)", plot::Axis("time [min]"), plot::Axis("velocity [m/s]")};
    const Scenario scenario = drive(kFast, kPrinted, 1);
    for (std::size_t i = 0; i < 2; ++i) {
        plot::Curve curve{i == 0 ? "east" : "north"};
        double velocity = 0;
        for (double t = 0; t < kDrive_s; t += 1) {
            for (const Manoeuvre& m : scenario.motion)
                velocity += t >= m.from_s && t < m.until_s ? m.acceleration_mps2[i] : 0;
            curve.add(t / 60, velocity);
        }
        chart.curves.push_back(std::move(curve));
    }
    return chart;
}

}  // namespace

void add_charts(Reproduction& table) {
    const Gains designed = gains_of(0.0088, 0.7);
    table.charts = {{"networks", networks_chart(designed)},
                    {"start", starts_chart(designed)},
                    {"drift", drift_chart()},
                    {"schedule", schedule_chart(designed)},
                    {"four-hours", hours_chart(0)},
                    {"noisy-reference", hours_chart(0.2)},
                    {"drive", drive_chart(false)},
                    {"internal", drive_chart(true)},
                    {"velocity", velocity_chart()}};
}

}  // namespace vibrig::tool::zha2019::drives
