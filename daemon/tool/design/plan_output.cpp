#include <cmath>
#include <nlohmann/json.hpp>

#include "daemon/tool/analysis/uncertainty_text.hpp"
#include "daemon/tool/design/plan_study.hpp"
#include "estimator/level/coning.hpp"
#include "proto/json_number.hpp"
#include "proto/json_text.hpp"

namespace vibrig::tool::planner {

namespace {

using Json = nlohmann::ordered_json;

std::size_t count_of(const PlanStudy& study) {
    std::size_t sum = 0;
    for (const PlanRun& run : study.runs) sum += run.count;
    return sum;
}

std::size_t sweeps_of(const PlanStudy& study) {
    std::size_t sum = 0;
    for (const PlanRun& run : study.runs) sum += run.sweep.any() ? run.count : 0;
    return sum;
}

Json correlation(const planning::Evaluation& evaluation) {
    if (evaluation.correlation == 0) return nullptr;
    return {{"between",
             {planning::kTermNames[evaluation.first], planning::kTermNames[evaluation.second]}},
            {"value", evaluation.correlation}};
}

/// Motion of the platform in step with the vibration for which its drift is given: what a good
/// platform on isolators has.
constexpr double kConingArcsec = 2;

double coning_of(const estimator::spectrum::SurveyLine& line) {
    return estimator::coning_bound(line.hz, kConingArcsec, line.level_g * line.level_g);
}

Json survey_json(const Survey& of) {
    Json lines = Json::array(), seen = Json::object();
    for (std::size_t k = 0; k < of.lines.size(); ++k) {
        const auto& line = of.lines[k];
        lines.push_back({{"hz", line.hz},
                         {"asked_hz", line.asked_hz},
                         {"transmission", line.transmission},
                         {"level_g", line.level_g},
                         {"table_g", line.table_g},
                         {"limited", line.limited},
                         {"coning_bound_deg_h_per_g2", coning_of(line)},
                         {"dwells", of.dwells[k]}});
    }
    for (const auto& [hz, share] : of.smallest_seen)
        seen[printed("%g", hz)] = proto::number_or_null(share);
    Json about = Json::array();
    for (const auto& one : of.about)
        about.push_back({{"gyro", std::string(1, "xyz"[one.gyro])},
                         {"resonance_hz", one.resonance_hz},
                         {"below_hz", one.below_hz},
                         {"above_hz", one.above_hz}});
    return {{"mount", of.hard ? "hard" : "isolated"},
            {"frequencies", std::move(lines)},
            {"coning_arcsec", kConingArcsec},
            {"highest_hz", of.highest_hz > 0 ? Json(of.highest_hz) : Json(nullptr)},
            {"smallest_share_seen", std::move(seen)},
            {"about", std::move(about)},
            {"profile", of.profile.empty() ? Json(nullptr) : Json(of.profile)},
            {"predicted_u_deg_h",
             of.predicted_u_deg_h ? proto::number_or_null(*of.predicted_u_deg_h) : Json(nullptr)}};
}

std::string survey_text(const Survey& of) {
    std::string text = printed("\nsurvey, %s mount\n", of.hard ? "hard" : "isolated");
    for (std::size_t k = 0; k < of.lines.size(); ++k) {
        const auto& line = of.lines[k];
        text += printed("  %8.6g Hz %7.4g g platform %7.4g g table %4zu dwells, coning %.1e%s%s\n",
                        line.hz, line.level_g, line.table_g, of.dwells[k], coning_of(line),
                        line.hz != line.asked_hz
                            ? printed(", for %.6g Hz, which is not free", line.asked_hz).c_str()
                            : "",
                        line.limited ? ", the shaker's limit" : "");
    }
    text += printed(
        "coning: deg/h/g^2 at most, if the platform turns by %g arcsec in step with the "
        "vibration\n",
        kConingArcsec);
    for (const auto& one : of.about)
        text += printed("about the resonance of gyro %c at %.4g Hz: %.6g and %.6g Hz\n",
                        "xyz"[one.gyro], one.resonance_hz, one.below_hz, one.above_hz);
    text += "smallest elastic share of all quadratic coefficients that is seen with 90 %:";
    if (of.smallest_seen.empty()) text += "  none, at one frequency";
    for (const auto& [hz, share] : of.smallest_seen)
        text += printed("  %.3g %% at %g Hz", 100 * share, hz);
    text += of.highest_hz > 0 ? printed("\na flat verdict reaches to %g Hz\n", of.highest_hz)
                              : "\na flat verdict cannot come of these dwells\n";
    if (of.predicted_u_deg_h)
        text += printed("drift under %s: u %.4g deg/h, rms over resonances that may be\n",
                        of.profile.c_str(), *of.predicted_u_deg_h);
    return text;
}

std::string shaken(const PlanRun& run) {
    if (run.sweep.any())
        return printed("  %.6g to %.6g Hz in %.6g s", run.sweep.from_hz, run.sweep.to_hz,
                       run.sweep.seconds);
    return run.frequency_hz > 0 ? printed("  %.6g Hz", run.frequency_hz) : "";
}

constexpr std::array<const char*, 6> kProducts{"xx", "yy", "zz", "xy", "xz", "yz"};

Json sweeps_json(const Sweeps& of) {
    const auto usable = [](const auto& one) {
        return Json{{"s", one.blocks},
                    {"known_s", one.known},
                    {"rates", one.rates},
                    {"usable", one.share()}};
    };
    Json seen = Json::object();
    for (std::size_t k = 0; k < kProducts.size(); ++k) seen[kProducts[k]] = of.seen[k];
    return {{"from_hz", of.from_hz},
            {"to_hz", of.to_hz},
            {"s", of.seconds},
            {"table_g", of.table_g},
            {"level_g", {of.lowest_g, of.highest_g}},
            {"up", usable(of.up)},
            {"down", usable(of.down)},
            {"products_seen", std::move(seen)}};
}

std::string sweeps_text(const Sweeps& of) {
    std::string text = printed(
        "\nsweeps up and down between %.6g and %.6g Hz in %.6g s at three positions, "
        "%.4g g at the table, %.4g to %.4g g at the platform\n",
        of.from_hz, of.to_hz, of.seconds, of.table_g, of.lowest_g, of.highest_g);
    for (const auto& [word, one] : {std::pair{"up", of.up}, std::pair{"down", of.down}})
        text += printed(
            "  %-4s %.3g %% usable: %zu of %zu s are off the forbidden frequencies, with "
            "%zu rates between neighbours\n",
            word, 100 * one.share(), one.known, one.blocks, one.rates);
    text += "  they see of the elastic part of a gyro (1: a whole sweep along that axis):";
    for (std::size_t k = 0; k < kProducts.size(); ++k)
        text += printed(" %s %.3g", kProducts[k], of.seen[k]);
    return text + "\n";
}

}  // namespace

std::string plan_json(const PlanStudy& study) {
    Json runs = Json::array();
    for (const PlanRun& run : study.runs) {
        Json one{{"position", to_attitude(study.rig, run.visit.position_deg)},
                 {"level_g", run.visit.level_g},
                 {"table_g", run.table_g},
                 {"count", run.count}};
        if (run.frequency_hz > 0) one["frequency_hz"] = run.frequency_hz;
        if (run.sweep.any())
            one["sweep"] = {{"from_hz", run.sweep.from_hz},
                            {"to_hz", run.sweep.to_hz},
                            {"s", run.sweep.seconds}};
        if (run.verify) one["role"] = "verify";
        runs.push_back(std::move(one));
    }
    Json errors = Json::object();
    for (std::size_t i = 0; i < estimator::kParameters; ++i)
        errors[estimator::parameter_names()[i]] = proto::number_or_null(study.forecast.sigma[i]);
    const planning::Evaluation& e = study.evaluation;
    Json unit = Json::object();
    for (std::size_t i = 0; i < planning::kTerms; ++i) {
        unit[planning::kTermNames[i]] =
            e.sigma[i] > 0 ? proto::number_or_null(e.sigma[i] * std::sqrt(e.effort))
                           : Json(nullptr);
    }
    Json shares = Json::array();
    for (const auto& [level, share] : study.optimal_shares)
        shares.push_back({{"level_g", level}, {"share", share}});
    Json json{{"d_efficiency", study.d_efficiency},
              {"bound", study.bound},
              {"rank", e.rank},
              {"runs", std::move(runs)},
              {"standard_errors", std::move(errors)},
              {"duration_s", study.duration.total_s},
              {"slewing_s", study.duration.slewing_s},
              {"vibrating_s", study.duration.vibrating_s},
              {"dwell_s", study.dwell_s},
              {"transmission", study.transmission},
              {"frequency_hz", study.frequency_hz},
              {"coefficients", e.coefficients},
              {"run_count", count_of(study)},
              {"a_efficiency", study.a_efficiency},
              {"e_efficiency_at_least", study.e_efficiency},
              {"condition", proto::number_or_null(e.condition)},
              {"unit_standard_errors", std::move(unit)},
              {"strongest_correlation", correlation(e)},
              {"drift_imbalance", study.drift_imbalance},
              {"optimal_shares", std::move(shares)},
              {"optimum_gap", study.optimum_gap},
              {"warnings", study.warnings}};
    if (study.survey) json["survey"] = survey_json(*study.survey);
    if (study.sweeps) json["sweeps"] = sweeps_json(*study.sweeps);
    if (study.uncertainty) {
        const auto& merit = study.uncertainty->merit;
        json["order_inflation"] = {{"bias", proto::number_or_null(merit.bias)},
                                   {"largest", proto::number_or_null(merit.largest)},
                                   {"median", proto::number_or_null(merit.median)},
                                   {"step", proto::number_or_null(merit.step)}};
        Json combined = Json::object(), expanded = Json::object();
        for (std::size_t i = 0; i < estimator::kParameters; ++i) {
            const auto& c = study.uncertainty->assessed.coefficients[i];
            combined[estimator::parameter_names()[i]] = proto::number_or_null(c.u);
            expanded[estimator::parameter_names()[i]] = proto::number_or_null(c.expanded);
        }
        json["combined_uncertainty"] = std::move(combined);
        json["expanded_uncertainty"] = std::move(expanded);
    }
    if (!study.refusal.empty()) {
        json["refusal"] = study.refusal;
        json["undetermined"] = Json::array();
        for (std::size_t i = 0; i < planning::kTerms; ++i) {
            for (const planning::Row& null : e.null_vectors) {
                if (null[i] == 0) continue;
                json["undetermined"].push_back(planning::kTermNames[i]);
                break;
            }
        }
    }
    if (!study.vertical_axes.empty()) {
        Json axes = Json::array();
        for (const planning::VerticalAxis& axis : study.vertical_axes) {
            axes.push_back({{"vertical", std::string(1, axis.axis)},
                            {"directions", axis.directions},
                            {"rank_one_level", axis.rank_one_level},
                            {"rank", axis.rank},
                            {"d_efficiency", axis.d_efficiency}});
        }
        json["vertical_axes"] = std::move(axes);
    }
    return proto::json_text(json);
}

std::string plan_table(const PlanStudy& study) {
    std::string text = "   run   outer  inner azimuth   platform     table  times\n";
    std::size_t number = 1;
    for (const PlanRun& run : study.runs) {
        const auto p = to_attitude(study.rig, run.visit.position_deg);
        text += printed("  %4zu %7.6g %6.6g %7.6g %8.4g g %7.4g g %6zu%s\n", number++, p[0], p[1],
                        p[2], run.visit.level_g, run.table_g, run.count, shaken(run).c_str());
    }
    const planning::Evaluation& e = study.evaluation;
    const std::size_t sweeps = sweeps_of(study);
    text += printed("\n%zu runs of %g s%s, %.4g h: vibrating %.4g h, slewing %.4g h\n",
                    count_of(study) - sweeps, study.dwell_s,
                    sweeps > 0 ? printed(" and %zu sweeps", sweeps).c_str() : "",
                    study.duration.total_s / 3600, study.duration.vibrating_s / 3600,
                    study.duration.slewing_s / 3600);
    text += printed("rank %zu of %zu", e.rank, e.coefficients);
    if (e.identifies_all()) {
        text +=
            printed(", condition %.4g, strongest correlation %.2f (%s, %s)\n", e.condition,
                    e.correlation, planning::kTermNames[e.first], planning::kTermNames[e.second]);
        text += printed(
            "D-efficiency %.4f (at least %.4f by the equivalence bound), A %.4f, E >= "
            "%.4f\n",
            study.d_efficiency, study.bound, study.a_efficiency, study.e_efficiency);
        text += "optimum over the same candidates and levels:";
        for (const auto& [level, share] : study.optimal_shares)
            text += printed("  %.4g of the runs at %.4g g", share, level);
        text += printed("\ncorrelation of place in the order with a term, at most %.2f\n",
                        study.drift_imbalance);
    } else {
        text += '\n';
    }
    if (!study.vertical_axes.empty()) {
        text += "\nvertical at zero angles  directions  rank, one level / all  D-efficiency *\n";
        for (const planning::VerticalAxis& axis : study.vertical_axes) {
            text += printed("  %c %33zu %12zu / %-7zu %13.3f\n", axis.axis, axis.directions,
                            axis.rank_one_level, axis.rank, axis.d_efficiency);
        }
        text += "  * against free directions at rest and at the highest level\n";
    }
    if (study.sweeps) text += sweeps_text(*study.sweeps);
    if (study.survey) text += survey_text(*study.survey);
    text += '\n' + plan::forecast_table(study.forecast);
    if (study.uncertainty) {
        const auto& merit = study.uncertainty->merit;
        text += printed(
            "\norder: a bias that walks and drifts makes sigma of D_F %.2f, of the worst %.4g, of "
            "most %.2f times as large; one that steps, %.4g\n\n",
            merit.bias, merit.largest, merit.median, merit.step);
        text += allowance_table(study.uncertainty->assessed);
    }
    for (const std::string& warning : study.warnings) text += "warning: " + warning + '\n';
    return text;
}

}  // namespace vibrig::tool::planner
