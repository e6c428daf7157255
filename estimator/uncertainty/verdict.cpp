#include "estimator/uncertainty/verdict.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "estimator/filter/parameters.hpp"
#include "estimator/filter/text.hpp"
#include "estimator/uncertainty/skew.hpp"

namespace vibrig::estimator::uncertainty {
namespace {

using Eigen::Index;

constexpr double kUnlikely = 1e-3;
constexpr double kNearBest = 3.0;  ///< of the logarithm of the odds
constexpr double kMostWidening = 5.0;
constexpr double kMostStep = 10.0;
constexpr double kMostInput = 5.0;  ///< deg/h/g, mean of the three input-axis terms

std::string dwell_name(const Assessment& a, int dwell) {
    std::string name = "dwell " + std::to_string(dwell);
    if (dwell >= 1 && dwell <= static_cast<int>(a.rates.size())) {
        const DwellRate& rate = a.rates[static_cast<std::size_t>(dwell - 1)];
        name += text(" (run %d position %d)", rate.run, rate.position);
    }
    return name;
}

/// The unknown of a pattern that stands out most from its sigma.
std::size_t strongest(const Evidence& e) {
    std::size_t best = 0;
    for (std::size_t i = 1; i < e.size.size(); ++i) {
        if (std::abs(e.size[i]) / e.sigma[i] > std::abs(e.size[best]) / e.sigma[best]) best = i;
    }
    return best;
}

void take_size(const Evidence& e, Reason& reason) {
    if (e.size.empty()) return;
    const std::size_t i = strongest(e);
    reason.size = e.size[i];
    reason.sigma = e.sigma[i];
    reason.unit = e.unit;
}

/// "a latitude 6.1 +- 0.7 arcmin off"
std::string words_of(const Evidence& e) {
    const std::size_t i = strongest(e);
    const double size = std::abs(e.size[i]), sigma = e.sigma[i];
    const std::string element = e.elements[i].empty() ? "" : " (" + e.elements[i] + ")";
    switch (e.pattern) {
        case Pattern::cross_axis:
            return text(
                "motion across the vertical of %.1f +- %.1f %% to the %s beyond what the "
                "accelerometers see",
                100 * size, 100 * sigma, e.elements[i].c_str());
        case Pattern::azimuth:
            return text("an azimuth %.1f +- %.1f arcmin off", size, sigma);
        case Pattern::latitude:
            return text("a latitude %.1f +- %.1f arcmin off", size, sigma);
        case Pattern::time_base:
            return text("a time base off by %.2g +- %.1g", size, sigma);
        case Pattern::encoder_zero:
            return text("an encoder zero%s %.1f +- %.1f arcmin off", element.c_str(), size, sigma);
        case Pattern::non_orthogonality:
            return text("gimbal axes%s %.1f +- %.1f arcmin from square", element.c_str(), size,
                        sigma);
        case Pattern::resolver_1:
        case Pattern::resolver_2:
        case Pattern::resolver_16:
            return text("resolver harmonics, %d per turn%s, of %.1f +- %.1f arcsec",
                        e.pattern == Pattern::resolver_16  ? 16
                        : e.pattern == Pattern::resolver_2 ? 2
                                                           : 1,
                        element.c_str(), size, sigma);
        default:
            return text("a cubic term %s of %.2g +- %.1g deg/h/g^3", e.elements[i].c_str(),
                        e.size[i], sigma);
    }
}

std::string words_of_state(const Assessment& a, const Evidence& e) {
    const std::string taken = text(": u widened %.2f times", a.widening);
    switch (e.pattern) {
        case Pattern::step: {
            const std::size_t i = strongest(e);
            return text("the bias of gyro %s stepped by %+.3f +- %.3f deg/h after ",
                        e.elements[i].c_str(), e.size[i], e.sigma[i]) +
                   dwell_name(a, e.after_dwell) + ": taken into u";
        }
        case Pattern::trend: {
            const std::size_t i = strongest(e);
            return text("the bias of gyro %s drifts by %+.3f +- %.3f deg/h per hour: taken into u",
                        e.elements[i].c_str(), e.size[i], e.sigma[i]);
        }
        case Pattern::walk:
            return "the bias walks from dwell to dwell" + taken;
        case Pattern::scatter:
            return text("dwells scatter by %.3f +- %.3f deg/h more than the noise explains",
                        e.size[0], e.sigma[0]) +
                   taken;
        case Pattern::unbalance_trend:
        case Pattern::unbalance_step: {
            const std::size_t i = strongest(e);
            return text("the mass unbalance %s %s by %+.3f +- %.3f %s", e.elements[i].c_str(),
                        e.pattern == Pattern::unbalance_step ? "stepped" : "drifts", e.size[i],
                        e.sigma[i], e.unit) +
                   (e.after_dwell > 0 ? " after " + dwell_name(a, e.after_dwell) : "") +
                   ": taken into u";
        }
        case Pattern::ramp: {
            const std::size_t i = strongest(e);
            return text(
                "within the dwells the drift of gyro %s grows by %+.3f +- %.3f deg/h per "
                "100 s: its mean is in D_F",
                e.elements[i].c_str(), e.size[i], e.sigma[i]);
        }
        default:
            return text("the rates scatter %.2f +- %.2f times as configured: gyro noise, or angles",
                        e.size[0], e.sigma[0]);
    }
}

struct Effect {
    double in_u = 0;
    std::size_t coefficient = 0;
};

/// What a pattern of the rates does to a constant-bias estimate, in u.
Effect effect_of(const Assessment& a, const Eigen::VectorXd& change) {
    Effect worst;
    for (std::size_t i = 0; i < kParameters; ++i) {
        const double in_u =
            std::abs(change[static_cast<Index>(internal_of(i))]) / a.coefficients[i].u;
        if (in_u > worst.in_u) worst = {in_u, i};
    }
    return worst;
}

/// Of a pattern whose input somebody has declared to be better known than the data say.
std::string contradiction(const Settings& settings, const Evidence& e) {
    const Inputs& in = settings.uncertainty;
    const auto declared = [](const char* key, const Declared& d, const char* unit) {
        return d.declared ? text(" (uncertainty.%s declares %.3g%s)", key, d.u, unit)
                          : std::string();
    };
    switch (e.pattern) {
        case Pattern::azimuth:
            return declared("azimuth_arcsec", in.azimuth_arcsec, " arcsec");
        case Pattern::latitude:
            return declared("latitude_arcsec", in.latitude_arcsec, " arcsec");
        case Pattern::time_base:
            return declared("time_base", in.time_base, "");
        case Pattern::encoder_zero:
            return declared("encoder_zero_arcsec", in.encoder_zero_arcsec[strongest(e) % 3],
                            " arcsec");
        case Pattern::non_orthogonality:
            return declared("non_orthogonality_arcsec",
                            in.non_orthogonality_arcsec[strongest(e) % 2], " arcsec");
        case Pattern::cross_axis:
            return declared("cross_axis", in.cross_axis[strongest(e) % 2], "");
        default:
            return {};
    }
}

/// What the odds of a pattern must be above to make the dwells so far "not valid". With each dwell
/// there is another look, and another chance of a false alarm: the l-th has a share of 1/l of what
/// a single one has (docs/theory/uncertainty.md). Of a campaign that has ended there is one.
double asked_of(const Assessment& a, Stage stage) {
    if (stage == Stage::ended) return Evidence::kNamedFrom;
    const int looks = 1 + std::max(0, a.degrees - kFewestDegrees) / static_cast<int>(kGyros);
    return Evidence::kNamedFrom + std::log(static_cast<double>(looks));
}

bool near_best(const Evidence& e, const std::vector<Evidence>& of) {
    return e.named() && e.log_odds >= of.front().log_odds - kNearBest;
}

void add_patterns(const Settings& settings, const Assessment& a, Stage stage,
                  std::vector<Reason>& list) {
    std::vector<const Evidence*> structural;
    for (const Evidence& e : a.evidence) {
        if (!near_best(e, a.evidence)) continue;
        if (is_structural(e.pattern)) {
            structural.push_back(&e);
            continue;
        }
        Reason reason{name_of(e.pattern), words_of_state(a, e)};
        reason.dwell = e.after_dwell;
        take_size(e, reason);
        list.push_back(std::move(reason));
    }
    const bool beside = structural.empty();
    for (const Evidence& e : a.beside_drift)
        if (beside && near_best(e, a.beside_drift)) structural.push_back(&e);
    if (structural.empty()) return;
    Reason reason{name_of(structural.front()->pattern),
                  beside ? "beside a drift the data fit " : "the data fit "};
    Effect worst;
    for (std::size_t i = 0; i < structural.size(); ++i) {
        reason.text += (i > 0 ? ", or " : "") + words_of(*structural[i]);
        const Effect effect = effect_of(a, structural[i]->change);
        if (effect.in_u > worst.in_u) worst = effect;
    }
    take_size(*structural.front(), reason);
    reason.largest_effect_u = worst.in_u;
    reason.coefficient = parameter_names()[worst.coefficient];
    reason.text += contradiction(settings, *structural.front());
    const bool sure = structural.front()->log_odds > asked_of(a, stage);
    reason.text += text(worst.in_u <= 1 ? ": %s by %.1f u at most"
                        : sure          ? ": %s by %.1f u; correct or declare it"
                                        : ": %s by %.1f u; the dwells to come will tell",
                        parameter_names()[worst.coefficient], worst.in_u);
    if (worst.in_u > 1 && sure) reason.level = Level::not_valid;
    list.push_back(std::move(reason));
}

void add_chi_square(const Assessment& a, std::vector<Reason>& list) {
    if (a.degrees < kFewestDegrees) {
        list.push_back({"dwells",
                        text("too few dwells to test the model (nu = %d)", std::max(0, a.degrees)),
                        Level::doubtful});
        return;
    }
    const bool named = !a.evidence.empty() && a.evidence.front().named();
    if (a.p < kUnlikely && !named)
        list.push_back({"unrecognised",
                        text("the dwells do not fit the model (chi-square %.0f of %d), pattern not "
                             "recognised",
                             a.chi_square, a.degrees),
                        Level::doubtful});
}

void add_signs(const Assessment& a, std::vector<Reason>& list) {
    double mean = 0;
    for (std::size_t j = 0; j < kGyros; ++j)
        mean += a.coefficients[kGroups * j + 1].value / static_cast<double>(kGyros);
    if (!(std::abs(mean) > kMostInput)) return;
    list.push_back({"sign",
                    text("latitude's sign or drift_sign: D_I of all gyros is %+.1f deg/h/g", mean),
                    Level::not_valid, mean, kNone, "deg/h/g"});
}

/// What the filter noticed dwell by dwell: why one is flagged says what is wrong, innovations out
/// of their band are what may follow from it.
enum class Noticed : std::uint8_t { flag, innovations };
void add_dwells(const Result& result, Noticed wanted, std::vector<Reason>& list) {
    int dwell = 0, bad = 0;
    bool flagged = false;
    Reason first;
    for (const DwellSummary& d : result.dwells) {
        ++dwell;
        const double band = std::max(0.1, 3.29 * std::sqrt(2.0 / (3.0 * std::max(1U, d.used))));
        const double white = std::max(0.1, 4.0 / std::sqrt(3.0 * std::max(1U, d.used)));
        std::string what;
        if (d.flagged && !d.followed) {
            what = d.reason;
        } else if (d.used >= 2 && std::abs(d.nis_per_dof - 1) > band) {
            what = text("innovations are %.2f times what is expected", d.nis_per_dof);
        } else if (d.used >= 2 && std::abs(d.innovation_correlation) > white) {
            what = text("innovations are correlated by %.2f", d.innovation_correlation);
        }
        if (what.empty() || ++bad > 1) continue;
        flagged = d.flagged && !d.followed;
        first.code = "dwell";
        first.dwell = dwell;
        first.text = text("run %d position %d: ", d.run, d.position) + what;
    }
    if (bad == 0 || flagged != (wanted == Noticed::flag)) return;
    if (bad > 1) first.text += text(", and %d more dwells", bad - 1);
    list.push_back(std::move(first));
}

/// "28 of 28 are rejected: no samples", with the most frequent reason; empty: fewer than half are,
/// and what is missing is missing for another one.
std::string words_of_rejected(const Result& result) {
    std::map<std::string, std::size_t> reasons;
    std::size_t rejected = 0;
    double force_g = 0;
    for (const DwellSummary& d : result.dwells) {
        if (!d.left_out) continue;
        ++rejected;
        ++reasons[d.reason];
        force_g += d.mean_force_g;
    }
    if (rejected == 0 || 2 * rejected < result.dwells.size()) return {};
    const auto most =
        std::ranges::max_element(reasons, {}, [](const auto& reason) { return reason.second; });
    std::string words = text("%zu of %zu are rejected, ", rejected, result.dwells.size()) +
                        (most->second < rejected ? text("%zu of them: ", most->second) : "") +
                        most->first;
    force_g /= static_cast<double>(rejected);
    constexpr double kGravity = 9.8;
    if (std::abs(force_g / kGravity - 1) < 0.02)
        words += text(" (it is %.2f: are the forces in m/s^2?)", force_g);
    return words;
}

void add_observability(const Result& result, std::vector<Reason>& list) {
    std::string names;
    for (std::size_t i = 0; i < kParameters; ++i) {
        if (!result.observable[i])
            names += std::string(names.empty() ? "" : " ") + parameter_names()[i];
    }
    if (names.empty()) return;
    const std::string rejected = words_of_rejected(result);
    if (result.rows.empty() && !result.dwells.empty()) {
        list.push_back(
            {"not observable",
             "no dwell is left to determine coefficients from: " +
                 (rejected.empty() ? "all are held out or of another vibration" : rejected),
             Level::not_valid});
    } else {
        list.push_back({"not observable",
                        "these positions and levels do not determine one by one " + names +
                            (rejected.empty() ? "" : "; of the dwells, " + rejected),
                        Level::not_valid});
    }
}

void add_cross_check(const CrossCheck& check, std::vector<Reason>& list) {
    if (!check.done) {
        list.push_back({"cross-check", "no batch over the same readings to check the filter by",
                        Level::not_valid});
    } else if (!check.agrees()) {
        list.push_back({"cross-check",
                        text("a batch over the same readings puts %s off by %.3f sigma (limit %g)",
                             check.coefficient.c_str(), check.largest, CrossCheck::kLimit),
                        Level::not_valid});
    }
}

void add_order(const Settings& settings, const Assessment& a, std::vector<Reason>& list) {
    if (!(a.worst_step > kMostStep) || settings.drift.power == Power::unbroken) return;
    list.push_back({"order",
                    "in this order a step of the bias between the runs cannot be told from D_F, "
                    "D_II, D_SS, D_OO: use the balanced order, or state that power was not "
                    "interrupted",
                    Level::doubtful});
}

std::string smallest_seen(const Assessment& a) {
    std::string out;
    for (const Evidence& e : a.evidence) {
        if (e.pattern != Pattern::azimuth && e.pattern != Pattern::cross_axis) continue;
        // What is determined beside the coefficients is no misfit that could hide.
        if (std::ranges::count(a.freed, name_of(e.pattern), &FreedUnknown::of_class) > 0) continue;
        out += out.empty() ? ", smallest misfit seen with 90 %: " : ", ";
        out += e.pattern == Pattern::azimuth
                   ? text("azimuth %.1f arcmin", e.smallest_seen)
                   : text("motion across the vertical %.1f %%", 100 * e.smallest_seen);
    }
    return out;
}

std::string sentence_of(const Assessment& a, const Verdict& verdict) {
    if (verdict.level == Level::valid)
        return text("valid: %d degrees of freedom, p = %.2g", a.degrees, a.p) + smallest_seen(a) +
               (a.over_frequency ? text("; over frequency: %zu dwells", a.rates.size()) : "");
    return std::string(word_of(verdict.level)) + ", because " + verdict.reasons.front().text;
}

}  // namespace

std::optional<Reason> motion_in_step(const Settings& settings, const Assessment& a) {
    if (settings.uncertainty.sync_motion != SyncMotionOf::warn) return {};
    double largest = 0;
    for (std::size_t i = 0; i < kParameters; ++i) {
        if (internal_of(i) / kGyros < kDii || !(a.coefficients[i].u > 0)) continue;
        largest = std::max(largest, a.sync_bound / std::sqrt(3.0) / a.coefficients[i].u);
    }
    if (!(largest > 0.3)) return {};
    return Reason{"sync motion",
                  text("the angles move by %.1f arcsec in step with the vibration: up to %.1e "
                       "deg/h/g^2 by coning, if it is the platform that moves",
                       a.sync_arcsec, a.sync_bound),
                  largest > 2 ? Level::not_valid : Level::doubtful,
                  a.sync_arcsec,
                  kNone,
                  "arcsec",
                  0,
                  largest};
}

void conclude(const Assessment& a, Verdict& verdict) {
    std::vector<Reason>& list = verdict.reasons;
    std::stable_sort(list.begin(), list.end(),
                     [](const Reason& x, const Reason& y) { return x.level > y.level; });
    verdict.level = list.empty() ? Level::valid : list.front().level;
    verdict.sentence = sentence_of(a, verdict);
}

Verdict judge(const Settings& settings, const Result& result, const Assessment& a, Stage stage) {
    Verdict verdict;
    std::vector<Reason>& list = verdict.reasons;
    if (stage == Stage::ended) add_observability(result, list);
    add_dwells(result, Noticed::flag, list);
    // Of reasons alike in level what names a cause comes first, then what may be its consequence:
    // angles that move with the vibration look like noise.
    if (a.done) {
        if (auto reason = motion_in_step(settings, a)) list.push_back(std::move(*reason));
        if (auto reason = accelerometers_apart(settings, result.rows, a))
            list.push_back(std::move(*reason));
        if (!a.freed_settled)
            list.push_back({"freed",
                            "what estimator.free names is too far off to be determined: measure "
                            "it, and state it in the configuration",
                            Level::not_valid});
        add_patterns(settings, a, stage, list);
        add_chi_square(a, list);
        add_order(settings, a, list);
        add_signs(a, list);
        add_dwells(result, Noticed::innovations, list);
        add_cross_check(result.cross_check, list);
        if (a.widening > kMostWidening && !list.empty())
            list.push_back({"widening", text("u is %.1f times what the noise explains", a.widening),
                            Level::not_valid, a.widening});
    } else {
        add_dwells(result, Noticed::innovations, list);
        add_cross_check(result.cross_check, list);
        if (settings.method == Method::joint) {
            add_chi_square(a, list);
        } else {
            list.push_back({"not tested",
                            "the two-step route tests nothing: neither drift nor misfit shows, and "
                            "there is no uncertainty",
                            Level::doubtful});
        }
    }
    conclude(a, verdict);
    return verdict;
}

void contradict(Verdict& verdict, const std::string& contradiction) {
    if (contradiction.empty()) return;
    const std::string text = "the configuration does not fit the recording: " + contradiction;
    verdict.level = Level::not_valid;
    verdict.reasons.insert(verdict.reasons.begin(), {"configuration", text, Level::not_valid});
    verdict.sentence = "not valid, because " + text;
}

}  // namespace vibrig::estimator::uncertainty
