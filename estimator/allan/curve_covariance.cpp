#include "estimator/allan/curve_covariance.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

namespace vibrig::estimator::allan {

namespace {

// Cells of the sum over lags, in parts of the distance to where the summand bends.
constexpr double kResolution = 16;
// C falls as 1 / lag^2 (flicker) or is zero beyond the differences' own span.
constexpr double kReach = 3;
// Further away than this many spans a second difference is a second derivative to 1e-5, and the
// difference itself would lose its digits.
constexpr double kFar = 100;
constexpr std::array<double, 3> kStencil{1, -2, 1};

enum Noise : std::size_t { q, n, b, k };

/// Generalised covariances, in units of the coefficients' own and tau0.
std::array<double, 4> angle_covariance(double t) {
    const double a = std::abs(t);
    return {0, -a / 2, a > 0 ? a * a * std::log(a) / (2 * std::numbers::pi) : 0, a * a * a / 12};
}

/// Second difference about u over steps of l.
std::array<double, 4> second_difference(double u, double l) {
    const double a = std::abs(u);
    if (a > kFar * l) {
        return {0, 0, l * l * (2 * std::log(a) + 3) / (2 * std::numbers::pi), l * l * a / 2};
    }
    const auto before = angle_covariance(u - l);
    const auto middle = angle_covariance(u);
    const auto after = angle_covariance(u + l);
    std::array<double, 4> d{};
    for (std::size_t j = 0; j < d.size(); ++j) {
        d[j] = before[j] - 2 * middle[j] + after[j];
    }
    return d;
}

/// Covariance of a difference over steps of m with one over steps of l whose centre is u after the
/// first one's beginning. Without Q.
std::array<double, 4> smooth_covariance(double u, double m, double l) {
    std::array<double, 4> c{};
    for (std::size_t a = 0; a < kStencil.size(); ++a) {
        const auto d = second_difference(u - static_cast<double>(a) * m, l);
        for (std::size_t j = 0; j < c.size(); ++j) {
            c[j] += kStencil[a] * d[j];
        }
    }
    return c;
}

}  // namespace

CurveCovariance::CurveCovariance(std::span<const std::size_t> factors, std::size_t points,
                                 double tau0)
    : factors_(factors.begin(), factors.end()), points_(points), tau0_(tau0) {
    std::sort(factors_.begin(), factors_.end());
    while (!factors_.empty() && 2 * factors_.back() >= points) {
        factors_.pop_back();
    }
    for (std::size_t i = 0; i < factors_.size(); ++i) {
        for (std::size_t j = 0; j <= i; ++j) {
            sums_.push_back(
                sums_of(static_cast<double>(factors_[i]), static_cast<double>(factors_[j])));
        }
    }
}

CurveCovariance::Sums CurveCovariance::sums_of(double m, double l) const {
    const double long_terms = static_cast<double>(points_) - 2 * m;
    const double short_terms = static_cast<double>(points_) - 2 * l;
    /// Pairs of differences whose distance is u, over all pairs.
    const auto share = [&](double u) {
        const double t = u - l;
        const double pairs = std::min(long_terms, short_terms - t) - std::max(0.0, -t);
        return std::max(0.0, pairs) / (long_terms * short_terms);
    };
    Sums sums;
    const auto add = [&](const Values& c, double weight) {
        for (std::size_t i = 0; i < kNoises; ++i) {
            sums.single[i] += weight * c[i];
            for (std::size_t j = 0; j < kNoises; ++j) {
                sums.product[i][j] += weight * c[i] * c[j];
            }
        }
    };
    const double last = (2 + kReach) * m;
    for (double u = -kReach * m; u <= last;) {
        double distance = m;
        for (std::size_t a = 0; a < kStencil.size(); ++a) {
            distance = std::min(distance, std::abs(u - static_cast<double>(a) * m));
        }
        // The number of pairs bends too; near the end of a record it is all within a few lags.
        const double bend = std::min(std::abs(u - l), std::abs(u - 2 * m + l));
        const double smooth = std::min(std::max(l, distance), std::max(long_terms, bend));
        const double cell = std::max(1.0, std::floor(smooth / kResolution));
        const double middle = u + (cell - 1) / 2;
        const double weight = share(middle) * cell;
        if (weight > 0) {
            add(smooth_covariance(middle, m, l), weight);
        }
        u += cell;
    }
    // Quantisation has a covariance at single lags only, where the others were counted already.
    std::vector<std::pair<double, double>> spikes;
    for (std::size_t a = 0; a < kStencil.size(); ++a) {
        for (std::size_t c = 0; c < kStencil.size(); ++c) {
            const double u = static_cast<double>(a) * m - (static_cast<double>(c) - 1) * l;
            const auto at = std::find_if(spikes.begin(), spikes.end(),
                                         [&](const auto& spike) { return spike.first == u; });
            const double height = kStencil[a] * kStencil[c];
            if (at == spikes.end()) {
                spikes.emplace_back(u, height);
            } else {
                at->second += height;
            }
        }
    }
    for (const auto& [u, height] : spikes) {
        Values c = smooth_covariance(u, m, l);
        const double weight = share(u);
        add(c, -weight);
        c[q] = height;
        add(c, weight);
    }
    return sums;
}

std::size_t CurveCovariance::index_of(std::size_t factor) const {
    const auto at = std::lower_bound(factors_.begin(), factors_.end(), factor);
    if (at == factors_.end() || *at != factor) {
        throw std::out_of_range("covariance of the curve: no averaging factor " +
                                std::to_string(factor));
    }
    return static_cast<std::size_t>(at - factors_.begin());
}

CurveCovariance::At CurveCovariance::at(std::span<const std::size_t> factors) const {
    At at;
    at.tau0_ = tau0_;
    const auto count = static_cast<Eigen::Index>(factors.size());
    for (Eigen::MatrixXd& part : at.pair_) part.resize(count, count);
    for (Eigen::MatrixXd& part : at.ramp_) part.resize(count, count);
    for (Eigen::Index row = 0; row < count; ++row) {
        for (Eigen::Index column = 0; column < count; ++column) {
            const std::size_t i = index_of(factors[static_cast<std::size_t>(row)]);
            const std::size_t j = index_of(factors[static_cast<std::size_t>(column)]);
            const auto [low, high] = std::minmax(i, j);
            const Sums& sums = sums_[high * (high + 1) / 2 + low];
            // The divisors 2 tau^2 of both variances.
            const double scale = 1 / (4 * std::pow(static_cast<double>(factors_[i]) * tau0_, 2) *
                                      std::pow(static_cast<double>(factors_[j]) * tau0_, 2));
            std::size_t pair = 0;
            for (std::size_t x = 0; x < kNoises; ++x) {
                at.ramp_[x](row, column) = sums.single[x];
                for (std::size_t y = 0; y <= x; ++y) {
                    at.pair_[pair++](row, column) = (x == y ? 2 : 4) * sums.product[x][y] * scale;
                }
            }
        }
    }
    return at;
}

CurveCovariance::Values CurveCovariance::At::scale(const Terms& terms) const {
    // 1 arcsec = 1 deg/h times 1 s.
    return {std::pow(terms[q], 2), std::pow(60 * terms[n], 2) * tau0_,
            std::pow(terms[b] * tau0_, 2), std::pow(terms[k] / 60, 2) * std::pow(tau0_, 3)};
}

Eigen::MatrixXd CurveCovariance::At::of(const Terms& terms) const {
    const Values s = scale(terms);
    const double ramp = terms[static_cast<std::size_t>(Term::R)] / 3600;
    Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(ramp_[0].rows(), ramp_[0].cols());
    std::size_t pair = 0;
    for (std::size_t x = 0; x < kNoises; ++x) {
        if (ramp > 0 && s[x] > 0) covariance += ramp * ramp * s[x] * ramp_[x];
        for (std::size_t y = 0; y <= x; ++y, ++pair) {
            if (s[x] * s[y] > 0) covariance += s[x] * s[y] * pair_[pair];
        }
    }
    return covariance;
}

Eigen::MatrixXd CurveCovariance::At::slope(const Terms& terms, std::size_t term) const {
    const Values s = scale(terms);
    const double ramp = terms[static_cast<std::size_t>(Term::R)] / 3600;
    Eigen::MatrixXd slope = Eigen::MatrixXd::Zero(ramp_[0].rows(), ramp_[0].cols());
    std::size_t pair = 0;
    for (std::size_t x = 0; x < kNoises; ++x) {
        if (term == x || term == kNoises) slope += ramp * ramp * s[x] * ramp_[x];
        for (std::size_t y = 0; y <= x; ++y, ++pair) {
            const int power = (term == x ? 1 : 0) + (term == y ? 1 : 0);
            if (power > 0 && s[x] * s[y] > 0) slope += power * s[x] * s[y] * pair_[pair];
        }
    }
    return slope;
}

Eigen::MatrixXd CurveCovariance::of(std::span<const std::size_t> factors,
                                    const Terms& terms) const {
    return at(factors).of(terms);
}

}  // namespace vibrig::estimator::allan
