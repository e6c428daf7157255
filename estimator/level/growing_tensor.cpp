#include "estimator/level/growing_tensor.hpp"

#include <cmath>

#include "estimator/filter/kinematics.hpp"

namespace vibrig::estimator {
namespace {

/// A ratio of sums over n samples moves by no more than that when n grows by a thirty-second.
constexpr std::size_t kGrowth = 32;

}  // namespace

void GrowingTensor::clear() noexcept {
    blocks_.clear();
    count_at_shape_ = 0;
}

void GrowingTensor::add(const Eigen::Vector3d& f) noexcept {
    blocks_.add({1.0, f[0], f[1], f[2], f[0] * f[0], f[1] * f[1], f[2] * f[2], f[0] * f[1],
                 f[0] * f[2], f[1] * f[2]});
}

std::array<double, GrowingTensor::kChannels> GrowingTensor::sums() const noexcept {
    std::array<double, kChannels> total{};
    const double step = 2.0 * kPi / static_cast<double>(blocks_.count());
    const double first = step * 0.5 * static_cast<double>(blocks_.length());
    const double turn = step * static_cast<double>(blocks_.length());
    const double cs = std::cos(turn), sn = std::sin(turn);
    double c = std::cos(first), s = std::sin(first);
    for (const auto& block : blocks_.used()) {
        for (std::size_t i = 0; i < kChannels; ++i) {
            total[i] += (1.0 - c) * block[0][i] + s * step * block[1][i] +
                        0.5 * c * step * step * block[2][i];
        }
        const double next = c * cs - s * sn;
        s = s * cs + c * sn;
        c = next;
    }
    return total;
}

bool GrowingTensor::due() const noexcept {
    return blocks_.count() >= count_at_shape_ + count_at_shape_ / kGrowth;
}

bool GrowingTensor::shape(double noise_g, LevelTensor& out) noexcept {
    count_at_shape_ = blocks_.count();
    if (count_at_shape_ < 2) return false;
    const std::array<double, kChannels> w = sums();
    if (!(w[0] > 0)) return false;
    const double n = w[1] / w[0], u = w[2] / w[0], e = w[3] / w[0];
    const double noise = noise_g * noise_g * u * u;  // relative to K^2, as kappa's
    const double nn = w[4] / w[0] - n * n - noise;
    const double uu = w[5] / w[0] - u * u - noise;
    const double ee = w[6] / w[0] - e * e - noise;
    if (!(uu > 0)) return false;
    out = {nn / uu,
           1.0,
           ee / uu,
           (w[7] / w[0] - n * u) / uu,
           (w[8] / w[0] - n * e) / uu,
           (w[9] / w[0] - u * e) / uu};
    return true;
}

}  // namespace vibrig::estimator
