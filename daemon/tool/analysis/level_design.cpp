#include <algorithm>
#include <cmath>
#include <iostream>
#include <optional>

#include "daemon/plot/chart.hpp"
#include "daemon/results/exit_status.hpp"
#include "daemon/tool/analysis/level_options.hpp"
#include "estimator/levelling/refusal.hpp"
#include "proto/json_number.hpp"
#include "proto/json_text.hpp"

namespace vibrig::tool::level_command {

namespace {

plot::Chart response_chart(const Options& options, const levelling::LevellerSettings& loop) {
    plot::Chart chart{"Response to an initial tilt", plot::Axis("time [s]"),
                      plot::Axis("tilt / initial tilt")};
    levelling::Scenario start;
    start.loop = loop;
    start.loop.noise = {};
    start.tilt = {kRadPerArcmin, 0};
    start.duration_s = 2 * loop.settling_s;
    plot::Curve curve{"sampled loop"};
    const auto run = levelling::simulate(start);
    const std::size_t every = std::max<std::size_t>(1, run.trace.size() / 1000);
    for (std::size_t k = 0; k < run.trace.size(); k += every) {
        curve.add(run.trace[k].time_s, run.trace[k].tilt[0] / kRadPerArcmin);
    }
    chart.curves.push_back(curve);
    if (options.gains.empty()) {
        plot::Curve exact{.name = "eq. 15", .look = plot::Look::dashed};
        const double sigma = levelling::mean_decay(loop.fast);
        for (const double t : curve.x) {
            exact.add(t, levelling::initial_response(sigma * t, options.specification.damping));
        }
        chart.curves.push_back(exact);
    }
    return chart;
}

}  // namespace

std::optional<double> declared_within(const Options& options,
                                      const levelling::LevellerSettings& loop) {
    check_samples("--settling", levelling::kPatience * loop.settling_s, loop.period_s);
    const Pair tilt = pair(options.tilt, kRadPerArcmin);
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
    return levelling::declared_within_s(loop, most_tilt + std::abs(options.step) * kRadPerArcmin,
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
        plot::write_pictures(options.plot, {{"response", response_chart(options, loop).svg()}});
    }
    if (options.json) {
        Json root_list = Json::array();
        for (const auto& root : roots) {
            root_list.push_back({{"re", root.real()}, {"im", root.imag()}});
        }
        std::cout << proto::json_text(Json{
                         {"gains", gains_json(gains)},
                         {"sigma", sigma},
                         {"x", proto::number_or_null(sigma * loop.settling_s)},
                         {"roots", root_list},
                         {"routh",
                          {{"K1_times_1_plus_K2", gains.k1 * (1 + gains.k2)}, {"K3", gains.k3}}},
                         {"longest_period_s", levelling::kMostStep / sigma},
                         {"declared_within_s", declared ? Json(*declared) : Json(nullptr)},
                         {"tolerance_arcmin", leveller.tolerance() / kRadPerArcmin},
                         {"noise", budget_json(leveller)},
                         {"message", leveller.message()}})
                  << '\n';
    } else {
        std::cout << printed("K1 = %.6g 1/s, K2 = %.6g, K3 = %.6g 1/s\n", gains.k1, gains.k2,
                             gains.k3)
                  << printed("sigma = %.5g 1/s", sigma);
        for (const auto& root : roots) {
            std::cout << printed("; root %.5g %+.5gj", root.real(), root.imag());
        }
        std::cout
            << printed("\nRouth: K1 (1 + K2) = %.5g > K3 = %.5g\n", gains.k1 * (1 + gains.k2),
                       gains.k3)
            << printed("sample period %.4g s, at most %.4g s\n", loop.period_s,
                       levelling::at_most(levelling::kMostStep / sigma, 4))
            << printed(
                   "tolerance %.3g'; from tilts up to %.4g' and %.4g' with drifts up to %.4g and "
                   "%.4g deg/h ",
                   leveller.tolerance() / kRadPerArcmin, options.tilt[0], options.tilt[1],
                   options.drift[0], options.drift[1])
            << (declared ? printed("declared settled within %.4g s (one start in twenty at most is "
                                   "more than 5 %% late)\n",
                                   *declared)
                         : printed("not sure to be declared settled within %.4g s\n",
                                   levelling::kPatience * loop.settling_s))
            << budget_table(leveller);
        if (!leveller.message().empty()) {
            std::cout << "note: " << leveller.message() << '\n';
        }
    }
    return declared ? 0 : kNo;
}

}  // namespace vibrig::tool::level_command
