#include "daemon/archive/trend.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "daemon/archive/vibration.hpp"
#include "estimator/uncertainty/distributions.hpp"

namespace vibrig::archive {

using estimator::uncertainty::chi_square_tail;
using estimator::uncertainty::f_tail;
using estimator::uncertainty::student_quantile;

namespace {

constexpr double kNotKnown = std::numeric_limits<double>::quiet_NaN();
constexpr double kNanosecondsPerHour = 3.6e12;
constexpr std::size_t kFewestBefore = 2;

double squared(double x) { return x * x; }

/// P(|t| >= this) with `dof` degrees of freedom.
double two_sided(double t, double dof) { return f_tail(squared(t), 1, dof); }

/// Of so many tests each, so that all together have this level.
double level_of_each(double level, std::size_t tests) {
    return tests == 0 ? level : 1 - std::pow(1 - level, 1 / static_cast<double>(tests));
}

/// Of values, weighted by one over their variances.
struct WeightedMean {
    double weight = 0, weight_squared = 0, mean = 0;

    void add(double value, double variance) {
        const double w = 1 / variance;
        weight += w;
        weight_squared += squared(w);
        mean += w * (value - mean) / weight;
    }
};

}  // namespace

Variance analyse_variance(const std::vector<double>& value, const std::vector<double>& u,
                          const std::vector<std::size_t>& group) {
    Variance out;
    std::map<std::size_t, WeightedMean> groups;
    for (std::size_t i = 0; i < value.size(); ++i) groups[group[i]].add(value[i], squared(u[i]));
    double q_within = 0, weight = 0, within_room = 0;
    for (std::size_t i = 0; i < value.size(); ++i)
        q_within += squared((value[i] - groups.at(group[i]).mean) / u[i]);
    for (const auto& [number, of] : groups) {
        weight += of.weight;
        out.mean += of.weight * of.mean;
        within_room += of.weight - of.weight_squared / of.weight;
    }
    out.mean /= weight;
    const auto k = static_cast<double>(groups.size());
    const double nu_within = static_cast<double>(value.size()) - k;
    // DerSimonian and Laird's moments, group by group.
    double variance_within = 0;
    if (nu_within > 0) {
        out.within = {true,
                      0,
                      q_within / nu_within,
                      nu_within,
                      std::numeric_limits<double>::infinity(),
                      chi_square_tail(q_within, nu_within)};
        variance_within = std::max(0.0, (q_within - nu_within) / within_room);
        out.within.value = std::sqrt(variance_within);
    }
    double q_between = 0, between_room = 0, expected = 0;
    for (const auto& [number, of] : groups) {
        const double rest = 1 - of.weight / weight;
        const double own = 1 / of.weight + variance_within * of.weight_squared / squared(of.weight);
        q_between += of.weight * squared(of.mean - out.mean);
        expected += of.weight * rest * own;
        between_room += of.weight * rest;
    }
    if (k > 1) {
        const double mean_square = q_between / (k - 1);
        Instability& of = out.between;
        of.tested = true;
        of.dof = k - 1;
        // The scatter within can only be larger than the uncertainties explain.
        const bool against_within = nu_within > 0 && q_within > nu_within;
        of.f = against_within ? mean_square / (q_within / nu_within) : mean_square;
        of.dof_of_error = against_within ? nu_within : std::numeric_limits<double>::infinity();
        of.p = f_tail(of.f, of.dof, of.dof_of_error);
        of.value = std::sqrt(std::max(0.0, (q_between - expected) / between_room));
    }
    double variance = 0;
    for (const auto& [number, of] : groups)
        variance += squared(of.weight / weight) *
                    (1 / of.weight + variance_within * of.weight_squared / squared(of.weight) +
                     squared(out.between.value));
    out.mean_sigma = std::sqrt(variance);
    // A scatter is known no better than by the number of turn-ons, or of campaigns within them.
    const Instability& dominant = out.between.value > 0 ? out.between : out.within;
    if (dominant.value > 0) out.mean_dof = dominant.dof;
    return out;
}

std::optional<Judgement> judge(double value, double u, const std::vector<double>& before,
                               const std::vector<double>& before_u) {
    if (before.size() < kFewestBefore) return {};
    WeightedMean own, with;
    for (std::size_t i = 0; i < before.size(); ++i) own.add(before[i], squared(before_u[i]));
    double q = 0;
    for (std::size_t i = 0; i < before.size(); ++i)
        q += squared((before[i] - own.mean) / before_u[i]);
    Judgement out;
    out.dof = static_cast<double>(before.size() - 1);
    const double instability = std::max(
        0.0, (q - out.dof) / (own.weight - own.weight_squared / own.weight));  // its square
    // With it the weights are others; of equal uncertainties the mean stays.
    for (std::size_t i = 0; i < before.size(); ++i)
        with.add(before[i], squared(before_u[i]) + instability);
    out.expected = with.mean;
    out.sigma = std::sqrt(squared(u) + instability + 1 / with.weight);
    out.t = (value - with.mean) / out.sigma;
    out.p = two_sided(out.t, out.dof);
    return out;
}

namespace {

void name_outliers(Trend& trend) {
    std::vector<std::size_t> tests(trend.campaigns.size(), 0);
    for (const auto& of : trend.coefficients)
        if (of.points.size() > kFewestBefore)
            for (const auto& point : of.points) ++tests[point.campaign];
    for (auto& of : trend.coefficients) {
        if (of.points.size() <= kFewestBefore) continue;
        for (std::size_t i = 0; i < of.points.size(); ++i) {
            std::vector<double> others, others_u;
            for (std::size_t j = 0; j < of.points.size(); ++j) {
                if (j == i) continue;
                others.push_back(of.points[j].of.value);
                others_u.push_back(of.points[j].u);
            }
            TrendPoint& point = of.points[i];
            const auto judged = judge(point.of.value, point.u, others, others_u);
            if (!judged) continue;
            point.t = judged->t;
            point.p = judged->p;
            point.outlier = judged->p < level_of_each(kFalseAlarm, tests[point.campaign] *
                                                                       trend.campaigns.size());
        }
    }
}

/// One coefficient of all campaigns, without what is of another vibration: those campaigns are
/// `others`, by their places.
CoefficientTrend points_of(std::size_t position, const Coefficients& like, Trend& trend,
                           std::set<std::size_t>& others) {
    CoefficientTrend of;
    of.position = position;
    const Coefficient* reference = like[position] ? &*like[position] : nullptr;
    for (auto one = trend.campaigns.rbegin(); one != trend.campaigns.rend() && !reference; ++one)
        if (one->coefficients[position]) reference = &*one->coefficients[position];
    if (reference == nullptr) return of;
    of.at_hz = reference->at_hz;
    if (estimator::is_quadratic(position)) trend.vibrations.insert(vibration_text(of.at_hz));
    for (std::size_t i = 0; i < trend.campaigns.size(); ++i) {
        const auto& c = trend.campaigns[i].coefficients[position];
        // What one rig has wrong it has wrong each time: between its campaigns only noise
        // differs.
        const double own = c ? (trend.several_rigs ? c->u : c->u_a) : 0;
        if (!(own > 0)) continue;
        if (same_vibration(c->at_hz, of.at_hz)) {
            of.points.push_back({i, *c, own, kNotKnown, 1, false});
            continue;
        }
        others.insert(i);
        trend.other_vibrations.insert(vibration_text(c->at_hz));
    }
    return of;
}

}  // namespace

Trend trend_of(std::vector<Entry> campaigns, double shutdown_after_h, bool simulated,
               const Coefficients& like) {
    Trend trend;
    trend.simulated = simulated;
    trend.elsewhere = std::erase_if(
        campaigns, [simulated](const Entry& one) { return one.simulated != simulated; });
    const std::size_t all = campaigns.size();
    std::erase_if(campaigns, [](const Entry& one) {
        return one.verdict == "not valid" ||
               std::ranges::none_of(one.coefficients, [](const auto& c) { return c.has_value(); });
    });
    trend.left_out = all - campaigns.size();
    trend.campaigns = std::move(campaigns);
    std::size_t turn = 0;
    for (std::size_t i = 0; i < trend.campaigns.size(); ++i) {
        if (i > 0) {
            const Entry &before = trend.campaigns[i - 1], &now = trend.campaigns[i];
            trend.several_rigs = trend.several_rigs || before.rig != now.rig;
            const auto pause = static_cast<double>(now.started_utc_ns - before.ended_utc_ns);
            if (pause > shutdown_after_h * kNanosecondsPerHour || before.rig != now.rig) ++turn;
        }
        trend.turn.push_back(turn);
    }
    std::set<std::size_t> others;
    for (std::size_t position = 0; position < estimator::kParameters; ++position) {
        CoefficientTrend of = points_of(position, like, trend, others);
        if (of.points.empty()) continue;
        std::vector<double> value, u;
        std::vector<std::size_t> group;
        for (const TrendPoint& point : of.points) {
            value.push_back(point.of.value);
            u.push_back(point.u);
            group.push_back(trend.turn[point.campaign]);
        }
        const Variance found = analyse_variance(value, u, group);
        of.operating = found.within;
        of.shutdown = found.between;
        of.mean = found.mean;
        const double half = student_quantile(0.95, found.mean_dof) * found.mean_sigma;
        of.mean_low = of.mean - half;
        of.mean_high = of.mean + half;
        trend.coefficients.push_back(std::move(of));
    }
    trend.of_other_vibration = others.size();
    name_outliers(trend);
    return trend;
}

std::string vibration_words(const Trend& trend) {
    if (trend.vibrations.empty()) return {};
    const bool alone = trend.vibrations.contains(vibration_text(kAtNoFrequency));
    std::string words =
        fmt::format("quadratic coefficients: {}{}", fmt::join(trend.vibrations, ", "),
                    alone ? ", which are compared with none" : "");
    if (trend.of_other_vibration > 0)
        words += fmt::format("; those of {} campaigns {}({}) left out", trend.of_other_vibration,
                             alone ? "" : "of another vibration ",
                             fmt::join(trend.other_vibrations, ", "));
    return words;
}

std::vector<Moved> moved(const Entry& campaign, const std::vector<Entry>& history) {
    std::vector<const Entry*> earlier;
    bool several_rigs = false;
    for (const Entry& one : history) {
        if (one.hash == campaign.hash || one.verdict == "not valid" ||
            one.simulated != campaign.simulated || one.started_utc_ns >= campaign.started_utc_ns)
            continue;
        earlier.push_back(&one);
        several_rigs = several_rigs || one.rig != campaign.rig;
    }
    const auto u_of = [several_rigs](const Coefficient& c) { return several_rigs ? c.u : c.u_a; };
    std::vector<Moved> tested;
    for (std::size_t position = 0; position < estimator::kParameters; ++position) {
        const auto& now = campaign.coefficients[position];
        if (!now) continue;
        std::vector<double> before, before_u;
        for (const Entry* one : earlier) {
            const auto& c = one->coefficients[position];
            if (!c || !(u_of(*c) > 0) || !same_vibration(c->at_hz, now->at_hz)) continue;
            before.push_back(c->value);
            before_u.push_back(u_of(*c));
        }
        if (const auto by = judge(now->value, u_of(*now), before, before_u))
            tested.push_back({position, now->value, *by});
    }
    const double level = level_of_each(kFalseAlarm, tested.size());
    std::erase_if(tested, [level](const Moved& one) { return !(one.by.p < level); });
    return tested;
}

}  // namespace vibrig::archive
