#include "daemon/results/assessment_json.hpp"

#include <array>

namespace vibrig::tool {

namespace {

using Json = nlohmann::ordered_json;
using namespace estimator::uncertainty;

const char* word_of(Shape shape) {
    constexpr std::array<const char*, 4> kWords{"normal", "rectangular", "triangular", "arcsine"};
    return kWords[static_cast<std::size_t>(shape)];
}

Json budget(const std::vector<Contribution>& contributions) {
    Json list = Json::array();
    for (const Contribution& one : contributions)
        list.push_back({{"input", one.input},
                        {"element", text_or_null(one.element)},
                        {"c", number_or_null(one.sensitivity)},
                        {"u", number_or_null(one.u)},
                        {"contribution", number_or_null(one.contribution)},
                        {"shape", word_of(one.shape)},
                        {"dof", number_or_null(one.dof)},
                        {"declared", one.declared}});
    return list;
}

Json verdict(const Verdict& of) {
    Json reasons = Json::array();
    for (const Reason& reason : of.reasons)
        reasons.push_back({{"code", reason.code},
                           {"text", reason.text},
                           {"level", static_cast<int>(reason.level)},
                           {"size", number_or_null(reason.size)},
                           {"sigma", number_or_null(reason.sigma)},
                           {"unit", text_or_null(reason.unit)},
                           {"dwell", reason.dwell > 0 ? Json(reason.dwell) : Json(nullptr)},
                           {"largest_effect_u", number_or_null(reason.largest_effect_u)},
                           {"coefficient", text_or_null(reason.coefficient)}});
    return {{"level", static_cast<int>(of.level)},
            {"word", estimator::uncertainty::word_of(of.level)},
            {"sentence", of.sentence},
            {"reasons", std::move(reasons)}};
}

Json fit(const Assessment& a) {
    Json evidence = Json::object(), smallest = Json::object();
    for (const Evidence& e : a.evidence) {
        evidence[name_of(e.pattern)] = number_or_null(e.log_odds);
        if (e.smallest_seen > 0) smallest[name_of(e.pattern)] = number_or_null(e.smallest_seen);
    }
    return {{"chi_square", number_or_null(a.chi_square)},
            {"dof", a.degrees},
            {"p", number_or_null(a.p)},
            {"ramp_chi_square", number_or_null(a.ramps.chi_square)},
            {"ramp_dof", a.ramps.degrees},
            {"birge", number_or_null(a.birge)},
            {"widening", number_or_null(a.widening)},
            {"worst_step", number_or_null(a.worst_step)},
            {"evidence", std::move(evidence)},
            {"smallest_seen", std::move(smallest)}};
}

Json drift(const Assessment& a) {
    constexpr std::array<const char*, 3> kGyros{"x", "y", "z"};
    Json weights = Json::array(), now = Json::array(), trend = Json::array(), step = nullptr;
    std::size_t clearest = 0;
    for (std::size_t j = 0; j < 3; ++j) {
        const DriftAverage& gyro = a.drift[j];
        const DriftWeights& w = gyro.weights;
        weights.push_back({{"none", w.none},
                           {"scatter", w.scatter},
                           {"walk", w.walk},
                           {"trend", w.trend},
                           {"step", w.step},
                           {"mass_unbalance", w.unbalance}});
        trend.push_back(number_or_null(gyro.trend_deg_h_h));
        now.push_back({{"value", number_or_null(gyro.bias_now)},
                       {"sigma", number_or_null(gyro.bias_now_sigma)}});
        if (gyro.step.weight > a.drift[clearest].step.weight) clearest = j;
    }
    if (const DriftStep& of = a.drift[clearest].step; of.weight > 0.5)
        step = {{"gyro", kGyros[clearest]},
                {"after_dwell", of.after_dwell},
                {"size", number_or_null(of.size)},
                {"sigma", number_or_null(of.sigma)}};
    constexpr std::array<const char*, 3> kModels{"auto", "constant", "walk"};
    return {{"model", kModels[static_cast<std::size_t>(a.model)]},
            {"times", a.times_assumed ? "assumed" : "measured"},
            {"weights", std::move(weights)},
            {"step", std::move(step)},
            {"trend_deg_h_h", std::move(trend)},
            {"ramp_deg_h_per_100_s", numbers_or_null(a.ramps.mean)},
            {"bias_now", std::move(now)}};
}

Json cross_axis(const Assessment& a) {
    Json list = Json::array();
    for (const CrossAxis& of : a.cross_axis)
        list.push_back({{"run", of.run},
                        {"c_n", number_or_null(of.gamma[3])},
                        {"c_e", number_or_null(of.gamma[5])},
                        {"gamma", numbers_or_null(of.gamma)}});
    return list;
}

Json dwell_rates(const Assessment& a) {
    Json list = Json::array();
    for (const DwellRate& rate : a.rates)
        list.push_back({{"run", rate.run},
                        {"position", rate.position},
                        {"level", number_or_null(rate.level_g)},
                        {"t_h", number_or_null(rate.time_h)},
                        {"rate", numbers_or_null(rate.rate)},
                        {"sigma", numbers_or_null(rate.sigma)},
                        {"residual", numbers_or_null(rate.residual)},
                        {"residual_sigma", numbers_or_null(rate.residual_sigma)}});
    return list;
}

Json freed(const Assessment& a) {
    Json list = Json::array();
    for (const FreedUnknown& of : a.freed)
        list.push_back({{"class", of.of_class},
                        {"element", text_or_null(of.element)},
                        {"value", number_or_null(of.value)},
                        {"sigma", number_or_null(of.sigma)},
                        {"unit", text_or_null(of.unit)}});
    return list;
}

}  // namespace

Json coefficient_json(const Coefficient& c) {
    return {{"noise", number_or_null(c.noise)},
            {"u_a", number_or_null(c.u_a)},
            {"u_b", number_or_null(c.u_b)},
            {"u", number_or_null(c.u)},
            {"nu_eff", number_or_null(c.nu_eff)},
            {"k", number_or_null(c.k)},
            {"expanded", number_or_null(c.expanded)},
            {"u_use", number_or_null(c.u_use)},
            {"budget", budget(c.budget)},
            {"correlation_variance", number_or_null(c.u > 0 ? c.correlation : kNone)}};
}

Json assessment_json(const Assessment& a) {
    Json root{{"verdict", verdict(a.verdict)}};
    if (!a.done) return root;
    root["covariance_combined"] = matrix_or_null(a.covariance_combined);
    root["fit"] = fit(a);
    root["drift"] = drift(a);
    root["cross_axis"] = cross_axis(a);
    root["sync_motion_arcsec"] = number_or_null(a.sync_arcsec);
    if (!a.freed.empty()) root["freed"] = freed(a);
    root["dwell_rates"] = dwell_rates(a);
    return root;
}

Json monte_carlo_json(const MonteCarlo& of) {
    return {{"blocks", of.blocks},
            {"digits", of.digits},
            {"stable", of.stable},
            {"gum_confirmed", of.gum_confirmed},
            {"largest_difference", number_or_null(of.largest_difference)},
            {"nonlinearity", number_or_null(of.nonlinearity)}};
}

}  // namespace vibrig::tool
