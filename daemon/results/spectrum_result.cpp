#include "daemon/results/spectrum_result.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>

#include "estimator/filter/parameters.hpp"
#include "estimator/filter/text.hpp"
#include "estimator/spectrum/prediction.hpp"
#include "estimator/uncertainty/coverage.hpp"
#include "estimator/uncertainty/verdict.hpp"

namespace vibrig::tool {

namespace {

using Eigen::Index;
using Eigen::VectorXd;
using estimator::kParameters;
using namespace estimator::spectrum;
namespace uncertainty = estimator::uncertainty;

/// The rates of gyro j by what is in force.
VectorXd modelled(const SpectrumResult& of, std::size_t j) {
    if (of.analysis.form == Form::groups)
        return of.table.grouped(j) * of.analysis.groups.value.col(static_cast<Index>(j));
    const Hypothesis& best = of.analysis.gyros[j].list.front();
    return design(of.table, j, best.resonances) * best.x;
}

/// The rates of all dwells, with what is left of them.
std::vector<uncertainty::DwellRate> rates_of(const SpectrumResult& of) {
    std::vector<uncertainty::DwellRate> list;
    std::array<VectorXd, 3> model;
    for (std::size_t j = 0; j < 3; ++j) model[j] = modelled(of, j);
    const auto times = uncertainty::dwell_table(of.table.rows());
    for (std::size_t k = 0; k < of.table.list().size(); ++k) {
        const estimator::DwellRow& row = of.table.list()[k].row;
        auto rate = uncertainty::rate_of(row, times.time_h[static_cast<Index>(k)]);
        for (std::size_t j = 0; j < 3; ++j) {
            rate.residual_sigma[j] =
                of.analysis.rate_sigma(static_cast<Index>(k), static_cast<Index>(j));
            rate.residual[j] = row.rate[j] - model[j][static_cast<Index>(k)];
        }
        list.push_back(rate);
    }
    return list;
}

/// Coefficients of gyro j by what is in force.
Index fitted(const SpectrumResult& of, std::size_t j) {
    return of.analysis.form == Form::groups ? of.table.grouped(j).cols()
                                            : of.analysis.gyros[j].list.front().x.size();
}

void tell_coefficients(const SpectrumResult& spectrum, const uncertainty::Inputs& inputs,
                       uncertainty::Assessment& to) {
    const Analysis& of = spectrum.analysis;
    const Eigen::MatrixXd combined =
        of.covariance + uncertainty::unseen_covariance(inputs, of.value, to.sync_bound);
    for (std::size_t i = 0; i < kParameters; ++i) {
        uncertainty::Coefficient& c = to.coefficients[i];
        if (!std::isfinite(c.value)) continue;
        const std::size_t internal = estimator::internal_of(i);
        const auto a = static_cast<Index>(internal);
        c.value = of.value[a];
        c.u_a = std::sqrt(of.covariance_a(a, a));
        c.noise = std::min(of.noise[a], c.u_a);
        c.u = std::sqrt(combined(a, a));
        c.u_b = std::sqrt(std::max(0.0, c.u * c.u - c.u_a * c.u_a));
        c.budget.clear();
        const auto infinite = std::numeric_limits<double>::infinity();
        c.budget.push_back({"noise and drift states", "", 1, c.u_a, c.u_a,
                            uncertainty::Shape::normal, infinite, true});
        for (const Effect& effect : of.model.effects) {
            const double change = effect.change[internal % estimator::kGyros]
                                               [static_cast<Index>(internal / estimator::kGyros)];
            const uncertainty::Declared& d = effect.declared;
            const double sensitivity = d.u > 0 ? change / d.u : 0;
            c.budget.push_back({effect.input, effect.element, sensitivity, d.u, std::abs(change),
                                d.shape, d.dof, d.declared});
        }
        uncertainty::add_correlations(of.model.correlated, c);
        uncertainty::add_unseen(inputs, of.value, to.sync_bound, internal, c.budget);
        const std::size_t j = internal % estimator::kGyros;
        uncertainty::expand(
            inputs, internal, static_cast<double>(spectrum.table.dwells() - fitted(spectrum, j)),
            uncertainty::growth_in_dwell(to.ramps.mean[j], spectrum.table.rows()), c);
        for (std::size_t k = 0; k < kParameters; ++k) {
            const auto b = static_cast<Index>(estimator::internal_of(k));
            if (!std::isfinite(to.coefficients[k].u)) continue;
            to.covariance_combined(static_cast<Index>(i), static_cast<Index>(k)) = combined(a, b);
        }
    }
}

void doubt(uncertainty::Assessment& assessed, const std::string& text,
           uncertainty::Level level = uncertainty::Level::doubtful) {
    assessed.verdict.reasons.push_back({"spectrum", text, level});
    uncertainty::conclude(assessed, assessed.verdict);
}

/// Of the dwells at other frequencies no pattern is looked for: that they do not fit is told here.
/// Seven dwells for six coefficients do not tell which of them it is.
void tell_fit(const SpectrumResult& of, uncertainty::Assessment& to) {
    const GroupedFit& fit = of.analysis.fit;
    if (!(fit.p < kAlarm) || fit.degrees < uncertainty::kFewestDegrees) return;
    const auto& kind = of.table.list()[fit.worst_rate / estimator::kGyros].kind;
    const Kind* of_kind = kind ? &of.table.kinds()[*kind] : nullptr;
    const std::string with = of_kind == nullptr ? "at rest"
                             : of_kind->profile.empty()
                                 ? estimator::text("at %.4g Hz", of_kind->hz())
                                 : "under " + of_kind->profile;
    doubt(to,
          estimator::text("the dwells do not fit coefficients of each frequency (chi-square "
                          "%.0f of %d), gyro %c %s least: taken into u",
                          fit.chi_square, fit.degrees, "xyz"[fit.worst_rate % 3], with.c_str()));
}

/// Of coefficients that the dwells at the reference frequency leave open: which all of them do not.
void tell_determined(const Analysis& of, const estimator::Settings& settings,
                     uncertainty::Assessment& to) {
    constexpr double kDetermined = 0.25;  // of the prior's variance, as the filter has it
    const estimator::ParameterArray prior = estimator::prior_sigma(settings);
    std::string names;
    for (std::size_t i = 0; i < kParameters; ++i) {
        const std::size_t internal = estimator::internal_of(i);
        const auto a = static_cast<Index>(internal);
        const bool open = !std::isfinite(to.coefficients[i].value);
        if (open && of.covariance_a(a, a) < kDetermined * prior[internal] * prior[internal])
            names += std::string(" ") + estimator::parameter_names()[i];
    }
    for (uncertainty::Reason& reason : to.verdict.reasons)
        if (reason.code == "not observable" && !names.empty())
            reason.text += " at the reference frequency; all frequencies together determine" +
                           names + ", see the result's \"spectrum\"";
}

/// Number, from 1, that a dwell of the reference frequency has among all of them.
int among_all(int number, const std::vector<uncertainty::DwellRate>& own,
              const std::vector<uncertainty::DwellRate>& all) {
    if (number < 1 || static_cast<std::size_t>(number) > own.size()) return number;
    const uncertainty::DwellRate& one = own[static_cast<std::size_t>(number) - 1];
    const auto at = std::ranges::find_if(all, [&one](const uncertainty::DwellRate& other) {
        return other.run == one.run && other.position == one.position && other.rate == one.rate;
    });
    return at == all.end() ? number : static_cast<int>(at - all.begin()) + 1;
}

/// The rates of all dwells in place of those at the reference frequency, and what counts them.
void take_rates(const SpectrumResult& spectrum, uncertainty::Assessment& to) {
    const auto own = std::exchange(to.rates, rates_of(spectrum));
    // A filter's own reason counts all dwells of the campaign.
    for (uncertainty::Reason& reason : to.verdict.reasons)
        if (reason.code != "dwell") reason.dwell = among_all(reason.dwell, own, to.rates);
    for (auto& gyro : to.drift)
        gyro.step.after_dwell = among_all(gyro.step.after_dwell, own, to.rates);
}

/// With what a row shook; nothing: it is not known. No bands: at rest.
std::optional<Kind> kind_of(const estimator::Settings& settings, const estimator::DwellRow& row,
                            const Shaken& shaken) {
    if (row.random) {
        const auto profile = std::ranges::find(shaken.profiles, row.profile,
                                               [](const auto& one) { return one.first; });
        return profile == shaken.profiles.end() ? std::nullopt : std::optional(profile->second);
    }
    if (!(row.vibration.kappa > 1)) return Kind{};
    const double hz = row.commanded_hz > 0 ? row.commanded_hz : settings.frequency_hz;
    return Kind{"", {{hz, 1, 0}}};
}

}  // namespace

double SpectrumResult::at_hz(std::size_t parameter) const {
    const std::size_t gyro = parameter / estimator::kGroups;
    if (!estimator::is_quadratic(parameter) || analysis.gyros[gyro].resonant()) return 0;
    return compromise ? std::numeric_limits<double>::quiet_NaN() : reference_hz;
}

bool SpectrumResult::same_at_all() const {
    return analysis.form == Form::flat && !analysis.flat.alarm && analysis.model.refusal.empty();
}

Form form_of(const std::string& name) {
    for (const Form form : {Form::automatic, Form::flat, Form::groups, Form::resonance}) {
        if (name == name_of(form)) return form;
    }
    throw std::runtime_error("found '" + name + "', expected auto, flat, groups or resonance");
}

SpectrumResult spectrum_of(const estimator::Settings& settings, std::vector<SpectralDwell> dwells,
                           std::vector<Kind> kinds, Form form, std::vector<Sweep> sweeps) {
    SpectralTable table(settings, std::move(dwells), std::move(kinds));
    Analysis analysis = analyse(settings, table, form, sweeps);
    const double hz = table.kinds().empty() ? 0 : table.kinds().front().hz();
    const bool compromise = analysis.form == Form::flat && analysis.flat.alarm;
    return {std::move(analysis), std::move(table), hz, {}, std::move(sweeps), compromise};
}

std::optional<SpectrumResult> spectrum_of(const estimator::Settings& settings,
                                          const std::vector<estimator::DwellRow>& rows,
                                          Shaken shaken, Form form) {
    const auto& psds = shaken.psds;
    std::vector<SpectralDwell> dwells;
    std::vector<Kind> kinds;
    std::vector<SpectrumResult::HeldOut> held_out;
    for (const estimator::DwellRow& row : rows) {
        std::optional<Kind> kind = kind_of(settings, row, shaken);
        if (!kind) continue;
        const bool own = row.psd > 0 && row.psd <= psds.size();
        if (row.held_out) {
            if (own) kind->bands = psds[row.psd - 1];
            held_out.push_back({row, std::move(*kind)});
            continue;
        }
        dwells.push_back({row, {}, row.relative_error});
        if (own) dwells.back().bands = psds[row.psd - 1];
        if (kind->bands.empty()) continue;
        const auto known = std::ranges::find_if(kinds, [&kind](const Kind& one) {
            return one.profile == kind->profile && (!one.profile.empty() || one.hz() == kind->hz());
        });
        dwells.back().kind = static_cast<std::size_t>(known - kinds.begin());
        if (known == kinds.end()) kinds.push_back(std::move(*kind));
    }
    std::erase_if(shaken.sweeps, [](const Sweep& sweep) { return sweep.known() == 0; });
    const bool several = kinds.size() >= 2 || (kinds.size() == 1 && !shaken.sweeps.empty());
    if (!several || dwells.size() < 2 || dwells.size() > kMostSpectralDwells) return std::nullopt;
    SpectrumResult found =
        spectrum_of(settings, std::move(dwells), std::move(kinds), form, std::move(shaken.sweeps));
    found.held_out = std::move(held_out);
    return found;
}

void adopt(const SpectrumResult& spectrum, const estimator::Settings& settings,
           uncertainty::Assessment& assessed) {
    if (!spectrum.several()) return;
    const Analysis& of = spectrum.analysis;
    assessed.over_frequency = true;
    assessed.combinations.clear();  // of the reference frequency's fit
    // It grows with the frequency.
    uncertainty::take_sync(spectrum.table.rows(), assessed);
    tell_coefficients(spectrum, settings.uncertainty, assessed);
    tell_determined(of, settings, assessed);
    take_rates(spectrum, assessed);
    auto& reasons = assessed.verdict.reasons;
    std::erase_if(reasons, [](const auto& reason) { return reason.code == "sync motion"; });
    if (auto motion = uncertainty::motion_in_step(settings, assessed))
        reasons.insert(reasons.begin(), std::move(*motion));
    uncertainty::conclude(assessed, assessed.verdict);
    if (!assessed.freed.empty())
        doubt(assessed,
              "over frequency nothing is freed: an error in what estimator.free names is in the "
              "coefficients",
              uncertainty::Level::not_valid);
    tell_fit(spectrum, assessed);
    // A resonance that is a little likelier than none is no explanation.
    const bool explained =
        of.form == Form::resonance &&
        std::ranges::any_of(of.gyros, [](const auto& gyro) { return gyro.named(); });
    if (of.flat.alarm && !explained)
        doubt(assessed, "quadratic coefficients depend on the frequency (p = " +
                            std::to_string(of.flat.p) + " that they do not)");
    if (!of.model.refusal.empty()) doubt(assessed, of.model.refusal);
}

Assessed assess(const estimator::Settings& settings, const std::optional<noise::Found>& found,
                const estimator::Result& result, const std::vector<estimator::DwellRow>& rows,
                Shaken shaken, Form form) {
    Assessed out{dwells::assess(settings, found, result), {}};
    if (!out.assessed.done) return out;
    const auto in_force = dwells::Anew::settings_of(settings, found);
    out.spectrum = spectrum_of(in_force, rows, std::move(shaken), form);
    if (out.spectrum) adopt(*out.spectrum, in_force, out.assessed);
    const bool others = std::ranges::any_of(
        rows, [](const estimator::DwellRow& row) { return row.apart && !row.held_out; });
    if (!out.spectrum && others && rows.size() > kMostSpectralDwells)
        doubt(out.assessed, "there are no coefficients over frequency of " +
                                std::to_string(rows.size()) + " dwells (" +
                                std::to_string(kMostSpectralDwells) +
                                " at most): those at the reference frequency stand");
    return out;
}

}  // namespace vibrig::tool
