#include <array>
#include <cmath>

#include "daemon/papers/reproduce.hpp"
#include "daemon/papers/reproduce_zha2019_vehicle.hpp"
#include "daemon/results/progress.hpp"
#include "daemon/results/text_line.hpp"
#include "estimator/filter/angles.hpp"
#include "estimator/levelling/simulation.hpp"

namespace vibrig::tool::zha2019 {

namespace {

using namespace estimator::levelling;
using estimator::kDegPerHour;
using estimator::kRadPerArcmin;

constexpr double kSigma = 0.0088;
constexpr double kDamping = 0.7;
using drives::kPrinted;
constexpr double kHour = 3600;

SimulatedStart start(Network network, const Gains& gains, double tilt_arcmin, double duration_s,
                     double period_s = 0.1) {
    Scenario scenario;
    scenario.network = network;
    scenario.loop.fast = gains;
    scenario.loop.settling_s = 600;
    scenario.loop.period_s = period_s;
    scenario.tilt = {tilt_arcmin * kRadPerArcmin, 0};
    scenario.duration_s = duration_s;
    return simulate(scenario);
}

double tilt_at(const SimulatedStart& run, double time_s) {
    std::size_t k = 0;
    while (k + 1 < run.trace.size() && run.trace[k].time_s < time_s) ++k;
    return std::abs(run.trace[k].tilt[0] / run.trace[0].tilt[0]);
}

bool near(double value, double expected, double relative) {
    return std::abs(value - expected) <= relative * std::abs(expected);
}

void add_gains(Reproduction& table) {
    const Gains gains = gains_of(kSigma, kDamping);
    table.add("K1", "0.0264", printed("%.4f", gains.k1), printed("%.4f", gains.k1) == "0.0264");
    table.add("K2", "156.063", printed("%.2f (erratum)", gains.k2));
    table.add("K3", "0.904", printed("%.4f", gains.k3), near(gains.k3, 0.904, 1e-3));
    const auto placed = roots(gains);
    const auto in_print = roots(kPrinted);
    const auto words = [](const std::array<std::complex<double>, 3>& r) {
        const double damping = -r[1].real() / std::abs(r[1]);
        return printed("%.5f, %.5f +- %.5fj (xi %.2f)", r[0].real(), r[1].real(),
                       std::abs(r[1].imag()), damping);
    };
    table.add("roots, gains by eqs. 11-14", "-0.0088, -0.0088 +- 0.0090j", words(placed),
              near(placed[0].real(), -kSigma, 1e-3) && near(placed[1].real(), -kSigma, 1e-3) &&
                  near(std::abs(placed[1].imag()), 0.0090, 5e-3));
    table.add("roots, gains as printed", "-0.0088, -0.0088 +- 0.0090j", words(in_print));
}

void add_settling(Reproduction& table) {
    const double x = settling_product(0.005, kDamping);
    table.add("sigma t for 10 min (in print its decimal point is lost)", "525",
              printed("%.2f, sigma %.5f", x, x / 600), printed("%.0f", 100 * x) == "525");
    const double fall = 100 * (1 - std::abs(initial_response(5.25, kDamping)));
    table.add(
        "fall of the tilt at sigma t = 5.25", "99.995 %",
        printed("%.2f %%; 99.995 %% needs sigma t = %.2f", fall, settling_product(5e-5, kDamping)));
    const Gains designed = gains_of(kSigma, kDamping);
    // Steps of 0.1 s delay the loop by more than the last digit shows.
    constexpr double kFine_s = 0.005;
    const SimulatedStart by_design = start(Network::fast, designed, 10, kHour, kFine_s);
    const SimulatedStart as_printed = start(Network::fast, kPrinted, 10, kHour, kFine_s);
    const SimulatedStart before = start(Network::conventional, designed, 10, 4 * kHour);
    table.add("residual at 600 s, designed / printed gains", "-",
              printed("%.2f %% / %.1f %%", 100 * tilt_at(by_design, 600),
                      100 * tilt_at(as_printed, 600)));
    const double within = by_design.last_above(0.005);
    table.add("time to 0.5 %, designed gains", "10 min", printed("%.0f s", within),
              near(within, 600, 0.02));
    table.add("time to 0.5 %, printed gains", "10 min",
              printed("%.0f s", as_printed.last_above(0.005)));
    const double hour = before.last_above(0.02);
    table.add("time to 2 %, conventional network", "about 1 h", printed("%.0f s", hour),
              std::round(hour / kHour) == 1);
    Scenario schedule;
    schedule.loop.fast = designed;
    schedule.loop.slow = Gains{7.68e-3, 6.68, 7.68e-3};
    schedule.loop.settling_s = 600;
    schedule.loop.period_s = 1;
    schedule.tilt = {10 * kRadPerArcmin, 0};
    schedule.duration_s = 4 * kHour;
    table.add("time to 2 %, hold until settled, then ramp to slow gains", "-",
              printed("%.0f s", simulate(schedule).last_above(0.02)));
}

/// The three figures of the four hours, gains as printed, where the loop's velocity is not the
/// reference's at first, and a gyro drifts: two numbers that the paper does not give, three that it
/// does.
void add_other_start(Reproduction& table) {
    constexpr double kVelocity_mps = 0.81, kDrift_deg_h = 0.057;
    constexpr std::array kPublished{1.8490, 0.4251, 0.2077};
    std::array<double, 3> found{};
    bool agree = true;
    for (std::size_t k = 0; k < found.size(); ++k) {
        Scenario scenario = drives::start(drives::kWays[k], kPrinted, 2.6, 4 * kHour);
        scenario.start_velocity = {kVelocity_mps, 0};
        scenario.drift = {kDrift_deg_h * kDegPerHour, 0};
        found[k] = simulate(scenario).tilt_deviation() / kRadPerArcmin;
        agree = agree && near(found[k], kPublished[k], 0.01);
    }
    table.add(printed("the three of 2.6', printed gains, started %g m/s too fast, drift %g deg/h",
                      kVelocity_mps, kDrift_deg_h),
              "1.8490', 0.4251', 0.2077'",
              printed("%.4f', %.4f', %.4f'", found[0], found[1], found[2]), agree, {},
              {{"none", found[0]}, {"conventional", found[1]}, {"fast", found[2]}});
}

void add_four_hours(Reproduction& table) {
    const auto deviation = [](Network network, const Gains& gains) {
        return start(network, gains, 2.6, 4 * kHour).tilt_deviation() / kRadPerArcmin;
    };
    const Gains designed = gains_of(kSigma, kDamping);
    const double none = deviation(Network::undamped, designed);
    const double conventional = deviation(Network::conventional, designed);
    const double in_print = deviation(Network::fast, kPrinted);
    const double fast = deviation(Network::fast, designed);
    // Of the start only 2.6' is known, to two digits: 2 % of every deviation; as much again for the
    // sampling, which is not known at all.
    constexpr double kStart = 0.04;
    table.add("4 h from 2.6', standard deviation, no network", "1.8490'", printed("%.4f'", none),
              near(none, 1.8490, kStart));
    table.add("the same, conventional network", "0.4251'", printed("%.4f'", conventional));
    table.add("the same, fast network, gains as printed", "0.2077'", printed("%.4f'", in_print),
              near(in_print, 0.2077, kStart));
    table.add("the same, fast network, gains by eqs. 11-14", "-", printed("%.4f'", fast));
    table.add("reduction against no network, printed gains", "88.7 %",
              printed("%.1f %%", 100 * (1 - in_print / none)),
              near(in_print / none, 1 - 0.887, 2 * kStart));
    table.add("reduction against the conventional network, printed gains", "51.1 %",
              printed("%.1f %%", 100 * (1 - in_print / conventional)));
    add_other_start(table);
}

/// Reductions in percent by the fast network with the printed gains, against no network and against
/// the conventional one, as means over seeds from 1.
std::array<double, 2> reductions(double tilt_arcmin, bool step, std::size_t seeds) {
    constexpr std::array kNetworks{Network::undamped, Network::conventional, Network::fast};
    std::array<double, 3> sum{};
    for (std::size_t n = 0; n < kNetworks.size(); ++n) {
        for (std::size_t seed = 1; seed <= seeds; ++seed) {
            Scenario scenario;
            scenario.network = kNetworks[n];
            scenario.loop.fast = kPrinted;
            scenario.loop.settling_s = 600;
            scenario.loop.period_s = 1;
            scenario.loop.noise.reference_mps = 0.2;
            scenario.reference_error = {0.5, 0};
            scenario.reference_error_s = step ? 1 : 0;
            scenario.tilt = {tilt_arcmin * kRadPerArcmin, 0};
            scenario.duration_s = 4 * kHour;
            scenario.seed = seed;
            sum[n] += simulate(scenario).tilt_deviation();
        }
    }
    return {100 * (1 - sum[2] / sum[0]), 100 * (1 - sum[2] / sum[1])};
}

void add_noisy_reference(Reproduction& table, std::size_t seeds) {
    Progress progress("reproducing zha2019");
    constexpr std::array kTilts{1.9, 3.0, 1.0};
    for (std::size_t i = 0; i < kTilts.size(); ++i) {
        for (const bool step : {false, true}) {
            progress.show(2 * i + (step ? 1 : 0), 2 * kTilts.size());
            const auto found = reductions(kTilts[i], step, seeds);
            ReproducedRow row;
            row.item =
                step ? printed("the same from %g', wrong by a step after the start", kTilts[i])
                     : printed("reductions, reference 0.5 m/s wrong, noise 0.2 m/s, from %g'",
                               kTilts[i]);
            row.published = "86 %, 48.9 %";
            row.computed = printed("%.1f %%, %.1f %%", found[0], found[1]);
            // One tilt that is not given, two figures: it was chosen for the first.
            if (i == 0 && !step) {
                row.agrees = std::abs(found[0] - 86) < 1.5 && std::abs(found[1] - 48.9) < 3;
            }
            table.rows.push_back(row);
        }
    }
}

}  // namespace

}  // namespace vibrig::tool::zha2019

namespace vibrig::tool {

Reproduction reproduce_zha2019(const ReproduceOptions& options) {
    using namespace zha2019;
    Reproduction table{"zha2019", "fast damping with an external velocity reference"};
    add_gains(table);
    add_settling(table);
    add_four_hours(table);
    add_noisy_reference(table, options.seeds > 0 ? options.seeds : 10);
    drives::add_vehicle(table);
    if (!options.plot.empty()) drives::add_charts(table);
    table.notes.push_back(printed(
        "K2: the printed %g does not follow from eqs. 11-14; 1 + K2 is low by the factor %.3f, "
        "and with it the roots are not where eq. 10 puts them",
        kPrinted.k2, (1 + kPrinted.k2) / (1 + gains_of(kSigma, kDamping).k2)));
    table.notes.emplace_back(
        "from 2.6' at rest the conventional network leaves 12 % more than the paper's 0.4251'. "
        "What "
        "the paper does not give explains it: a loop that starts 0.81 m/s faster than the "
        "reference, gyros that drift 0.057 deg/h. These two were chosen for its three figures, "
        "which come out within 1 %; neither of them alone does that, nor other times of the "
        "statistics");
    table.notes.emplace_back(
        "Tables 1 and 2: the data of the six runs in a vehicle are not published, nor is what it "
        "drove. Computed are six simulated drives of 4 h (seeds 1 to 6): from 2.6', every 5 to 15 "
        "min up to 15 m/s faster or slower within 20 s, reference 0.2 m/s noisy at 1 Hz, drift "
        "0.01 deg/h; standard deviations without network, conventional, fast (gains as printed). "
        "They are not compared");
    table.notes.emplace_back(
        "noisy reference: means over the seeds from 1, 10 unless --seeds says otherwise; the "
        "initial tilt is not given; about 1.9' gives both published figures "
        "at "
        "once. By eq. 3 a constant error of the reference acts only through its derivative, and a "
        "loop that begins at the reference does not see it (88 %, 53 % from 3'): right for a "
        "constant error. One that begins at zero sees a step of 0.5 m/s that tilts it (84 %, 42 % "
        "from 3')");
    return table;
}

}  // namespace vibrig::tool
