#include "estimator/level/growing_tensor.hpp"

#include <cmath>

#include "estimator/filter/kinematics.hpp"

namespace vibrig::estimator {
namespace {

/// A ratio of sums over n samples moves by no more than that when n grows by a thirty-second.
constexpr std::size_t kGrowth = 32;

}  // namespace

GrowingTensor::GrowingTensor() : blocks_(kBlocks) {}

void GrowingTensor::clear() noexcept {
    full_ = in_block_ = count_ = count_at_shape_ = 0;
    length_ = 1;
    blocks_[0] = {};
}

void GrowingTensor::add(const Eigen::Vector3d& f) noexcept {
    const std::array<double, kChannels> x{1.0,         f[0],        f[1],        f[2],
                                          f[0] * f[0], f[1] * f[1], f[2] * f[2], f[0] * f[1],
                                          f[0] * f[2], f[1] * f[2]};
    const double tau = static_cast<double>(in_block_) - 0.5 * static_cast<double>(length_ - 1);
    Block& block = blocks_[full_];
    for (std::size_t c = 0; c < kChannels; ++c) {
        block.sum[0][c] += x[c];
        block.sum[1][c] += x[c] * tau;
        block.sum[2][c] += x[c] * tau * tau;
    }
    advance();
}

void GrowingTensor::advance() noexcept {
    ++count_;
    if (++in_block_ < length_) return;
    in_block_ = 0;
    if (++full_ == kBlocks) merge();
    blocks_[full_] = {};
}

void GrowingTensor::merge() noexcept {
    const double half = 0.5 * static_cast<double>(length_);
    for (std::size_t k = 0; k < kBlocks / 2; ++k) {
        const Block a = blocks_[2 * k], b = blocks_[2 * k + 1];
        for (std::size_t c = 0; c < kChannels; ++c) {
            blocks_[k].sum[0][c] = a.sum[0][c] + b.sum[0][c];
            blocks_[k].sum[1][c] =
                a.sum[1][c] - half * a.sum[0][c] + b.sum[1][c] + half * b.sum[0][c];
            blocks_[k].sum[2][c] = a.sum[2][c] - 2.0 * half * a.sum[1][c] +
                                   half * half * a.sum[0][c] + b.sum[2][c] +
                                   2.0 * half * b.sum[1][c] + half * half * b.sum[0][c];
        }
    }
    full_ = kBlocks / 2;
    length_ *= 2;
}

std::array<double, GrowingTensor::kChannels> GrowingTensor::sums() const noexcept {
    std::array<double, kChannels> total{};
    const double step = 2.0 * kPi / static_cast<double>(count_);
    const std::size_t used = full_ + (in_block_ > 0 ? 1 : 0);
    const double first = step * 0.5 * static_cast<double>(length_);
    const double turn = step * static_cast<double>(length_);
    const double cs = std::cos(turn), sn = std::sin(turn);
    double c = std::cos(first), s = std::sin(first);
    for (std::size_t k = 0; k < used; ++k) {
        const Block& block = blocks_[k];
        for (std::size_t i = 0; i < kChannels; ++i) {
            total[i] += (1.0 - c) * block.sum[0][i] + s * step * block.sum[1][i] +
                        0.5 * c * step * step * block.sum[2][i];
        }
        const double next = c * cs - s * sn;
        s = s * cs + c * sn;
        c = next;
    }
    return total;
}

bool GrowingTensor::due() const noexcept {
    return count_ >= count_at_shape_ + count_at_shape_ / kGrowth;
}

bool GrowingTensor::shape(double noise_g, LevelTensor& out) noexcept {
    count_at_shape_ = count_;
    if (count_ < 2) return false;
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
