#include <algorithm>
#include <cmath>
#include <iostream>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include "daemon/plot/chart.hpp"
#include "daemon/results/exit_status.hpp"
#include "daemon/results/progress.hpp"
#include "daemon/tool/analysis/level_options.hpp"
#include "proto/json_number.hpp"
#include "proto/json_text.hpp"

namespace vibrig::tool::level_command {

namespace {

levelling::Scenario scenario_of(const Options& options) {
    levelling::Scenario start;
    start.loop = settings_of(options);
    start.network = options.network == "fast"           ? levelling::Network::fast
                    : options.network == "conventional" ? levelling::Network::conventional
                                                        : levelling::Network::undamped;
    start.tilt = pair(options.tilt, kRadPerArcmin);
    start.drift = pair(options.drift, kDegPerHour);
    start.zero = pair(options.zero_mg, 1e-3 * options.gravity);
    start.reference_error = pair(options.reference_error, 1);
    start.step = {options.step * kRadPerArcmin, options.step * kRadPerArcmin};
    start.step_s = options.step_s;
    start.duration_s =
        options.duration_s > 0 ? options.duration_s : 3.1 * options.specification.settling_s;
    check_samples("--duration", start.duration_s, options.period_s);
    if (start.duration_s < options.period_s) {
        throw std::invalid_argument(
            printed("--duration: found %g s, expected at least the %g s of --period",
                    start.duration_s, options.period_s));
    }
    if (const bool slow = !options.slow.empty();
        options.network != "fast" && (slow || options.torquer_limit != Options{}.torquer_limit)) {
        throw std::invalid_argument(printed("%s: found with --network %s, expected --network fast",
                                            slow ? "--slow" : "--torquer-limit",
                                            options.network.c_str()));
    }
    if (options.step != 0 && options.step_s < 0 && options.runs == 1) {
        throw std::invalid_argument(printed(
            "--step: found %g without --step-at, expected the time of the step", options.step));
    }
    if (options.step_s >= start.duration_s) {
        throw std::invalid_argument(
            printed("--step-at: found %g s, expected less than the %g s of --duration",
                    options.step_s, start.duration_s));
    }
    start.seed = options.seed;
    return start;
}

void plot_run(const std::string& path, const levelling::SimulatedStart& run) {
    plot::Chart tilt{"Tilt while levelling", plot::Axis("time [s]"), plot::Axis("tilt [arcmin]")};
    plot::Chart rate{"Commanded rate while levelling", plot::Axis("time [s]"),
                     plot::Axis("rate [deg/h]")};
    const std::size_t every = std::max<std::size_t>(1, run.trace.size() / 2000);
    for (std::size_t i = 0; i < 2; ++i) {
        const char* name = i == 0 ? "first channel" : "second channel";
        plot::Curve of_tilt{name};
        plot::Curve of_rate{name};
        for (std::size_t k = 0; k < run.trace.size(); k += every) {
            of_tilt.add(run.trace[k].time_s, run.trace[k].tilt[i] / kRadPerArcmin);
            of_rate.y.push_back(run.trace[k].rate[i] / kDegPerHour);
        }
        of_rate.x = of_tilt.x;
        tilt.curves.push_back(std::move(of_tilt));
        rate.curves.push_back(std::move(of_rate));
    }
    plot::write_pictures(path, {{"tilt", tilt.svg()}, {"rate", rate.svg()}});
}

/// What became of many starts.
struct ManyStarts {
    std::vector<double> times;  ///< of those that settled, from the start or the step, ascending, s
    double bound = 0;           ///< of these times, s
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
        const double took_s = run.settled_s - (stepped ? start.step_s : 0);
        many.late += took_s > many.bound ? 1 : 0;
        double tilt = 0;
        for (std::size_t i = 0; i < 2; ++i) {
            tilt = std::max(tilt,
                            std::abs(run.tilt_when_settled[i] + start.zero[i] / options.gravity));
        }
        many.falsely += tilt > 2 * tolerance ? 1U : 0U;
        many.worst_tilt = std::max(many.worst_tilt, tilt);
        many.times.push_back(took_s);
    }
    std::sort(many.times.begin(), many.times.end());
    return many;
}

int run_many(const Options& options) {
    const levelling::LevellerSettings loop = settings_of(options);
    const double tolerance = levelling::Leveller(loop).tolerance();
    const ManyStarts many = simulate_many(options, loop, tolerance);
    if (options.json) {
        std::cout << proto::json_text(
                         Json{{"runs", options.runs},
                              {"settled", many.times.size()},
                              {"late", many.late},
                              {"false", many.falsely},
                              {"bound_s", many.bound},
                              {"median_s", proto::number_or_null(many.time_within(0.5))},
                              {"p95_s", proto::number_or_null(many.time_within(0.95))},
                              {"longest_s", proto::number_or_null(many.time_within(1))},
                              {"worst_tilt_arcmin", many.times.empty()
                                                        ? Json(nullptr)
                                                        : Json(many.worst_tilt / kRadPerArcmin)},
                              {"tolerance_arcmin", tolerance / kRadPerArcmin}})
                  << '\n';
    } else {
        std::cout << printed("%zu of %zu settled, %zu later than %.5g s, %zu declared falsely\n",
                             many.times.size(), options.runs, many.late, many.bound, many.falsely);
        if (!many.times.empty())
            std::cout << printed(
                "time after the start or the step: median %.5g s, 95 %% within %.5g s, "
                "longest %.5g s\nlargest tilt when declared, besides the accelerometers' "
                "zero, %.3g' (tolerance %.3g')\n",
                many.time_within(0.5), many.time_within(0.95), many.time_within(1),
                many.worst_tilt / kRadPerArcmin, tolerance / kRadPerArcmin);
    }
    return many.never == 0 && 20 * many.late <= options.runs && many.falsely == 0 ? 0 : kNo;
}

/// Largest tilt over the last settling time, or all of a shorter run, besides what the
/// accelerometers' zeros ask for, rad.
double tilt_at_last(const levelling::SimulatedStart& run, const levelling::Scenario& start,
                    double gravity) {
    double largest = 0;
    for (const levelling::TracePoint& point : run.trace) {
        if (point.time_s < run.trace.back().time_s - start.loop.settling_s) continue;
        for (std::size_t i = 0; i < 2; ++i)
            largest = std::max(largest, std::abs(point.tilt[i] + start.zero[i] / gravity));
    }
    return largest;
}

/// One start, and what there is to say of it.
struct OneStart {
    levelling::Scenario start;
    levelling::SimulatedStart run;
    levelling::Leveller leveller;
    double at_last = 0;  ///< rad
    bool settled = false;
    [[nodiscard]] bool fast() const { return start.network == levelling::Network::fast; }
};

std::string json_of(const Options& options, const OneStart& of) {
    const auto both = [](const Pair& p, double unit) {
        return Json::array(
            {proto::number_or_null(p[0] / unit), proto::number_or_null(p[1] / unit)});
    };
    Json result = {{"network", options.network}};
    if (of.fast()) result["gains"] = gains_json(of.start.loop.fast);
    result["seed"] = options.seed;
    result["tilt_arcmin"] = both(of.run.trace.back().tilt, kRadPerArcmin);
    result["tilt_deviation_arcmin"] = of.run.tilt_deviation() / kRadPerArcmin;
    result["tolerance_arcmin"] = of.leveller.tolerance() / kRadPerArcmin;
    if (of.fast()) {
        result["verdict"] = levelling::name_of(of.run.verdict);
        result["settled_s"] = of.run.settled_s >= 0 ? Json(of.run.settled_s) : Json(nullptr);
        result["force_arcmin"] = both(of.run.observables.force_rad, kRadPerArcmin);
        result["rate_arcmin"] = both(of.run.observables.rate_rad, kRadPerArcmin);
        result["drift_deg_h"] = both(of.run.drift, kDegPerHour);
        result["noise"] = budget_json(of.leveller);
        result["message"] = of.run.message;
    } else {
        result["verdict"] = of.settled ? "settled" : "not settled";
        result["last_tilt_arcmin"] = of.at_last / kRadPerArcmin;
    }
    return proto::json_text(result) + "\n";
}

std::string text_of(const OneStart& of) {
    const Pair end = of.run.trace.back().tilt;
    const double tolerance = of.leveller.tolerance() / kRadPerArcmin;
    std::string text = printed("tilt after %.6g s: %.4g' and %.4g'\n", of.start.duration_s,
                               end[0] / kRadPerArcmin, end[1] / kRadPerArcmin);
    if (!of.fast())
        return text + printed(
                          "%s: at most %.4g' over the last %.4g s besides the accelerometers' "
                          "zero; tolerance %.3g'\n",
                          of.settled ? "settled" : "not settled", of.at_last / kRadPerArcmin,
                          std::min(of.start.loop.settling_s, of.start.duration_s), tolerance);
    text += of.settled ? printed("settled after %.5g s", of.run.settled_s)
                       : std::string(levelling::name_of(of.run.verdict));
    const auto& [force, rate] = of.run.observables;
    text += printed("; tolerance %.3g'\n", tolerance) +
            printed("mean specific force %.4g' and %.4g'; left for z %.4g' and %.4g'\n",
                    force[0] / kRadPerArcmin, force[1] / kRadPerArcmin, rate[0] / kRadPerArcmin,
                    rate[1] / kRadPerArcmin) +
            printed("drift found: %.5g and %.5g deg/h\n", of.run.drift[0] / kDegPerHour,
                    of.run.drift[1] / kDegPerHour) +
            budget_table(of.leveller);
    if (!of.run.message.empty()) text += "note: " + of.run.message + '\n';
    return text;
}

}  // namespace

int run_simulate(const Options& options) {
    if (options.runs > 1) {
        // Each has its own tilt and its own time of the step.
        if (!options.plot.empty())
            throw std::invalid_argument(
                printed("--plot: found %s with --runs %zu, expected one start",
                        options.plot.c_str(), options.runs));
        if (options.network != "fast")
            throw std::invalid_argument(
                printed("--runs: found %zu with --network %s, which has no verdict of its own; "
                        "expected one start",
                        options.runs, options.network.c_str()));
        if (options.step_s >= 0)
            throw std::invalid_argument(
                printed("--step-at: found %g with --runs %zu, whose steps come at any time; "
                        "expected one start",
                        options.step_s, options.runs));
        return run_many(options);
    }
    const levelling::Scenario start = scenario_of(options);
    OneStart of{start, levelling::simulate(start), levelling::Leveller(start.loop)};
    // The other networks have no verdict of their own.
    of.at_last = tilt_at_last(of.run, start, options.gravity);
    of.settled = of.fast() ? of.run.settled_s >= 0 : of.at_last <= of.leveller.tolerance();
    if (!options.plot.empty()) plot_run(options.plot, of.run);
    std::cout << (options.json ? json_of(options, of) : text_of(of));
    return of.settled ? 0 : kNo;
}

}  // namespace vibrig::tool::level_command
