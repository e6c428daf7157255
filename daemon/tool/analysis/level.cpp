#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <CLI/Validators.hpp>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <random>
#include <stdexcept>
#include <vector>

#include "daemon/plot/chart.hpp"
#include "daemon/results/exit_status.hpp"
#include "daemon/results/progress.hpp"
#include "daemon/tool/commands.hpp"
#include "estimator/levelling/simulation.hpp"
#include "proto/option_value.hpp"

namespace vibrig::tool::level_command {

namespace {

namespace levelling = estimator::levelling;
using Json = nlohmann::ordered_json;
using levelling::kArcmin;
using levelling::kDegPerHour;
using levelling::Pair;

/// As typed; angles in arcmin, rates in deg/h.
struct Options {
    levelling::Specification specification;
    std::vector<double> gains;
    double period_s = 0.1;
    double window_s = 1;
    double tolerance = 0;
    double gravity = 9.80665;
    double reference_noise = 0;
    double accelerometer_noise_g = 1e-5;
    double gyro_noise = 0;  ///< deg/sqrt(h)
    bool json = false;
    std::string plot;
    // simulate
    std::vector<double> tilt{30, -20};
    std::vector<double> drift{0.1, -0.1};
    std::vector<double> zero_mg{0, 0};
    std::vector<double> reference_error{0, 0};
    std::vector<double> slow;
    double ramp_s = 60;
    double step = 0;
    double step_s = -1;
    double duration_s = 0;
    double torquer_limit = 3276.7;  ///< what TorqueCommand can carry
    std::string network = "fast";
    std::uint64_t seed = 1;
    std::size_t runs = 1;
};

template <typename... Values>
std::string text(const char* format, Values... values) {
    std::array<char, 400> out{};
    std::snprintf(out.data(), out.size(), format, values...);
    return out.data();
}

Json number(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

levelling::Gains gains_in(const std::vector<double>& list) { return {list[0], list[1], list[2]}; }

Pair pair(const std::vector<double>& list, double unit) { return {list[0] * unit, list[1] * unit}; }

levelling::LevellerSettings settings_of(const Options& options) {
    levelling::LevellerSettings loop;
    loop.earth.gravity_mps2 = options.gravity;
    loop.settling_s = options.specification.settling_s;
    loop.fast = options.gains.empty() ? levelling::design(options.specification, loop.earth).gains
                                      : gains_in(options.gains);
    if (!options.slow.empty()) {
        loop.slow = gains_in(options.slow);
    }
    loop.ramp_s = options.ramp_s;
    loop.period_s = options.period_s;
    loop.window_s = options.window_s;
    loop.tolerance_rad = options.tolerance * kArcmin;
    loop.torquer_limit = options.torquer_limit * kDegPerHour;
    loop.noise = {options.reference_noise, options.accelerometer_noise_g * options.gravity,
                  options.gyro_noise * kArcmin};  // deg/sqrt(h) is arcmin/sqrt(s)
    return loop;
}

void check_samples(const char* option, double duration_s, double period_s) {
    if (duration_s / period_s > 2e7) {
        throw std::invalid_argument(text("%s: %g s are %g samples, expected at most 2e7", option,
                                         duration_s, duration_s / period_s));
    }
}

Json budget_json(const levelling::Leveller& loop) {
    const levelling::NoiseBudget& budget = loop.budget();
    return {{"reference_arcmin", budget.reference / kArcmin},
            {"accelerometer_arcmin", budget.accelerometer / kArcmin},
            {"gyro_arcmin", budget.gyro / kArcmin},
            {"total_arcmin", budget.total / kArcmin},
            {"dominant", budget.dominant()},
            {"mean_force_arcmin", loop.force_noise() / kArcmin}};
}

Json gains_json(const levelling::Gains& gains) {
    return {{"K1", gains.k1}, {"K2", gains.k2}, {"K3", gains.k3}};
}

std::string budget_table(const levelling::Leveller& loop) {
    const levelling::NoiseBudget& budget = loop.budget();
    return text(
        "noise of the tilt, 1 sigma: reference %.4g', accelerometer %.4g', gyro %.4g'; "
        "together %.4g' (mostly %s); of the mean specific force %.4g'\n",
        budget.reference / kArcmin, budget.accelerometer / kArcmin, budget.gyro / kArcmin,
        budget.total / kArcmin, budget.dominant(), loop.force_noise() / kArcmin);
}

plot::Chart response_chart(const Options& options, const levelling::LevellerSettings& loop) {
    plot::Chart chart;
    chart.title = "Response to an initial tilt";
    chart.x = plot::Axis("time [s]");
    chart.y = plot::Axis("tilt / initial tilt");
    levelling::Scenario start;
    start.loop = loop;
    start.loop.noise = {};
    start.tilt = {kArcmin, 0};
    start.duration_s = 2 * loop.settling_s;
    plot::Curve curve{"sampled loop", {}, {}, {}, {}, plot::Look::line};
    const auto run = levelling::simulate(start);
    const std::size_t every = std::max<std::size_t>(1, run.trace.size() / 1000);
    for (std::size_t k = 0; k < run.trace.size(); k += every) {
        curve.x.push_back(run.trace[k].time_s);
        curve.y.push_back(run.trace[k].tilt[0] / kArcmin);
    }
    chart.curves.push_back(curve);
    if (options.gains.empty()) {
        plot::Curve exact{"eq. 15", {}, {}, {}, {}, plot::Look::dashed};
        const double sigma = levelling::mean_decay(loop.fast);
        for (const double t : curve.x) {
            exact.x.push_back(t);
            exact.y.push_back(
                levelling::initial_response(sigma * t, options.specification.damping));
        }
        chart.curves.push_back(exact);
    }
    return chart;
}

/// Of the start with the largest tilt and drift that the options allow, s.
std::optional<double> declared_within(const Options& options,
                                      const levelling::LevellerSettings& loop) {
    check_samples("--settling", levelling::kPatience * loop.settling_s, loop.period_s);
    const Pair tilt = pair(options.tilt, kArcmin);
    const Pair drift = pair(options.drift, kDegPerHour);
    const Pair zero = pair(options.zero_mg, 1e-3);
    double most_tilt = 0;
    double most_drift = 0;
    for (std::size_t i = 0; i < 2; ++i) {
        most_tilt = std::max(most_tilt, std::abs(tilt[i]) + std::abs(zero[i]));
        most_drift =
            std::max(most_drift, std::abs(drift[i]) +
                                     std::abs(options.reference_error[i]) / loop.earth.radius_m);
    }
    return levelling::declared_within_s(loop, most_tilt + std::abs(options.step) * kArcmin,
                                        most_drift);
}

int run_design(const Options& options) {
    const levelling::LevellerSettings loop = settings_of(options);
    const levelling::Leveller leveller(loop);
    const levelling::Gains& gains = loop.fast;
    const double sigma = leveller.sigma();
    const auto roots = levelling::roots(gains, loop.earth);
    const auto declared = declared_within(options, loop);
    if (!options.plot.empty()) {
        plot::write_file(options.plot, response_chart(options, loop).svg());
    }
    if (options.json) {
        Json root_list = Json::array();
        for (const auto& root : roots) {
            root_list.push_back({{"re", root.real()}, {"im", root.imag()}});
        }
        std::cout << Json{{"gains", gains_json(gains)},
                          {"sigma", sigma},
                          {"x", number(sigma * loop.settling_s)},
                          {"roots", root_list},
                          {"routh",
                           {{"K1_times_1_plus_K2", gains.k1 * (1 + gains.k2)}, {"K3", gains.k3}}},
                          {"longest_period_s", levelling::kMostStep / sigma},
                          {"declared_within_s", declared ? Json(*declared) : Json(nullptr)},
                          {"tolerance_arcmin", leveller.tolerance() / kArcmin},
                          {"noise", budget_json(leveller)},
                          {"message", leveller.message()}}
                         .dump()
                  << '\n';
    } else {
        std::cout << text("K1 = %.6g 1/s, K2 = %.6g, K3 = %.6g 1/s\n", gains.k1, gains.k2, gains.k3)
                  << text("sigma = %.5g 1/s", sigma);
        for (const auto& root : roots) {
            std::cout << text("; root %.5g %+.5gj", root.real(), root.imag());
        }
        std::cout
            << text("\nRouth: K1 (1 + K2) = %.5g > K3 = %.5g\n", gains.k1 * (1 + gains.k2),
                    gains.k3)
            << text("sample period %.4g s, at most %.4g s\n", loop.period_s,
                    levelling::kMostStep / sigma)
            << text(
                   "tolerance %.3g'; from tilts up to %.4g' and %.4g' with drifts up to %.4g and "
                   "%.4g deg/h ",
                   leveller.tolerance() / kArcmin, options.tilt[0], options.tilt[1],
                   options.drift[0], options.drift[1])
            << (declared ? text("declared settled within %.4g s (one start in twenty at most is "
                                "more than 5 %% late)\n",
                                *declared)
                         : text("not sure to be declared settled within %.4g s\n",
                                levelling::kPatience * loop.settling_s))
            << budget_table(leveller);
        if (!leveller.message().empty()) {
            std::cout << "note: " << leveller.message() << '\n';
        }
    }
    return declared ? 0 : kNo;
}

levelling::Scenario scenario_of(const Options& options) {
    levelling::Scenario start;
    start.loop = settings_of(options);
    start.network = options.network == "fast"           ? levelling::Network::fast
                    : options.network == "conventional" ? levelling::Network::conventional
                                                        : levelling::Network::undamped;
    start.tilt = pair(options.tilt, kArcmin);
    start.drift = pair(options.drift, kDegPerHour);
    start.zero = pair(options.zero_mg, 1e-3 * options.gravity);
    start.reference_error = pair(options.reference_error, 1);
    start.step = {options.step * kArcmin, options.step * kArcmin};
    start.step_s = options.step_s;
    start.duration_s =
        options.duration_s > 0 ? options.duration_s : 3.1 * options.specification.settling_s;
    check_samples("--duration", start.duration_s, options.period_s);
    if (options.step != 0 && options.step_s < 0 && options.runs == 1) {
        throw std::invalid_argument(text(
            "--step: found %g without --step-at, expected the time of the step", options.step));
    }
    start.seed = options.seed;
    return start;
}

void plot_run(const std::string& path, const levelling::SimulatedStart& run) {
    plot::Chart tilt;
    tilt.title = "Tilt while levelling";
    tilt.x = plot::Axis("time [s]");
    tilt.y = plot::Axis("tilt [arcmin]");
    plot::Chart rate;
    rate.title = "Commanded rate while levelling";
    rate.x = plot::Axis("time [s]");
    rate.y = plot::Axis("rate [deg/h]");
    const std::size_t every = std::max<std::size_t>(1, run.trace.size() / 2000);
    for (std::size_t i = 0; i < 2; ++i) {
        const char* name = i == 0 ? "first channel" : "second channel";
        plot::Curve of_tilt{name, {}, {}, {}, {}, plot::Look::line};
        plot::Curve of_rate{name, {}, {}, {}, {}, plot::Look::line};
        for (std::size_t k = 0; k < run.trace.size(); k += every) {
            of_tilt.x.push_back(run.trace[k].time_s);
            of_tilt.y.push_back(run.trace[k].tilt[i] / kArcmin);
            of_rate.y.push_back(run.trace[k].rate[i] / kDegPerHour);
        }
        of_rate.x = of_tilt.x;
        tilt.curves.push_back(std::move(of_tilt));
        rate.curves.push_back(std::move(of_rate));
    }
    const std::filesystem::path where(path);
    if (where.extension() == ".svg") {
        plot::write_file(path, tilt.svg());
        return;
    }
    plot::make_folder(path);
    plot::write_file((where / "tilt.svg").string(), tilt.svg());
    plot::write_file((where / "rate.svg").string(), rate.svg());
}

/// What became of many starts.
struct ManyStarts {
    std::vector<double> times;  ///< of those that settled, ascending, s
    double bound = 0;           ///< s, after the start or the step
    double worst_tilt = 0;      ///< when declared, rad
    std::size_t late = 0, never = 0, falsely = 0;

    [[nodiscard]] double time_within(double part) const {
        return times.empty()
                   ? std::nan("")
                   : times[static_cast<std::size_t>(part * static_cast<double>(times.size() - 1))];
    }
};

/// A start with tilts and drifts up to those given and a step at any time before settling.
levelling::Scenario random_start(const Options& options, double settling_s, std::size_t number) {
    levelling::Scenario start = scenario_of(options);
    start.seed = options.seed + number;
    start.until_settled = true;
    std::mt19937_64 generator(start.seed ^ 0x5eedU);
    std::uniform_real_distribution<double> uniform(-1, 1);
    for (std::size_t i = 0; i < 2; ++i) {
        start.tilt[i] *= uniform(generator);
        start.drift[i] *= uniform(generator);
        start.step[i] = std::copysign(start.step[i], uniform(generator));
    }
    start.step_s = options.step != 0 ? settling_s * (1 + uniform(generator)) : -1;
    return start;
}

ManyStarts simulate_many(const Options& options, const levelling::LevellerSettings& loop,
                         double tolerance) {
    Progress progress("levelling");
    ManyStarts many;
    const auto declared = declared_within(options, loop);
    many.bound = declared ? 1.05 * *declared : levelling::kPatience * loop.settling_s;
    for (std::size_t n = 0; n < options.runs; ++n) {
        progress.show(n, options.runs);
        const levelling::Scenario start = random_start(options, loop.settling_s, n);
        const levelling::SimulatedStart run = levelling::simulate(start);
        if (run.verdict != levelling::Verdict::settled) {
            ++many.never;
            continue;
        }
        const bool stepped = start.step_s >= 0 && start.step_s < run.settled_s;
        many.late += run.settled_s - (stepped ? start.step_s : 0) > many.bound ? 1 : 0;
        double tilt = 0;
        for (std::size_t i = 0; i < 2; ++i) {
            tilt = std::max(tilt,
                            std::abs(run.tilt_when_settled[i] + start.zero[i] / options.gravity));
        }
        many.falsely += tilt > 2 * tolerance ? 1U : 0U;
        many.worst_tilt = std::max(many.worst_tilt, tilt);
        many.times.push_back(run.settled_s);
    }
    std::sort(many.times.begin(), many.times.end());
    return many;
}

int run_many(const Options& options) {
    const levelling::LevellerSettings loop = settings_of(options);
    const double tolerance = levelling::Leveller(loop).tolerance();
    const ManyStarts many = simulate_many(options, loop, tolerance);
    if (options.json) {
        std::cout << Json{{"runs", options.runs},
                          {"settled", many.times.size()},
                          {"late", many.late},
                          {"false", many.falsely},
                          {"bound_s", many.bound},
                          {"median_s", number(many.time_within(0.5))},
                          {"p95_s", number(many.time_within(0.95))},
                          {"longest_s", number(many.time_within(1))},
                          {"worst_tilt_arcmin", many.worst_tilt / kArcmin},
                          {"tolerance_arcmin", tolerance / kArcmin}}
                         .dump()
                  << '\n';
    } else {
        std::cout << text(
                         "%zu of %zu settled, %zu later than %.5g s after the start or the step, "
                         "%zu declared falsely\n",
                         many.times.size(), options.runs, many.late, many.bound, many.falsely)
                  << text(
                         "time: median %.5g s, 95 %% within %.5g s, longest %.5g s; largest tilt "
                         "when declared %.3g' (tolerance %.3g')\n",
                         many.time_within(0.5), many.time_within(0.95), many.time_within(1),
                         many.worst_tilt / kArcmin, tolerance / kArcmin);
    }
    return many.never == 0 && 20 * many.late <= options.runs && many.falsely == 0 ? 0 : kNo;
}

int run_simulate(const Options& options) {
    if (options.runs > 1) {
        return run_many(options);
    }
    const levelling::Scenario start = scenario_of(options);
    const levelling::SimulatedStart run = levelling::simulate(start);
    const levelling::Leveller leveller(start.loop);
    const Pair end = run.trace.back().tilt;
    if (!options.plot.empty()) {
        plot_run(options.plot, run);
    }
    const bool fast = start.network == levelling::Network::fast;
    if (options.json) {
        const auto both = [](const Pair& p, double unit) {
            return Json::array({number(p[0] / unit), number(p[1] / unit)});
        };
        Json result = {{"network", options.network},
                       {"gains", gains_json(start.loop.fast)},
                       {"seed", options.seed},
                       {"tilt_arcmin", both(end, kArcmin)},
                       {"tilt_deviation_arcmin", run.tilt_deviation() / kArcmin}};
        if (fast) {
            result["verdict"] = levelling::name_of(run.verdict);
            result["settled_s"] = run.settled_s >= 0 ? Json(run.settled_s) : Json(nullptr);
            result["force_arcmin"] = both(run.observables.force_rad, kArcmin);
            result["drift_deg_h"] = both(run.drift, kDegPerHour);
            result["tolerance_arcmin"] = leveller.tolerance() / kArcmin;
            result["noise"] = budget_json(leveller);
            result["message"] = run.message;
        }
        std::cout << result.dump() << '\n';
    } else {
        std::cout << text("tilt after %.6g s: %.4g' and %.4g'\n", start.duration_s,
                          end[0] / kArcmin, end[1] / kArcmin);
        if (fast) {
            std::cout << (run.settled_s >= 0 ? text("settled after %.5g s", run.settled_s)
                                             : std::string(levelling::name_of(run.verdict)))
                      << text("; tolerance %.3g'\n", leveller.tolerance() / kArcmin)
                      << text("drift found: %.5g and %.5g deg/h\n", run.drift[0] / kDegPerHour,
                              run.drift[1] / kDegPerHour)
                      << budget_table(leveller);
            if (!run.message.empty()) {
                std::cout << "note: " << run.message << '\n';
            }
        }
    }
    return fast && run.settled_s < 0 ? kNo : 0;
}

constexpr double kRightAngle = 5400;  // arcmin

void add_two(CLI::App& command, const char* name, std::vector<double>& value, double most,
             const char* help) {
    command.add_option(name, value, help)
        ->expected(2)
        ->delimiter(',')
        ->check(proto::finite(-most, most));
}

void add_design_options(CLI::App& command, Options& o) {
    add_two(command, "--tilt", o.tilt, kRightAngle, "of both channels at first, arcmin (30,-20)");
    add_two(command, "--drift", o.drift, 1e6, "deg/h (0.1,-0.1)");
    command.add_option("--settling", o.specification.settling_s, "settling time in s (100)")
        ->check(proto::finite(proto::kAboveZero, 1e7));
    command
        .add_option("--residual", o.specification.residual,
                    "fraction of the initial tilt left then (0.005)")
        ->check(proto::finite());
    command.add_option("--damping", o.specification.damping, "ratio xi (0.7)")
        ->check(proto::finite());
    command.add_option("--gains", o.gains, "K1,K2,K3 instead of a design")
        ->expected(3)
        ->delimiter(',')
        ->check(proto::finite());
    command.add_option("--period", o.period_s, "s between samples (0.1)")
        ->check(proto::finite(1e-4, 1e4));
    command
        .add_option("--window", o.window_s,
                    "of the means in s (1); shaker on: whole vibration periods")
        ->check(proto::finite(proto::kAboveZero, 3600));
    command
        .add_option("--tolerance", o.tolerance,
                    "arcmin; default the larger of 0.05 and four times the noise of the means")
        ->check(proto::finite(proto::kAboveZero, 300));
    command.add_option("--reference-noise", o.reference_noise, "m/s per sample (0)")
        ->check(proto::finite(0, 1000));
    command.add_option("--accelerometer-noise", o.accelerometer_noise_g, "g per sample (1e-5)")
        ->check(proto::finite(0, 1));
    command.add_option("--gyro-noise", o.gyro_noise, "random walk, deg/sqrt(h) (0)")
        ->check(proto::finite(0, 100));
    command.add_option("--gravity", o.gravity, "m/s^2 (9.80665)")->check(proto::finite(1, 30));
    command.add_flag("--json", o.json, "print the result as JSON");
    command.add_option("--plot", o.plot, "an SVG file (simulate: or a folder)");
}

void add_simulate_options(CLI::App& command, Options& o) {
    add_two(command, "--zero", o.zero_mg, 1000, "of the accelerometers, mg (0,0)");
    add_two(command, "--reference-error", o.reference_error, 1000, "constant, m/s (0,0)");
    auto* step = command.add_option("--step", o.step, "both channels tip by so much, arcmin")
                     ->check(proto::finite(-kRightAngle, kRightAngle));
    command.add_option("--step-at", o.step_s, "when, s; with --runs at any time")
        ->check(proto::finite(0))
        ->needs(step);
    command.add_option("--slow", o.slow, "K1,K2,K3 to ramp to after settling")
        ->expected(3)
        ->delimiter(',')
        ->check(proto::finite());
    command.add_option("--ramp", o.ramp_s, "length of that ramp, s (60)")
        ->check(proto::finite(proto::kAboveZero, 1e6));
    command.add_option("--torquer-limit", o.torquer_limit, "deg/h (3276.7)")
        ->check(proto::finite(proto::kAboveZero, 1e9));
    command.add_option("--network", o.network, "fast (default), conventional, undamped")
        ->check(CLI::IsMember({"fast", "conventional", "undamped"}));
    command.add_option("--duration", o.duration_s, "s (3.1 settling times)")
        ->check(proto::finite(proto::kAboveZero, 1e9));
    command.add_option("--seed", o.seed, "of the noise (1)")->check(proto::whole());
    command
        .add_option("--runs", o.runs,
                    "many starts, tilt and drift drawn up to those given; exit 0 if all are "
                    "declared, 19 of 20 in the time that `level design` says + 5 %, none falsely")
        ->check(CLI::Range(std::size_t{1}, std::size_t{1000000}));
}

}  // namespace

}  // namespace vibrig::tool::level_command

namespace vibrig::tool {

void add_level(CLI::App& app, int& exit_code) {
    using namespace level_command;
    CLI::App* command = app.add_subcommand("level", "The levelling loop: gains, simulated starts");
    command->require_subcommand(1);
    command->footer("Example: vibrig level simulate --tilt 30,-20 --plot tilt.svg");
    auto options = std::make_shared<level_command::Options>();
    CLI::App* design = command->add_subcommand(
        "design", "Gains from settling time, residual and damping ratio; noise budget");
    add_design_options(*design, *options);
    design->footer(
        "Example: vibrig level design --settling 600 --period 1 --reference-noise 0.2\n"
        "Method: Zha et al. 2019, eqs. 11-15.\n"
        "Exit codes: 0 done, 1 cannot settle with these figures, 2 bad usage or input.");
    design->callback(
        [options, &exit_code] { exit_code = guarded([&] { return run_design(*options); }); });
    CLI::App* simulate =
        command->add_subcommand("simulate", "Starts of two channels under the loop");
    add_design_options(*simulate, *options);
    add_simulate_options(*simulate, *options);
    simulate->footer(
        "Example: vibrig level simulate --tilt 30,30 --step 2 --window 10 --tolerance 0.2 --runs "
        "1000\n"
        "Exit codes: 0 settled, 1 not settled, 2 bad usage or input.");
    simulate->callback(
        [options, &exit_code] { exit_code = guarded([&] { return run_simulate(*options); }); });
}

}  // namespace vibrig::tool
