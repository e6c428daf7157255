#include "estimator/spectrum/flatness.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include "estimator/filter/linear_algebra.hpp"
#include "estimator/uncertainty/distributions.hpp"

namespace vibrig::estimator::spectrum {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kLeastSlow = 1e-3;  ///< of a slow change of the bias
constexpr double kSeen = 1.2816;     ///< 90 % of a normal distribution
constexpr double kReportedDamping = 0.05;
constexpr double kShare = 0.2;
constexpr std::array<double, 5> kReportedAt{40, 60, 120, 300, 1000};

/// Columns of three gyros, one below the other in the order of the rates.
MatrixXd interleaved(const std::array<MatrixXd, 3>& of) {
    const Index n = of[0].rows(), columns = of[0].cols();
    MatrixXd out = MatrixXd::Zero(3 * n, 3 * columns);
    for (Index j = 0; j < 3; ++j) {
        for (Index k = 0; k < n; ++k)
            out.block(3 * k + j, columns * j, 1, columns) = of[static_cast<std::size_t>(j)].row(k);
    }
    return out;
}

/// Least squares of whitened columns with a prior about zero.
class Fitted {
  public:
    Fitted(MatrixXd white, const VectorXd& sigma)
        : white_(std::move(white)), prior_information_(sigma.array().square().inverse()) {
        MatrixXd normal = white_.transpose() * white_;
        normal.diagonal() += prior_information_;
        factor_ = linear_algebra::Cholesky::or_nan(normal);
    }
    /// z' Q z of a whitened column.
    [[nodiscard]] double left(const VectorXd& z) const {
        const VectorXd seen = white_.transpose() * z;
        return z.squaredNorm() - factor_->whiten(seen).squaredNorm();
    }
    [[nodiscard]] VectorXd value(const VectorXd& z) const {
        return factor_->solve(white_.transpose() * z);
    }
    /// How large the coefficients are is no lack of fit (docs/theory/uncertainty.md).
    [[nodiscard]] GroupedFit fit(const VectorXd& z) const {
        const double determined = static_cast<double>(white_.cols()) -
                                  factor_->inverse().diagonal().dot(prior_information_);
        GroupedFit out;
        out.chi_square = left(z) - value(z).cwiseAbs2().dot(prior_information_);
        out.degrees = static_cast<int>(z.size() - std::lround(determined));
        if (out.degrees > 0) out.p = uncertainty::chi_square_tail(out.chi_square, out.degrees);
        return out;
    }
    /// Of whitened columns the one that takes most of z's chi-square away.
    [[nodiscard]] std::size_t strongest(const MatrixXd& columns, const VectorXd& z) const {
        const VectorXd rest = z - white_ * value(z);
        const MatrixXd left = columns - white_ * factor_->solve(white_.transpose() * columns);
        Index best = 0;
        (columns.transpose() * rest)
            .cwiseAbs2()
            .cwiseQuotient(columns.cwiseProduct(left).colwise().sum().transpose())
            .maxCoeff(&best);
        return static_cast<std::size_t>(best);
    }

  private:
    MatrixXd white_;
    VectorXd prior_information_;
    std::optional<linear_algebra::Cholesky> factor_;
};

VectorXd stacked(const MatrixXd& per_gyro) {
    return Eigen::Map<const VectorXd>(per_gyro.data(), per_gyro.size());
}

/// The groups model, whitened by the covariance's root.
Fitted grouped_fit(const SpectralTable& table, const linear_algebra::Cholesky& root,
                   const MatrixXd& prior_sigma) {
    std::array<MatrixXd, 3> groups;
    for (std::size_t j = 0; j < 3; ++j) groups[j] = table.grouped(j);
    MatrixXd prior(groups[0].cols(), 3);
    for (Index j = 0; j < 3; ++j)
        prior.col(j) = grouped_prior(prior_sigma.col(j), groups[0].cols());
    return {root.whiten(interleaved(groups)), stacked(prior)};
}

/// Chi-square that a clean campaign exceeds with kAlarm.
double critical(int degrees) {
    double low = 0, high = 40.0 * degrees + 100;
    for (int i = 0; i < 100; ++i) {
        const double middle = (low + high) / 2;
        (uncertainty::chi_square_tail(middle, degrees) > kAlarm ? low : high) = middle;
    }
    return high;
}

/// Noncentrality with which the alarm is 90 % sure, by its mean and variance.
double noncentrality(int degrees) {
    const double over = critical(degrees) - degrees;
    double lambda = over;
    for (int i = 0; i < 60; ++i) lambda = over + kSeen * std::sqrt(2 * (degrees + 2 * lambda));
    return lambda;
}

/// The likeliest changes of the bias without their scatter, each once.
std::vector<std::pair<uncertainty::DriftHypothesis, double>> slow_part(
    const uncertainty::DriftAverage& average) {
    std::vector<std::pair<uncertainty::DriftHypothesis, double>> out;
    for (auto [what, weight] : average.likeliest) {
        what.scatter = 0;
        const auto same = std::find_if(out.begin(), out.end(), [&what = what](const auto& other) {
            return other.first == what;
        });
        if (same == out.end())
            out.emplace_back(what, weight);
        else
            same->second += weight;
    }
    std::erase_if(out, [](const auto& one) { return one.second < kLeastSlow; });
    return out;
}

}  // namespace

MatrixXd covariance_if_flat(const uncertainty::GyroRates& gyro,
                            const uncertainty::DriftAverage& of_groups, const MatrixXd& base,
                            const VectorXd& prior_sigma, const uncertainty::Drift& drift) {
    uncertainty::GyroRates flat = gyro;
    flat.regressors = base;
    flat.prior_information = prior_sigma.array().square().inverse();
    const double unit = uncertainty::unit_of(gyro.variance);
    double scatter = 0;  // of the rates' variance
    for (const auto& [what, weight] : of_groups.likeliest)
        scatter += weight * std::pow(what.scatter * unit, 2);
    const Index n = gyro.dwells();
    const MatrixXd one_each = MatrixXd::Identity(n, n);
    MatrixXd precision = MatrixXd::Zero(n, n);
    double all = 0;
    // Of the inverses: a change that is large, but hardly likely, does not hide the frequencies.
    for (const auto& one : slow_part(uncertainty::average_drift(flat, drift))) {
        uncertainty::DriftAverage alone;
        alone.likeliest = {{one.first, 1.0}};
        const MatrixXd covariance = uncertainty::mean_covariance(flat, alone) + scatter * one_each;
        precision += one.second * linear_algebra::positive_inverse(covariance);
        all += one.second;
    }
    return linear_algebra::positive_inverse(precision / all);
}

VectorXd grouped_prior(const VectorXd& base, Index columns) {
    VectorXd out(columns);
    out.head(kBase) = base;
    for (Index i = kBase; i < columns; ++i)
        out[i] = base[kBase - kElastic + (i - kBase) % kElastic];
    return out;
}

GroupedFit fit_groups(const SpectralTable& table, const VectorXd& rates, const MatrixXd& covariance,
                      const MatrixXd& prior_sigma) {
    const auto root = linear_algebra::Cholesky::or_nan(covariance);
    const Fitted grouped = grouped_fit(table, root, prior_sigma);
    const VectorXd y = root.whiten(rates);
    GroupedFit out = grouped.fit(y);
    if (out.p < kAlarm)
        out.worst_rate = grouped.strongest(root.whiten(MatrixXd::Identity(y.size(), y.size())), y);
    return out;
}

Flatness test_flatness(const SpectralTable& table, const VectorXd& rates,
                       const MatrixXd& covariance, const MatrixXd& prior_sigma, bool scattered) {
    const auto root = linear_algebra::Cholesky::or_nan(covariance);
    const auto whitened = [&](const MatrixXd& x) { return root.whiten(x); };
    std::array<MatrixXd, 3> base;
    for (std::size_t j = 0; j < 3; ++j) base[j] = table.base(j);
    const Fitted flat(whitened(interleaved(base)), stacked(prior_sigma));
    const Fitted grouped = grouped_fit(table, root, prior_sigma);
    const VectorXd y = whitened(rates);
    Flatness out;
    out.grouped_chi_square = grouped.left(y);
    const auto kinds = static_cast<int>(table.kinds().size());
    if (kinds < 2) return out;
    out.degrees = 18 * (kinds - 1);
    out.chi_square = flat.left(y) - out.grouped_chi_square;
    out.p = uncertainty::chi_square_tail(out.chi_square, out.degrees);
    const double spare = 3.0 * static_cast<double>(table.dwells() - 4 - 6 * kinds);
    const double ratio =
        out.chi_square / out.degrees / (out.grouped_chi_square / std::max(1.0, spare));
    out.alarm =
        out.p < kAlarm &&
        (!scattered || uncertainty::f_tail(ratio, out.degrees, std::max(1.0, spare)) < kAlarm);

    const double needed = noncentrality(out.degrees);
    // Of the lowest frequency: a flat fit of what is not flat has coefficients of no meaning.
    const VectorXd value = grouped.value(y);
    const Index of_gyro = value.size() / 3;
    const auto share_seen = [&](double hz) {
        const VectorXd weights = table.elastic_weights({hz, kReportedDamping});
        VectorXd moved(rates.size());
        for (Index j = 0; j < 3; ++j) {
            const auto g = static_cast<std::size_t>(j);
            const VectorXd quadratic =
                table.vibration(g) * value.segment(of_gyro * j + kBase - kElastic, kElastic);
            for (Index k = 0; k < table.dwells(); ++k) moved[3 * k + j] = weights[k] * quadratic[k];
        }
        return std::sqrt(needed / std::max(1e-300, flat.left(whitened(moved))));
    };
    for (const double hz : kReportedAt) out.smallest_seen.emplace_back(hz, share_seen(hz));
    for (const Kind& kind : table.kinds()) {
        for (const Band& band : kind.bands) {
            if (band.hz > out.highest_hz && share_seen(band.hz) <= kShare) out.highest_hz = band.hz;
        }
    }
    return out;
}

}  // namespace vibrig::estimator::spectrum
