#include "estimator/allan/fit.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "estimator/allan/series.hpp"
#include "estimator/filter/text.hpp"

namespace vibrig::estimator::allan {

namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kLeastWeight = 0.01;  // of a set that is named
constexpr double kNoWeight = 1e-6;     // its terms are not there at all
// Of the search for a bound, in ln(square).
constexpr double kStretch = 1.5;
constexpr double kFineEnough = 0.01;
constexpr int kMostSections = 12;
constexpr double kWidest = 2;
constexpr double kGuess = 0.01;

std::size_t at(Term term) { return static_cast<std::size_t>(term); }

/// -2 ln(likelihood) so many standard errors away.
double deviance_at(double errors) { return errors * errors; }

bool is_slow(std::size_t term) { return term > at(Term::N); }

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

/// Of -2 ln(likelihood), up to the bound.
double rise_of_bound(std::size_t term) { return deviance_at(is_slow(term) ? kBoundSlow : kBound); }

/// How far term j of this square is beyond the bound, by the least deviance over the other terms.
double excess_of(const TermFit& from, std::size_t j, double square,
                 const CurveLikelihood& likelihood) {
    return likelihood.profile(from, j, square) - from.deviance - rise_of_bound(j);
}

/// Square of term j, from ln `start` on, where the least deviance over the other terms of `from`
/// has risen to the bound; infinite where it does not within anything that the curve has room for.
double bound_from(const TermFit& from, std::size_t j, double start,
                  const CurveLikelihood& likelihood) {
    const auto excess = [&](double x) { return excess_of(from, j, std::exp(x), likelihood); };
    // The last point, of one difference, may be next to nothing by chance: so large that the term
    // alone is above all of the curve.
    double whole = 0;
    for (const VariancePoint& point : likelihood.curve()) {
        whole = std::max(whole, point.variance / term_variance(static_cast<Term>(j), point.tau));
    }
    const double most = std::log(1e3 * whole);
    // The fit's own value is not beyond, and is not stepped over: of a term that is well known the
    // curve forbids what is smaller, too.
    double low = std::log(from.has[j] ? from.square[j] : 1e-12 * likelihood.largest_square(j));
    double at_low = -rise_of_bound(j);
    double high = std::max(start, low);
    double at_high = excess(high);
    while (at_high < 0 && high < most) {
        low = std::exchange(high, high + kStretch);
        at_low = std::exchange(at_high, excess(high));
    }
    if (at_high < 0) return kInfinity;
    for (double nearer = high - kStretch; nearer > low; nearer -= kStretch) {
        const double found = excess(nearer);
        if (found < 0) {
            low = nearer;
            at_low = found;
        } else {
            high = nearer;
            at_high = found;
        }
    }
    // False position; a side that stays counts half (Illinois).
    for (int i = 0; i < kMostSections && high - low > kFineEnough; ++i) {
        const double middle =
            std::isfinite(at_high)
                ? std::clamp((low * at_high - high * at_low) / (at_high - at_low), low, high)
                : (low + high) / 2;
        const double found = excess(middle);
        if (found < 0) {
            low = middle;
            at_low = found;
            at_high /= 2;
        } else {
            high = middle;
            at_high = found;
            at_low /= 2;
        }
    }
    return std::exp(high);
}

/// Largest square of the term that a set which is not excluded allows, by its own likelihood. Those
/// that allow most by their errors come first; others are followed when they allow more than those
/// do. Of the sets in which the term went to zero the best one is enough.
double bound_of(std::size_t j, const std::vector<TermFit>& fits, double excluded,
                const CurveLikelihood& likelihood) {
    struct Candidate {
        double start;  ///< about the bound, ln(square)
        const TermFit* fit;
    };
    std::vector<Candidate> with;
    const TermFit* zero = nullptr;
    for (const TermFit& fit : fits) {
        if (fit.deviance > excluded) continue;
        if (fit.has[j]) {
            const double error = std::min(fit.log_sigma[j], kWidest);
            with.push_back({std::log(fit.square[j]) + 2 * error, &fit});
            continue;
        }
        TermSet set = fit.has;
        set[j] = true;
        const bool fitted =
            std::any_of(fits.begin(), fits.end(), [&](const TermFit& f) { return f.has == set; });
        if (!fitted && (zero == nullptr || fit.deviance < zero->deviance)) zero = &fit;
    }
    if (zero != nullptr) with.push_back({std::log(kGuess * likelihood.largest_square(j)), zero});
    std::sort(with.begin(), with.end(),
              [](const Candidate& a, const Candidate& b) { return a.start > b.start; });
    double square = 0;
    for (const Candidate& candidate : with) {
        if (square > 0 && excess_of(*candidate.fit, j, square, likelihood) >= 0) continue;
        square = std::max(square, bound_from(*candidate.fit, j, candidate.start, likelihood));
    }
    return square;
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
    for (NoiseModel& model : out.models) {
        model.weight = model.weight > kNoWeight * sum ? model.weight / sum : 0;
    }
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
    // A ramp is known no better than the walk over the record lets it: K / sqrt(T), also when the
    // walk is only known to be below something.
    const double walk = k.detected ? k.value : k.below;
    const double bound = walk / std::sqrt(record_h);
    r.sigma = r.value > 0 ? std::max(r.sigma, bound) : r.sigma;
    if (r.detected) r.below = r.value + 2 * r.sigma;
    if (!k.detected) return;
    r.below = std::max(r.below, bound);
    if (!r.detected) {
        fit.ramp_note =
            text("R is known no better than K/sqrt(T) = %.3g deg/h^2 in this record of %.3g h",
                 bound, record_h);
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
    return "slow noise" +
           (slow.tau > 0 ? text(" of %.3g times white at %.3g s", slow.ratio, slow.tau) : "") +
           "; kind not determined";
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
    out.slow = slow_noise(fits, best, likelihood);
    const double hours = static_cast<double>(covariance.points() - 1) * covariance.tau0() / 3600;
    for (std::size_t j = 0; j < kTerms; ++j) {
        FittedTerm& term = out.terms[j];
        const double without = least(fits, [&](const TermFit& fit) { return !fit.has[j]; });
        term.detected = without - best > deviance_at(is_slow(j) ? kDetectedSlow : kDetected);
        // One question comes first: is there anything?
        if (is_slow(j)) term.detected = term.detected && out.slow.found;
    }
    // A random walk makes a ramp of K / sqrt(T) by itself, 1 sigma.
    FittedTerm& ramp = out.terms[at(Term::R)];
    ramp.detected =
        ramp.detected && ramp.value > 3 * out.terms[at(Term::K)].value / std::sqrt(hours);
    for (std::size_t j = 0; j < kTerms; ++j) {
        FittedTerm& term = out.terms[j];
        out.slow.determined = out.slow.determined || (is_slow(j) && term.detected);
        if (term.detected) {
            term.below = term.value + 2 * term.sigma;
        } else if (wanted[j]) {
            term.below = std::sqrt(bound_of(
                j, fits, best + deviance_at(is_slow(j) ? kDetectedSlow : kDetected), likelihood));
        }
    }
    note_ramp(out, hours);
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
