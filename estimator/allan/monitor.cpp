#include "estimator/allan/monitor.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "estimator/allan/deviation.hpp"

namespace vibrig::estimator::allan {

namespace {

constexpr double kFewestDegrees = 0.5;

}  // namespace

const char* words_of(Reading reading) {
    static constexpr std::array kWords{
        "short averaging times: quantisation or vibration leakage",
        "middle averaging times: angle random walk N",
        "long averaging times: temperature, rate random walk K or ramp R",
        "step of the mean between adjacent windows"};
    return kWords[static_cast<std::size_t>(reading)];
}

Reading reading_of(std::size_t octave, std::size_t octaves) {
    const std::size_t part = 3 * octave / octaves;
    return part == 0 ? Reading::short_tau : part == 1 ? Reading::middle_tau : Reading::long_tau;
}

StationarityMonitor::StationarityMonitor(const MonitorSettings& settings,
                                         const DynamicAllan& dynamic)
    : settings_(settings),
      covariance_(dynamic.covariance()),
      window_share_(share_of(dynamic.settings().shape)),
      tau0_(dynamic.settings().tau0),
      window_(dynamic.settings().window),
      back_(std::max<std::size_t>(
          1, static_cast<std::size_t>(std::ceil(1 / (1 - dynamic.settings().overlap) - 1e-9)))),
      overlap_(dynamic.settings().overlap) {
    if (!(settings.alpha > 0 && settings.alpha < 1)) {
        throw DataError("alpha: must be between 0 and 1, got " + std::to_string(settings.alpha));
    }
    const std::vector<std::size_t>& factors = dynamic.factors();
    for (const std::size_t m : octave_factors(window_ / 4)) {
        const auto at = std::find(factors.begin(), factors.end(), m);
        octaves_.push_back({static_cast<std::size_t>(at - factors.begin()), m, 0, 0, 1, {}});
    }
}

void StationarityMonitor::set_reference(const Terms& terms) {
    for (Octave& octave : octaves_) {
        octave.reference = model_variance(terms, static_cast<double>(octave.m) * tau0_);
    }
    set_bounds(terms, 0);
}

double StationarityMonitor::share_of_alpha() const {
    return settings_.alpha / static_cast<double>(octaves_.size() + 1);
}

void StationarityMonitor::set_bounds(const Terms& terms, double reference_windows) {
    std::vector<std::size_t> factors;
    for (const Octave& octave : octaves_) factors.push_back(octave.m);
    const Eigen::VectorXd spread = covariance_.of(factors, terms).diagonal();
    reference_windows_ = reference_windows;
    for (std::size_t i = 0; i < octaves_.size(); ++i) {
        Octave& octave = octaves_[i];
        const double mean = model_variance(terms, static_cast<double>(octave.m) * tau0_);
        // A ramp alone does not vary at all; half the window is what any noise has at least.
        octave.degrees =
            std::clamp(window_share_ * 2 * mean * mean / spread[static_cast<Eigen::Index>(i)],
                       kFewestDegrees, static_cast<double>(window_));
    }
    mean_sigma_ = std::sqrt(2 * model_variance(terms, static_cast<double>(window_) * tau0_));
}

StationarityMonitor::Bounds StationarityMonitor::bounds_of(const Octave& octave,
                                                           double present) const {
    const double tail = share_of_alpha() / 2;
    const double degrees = std::max(kFewestDegrees, octave.degrees * present);
    if (reference_windows_ > 0) {
        const double taught =
            std::max(kFewestDegrees, octave.degrees * reference_windows_ * octave.taught);
        return {f_quantile(tail, degrees, taught), f_quantile(1 - tail, degrees, taught)};
    }
    return {chi_square_quantile(tail, degrees) / degrees,
            chi_square_quantile(1 - tail, degrees) / degrees};
}

void StationarityMonitor::learn(const WindowRow& row) {
    lessons_.push_back(row);
    if (lessons_.size() < settings_.reference_windows) {
        return;
    }
    const auto n = static_cast<double>(lessons_.size());
    const double windows = 1 + (n - 1) * (1 - overlap_);
    std::vector<VariancePoint> curve;
    for (Octave& octave : octaves_) {
        double sum = 0;
        double shares = 0;
        for (const WindowRow& lesson : lessons_) {
            // Gaps may leave no difference.
            if (!(lesson.share[octave.k] > 0)) continue;
            sum += lesson.share[octave.k] * lesson.allan[octave.k];
            shares += lesson.share[octave.k];
        }
        octave.reference = shares > 0 ? sum / shares : 0;
        octave.taught = shares / n / window_share_;
        if (octave.reference > 0) {
            curve.push_back({static_cast<double>(octave.m) * tau0_, octave.m, octave.reference,
                             windows * shares / n});
        }
    }
    lessons_.clear();
    if (curve.size() < 2) return;
    const Fit fit = fit_noise(curve, covariance_);
    const double tau = static_cast<double>(window_) * tau0_;
    const auto variance_of = [tau](double value, Term term) {
        return value * value * term_variance(term, tau);
    };
    // In a few windows a ramp cannot be distinguished from a walk, and a ramp varies from one to
    // the next by nothing: it counts as the walk that does as much over a window.
    Terms terms = fit.values();
    double& walk = terms[static_cast<std::size_t>(Term::K)];
    double& ramp = terms[static_cast<std::size_t>(Term::R)];
    walk = std::hypot(walk, std::sqrt(variance_of(ramp, Term::R) / term_variance(Term::K, tau)));
    ramp = 0;
    set_bounds(terms, windows);
    // The windows' mean varies by what is slow, and all that is not excluded may be there.
    double slow = 0;
    for (const Term term : {Term::B, Term::K, Term::R}) {
        slow = std::max(slow, variance_of(fit.terms[static_cast<std::size_t>(term)].below, term));
    }
    terms[static_cast<std::size_t>(Term::B)] = walk = 0;
    mean_sigma_ = std::sqrt(2 * (model_variance(terms, tau) + slow));
}

std::vector<Alarm> StationarityMonitor::check(const WindowRow& row) {
    std::vector<Alarm> alarms;
    if (row.refused) {
        means_.clear();
        return alarms;
    }
    means_.push_back(row.mean);
    if (means_.size() > back_ + 1) {
        means_.erase(means_.begin());
    }
    if (!has_reference()) {
        learn(row);
        return alarms;
    }
    for (std::size_t i = 0; i < octaves_.size(); ++i) {
        Octave& octave = octaves_[i];
        // Of an averaging time at which gaps leave no difference nothing is known.
        if (!(row.share[octave.k] > 0) || !(octave.reference > 0)) continue;
        const double ratio = row.allan[octave.k] / octave.reference;
        const Bounds bounds = bounds_of(octave, row.share[octave.k] / window_share_);
        if (ratio >= bounds.low && ratio <= bounds.high) {
            octave.since.reset();
            continue;
        }
        octave.since = octave.since.value_or(row.begin_s);
        alarms.push_back({reading_of(i, octaves_.size()), static_cast<double>(octave.m) * tau0_,
                          ratio, ratio < bounds.low ? bounds.low : bounds.high, *octave.since});
    }
    const double step = means_.size() > back_ && mean_sigma_ > 0
                            ? (means_.back() - means_.front()) / mean_sigma_
                            : 0;
    const double limit = normal_quantile(1 - share_of_alpha() / 2);
    if (std::abs(step) <= limit) {
        step_since_.reset();
        return alarms;
    }
    step_since_ = step_since_.value_or(row.begin_s);
    alarms.push_back({Reading::mean_step, static_cast<double>(window_) * tau0_, step,
                      std::copysign(limit, step), *step_since_});
    return alarms;
}

double StationarityMonitor::smallest_change() const {
    double least = 0;
    for (const Octave& octave : octaves_) {
        if (!(octave.reference > 0)) continue;
        const double change = std::sqrt(bounds_of(octave, 1).high) - 1;
        least = least > 0 ? std::min(least, change) : change;
    }
    return least;
}

}  // namespace vibrig::estimator::allan
