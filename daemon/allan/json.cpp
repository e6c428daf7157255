#include <cmath>
#include <nlohmann/json.hpp>

#include "daemon/allan/analysis.hpp"
#include "proto/json_number.hpp"
#include "proto/json_text.hpp"

namespace vibrig::tool {

namespace {

using Json = nlohmann::ordered_json;

Json fit_json(const allan::Fit& fit) {
    Json terms = Json::object();
    for (std::size_t j = 0; j < allan::kTerms; ++j) {
        const allan::FittedTerm& term = fit.terms[j];
        Json entry = {{"value", term.detected ? proto::number_or_null(term.value) : Json(nullptr)},
                      {"sigma", term.detected ? proto::number_or_null(term.sigma) : Json(nullptr)},
                      {"unit", allan::kTermUnits[j]}};
        if (!term.detected) {
            entry["below"] = proto::number_or_null(term.below);
        }
        terms[allan::kTermNames[j]] = std::move(entry);
    }
    return terms;
}

/// What there is beside white noise, of whatever kind, and the sets of terms that explain the
/// curve.
Json slow_json(const allan::Fit& fit) {
    Json models = Json::array();
    for (const allan::NoiseModel& model : fit.models) {
        std::string terms;
        for (std::size_t j = 0; j < allan::kTerms; ++j)
            terms += model.terms[j] ? allan::kTermNames[j] : "";
        models.push_back({{"terms", terms}, {"weight", model.weight}});
    }
    const bool where = fit.slow.tau > 0;
    return {{"found", fit.slow.found},
            {"kind_determined", fit.slow.determined},
            {"tau", where ? Json(fit.slow.tau) : Json(nullptr)},
            {"ratio", where ? proto::number_or_null(fit.slow.ratio) : Json(nullptr)},
            {"verdict", fit.verdict()},
            {"models", std::move(models)}};
}

/// Without a known mean the slow class is known up to the constant a0, which is left out.
Json class_sums_json(const allan::ClassicalFit& fit, const std::vector<double>& taus) {
    allan::Polynomial a = fit.a;
    a[0] = fit.a0_known ? a[0] : 0;
    Json slow = Json::array();
    Json fast = Json::array();
    for (const double tau : taus) {
        const allan::ClassSums sums = allan::class_sums(a, tau);
        slow.push_back(proto::number_or_null(sums.slow));
        fast.push_back(proto::number_or_null(sums.fast));
    }
    return {{"a0_known", fit.a0_known}, {"slow", std::move(slow)}, {"fast", std::move(fast)}};
}

Json classical_json(const allan::ClassicalFit& fit, const std::vector<double>& taus) {
    Json a = Json::object();
    for (std::size_t k = 0; k < fit.a.size(); ++k) {
        a["a" + std::to_string(k)] =
            k == 0 && !fit.a0_known ? Json(nullptr) : proto::number_or_null(fit.a[k]);
    }
    Json terms = Json::object();
    for (std::size_t j = 0; j < allan::kTerms; ++j) {
        terms[allan::kTermNames[j]] = proto::number_or_null(fit.terms[j]);
    }
    return {{"a", std::move(a)},
            {"terms", std::move(terms)},
            {"class_sums", class_sums_json(fit, taus)},
            {"notes", fit.notes}};
}

Json alarms_json(const std::vector<allan::Alarm>& alarms) {
    Json list = Json::array();
    for (const allan::Alarm& alarm : alarms) {
        list.push_back({{"tau", alarm.tau},
                        {"ratio", proto::number_or_null(alarm.ratio)},
                        {"limit", proto::number_or_null(alarm.limit)},
                        {"since", alarm.since_s},
                        {"reading", allan::words_of(alarm.reading)}});
    }
    return list;
}

Json deviations(const std::vector<double>& variances, double to_deg_h) {
    Json list = Json::array();
    for (const double variance : variances)
        list.push_back(proto::number_or_null(std::sqrt(variance) / to_deg_h));
    return list;
}

/// What is the same of a window in a file and of one that has just come: deviations in the unit of
/// the input, null where gaps leave none.
Json window_json(const allan::WindowRow& row, double to_deg_h) {
    return {{"t", row.centre_s},
            {"mean", proto::number_or_null(row.mean)},
            {"missing", row.missing},
            {"refused", row.refused},
            {"dev", deviations(row.allan, to_deg_h)},
            {"fit", row.refused ? Json(nullptr) : fit_json(row.fit)}};
}

Json dynamic_json(const AllanAnalysis& analysis) {
    const double tau0 = analysis.request.tau0;
    std::vector<double> taus;
    for (const std::size_t m : analysis.factors) {
        taus.push_back(static_cast<double>(m) * tau0);
    }
    Json rows = Json::array();
    for (const auto& [row, alarms] : analysis.windows) {
        Json window = window_json(row, analysis.to_deg_h);
        window["classical"] = row.refused ? Json(nullptr) : classical_json(row.classical_fit, taus);
        window["alarms"] = alarms_json(alarms);
        rows.push_back(std::move(window));
    }
    Json summary = nullptr;
    if (analysis.summary && analysis.summary->windows > 0) {
        summary = {{"windows", analysis.summary->windows},
                   {"refused", analysis.summary->refused},
                   {"fit", fit_json(analysis.summary->fit)},
                   {"slow_noise", slow_json(analysis.summary->fit)},
                   {"classical", classical_json(analysis.summary->classical, taus)},
                   {"recomputation_faults", analysis.summary->faults}};
    }
    return {{"window", analysis.request.window_s},
            {"overlap", analysis.request.overlap},
            {"smallest_change", analysis.smallest_change > 0
                                    ? proto::number_or_null(analysis.smallest_change)
                                    : Json(nullptr)},
            {"taus", taus},
            {"rows", std::move(rows)},
            {"summary", std::move(summary)}};
}

}  // namespace

std::string allan_json(const AllanAnalysis& analysis) {
    Json root;
    root["type"] = allan::name_of(analysis.request.statistic);
    root["tau0"] = analysis.request.tau0;
    root["samples"] = analysis.samples;
    root["missing"] = analysis.missing;
    root["confidence"] = analysis.request.confidence;
    Json points = Json::array();
    for (const allan::Point& p : analysis.points) {
        points.push_back({{"m", p.m},
                          {"tau", p.tau},
                          {"dev", proto::number_or_null(p.dev)},
                          {"lo", proto::number_or_null(p.lo)},
                          {"hi", proto::number_or_null(p.hi)},
                          {"edf", proto::number_or_null(p.edf)},
                          {"n", p.n}});
    }
    root["points"] = std::move(points);
    if (analysis.fit) {
        root["fit"] = fit_json(*analysis.fit);
        root["slow_noise"] = slow_json(*analysis.fit);
    }
    if (analysis.request.window_s > 0) {
        root["dynamic"] = dynamic_json(analysis);
    }
    root["warnings"] = analysis.warnings;
    return proto::json_text(root);
}

std::string allan_window_json(const allan::WindowRow& row, const std::vector<allan::Alarm>& alarms,
                              const allan::DynamicAllan& dynamic, double to_deg_h) {
    Json window = window_json(row, to_deg_h);
    Json tau = Json::array();
    for (const std::size_t m : dynamic.factors())
        tau.push_back(static_cast<double>(m) * dynamic.settings().tau0);
    window["tau"] = std::move(tau);
    window["classical_dev"] = deviations(row.classical, to_deg_h);
    window["alarms"] = alarms_json(alarms);
    return window.dump();
}

}  // namespace vibrig::tool
