#include "estimator/uncertainty/fit.hpp"

#include <cmath>

#include "estimator/filter/linear_algebra.hpp"
#include "estimator/filter/mapped.hpp"
#include "estimator/filter/parameters.hpp"

namespace vibrig::estimator::uncertainty {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr auto kCoefficients = static_cast<Index>(kParameters);

/// W with W variance W' = 1: triangular. NaN if the variance is none.
Eigen::Matrix3d whitening_of(const Eigen::Matrix3d& variance) {
    return linear_algebra::Cholesky::or_nan(variance).whiten(Eigen::Matrix3d::Identity());
}

}  // namespace

MatrixXd all_regressors(const DwellTable& table) {
    MatrixXd h = MatrixXd::Zero(3 * table.dwells(), kCoefficients);
    for (Index k = 0; k < table.dwells(); ++k) {
        const auto regressors = mapped(table.rows[static_cast<std::size_t>(k)].regressors);
        for (Index j = 0; j < 3; ++j) {
            for (Index g = 0; g < kCoefficients / 3; ++g)
                h(3 * k + j, 3 * g + j) = regressors(j, g);
        }
    }
    return h;
}

VectorXd all_rates(const DwellTable& table) {
    VectorXd y(3 * table.dwells());
    for (Index k = 0; k < table.dwells(); ++k)
        y.segment<3>(3 * k) = mapped(table.rows[static_cast<std::size_t>(k)].rate);
    return y;
}

NullFit::NullFit(const DwellTable& table, const MatrixXd& declared,
                 const VectorXd& prior_information, int freed)
    : table_(table), h_(all_regressors(table)), declared_(declared) {
    for (const auto& row : table_.rows) whitening_.push_back(whitening_of(mapped(row.variance)));
    MatrixXd columns(h_.rows(), kCoefficients + declared.cols());
    columns << h_, declared;
    white_ = whitened(columns);
    VectorXd information = VectorXd::Ones(columns.cols());
    information.head(kCoefficients) = prior_information;
    MatrixXd normal = white_.transpose() * white_;
    const MatrixXd of_data = normal.topLeftCorner(kCoefficients, kCoefficients);
    normal.diagonal() += information;
    normal_ = linear_algebra::Cholesky::or_nan(normal);

    const MatrixXd y = whitened(all_rates(table));
    y_left_ = left(y);
    // y' Q0 y holds what the prior says of the coefficients: how large they are is no lack of fit.
    const VectorXd fitted =
        VectorXd(normal_->solve(white_.transpose() * y).col(0)).head(kCoefficients);
    chi_square_ = y_left_.dot(y.col(0)) - fitted.cwiseAbs2().dot(prior_information);

    MatrixXd constant = of_data;
    constant.diagonal() += prior_information;
    covariance_ = linear_algebra::positive_inverse(constant);
    value_ = covariance_ * (white_.leftCols(kCoefficients).transpose() * y);
    // trace(I - P Pi0): how many coefficients the data determine.
    const double determined =
        static_cast<double>(kCoefficients) - covariance_.diagonal().dot(prior_information);
    degrees_ = static_cast<int>(h_.rows()) - static_cast<int>(std::lround(determined)) - freed;
}

MatrixXd NullFit::whitened(const MatrixXd& x) const {
    MatrixXd white = x;
    for (Index k = 0; k < table_.dwells(); ++k) {
        const Eigen::Matrix3d& whitening = whitening_[static_cast<std::size_t>(k)];
        white.middleRows<3>(3 * k) = whitening.lazyProduct(x.middleRows<3>(3 * k));
    }
    return white;
}

MatrixXd NullFit::left(const MatrixXd& white) const {
    return white - white_ * normal_->solve(white_.transpose() * white);
}

NullFit::Projection NullFit::project(const MatrixXd& z) const {
    const MatrixXd white = whitened(z);
    return {white.transpose() * y_left_, white.transpose() * left(white)};
}

MatrixXd NullFit::weights(const MatrixXd& z) const {
    MatrixXd out = left(whitened(z));
    for (Index k = 0; k < table_.dwells(); ++k) {
        const Eigen::Matrix3d& whitening = whitening_[static_cast<std::size_t>(k)];
        out.middleRows<3>(3 * k) =
            whitening.transpose().lazyProduct(out.middleRows<3>(3 * k)).eval();
    }
    return out;
}

VectorXd NullFit::change(const VectorXd& rates) const {
    return covariance_ * (white_.leftCols(kCoefficients).transpose() * whitened(rates));
}

VectorXd NullFit::residual(const VectorXd& coefficients) const {
    return all_rates(table_) - h_ * coefficients;
}

VectorXd NullFit::residual_variance(Index declared) const {
    VectorXd variance(h_.rows());
    for (Index k = 0; k < table_.dwells(); ++k)
        variance.segment<3>(3 * k) =
            mapped(table_.rows[static_cast<std::size_t>(k)].variance).diagonal();
    if (declared > 0) variance += declared_.leftCols(declared).rowwise().squaredNorm();
    const MatrixXd hp = h_ * covariance_;
    variance -= hp.cwiseProduct(h_).rowwise().sum();
    return variance.cwiseMax(0.0);
}

double RampFit::log_evidence() const {
    double square = 0;
    for (std::size_t j = 0; j < 3; ++j) square += (mean[j] / sigma[j]) * (mean[j] / sigma[j]);
    constexpr std::array<double, 3> kRampSizes{2, 6, 20};
    double sum = 0;
    for (const double q : kRampSizes) {
        const double share = q * q / (1 + q * q);
        // Relative to the largest term: the exponent may be large.
        sum += std::exp(-1.5 * std::log1p(q * q) + 0.5 * (share - 1) * square);
    }
    return 0.5 * square + std::log(sum / kRampSizes.size());
}

RampFit fit_ramps(const DwellTable& table, const VectorXd& coefficients) {
    RampFit fit;
    fit.degrees = 3 * table.rows.size();
    std::array<double, 3> weight{}, sum{};
    for (const DwellRow& row : table.rows) {
        for (std::size_t j = 0; j < 3; ++j) {
            double off = row.ramp[j];
            for (std::size_t i = 0; i < kGroups; ++i)
                off -= row.ramp_regressors[j][i] *
                       coefficients[static_cast<Index>(internal_index(i, j))];
            const double variance = row.ramp_variance[j][j];
            fit.chi_square += off * off / variance;
            sum[j] += off / variance;
            weight[j] += 1 / variance;
        }
    }
    for (std::size_t j = 0; j < 3; ++j) {
        fit.mean[j] = sum[j] / weight[j];
        fit.sigma[j] = 1 / std::sqrt(weight[j]);
    }
    return fit;
}

}  // namespace vibrig::estimator::uncertainty
