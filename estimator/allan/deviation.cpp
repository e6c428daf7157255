#include "estimator/allan/deviation.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "estimator/allan/overlap_kernel.hpp"

namespace vibrig::estimator::allan {

namespace {

double number(std::size_t n) { return static_cast<double>(n); }

struct Sum {
    double squares = 0;
    std::size_t terms = 0;
};

Sum second_differences(const double* x, std::size_t points, std::size_t m, std::size_t stride) {
    Sum sum;
    for (std::size_t i = 0; i + 2 * m < points; i += stride) {
        const double d = (x[i + 2 * m] - x[i + m]) - (x[i + m] - x[i]);
        sum.squares += d * d;
        ++sum.terms;
    }
    return sum;
}

Sum third_differences(const double* x, std::size_t points, std::size_t m, std::size_t stride) {
    Sum sum;
    for (std::size_t i = 0; i + 3 * m < points; i += stride) {
        const double d = x[i + 3 * m] - 3 * (x[i + 2 * m] - x[i + m]) - x[i];
        sum.squares += d * d;
        ++sum.terms;
    }
    return sum;
}

/// Second differences of phase averaged over m points; divided by m^2 it compares with the others.
Sum averaged_differences(const double* x, std::size_t points, std::size_t m) {
    Sum sum;
    if (points < 3 * m) {
        return sum;
    }
    double total = 0;
    for (std::size_t i = 0; i < m; ++i) {
        total += (x[i + 2 * m] - x[i + m]) - (x[i + m] - x[i]);
    }
    const double scale = 1 / (number(m) * number(m));
    for (std::size_t j = 0;; ++j) {
        sum.squares += total * total * scale;
        ++sum.terms;
        if (j + 3 * m >= points) {
            return sum;
        }
        total += x[j + 3 * m] - 3 * (x[j + 2 * m] - x[j + m]) - x[j];
    }
}

/// Phase reflected at both ends (SP 1065, section 5.2.11): a centre for every inner point.
Sum total_differences(const double* x, std::size_t points, std::size_t m) {
    Sum sum;
    const std::size_t last = points - 1;
    if (m > last) {
        return sum;
    }
    for (std::size_t i = 1; i < last; ++i) {
        const double before = i >= m ? x[i - m] : 2 * x[0] - x[m - i];
        const double after = i + m <= last ? x[i + m] : 2 * x[last] - x[2 * last - i - m];
        const double d = before - 2 * x[i] + after;
        sum.squares += d * d;
        ++sum.terms;
    }
    return sum;
}

Sum sum_of(Statistic statistic, const double* x, std::size_t points, std::size_t m) {
    switch (statistic) {
        case Statistic::adev:
            return second_differences(x, points, m, m);
        case Statistic::oadev:
            return second_differences(x, points, m, 1);
        case Statistic::mdev:
        case Statistic::tdev:
            return averaged_differences(x, points, m);
        case Statistic::hdev:
            return third_differences(x, points, m, m);
        case Statistic::ohdev:
            return third_differences(x, points, m, 1);
        case Statistic::totdev:
            return total_differences(x, points, m);
    }
    return {};
}

/// All factors of one segment; the overlapping Allan variance has a kernel that reads once.
std::vector<Sum> sums_of(Statistic statistic, const double* x, std::size_t points,
                         std::span<const std::size_t> factors) {
    std::vector<Sum> sums(factors.size());
    if (statistic == Statistic::oadev) {
        std::vector<double> squares(factors.size(), 0.0);
        add_overlapping_squares(x, points, factors.data(), factors.size(), squares.data());
        for (std::size_t k = 0; k < factors.size(); ++k) {
            const std::size_t span = 2 * factors[k];
            sums[k] = {squares[k], points > span ? points - span : 0};
        }
    } else {
        std::transform(factors.begin(), factors.end(), sums.begin(),
                       [&](std::size_t m) { return sum_of(statistic, x, points, m); });
    }
    return sums;
}

double divisor(Statistic statistic, double tau) {
    const bool third = statistic == Statistic::hdev || statistic == Statistic::ohdev;
    return (third ? 6 : 2) * tau * tau;
}

constexpr std::array<const char*, 7> kNames{"adev",  "oadev", "mdev",  "hdev",
                                            "ohdev", "tdev",  "totdev"};  ///< by Statistic

}  // namespace

const char* name_of(Statistic statistic) { return kNames[static_cast<std::size_t>(statistic)]; }

Statistic statistic_named(const std::string& name) {
    std::string all;
    for (std::size_t i = 0; i < kNames.size(); ++i) {
        if (name == kNames[i]) return static_cast<Statistic>(i);
        all += std::string(all.empty() ? "" : ", ") + kNames[i];
    }
    throw DataError("--type: \"" + name + "\" found, expected one of " + all);
}

std::size_t largest_factor(Statistic statistic, std::size_t rates) {
    switch (statistic) {
        case Statistic::hdev:
        case Statistic::ohdev:
            return rates / 3;
        case Statistic::mdev:
        case Statistic::tdev:
            return (rates + 1) / 3;
        default:
            return rates / 2;
    }
}

std::vector<Point> deviations(const Series& series, Statistic statistic,
                              std::span<const std::size_t> factors, double confidence) {
    if (statistic == Statistic::totdev && series.missing > 0) {
        throw DataError(
            "totdev reflects the record at its ends and needs one without gaps, found " +
            std::to_string(series.missing) + " missing samples; use oadev");
    }
    std::vector<Sum> total(factors.size());
    // Sums of unequal length: Welch and Satterthwaite's rule joins their degrees of freedom.
    std::vector<double> spread(factors.size(), 0.0);
    std::vector<Alpha> alpha(factors.size());
    Alpha last = 0;
    for (std::size_t k = 0; k < factors.size(); ++k) {
        alpha[k] = last = identify_noise(series, factors[k], last);
    }
    for (const Segment& segment : series.segments) {
        const std::vector<Sum> sums =
            sums_of(statistic, series.phase.data() + segment.begin, segment.points(), factors);
        for (std::size_t k = 0; k < factors.size(); ++k) {
            if (sums[k].terms == 0) {
                continue;
            }
            const double terms = number(sums[k].terms);
            total[k].squares += sums[k].squares;
            total[k].terms += sums[k].terms;
            spread[k] += terms * terms / edf(statistic, alpha[k], segment.points(), factors[k]);
        }
    }
    std::vector<Point> points;
    for (std::size_t k = 0; k < factors.size(); ++k) {
        if (total[k].terms == 0) {
            continue;
        }
        Point point;
        point.m = factors[k];
        point.tau = number(factors[k]) * series.tau0;
        point.n = total[k].terms;
        point.alpha = alpha[k];
        const double terms = number(point.n);
        point.edf = std::max(1.0, terms * terms / spread[k]);
        point.dev = std::sqrt(total[k].squares / (divisor(statistic, point.tau) * terms));
        if (statistic == Statistic::tdev) {
            point.dev *= point.tau / std::sqrt(3.0);
        }
        const double tail = (1 - confidence) / 2;
        point.lo = point.dev * std::sqrt(point.edf / chi_square_quantile(1 - tail, point.edf));
        point.hi = point.dev * std::sqrt(point.edf / chi_square_quantile(tail, point.edf));
        points.push_back(point);
    }
    return points;
}

}  // namespace vibrig::estimator::allan
