#include "estimator/filter/ud_filter.hpp"

#include <cmath>

#include "estimator/filter/instruction_set.hpp"

namespace vibrig::estimator {

UdFilter::UdFilter(const std::array<double, kConstants>& sigma) noexcept : kernel_(&ud_kernel()) {
    for (std::size_t c = 0; c < kConstants; ++c) {
        memory_.column[c][c] = 1.0;
        memory_.d_constant[c] = sigma[c] * sigma[c];
    }
    for (std::size_t k = 0; k < kAngles; ++k) memory_.angle_block[k][k] = 1.0;
}

void UdFilter::start_angles(const Vector3& angles, double variance) noexcept {
    for (std::size_t r = 0; r < kAngles; ++r) {
        for (double& u : memory_.angle_row[r]) u = 0.0;
        for (std::size_t c = 0; c < kAngles; ++c) memory_.angle_block[c][r] = c == r ? 1.0 : 0.0;
        memory_.d_angle[r] = variance;
        memory_.x_angle[r] = angles[r];
    }
}

void UdFilter::let_first_move(double variance) noexcept {
    constexpr std::size_t kFirst = 3;
    for (std::size_t moved = 0; moved < kFirst; ++moved) {
        std::array<double, kFirst> a{};
        a[moved] = 1.0;
        double c = variance;
        for (std::size_t j = moved + 1; j-- > 0;) {
            const double d = memory_.d_constant[j] + c * a[j] * a[j];
            if (!(d > 0)) continue;
            const double share = c * a[j] / d;
            for (std::size_t k = 0; k < j; ++k) {
                double& u = memory_.column[j][k];
                a[k] -= a[j] * u;
                u += share * a[k];
            }
            c *= memory_.d_constant[j] / d;
            memory_.d_constant[j] = d;
        }
    }
}

void UdFilter::sigma(std::array<double, kConstants>& out) const noexcept {
    out = {};
    for (std::size_t c = 0; c < kConstants; ++c) {
        for (std::size_t i = 0; i <= c; ++i) {
            out[i] += memory_.column[c][i] * memory_.column[c][i] * memory_.d_constant[c];
        }
    }
    for (double& s : out) s = std::sqrt(s);
}

void UdFilter::covariance(double* out) const noexcept {
    for (std::size_t i = 0; i < kConstants; ++i) {
        for (std::size_t j = i; j < kConstants; ++j) {
            double p = 0;
            for (std::size_t c = j; c < kConstants; ++c) {
                p += memory_.column[c][i] * memory_.column[c][j] * memory_.d_constant[c];
            }
            out[i * kConstants + j] = out[j * kConstants + i] = p;
        }
    }
}

}  // namespace vibrig::estimator
