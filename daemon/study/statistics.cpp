#include "daemon/study/statistics.hpp"

#include <algorithm>
#include <boost/math/distributions/binomial.hpp>
#include <boost/math/distributions/chi_squared.hpp>
#include <boost/math/distributions/normal.hpp>
#include <cmath>
#include <limits>

#include "estimator/filter/linear_algebra.hpp"

namespace vibrig::study {

namespace {

constexpr double kTail = 0.025;

// Beyond so many degrees the library's gamma functions overflow, and the cube root of chi-square
// is normal to 1e-8 (Wilson and Hilferty 1931).
constexpr double kMany = 20'000;

double cube_mean(double degrees) { return 1 - 2 / (9 * degrees); }
double cube_sigma(double degrees) { return std::sqrt(2 / (9 * degrees)); }

double chi_square_quantile(double degrees, double p) {
    if (degrees <= kMany)
        return boost::math::quantile(boost::math::chi_squared_distribution<double>(degrees), p);
    const double z = boost::math::quantile(boost::math::normal_distribution<double>(), p);
    return degrees * std::pow(cube_mean(degrees) + z * cube_sigma(degrees), 3);
}

/// Two-sided probability of a sum that is as far off.
double chi_square_p(double degrees, double sum) {
    double below = 0, above = 0;
    if (degrees <= kMany) {
        const boost::math::chi_squared_distribution<double> all(degrees);
        below = boost::math::cdf(all, sum);
        above = boost::math::cdf(boost::math::complement(all, sum));
    } else {
        const double z = (std::cbrt(sum / degrees) - cube_mean(degrees)) / cube_sigma(degrees);
        below = 0.5 * std::erfc(-z / std::sqrt(2.0));
        above = 0.5 * std::erfc(z / std::sqrt(2.0));
    }
    return std::min(1.0, 2 * std::min(below, above));
}

}  // namespace

void Sum::add(double x) noexcept {
    const double next = sum_ + x;
    lost_ += std::abs(sum_) >= std::abs(x) ? (sum_ - next) + x : (x - next) + sum_;
    sum_ = next;
}

Interval rms_interval(double sum, std::uint64_t n) {
    const auto count = static_cast<double>(n);
    return {std::sqrt(sum / count), std::sqrt(sum / chi_square_quantile(count, 1 - kTail)),
            std::sqrt(sum / chi_square_quantile(count, kTail))};
}

Interval share_interval(std::uint64_t hits, std::uint64_t n) {
    using Binomial = boost::math::binomial_distribution<double>;
    const auto trials = static_cast<double>(n), successes = static_cast<double>(hits);
    return {successes / trials,
            hits == 0 ? 0 : Binomial::find_lower_bound_on_p(trials, successes, kTail),
            hits == n ? 1 : Binomial::find_upper_bound_on_p(trials, successes, kTail)};
}

ChiSquareMean chi_square_mean(double sum, std::uint64_t n, double degrees) {
    const auto count = static_cast<double>(n);
    return {sum / count, chi_square_quantile(degrees * count, kTail) / count,
            chi_square_quantile(degrees * count, 1 - kTail) / count,
            chi_square_p(degrees * count, sum)};
}

std::vector<double> chi_square_bounds(std::size_t bins, double degrees) {
    std::vector<double> bounds;
    for (std::size_t i = 1; i < bins; ++i)
        bounds.push_back(
            chi_square_quantile(degrees, static_cast<double>(i) / static_cast<double>(bins)));
    return bounds;
}

double nees(const Eigen::VectorXd& error, const Eigen::MatrixXd& covariance) {
    if (covariance.rows() != error.size()) return std::numeric_limits<double>::quiet_NaN();
    return estimator::linear_algebra::squared_distance(covariance, error);
}

}  // namespace vibrig::study
