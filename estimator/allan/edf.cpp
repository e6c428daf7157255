#include "estimator/allan/edf.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <unsupported/Eigen/SpecialFunctions>
#include <vector>

namespace vibrig::estimator::allan {

namespace {

// Above this factor sums over lags are sampled: the terms are smooth in lag / m.
constexpr std::size_t kLagResolution = 64;
constexpr std::size_t kFewestForIdentification = 30;
constexpr std::size_t kFewestInPart = 20;
constexpr double kEnough = 200;  // points: 0.14 of the exponent, 1 sigma

double real(std::size_t n) { return static_cast<double>(n); }

/// Generalised autocovariance of the phase, up to a factor.
double s_w(double t, Alpha alpha) {
    const double a = std::abs(t);
    const double log_a = a > 0 ? std::log(a) : 0.0;
    switch (alpha) {
        case 2:
            return -a;
        case 1:
            return a * a * log_a;
        case 0:
            return a * a * a;
        case -1:
            return -std::pow(a, 4) * log_a;
        default:
            return -std::pow(a, 5);
    }
}

/// As s_w for phase averaged over 1 / f of a step; f <= 0 stands for no averaging.
double s_x(double t, double f, Alpha alpha) {
    if (f <= 0) {
        switch (alpha) {
            case 2:
                return t == 0.0 ? 1.0 : 0.0;
            case 1:
                return 0.0;
            default:
                return s_w(t, alpha + 2);
        }
    }
    return f * f * (2 * s_w(t, alpha) - s_w(t - 1 / f, alpha) - s_w(t + 1 / f, alpha));
}

double s_z(double t, double f, Alpha alpha, int order) {
    const auto s = [&](double at) { return s_x(at, f, alpha); };
    if (order == 2) {
        return 6 * s(t) - 4 * (s(t - 1) + s(t + 1)) + s(t - 2) + s(t + 2);
    }
    return 20 * s(t) - 15 * (s(t - 1) + s(t + 1)) + 6 * (s(t - 2) + s(t + 2)) - s(t - 3) - s(t + 3);
}

double difference_edf(Alpha alpha, std::size_t points, std::size_t m, int order, bool modified,
                      bool overlapping) {
    const double factor = real(m);
    const double span = factor * order + (modified ? factor : 1.0);
    if (real(points) < span) {
        return 1.0;
    }
    const std::size_t stride = overlapping ? std::min(m, kLagResolution) : 1;
    // The phase is read, not averaged, and from white FM on it needs no bandwidth: then it is
    // exact.
    const bool as_read = alpha <= 0 && (!modified || m == 1);
    const double f = as_read ? 0.0 : modified ? 1.0 : real(std::min(m, kLagResolution));
    const double terms = 1 + std::floor(real(stride) * (real(points) - span) / factor);
    const double lags = std::min(terms, real(stride) * (order + 1));
    const double zero = std::pow(s_z(0, f, alpha, order), 2);
    double sum = zero;
    for (double j = 1; j < lags; ++j) {
        sum += 2 * (1 - j / terms) * std::pow(s_z(j / real(stride), f, alpha, order), 2);
    }
    sum += (1 - lags / terms) * std::pow(s_z(lags / real(stride), f, alpha, order), 2);
    return zero * terms / sum;
}

double overlapping_allan_edf(Alpha alpha, double n, double m) {
    switch (alpha) {
        case 2:
            return (n + 1) * (n - 2 * m) / (2 * (n - m));
        case 1:
            return std::exp(std::sqrt(
                std::max(0.0, std::log((n - 1) / (2 * m)) * std::log((2 * m + 1) * (n - 1) / 4))));
        case 0:
            return (3 * (n - 1) / (2 * m) - 2 * (n - 2) / n) * 4 * m * m / (4 * m * m + 5);
        case -1:
            return m < 2 ? 2 * (n - 2) * (n - 2) / (2.3 * n - 4.9)
                         : 5 * n * n / (4 * m * (n + 3 * m));
        default:
            return (n - 2) / m * ((n - 1) * (n - 1) - 3 * m * (n - 1) + 4 * m * m) /
                   ((n - 3) * (n - 3));
    }
}

/// White phase, reflected about noisy end points: each of the m - 1 differences at an end holds
/// twice that point, so that all of them are correlated. With A of the differences' rows edf = (tr
/// A A')^2 / tr (A A')^2. Rows inside: length^2 6, products -4 and 1 with those m and 2m further
/// on. At an end: length^2 10, products 4 among all (8 for i + k = m), and -4, 1, -1, 2 with one
/// row inside each.
double total_white_phase_edf(double n, double m) {
    const double end = std::min(m - 1, std::floor((n - 2) / 2));
    const double inside = n - 2 - 2 * end;
    const double trace = 6 * inside + 2 * 10 * end;
    const double within =
        36 * inside + 2 * 16 * std::max(0.0, inside - m) + 2 * std::max(0.0, inside - 2 * m);
    const double at_end = 16 * end * (end - 1) + (100 + 48 + 2 * (16 + 1 + 1 + 4)) * end;
    const double squares = within + 2 * at_end;
    return trace * trace / squares;
}

double total_edf(Alpha alpha, double n, double m) {
    const double ratio = (n - 1) / m;
    // At m = 1 both variances are the same sum; the table is for long averaging times.
    if (m < 2) {
        return overlapping_allan_edf(alpha, n, m);
    }
    switch (alpha) {
        case 2:
            return total_white_phase_edf(n, m);
        case 0:
            return 1.50 * ratio * 4 * m * m / (4 * m * m + 5);
        case -1:
            return 1.17 * ratio - 0.22;
        case -2:
            return 0.93 * ratio - 0.36;
        default:
            return overlapping_allan_edf(alpha, n, m);
    }
}

double statistic_edf(Statistic statistic, Alpha alpha, std::size_t points, std::size_t m) {
    switch (statistic) {
        case Statistic::adev:
            return difference_edf(alpha, points, m, 2, false, false);
        case Statistic::oadev:
            return overlapping_allan_edf(alpha, real(points), real(m));
        case Statistic::mdev:
        case Statistic::tdev:
            return difference_edf(alpha, points, m, 2, true, true);
        case Statistic::hdev:
            return difference_edf(alpha, points, m, 3, false, false);
        case Statistic::ohdev:
            return difference_edf(alpha, points, m, 3, false, true);
        case Statistic::totdev:
            return total_edf(alpha, real(points), real(m));
    }
    return 1.0;
}

/// Lag-1 autocorrelation, all parts together. Phase has an offset of its own in each part; the mean
/// of its differences is common, and taken from short parts it would lower the correlation.
double lag_one(const std::vector<std::vector<double>>& parts, bool common_mean) {
    double all = 0;
    double count = 0;
    for (const std::vector<double>& z : parts) {
        all = std::accumulate(z.begin(), z.end(), all);
        count += real(z.size());
    }
    double zero = 0;
    double one = 0;
    for (const std::vector<double>& z : parts) {
        const double mean =
            common_mean ? all / count : std::accumulate(z.begin(), z.end(), 0.0) / real(z.size());
        for (std::size_t i = 0; i < z.size(); ++i) {
            zero += (z[i] - mean) * (z[i] - mean);
            one += i > 0 ? (z[i] - mean) * (z[i - 1] - mean) : 0;
        }
    }
    return zero > 0 ? one / zero : 0;
}

/// Exponent of the rate's spectrum at averaging factor m, not rounded, and how many points it comes
/// from.
struct Exponent {
    double alpha = 0;
    double points = 0;
};
std::optional<Exponent> exponent_at(const Series& series, std::size_t m) {
    std::vector<std::vector<double>> parts;
    std::size_t count = 0;
    for (const Segment& segment : series.segments) {
        // Less than this about its own mean, a random walk of the phase looks white.
        if (segment.points() / m < kFewestInPart) {
            continue;
        }
        std::vector<double>& z = parts.emplace_back();
        for (std::size_t i = segment.begin; i < segment.end; i += m) {
            z.push_back(series.phase[i]);
        }
        count += z.size();
    }
    if (count < kFewestForIdentification) {
        return {};
    }
    constexpr int kMostDifferences = 2;
    double before = 0;
    for (int order = 0;; ++order) {
        const double r = lag_one(parts, order > 0);
        const double delta = r / (1 + r);
        double alpha = 2 - 2 * (delta + order);
        // Of one noise both differences say the same. Where two cross, what the second one leaves
        // of the phase's looks like white phase, whose interval would be far too narrow.
        if (order == kMostDifferences) alpha = std::min(alpha, before);
        if (order == kMostDifferences || delta < 0.25) {
            return Exponent{alpha, real(count)};
        }
        before = alpha;
        for (std::vector<double>& z : parts) {
            std::adjacent_difference(z.begin(), z.end(), z.begin());
            z.erase(z.begin());
        }
    }
}

}  // namespace

double edf(Statistic statistic, Alpha alpha, std::size_t points, std::size_t m) {
    const double value = statistic_edf(statistic, std::clamp(alpha, -2, 2), points, m);
    // The closed forms fall below one, or turn negative, at the very end of a record.
    return value >= 1.0 ? value : 1.0;
}

Alpha identify_noise(const Series& series, std::size_t m, Alpha fallback) {
    // Few points mistake one noise for another, and the interval with it: shorter averages of the
    // same record are asked too, each octave with the weight of its longest.
    double sum = 0;
    double weight = 0;
    double share = 1;
    for (std::size_t factor = m; factor > 0 && weight < kEnough; factor /= 2, share /= 2) {
        if (const auto found = exponent_at(series, factor)) {
            sum += share * found->points * found->alpha;
            weight += share * found->points;
        }
    }
    return weight > 0 ? std::clamp(static_cast<int>(std::lround(sum / weight)), -2, 2) : fallback;
}

double normal_quantile(double probability) { return Eigen::numext::ndtri(probability); }

namespace {

/// Where the growing function reaches `probability`, from a guess.
template <typename Below>
double quantile(double probability, double guess, const Below& below) {
    double low = guess;
    double high = guess;
    while (below(low) > probability && low > 1e-300) {
        low /= 2;
    }
    while (below(high) < probability && high < 1e300) {
        high *= 2;
    }
    for (int i = 0; i < 60 && high > low * (1 + 1e-13); ++i) {
        const double middle = std::sqrt(low * high);
        (below(middle) < probability ? low : high) = middle;
    }
    return std::sqrt(low * high);
}

}  // namespace

double chi_square_quantile(double probability, double degrees) {
    // Wilson and Hilferty bring the start, bisection in the logarithm cannot fail after it.
    const double c = 2 / (9 * degrees);
    const double cube = 1 - c + normal_quantile(probability) * std::sqrt(c);
    return quantile(probability, std::max(1e-12 * degrees, degrees * cube * cube * cube),
                    [&](double x) { return Eigen::numext::igamma(degrees / 2, x / 2); });
}

double f_quantile(double probability, double numerator, double denominator) {
    return quantile(probability, 1, [&](double x) {
        return Eigen::numext::betainc(numerator / 2, denominator / 2,
                                      numerator * x / (numerator * x + denominator));
    });
}

}  // namespace vibrig::estimator::allan
