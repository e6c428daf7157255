#include "tests/bench/dense_filter.hpp"

#include <Eigen/Core>
#include <cmath>

namespace vibrig::bench {

struct DenseFilter::Impl {
    static constexpr int kN = 33;
    Eigen::Matrix<double, kN, 1> x = Eigen::Matrix<double, kN, 1>::Zero();
    Eigen::Matrix<double, kN, kN> p = Eigen::Matrix<double, kN, kN>::Zero();
    Eigen::Matrix<double, kN, kN> f = Eigen::Matrix<double, kN, kN>::Identity();
    Eigen::Matrix<double, kN, kN> work = Eigen::Matrix<double, kN, kN>::Zero();
};

DenseFilter::DenseFilter(double prior_sigma) : impl_(std::make_unique<Impl>()) {
    impl_->p.diagonal().tail<30>().setConstant(prior_sigma * prior_sigma);
    impl_->p.diagonal().head<3>().setConstant(25.0);
}
DenseFilter::~DenseFilter() = default;

void DenseFilter::predict(const estimator::UdTransition& t) {
    Impl& m = *impl_;
    Eigen::Matrix3d map;
    for (int r = 0; r < 3; ++r) {
        m.x[r] += t.angle_increment[r];
        for (int c = 0; c < 3; ++c) {
            m.f(r, c) = t.f[r][c];
            map(r, c) = t.noise_map[r][c];
        }
        for (int i = 0; i < 30; ++i) m.f(r, 3 + i) = t.g[r][i % 3] * t.h[i];
    }
    m.work.noalias() = m.f * m.p;
    m.p.noalias() = m.work * m.f.transpose();
    m.p.topLeftCorner<3, 3>() += t.noise * map * map.transpose();
}

void DenseFilter::update(const double* measured, double variance) {
    Impl& m = *impl_;
    for (int k = 0; k < 3; ++k) {
        const double s = m.p(k, k) + variance;
        const Eigen::Matrix<double, Impl::kN, 1> column = m.p.col(k);
        const Eigen::Matrix<double, Impl::kN, 1> gain = column / s;
        m.x += gain * (measured[k] - m.x[k]);
        m.p.noalias() -= gain * column.transpose();
    }
}

const double* DenseFilter::state() const { return impl_->x.data(); }
double DenseFilter::sigma(int index) const { return std::sqrt(impl_->p(index, index)); }

}  // namespace vibrig::bench
