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
    core_.compute(inverse_core + columns_.transpose() * columns_);
    const auto log_of = [](const Eigen::PartialPivLU<MatrixXd>& factor) {
        return factor.matrixLU().diagonal().array().abs().log().sum();
    };
    log_determinant_ += log_of(core_) - log_of(Eigen::PartialPivLU<MatrixXd>(inverse_core));
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
    if (columns_.cols() > 0) white -= columns_ * core_.solve(columns_.transpose() * white);
    return whitened_back(std::move(white));
}

MatrixXd RatesCovariance::square(const MatrixXd& x) const {
    const MatrixXd white = whitened(x);
    MatrixXd out = white.transpose() * white;
    if (columns_.cols() > 0) {
        const MatrixXd seen = columns_.transpose() * white;
        out -= seen.transpose() * core_.solve(seen);
    }
    return out;
}

}  // namespace vibrig::estimator::uncertainty
