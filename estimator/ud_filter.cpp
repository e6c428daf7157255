#include "estimator/ud_filter.hpp"

#include <cmath>

namespace vibrig::estimator {
namespace {

constexpr std::size_t kLane = 8;

/// Rows of a column rounded up to whole vectors; what lies beyond is zero.
constexpr std::size_t padded_rows(std::size_t column) { return (column / kLane + 1) * kLane; }

}  // namespace

UdFilter::UdFilter(const std::array<double, kConstants>& sigma) noexcept {
    for (std::size_t c = 0; c < kConstants; ++c) {
        column_[c][c] = 1.0;
        d_[kAngles + c] = sigma[c] * sigma[c];
    }
    for (std::size_t k = 0; k < kAngles; ++k) angle_block_[k][k] = 1.0;
}

void UdFilter::start_angles(const Vector3& angles, double variance) noexcept {
    angle_rows_ = {};
    angle_block_ = {};
    for (std::size_t k = 0; k < kAngles; ++k) {
        angle_block_[k][k] = 1.0;
        d_[k] = variance;
        x_[k] = angles[k];
    }
}

void UdFilter::predict(const Transition& t) noexcept {
    for (std::size_t c = 0; c < kConstants; ++c) {
        const std::array<double, kPadded>& u = column_[c];
        // h is applied before M: 30 products per column, not 90.
        Vector3 drift{};
        for (std::size_t i = 0; i <= c; i += 3) {
            drift[0] += t.h[i] * u[i];
            drift[1] += t.h[i + 1] * u[i + 1];
            drift[2] += t.h[i + 2] * u[i + 2];
        }
        const Vector3 a = angle_rows_[c];
        for (std::size_t r = 0; r < kAngles; ++r) {
            angle_rows_[c][r] =
                (t.f[r][0] * a[0] + t.f[r][1] * a[1] + t.f[r][2] * a[2]) +
                (t.g[r][0] * drift[0] + t.g[r][1] * drift[1] + t.g[r][2] * drift[2]);
        }
    }
    // Weighted modified Gram-Schmidt on [F U_angles | M], rows from the last (Thornton).
    std::array<std::array<double, 6>, 3> w{};
    for (std::size_t r = 0; r < kAngles; ++r) {
        for (std::size_t c = 0; c < kAngles; ++c) {
            for (std::size_t k = 0; k <= c; ++k) w[r][c] += t.f[r][k] * angle_block_[c][k];
            w[r][3 + c] = t.noise_map[r][c];
        }
    }
    const std::array<double, 6> weight{d_[0], d_[1], d_[2], t.noise, t.noise, t.noise};
    for (std::size_t row = kAngles; row-- > 0;) {
        std::array<double, 6> weighted{};
        double d = 0;
        for (std::size_t k = 0; k < 6; ++k) {
            weighted[k] = weight[k] * w[row][k];
            d += weighted[k] * w[row][k];
        }
        d_[row] = d;
        for (std::size_t above = 0; above < row; ++above) {
            double u = 0;
            for (std::size_t k = 0; k < 6; ++k) u += w[above][k] * weighted[k];
            u = d > 0 ? u / d : 0.0;
            angle_block_[row][above] = u;
            for (std::size_t k = 0; k < 6; ++k) w[above][k] -= u * w[row][k];
        }
    }
    for (std::size_t k = 0; k < kAngles; ++k) x_[k] += t.angle_increment[k];
}

UdFilter::Matrix3 UdFilter::angle_covariance() const noexcept {
    double p00 = 0, p01 = 0, p02 = 0, p11 = 0, p12 = 0, p22 = 0;
    const auto add = [&](const Vector3& u, double d) {
        const double v0 = d * u[0], v1 = d * u[1], v2 = d * u[2];
        p00 += v0 * u[0];
        p01 += v0 * u[1];
        p02 += v0 * u[2];
        p11 += v1 * u[1];
        p12 += v1 * u[2];
        p22 += v2 * u[2];
    };
    for (std::size_t c = 0; c < kAngles; ++c) add(angle_block_[c], d_[c]);
    for (std::size_t c = 0; c < kConstants; ++c) add(angle_rows_[c], d_[kAngles + c]);
    return {{{p00, p01, p02}, {p01, p11, p12}, {p02, p12, p22}}};
}

double UdFilter::nis(const Vector3& measured, double variance) const noexcept {
    Matrix3 s = angle_covariance();
    for (std::size_t k = 0; k < kAngles; ++k) s[k][k] += variance;
    // L D L^T of the 3 x 3.
    const double n0 = measured[0] - x_[0], n1 = measured[1] - x_[1], n2 = measured[2] - x_[2];
    const double l10 = s[1][0] / s[0][0], l20 = s[2][0] / s[0][0];
    const double d1 = s[1][1] - l10 * s[1][0];
    const double l21 = (s[2][1] - l20 * s[1][0]) / d1;
    const double d2 = s[2][2] - l20 * s[2][0] - l21 * l21 * d1;
    const double y1 = n1 - l10 * n0;
    const double y2 = n2 - l20 * n0 - l21 * y1;
    return n0 * n0 / s[0][0] + y1 * y1 / d1 + y2 * y2 / d2;
}

void UdFilter::update(const Vector3& measured, double variance) noexcept {
    // The three Bierman sweeps run together: measurement k meets a column after measurements 0..k-1
    // have.
    Vector3 alpha{variance, variance, variance};
    Matrix3 gain_angles{};
    alignas(64) std::array<std::array<double, kPadded>, 3> gain{};
    Vector3 lambda{}, v{};
    const auto sweep_angle_rows = [&](Vector3& u, double& d) {
        for (std::size_t k = 0; k < kAngles; ++k) {
            const double f = u[k];
            v[k] = d * f;
            lambda[k] = -f / alpha[k];
            const double next = alpha[k] + f * v[k];
            d *= alpha[k] / next;
            alpha[k] = next;
            for (std::size_t r = 0; r < kAngles; ++r) {
                const double old = u[r];
                u[r] = old + gain_angles[k][r] * lambda[k];
                gain_angles[k][r] += old * v[k];
            }
        }
    };
    for (std::size_t c = 0; c < kAngles; ++c) sweep_angle_rows(angle_block_[c], d_[c]);
    for (std::size_t c = 0; c < kConstants; ++c) {
        sweep_angle_rows(angle_rows_[c], d_[kAngles + c]);
        double* __restrict u = column_[c].data();
        double* __restrict b0 = gain[0].data();
        double* __restrict b1 = gain[1].data();
        double* __restrict b2 = gain[2].data();
        const double l0 = lambda[0], l1 = lambda[1], l2 = lambda[2];
        const double v0 = v[0], v1 = v[1], v2 = v[2];
        for (std::size_t block = 0; block < padded_rows(c); block += kLane) {
            for (std::size_t i = block; i < block + kLane; ++i) {
                const double t0 = u[i];
                const double t1 = t0 + b0[i] * l0;
                const double t2 = t1 + b1[i] * l1;
                u[i] = t2 + b2[i] * l2;
                b0[i] += t0 * v0;
                b1[i] += t1 * v1;
                b2[i] += t2 * v2;
            }
        }
    }
    for (std::size_t k = 0; k < kAngles; ++k) {
        const double scaled = (measured[k] - x_[k]) / alpha[k];
        for (std::size_t r = 0; r < kAngles; ++r) x_[r] += gain_angles[k][r] * scaled;
        for (std::size_t i = 0; i < kConstants; ++i) x_[kAngles + i] += gain[k][i] * scaled;
    }
}

void UdFilter::sigma(std::array<double, kConstants>& out) const noexcept {
    for (std::size_t i = 0; i < kConstants; ++i) {
        double variance = 0;
        for (std::size_t c = i; c < kConstants; ++c) {
            variance += column_[c][i] * column_[c][i] * d_[kAngles + c];
        }
        out[i] = std::sqrt(variance);
    }
}

void UdFilter::covariance(double* out) const noexcept {
    for (std::size_t i = 0; i < kConstants; ++i) {
        for (std::size_t j = i; j < kConstants; ++j) {
            double p = 0;
            for (std::size_t c = j; c < kConstants; ++c)
                p += column_[c][i] * column_[c][j] * d_[kAngles + c];
            out[i * kConstants + j] = out[j * kConstants + i] = p;
        }
    }
}

}  // namespace vibrig::estimator
