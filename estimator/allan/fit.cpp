#include "estimator/allan/fit.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>

#include "estimator/allan/series.hpp"

namespace vibrig::estimator::allan {

namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kLeastWeight = 0.01;  // of a set that is named
constexpr int kBisections = 20;

std::size_t at(Term term) { return static_cast<std::size_t>(term); }

bool white(const TermSet& set) {
    return !set[at(Term::B)] && !set[at(Term::K)] && !set[at(Term::R)];
}

std::vector<TermFit> fits_of(const CurveLikelihood& likelihood, const TermSet& wanted) {
    std::vector<TermFit> fits;
    for (unsigned bits = 1; bits < (1U << kTerms); ++bits) {
        TermSet set{};
        bool all_wanted = true;
        for (std::size_t j = 0; j < kTerms; ++j) {
            set[j] = (bits >> j & 1U) != 0;
            all_wanted = all_wanted && (!set[j] || wanted[j]);
        }
        if (!all_wanted) continue;
        if (const auto fit = likelihood.best(set)) fits.push_back(*fit);
    }
    return fits;
}

/// Least deviance of the sets that `where` holds for; infinite without any.
template <typename Where>
double least(const std::vector<TermFit>& fits, const Where& where) {
    double deviance = kInfinity;
    for (const TermFit& fit : fits) {
        if (where(fit)) deviance = std::min(deviance, fit.deviance);
    }
    return deviance;
}

/// Largest square of term j that costs kBound over `best` when the other terms of `from` follow.
double bound_from(const TermFit& from, std::size_t j, double best,
                  const CurveLikelihood& likelihood) {
    // Beyond where the term alone would make the curve many times over.
    double high = std::log(1e3 * likelihood.largest_square(j));
    double low = std::log(from.has[j] ? from.square[j] : 1e-6 * likelihood.largest_square(j));
    const auto allowed = [&](double x) {
        return likelihood.profile(from, j, std::exp(x)) <= best + kBound;
    };
    high = std::max(high, low + 1);
    for (int i = 0; i < kBisections && high - low > 1e-3; ++i) {
        const double middle = (low + high) / 2;
        (allowed(middle) ? low : high) = middle;
    }
    return std::exp(high);
}

/// Over the sets with the term that are not excluded; the best is followed exactly, the others by
/// their errors.
double bound_of(std::size_t j, const std::vector<TermFit>& fits, double best,
                const CurveLikelihood& likelihood) {
    const TermFit* with = nullptr;
    const TermFit* any = &fits.front();
    double square = 0;
    for (const TermFit& fit : fits) {
        any = fit.deviance < any->deviance ? &fit : any;
        if (!fit.has[j]) continue;
        with = with == nullptr || fit.deviance < with->deviance ? &fit : with;
        const double left = best + kBound - fit.deviance;
        if (left > 0) {
            square = std::max(square, fit.square[j] * std::exp(std::sqrt(left) * fit.log_sigma[j]));
        }
    }
    const bool followed = with != nullptr && with->deviance < best + kBound;
    return std::max(followed ? 0 : square,
                    bound_from(followed ? *with : *any, j, best, likelihood));
}

/// Mean and spread over the sets; weights by Akaike's criterion.
void average(const std::vector<TermFit>& fits, Fit& out) {
    const auto criterion = [](const TermFit& fit) {
        return fit.deviance + 2 * static_cast<double>(fit.parameters);
    };
    double lowest = kInfinity;
    for (const TermFit& fit : fits) lowest = std::min(lowest, criterion(fit));
    double sum = 0;
    for (const TermFit& fit : fits) {
        out.models.push_back({fit.has, std::exp((lowest - criterion(fit)) / 2)});
        sum += out.models.back().weight;
    }
    for (NoiseModel& model : out.models) model.weight /= sum;
    for (std::size_t j = 0; j < kTerms; ++j) {
        double mean = 0;
        for (std::size_t k = 0; k < fits.size(); ++k) {
            mean += out.models[k].weight * std::sqrt(fits[k].square[j]);
        }
        double spread = 0;
        for (std::size_t k = 0; k < fits.size(); ++k) {
            const double value = std::sqrt(fits[k].square[j]);
            // d(ln c^2) = 2 d(ln c).
            const double own = fits[k].has[j] ? value * fits[k].log_sigma[j] / 2 : 0;
            spread += out.models[k].weight * (own * own + (value - mean) * (value - mean));
        }
        out.terms[j].value = mean;
        out.terms[j].sigma = std::sqrt(spread);
    }
    std::erase_if(out.models, [](const NoiseModel& m) { return m.weight < kLeastWeight; });
    std::stable_sort(out.models.begin(), out.models.end(),
                     [](const NoiseModel& a, const NoiseModel& b) { return a.weight > b.weight; });
}

SlowNoise slow_noise(const std::vector<TermFit>& fits, double best,
                     const CurveLikelihood& likelihood) {
    SlowNoise slow;
    const double alone = least(fits, [](const TermFit& fit) { return white(fit.has); });
    slow.deviance = alone - best;
    slow.found = slow.deviance > kLongTerm;
    if (!slow.found || !std::isfinite(alone)) return slow;
    const auto fit = std::find_if(fits.begin(), fits.end(), [&](const TermFit& f) {
        return white(f.has) && f.deviance == alone;
    });
    double most = -kInfinity;
    for (std::size_t i = 0; i < likelihood.points(); ++i) {
        const double excess = likelihood.excess(fit->square, i);
        if (excess <= most) continue;
        most = excess;
        const VariancePoint& point = likelihood.curve()[i];
        Terms terms{};
        for (std::size_t j = 0; j < kTerms; ++j) terms[j] = std::sqrt(fit->square[j]);
        slow.tau = point.tau;
        slow.ratio = std::sqrt(point.variance / model_variance(terms, point.tau));
    }
    return slow;
}

void note_ramp(Fit& fit, double record_h) {
    const FittedTerm& k = fit.terms[static_cast<std::size_t>(Term::K)];
    FittedTerm& r = fit.terms[static_cast<std::size_t>(Term::R)];
    const double walk = k.value;
    // A ramp is known no better than the walk over the record lets it: K / sqrt(T).
    const double bound = walk / std::sqrt(record_h);
    if (!k.detected) {
        return;
    }
    r.sigma = r.value > 0 ? std::max(r.sigma, bound) : r.sigma;
    r.below = std::max(r.below, bound);
    if (!r.detected || r.value < 2 * bound) {
        std::ostringstream note;
        note.precision(3);
        note << "R is known no better than K/sqrt(T) = " << bound << " deg/h^2 in this record of "
             << record_h << " h";
        if (r.value > 0) {
            note << "; a record of " << 4 * walk * walk / (r.value * r.value)
                 << " h would show it at two standard errors";
        }
        fit.ramp_note = note.str();
    }
}

}  // namespace

Terms Fit::values() const {
    Terms values{};
    for (std::size_t j = 0; j < kTerms; ++j) {
        values[j] = terms[j].value;
    }
    return values;
}

std::string Fit::verdict() const {
    if (!slow.found) return "no noise slower than white is detected";
    if (slow.determined) return {};
    std::ostringstream text;
    text.precision(3);
    text << "slow noise";
    if (slow.tau > 0) text << " of " << slow.ratio << " times white at " << slow.tau << " s";
    text << "; kind not determined";
    return text.str();
}

Fit fit_noise(std::span<const VariancePoint> curve, const CurveCovariance& covariance,
              const TermSet& wanted) {
    if (curve.size() < 2) {
        throw DataError("fit: a curve of " + std::to_string(curve.size()) +
                        " points found, at least 2 needed");
    }
    const CurveLikelihood likelihood(curve, covariance);
    Fit out;
    const std::vector<TermFit> fits =
        likelihood.points() > 0 ? fits_of(likelihood, wanted) : std::vector<TermFit>{};
    if (fits.empty()) {
        throw DataError("fit: no set of the terms fits the curve, every variance is zero");
    }
    const double best = least(fits, [](const TermFit&) { return true; });
    average(fits, out);
    for (std::size_t j = 0; j < kTerms; ++j) {
        FittedTerm& term = out.terms[j];
        const double without = least(fits, [&](const TermFit& fit) { return !fit.has[j]; });
        term.detected = without - best > kDetected;
        term.below = wanted[j] ? std::sqrt(bound_of(j, fits, best, likelihood)) : 0;
    }
    out.slow = slow_noise(fits, best, likelihood);
    for (const Term term : {Term::B, Term::K, Term::R}) {
        // One question comes first: is there anything?
        FittedTerm& slow = out.terms[at(term)];
        slow.detected = slow.detected && out.slow.found;
        out.slow.determined = out.slow.determined || slow.detected;
    }
    note_ramp(out, static_cast<double>(covariance.points() - 1) * covariance.tau0() / 3600);
    return out;
}

Fit fit_noise(std::span<const VariancePoint> curve, std::size_t points, double tau0,
              const TermSet& wanted) {
    std::vector<std::size_t> factors;
    for (const VariancePoint& point : curve) {
        factors.push_back(point.m);
    }
    return fit_noise(curve, CurveCovariance(factors, points, tau0), wanted);
}

}  // namespace vibrig::estimator::allan
