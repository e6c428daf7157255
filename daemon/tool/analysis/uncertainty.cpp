// vibrig uncertainty: the budget of a result, and what would shrink it.
#include <iostream>
#include <optional>
#include <string>

#include "daemon/plot/chart.hpp"
#include "daemon/results/assessment_json.hpp"
#include "daemon/results/exit_status.hpp"
#include "daemon/results/result_table.hpp"
#include "daemon/tool/analysis/uncertainty_text.hpp"
#include "daemon/tool/commands.hpp"
#include "daemon/tool/recordings/identified.hpp"
#include "daemon/tool/simulated.hpp"
#include "proto/json_text.hpp"

namespace vibrig::tool {
namespace {

using Json = nlohmann::ordered_json;
namespace uncertainty = estimator::uncertainty;

struct UncertaintyOptions {
    std::string file, config, plot, coefficient;
    bool json = false, strict = false, monte_carlo = false;
};

Json leverage_json(const uncertainty::Assessment& assessed) {
    Json list = Json::array();
    for (const uncertainty::Leverage& of : uncertainty::leverages(assessed)) {
        Json without = Json::object();
        for (std::size_t k = 0; k < uncertainty::kKinds; ++k)
            without[uncertainty::kind_name(k)] = number_or_null(of.without[k]);
        list.push_back({{"input", of.input},
                        {"u", number_or_null(of.u)},
                        {"declared", of.declared},
                        {"u_ratio_without", std::move(without)},
                        {"remedy", of.remedy()}});
    }
    return list;
}

std::string budget_json(const Identified& of, std::optional<std::size_t> only,
                        const uncertainty::MonteCarlo* drawn) {
    Json root = assessment_json(of.assessed), list = Json::array();
    for (std::size_t i = 0; i < estimator::kParameters; ++i) {
        if (only && i != *only) continue;
        const auto& c = of.assessed.coefficients[i];
        Json one{{"name", estimator::parameter_names()[i]},
                 {"unit", estimator::parameter_unit(i)},
                 {"value", number_or_null(c.value)},
                 {"sigma", number_or_null(c.sigma)}};
        one.update(coefficient_json(c));
        if (drawn != nullptr)
            one["interval"] = {number_or_null(drawn->coefficients[i].low),
                               number_or_null(drawn->coefficients[i].high)};
        list.push_back(std::move(one));
    }
    Json out{{"simulated", of.simulated},
             {"coefficients", std::move(list)},
             {"leverage", leverage_json(of.assessed)}};
    out.update(root);
    if (drawn != nullptr) out["monte_carlo"] = monte_carlo_json(*drawn);
    return proto::json_text(out) + "\n";
}

std::size_t coefficient_number(const std::string& name) {
    for (std::size_t i = 0; i < estimator::kParameters; ++i) {
        if (name == estimator::parameter_names()[i]) return i;
    }
    throw std::runtime_error("--coefficient: found '" + name +
                             "', expected a name such as D_Fx or D_IIz");
}

/// Of each coefficient the parts, squared, over u squared. All of them and the correlations, which
/// may be below 0, are 1.
void draw_budget(const uncertainty::Assessment& assessed, bool simulated, const std::string& path) {
    plot::Chart chart{
        std::string(simulated ? "SIMULATED: " : "") + "Parts of the combined uncertainty",
        plot::Axis("coefficient, as listed"), plot::Axis("part of u squared")};
    chart.y.include(0);
    chart.y.include(1);
    for (const uncertainty::Leverage& of : uncertainty::leverages(assessed)) {
        plot::Curve curve{.name = of.input, .look = plot::Look::dots};
        for (std::size_t i = 0; i < estimator::kParameters; ++i) {
            const auto& c = assessed.coefficients[i];
            double square = 0;
            for (const auto& part : c.budget)
                square += part.input == of.input ? part.contribution * part.contribution : 0;
            curve.add(static_cast<double>(i + 1),
                      c.u > 0 ? square / (c.u * c.u) : uncertainty::kNone);
        }
        chart.curves.push_back(std::move(curve));
        if (chart.curves.size() == 6) break;
    }
    plot::Curve correlations{.name = "correlations", .look = plot::Look::dots};
    bool any = false;
    for (std::size_t i = 0; i < estimator::kParameters; ++i) {
        const auto& c = assessed.coefficients[i];
        any |= c.correlation != 0;
        correlations.add(static_cast<double>(i + 1),
                         c.u > 0 ? c.correlation / (c.u * c.u) : uncertainty::kNone);
    }
    if (any) chart.curves.push_back(std::move(correlations));
    plot::write_pictures(path, {{"budget", chart.svg()}});
}

int run(const UncertaintyOptions& options) {
    const std::optional<std::size_t> only =
        options.coefficient.empty() ? std::nullopt
                                    : std::optional(coefficient_number(options.coefficient));
    const Identified identified = identify_recording(options.file, options.config);
    const auto& assessed = identified.assessed;
    if (!assessed.done)
        throw std::runtime_error(options.file +
                                 ": found no two dwells that can be used, or estimator.method = "
                                 "\"two-step\"; expected what an uncertainty can be had from");
    std::optional<uncertainty::MonteCarlo> drawn;
    if (options.monte_carlo) drawn = draw(identified);
    const auto* check = drawn ? &*drawn : nullptr;
    if (!options.plot.empty()) draw_budget(assessed, identified.simulated, options.plot);
    std::cout << (options.json
                      ? budget_json(identified, only, check)
                      : simulated_line(identified.simulated) + budget_table(assessed, only) +
                            (check != nullptr ? monte_carlo_text(*check) : ""));
    return exit_status(assessed.verdict.level, options.strict);
}

}  // namespace

void add_uncertainty(CLI::App& app, int& exit_code) {
    const auto [command, options] = add_command<UncertaintyOptions>(
        app, exit_code, "uncertainty",
        "The uncertainty budget of a result, and what would shrink it most", run);
    command
        .add_option("FILE", options.file,
                    "a recording (CSV), or a campaign: its folder, HDF5 file or name")
        ->required();
    command.add_option("--config", options.config,
                       "configuration file (TOML) with [uncertainty] and [drift]; without it all "
                       "defaults apply, of a campaign its own");
    command.add_option("--coefficient", options.coefficient,
                       "the whole budget of this one only, such as D_IIx");
    command.add_option("--plot", options.plot, "an SVG file, or a folder: the parts of the budget")
        ->check(proto::charts());
    command.add_flag("--monte-carlo", options.monte_carlo,
                     "check the combined uncertainty by drawing the inputs (JCGM 101)");
    command.add_flag("--json", options.json, "print everything as JSON");
    command.add_flag("--strict", options.strict, "a doubtful result is a no as well");
    command.footer(
        "Example: vibrig uncertainty platform-17-20260301T080000Z --monte-carlo\n"
        "Inputs are declared in [uncertainty]; what is not declared stands at its default and is "
        "marked.\n"
        "Exit codes: 0 the result is valid or doubtful, 1 it is not valid (with --strict: or "
        "doubtful),\n2 bad usage or input.");
}

}  // namespace vibrig::tool
