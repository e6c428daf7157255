#include "estimator/uncertainty/rates_covariance.hpp"

#include <algorithm>
#include <cmath>

namespace vibrig::estimator::uncertainty {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

RatesCovariance::RatesCovariance(const VectorXd& noise, const VectorXd& elapsed, double walk)
    : gain_(noise.size()), deviation_(noise.size()), columns_(noise.size(), 0) {
    double variance = 0;
    for (Index i = 0; i < noise.size(); ++i) {
        if (i > 0) variance += walk * std::max(0.0, elapsed[i] - elapsed[i - 1]);
        const double innovation = variance + noise[i];
        gain_[i] = variance / innovation;
        deviation_[i] = std::sqrt(innovation);
        variance *= noise[i] / innovation;
        log_determinant_ += std::log(innovation);
    }
}

void RatesCovariance::add(const MatrixXd& columns, const MatrixXd& inverse_core) {
    if (columns.cols() == 0) return;
    columns_ = whitened(columns);
    core_.emplace(inverse_core + linear_algebra::gram(columns_));
    log_determinant_ += core_->log_det() - linear_algebra::LowerUpper(inverse_core).log_det();
}

MatrixXd RatesCovariance::whitened(const MatrixXd& x) const {
    MatrixXd out(x.rows(), x.cols());
    for (Index c = 0; c < x.cols(); ++c) {
        double mean = 0;
        for (Index i = 0; i < x.rows(); ++i) {
            const double off = x(i, c) - mean;
            mean += gain_[i] * off;
            out(i, c) = off / deviation_[i];
        }
    }
    return out;
}

/// The transpose of whitened(): the same steps, the last first.
MatrixXd RatesCovariance::whitened_back(MatrixXd x) const {
    for (Index c = 0; c < x.cols(); ++c) {
        double carried = 0;
        for (Index i = x.rows() - 1; i >= 0; --i) {
            x(i, c) = x(i, c) / deviation_[i] + gain_[i] * carried;
            carried -= x(i, c);
        }
    }
    return x;
}

MatrixXd RatesCovariance::solve(const MatrixXd& x) const {
    MatrixXd white = whitened(x);
    if (columns_.cols() > 0) white -= columns_ * core_->solve(columns_.transpose() * white);
    return whitened_back(std::move(white));
}

VectorXd walk_means(const VectorXd& elapsed) {
    const Index n = elapsed.size();
    VectorXd means(n);
    double before = 0;
    for (Index i = 0; i < n; ++i) {
        before += elapsed[i];
        means[i] = (before + static_cast<double>(n - 1 - i) * elapsed[i]) / static_cast<double>(n);
    }
    return means;
}

RatesCovariance drifting(const VectorXd& noise, const VectorXd& elapsed, double walk,
                         const MatrixXd& columns) {
    return drifting(RatesCovariance(noise, elapsed, walk), elapsed, walk, columns);
}

RatesCovariance drifting(RatesCovariance still, const VectorXd& elapsed, double walk,
                         const MatrixXd& columns) {
    const Index r = columns.cols(), of_mean = walk > 0 ? 2 : 0;
    MatrixXd u(elapsed.size(), r + of_mean);
    MatrixXd inverse = MatrixXd::Identity(r + of_mean, r + of_mean);
    u.leftCols(r) = columns;
    if (walk > 0) {
        // P K P = K - 1 k' - k 1' + mean(k) 1 1', k the means of the rows.
        const VectorXd means = walk_means(elapsed);
        u.col(r).setOnes();
        u.col(r + 1) = means;
        inverse.bottomRightCorner<2, 2>() << 0, -1, -1, -means.mean();
        inverse.bottomRightCorner<2, 2>() /= walk;
    }
    still.add(u, inverse);
    return still;
}

RatesCovariance::Whitened RatesCovariance::whiten(const MatrixXd& x) const {
    MatrixXd white = whitened(x);
    MatrixXd square = white.transpose() * white;
    return {std::move(white), std::move(square)};
}

MatrixXd RatesCovariance::square(const MatrixXd& x) const { return square(whiten(x)); }

MatrixXd RatesCovariance::square(const Whitened& of) const {
    MatrixXd out = of.square;
    if (columns_.cols() > 0) {
        const MatrixXd seen = columns_.transpose() * of.x;
        out -= seen.transpose() * core_->solve(seen);
    }
    return out;
}

}  // namespace vibrig::estimator::uncertainty
