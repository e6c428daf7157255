#include "estimator/level/hann.hpp"

#include <cmath>

#include "estimator/filter/kinematics.hpp"

namespace vibrig::estimator {

void HannWindow::weigh(std::size_t count) noexcept {
    weights_.clear();
    // cos(2 pi (i + 1/2) / n) by rotation: one sine and cosine per call.
    const double step = 2.0 * kPi / static_cast<double>(count);
    const double cs = std::cos(step), sn = std::sin(step);
    double c = std::cos(step / 2.0), s = std::sin(step / 2.0);
    for (std::size_t i = 0; i < count; ++i) {
        weights_.push_back(1.0 - c);
        const double next = c * cs - s * sn;
        s = s * cs + c * sn;
        c = next;
    }
}

HannMeans HannWindow::means(const double* ring, std::size_t capacity, std::size_t begin,
                            std::size_t count) noexcept {
    if (count == 0) return {};
    if (weights_.size() != count) weigh(count);
    double sum = 0, square = 0;
    std::size_t at = begin;
    for (const double weight : weights_) {
        const double value = ring[at];
        const double weighted = weight * value;
        sum += weighted;
        square += weighted * value;
        if (++at == capacity) at = 0;
    }
    // A single sample has weight 2; otherwise the cosines sum to zero.
    const double norm = count == 1 ? 2.0 : static_cast<double>(count);
    return {sum / norm, square / norm};
}

GrowingHann::GrowingHann() : blocks_(kBlocks) {}

void GrowingHann::clear() noexcept {
    full_ = in_block_ = count_ = 0;
    length_ = 1;
    blocks_[0] = {};
}

void GrowingHann::add(double value) noexcept {
    Block& block = blocks_[full_];
    const double tau = static_cast<double>(in_block_) - 0.5 * static_cast<double>(length_ - 1);
    const double square = value * value;
    block.signal[0] += value;
    block.signal[1] += value * tau;
    block.signal[2] += value * tau * tau;
    block.square[0] += square;
    block.square[1] += square * tau;
    block.square[2] += square * tau * tau;
    ++count_;
    if (++in_block_ < length_) return;
    in_block_ = 0;
    if (++full_ == kBlocks) merge();
    blocks_[full_] = {};
}

void GrowingHann::merge() noexcept {
    const double half = 0.5 * static_cast<double>(length_);
    const auto joined = [half](const std::array<double, 3>& a, const std::array<double, 3>& b) {
        return std::array<double, 3>{a[0] + b[0], a[1] - half * a[0] + b[1] + half * b[0],
                                     a[2] - 2.0 * half * a[1] + half * half * a[0] + b[2] +
                                         2.0 * half * b[1] + half * half * b[0]};
    };
    for (std::size_t k = 0; k < kBlocks / 2; ++k) {
        const Block &a = blocks_[2 * k], &b = blocks_[2 * k + 1];
        blocks_[k] = {joined(a.signal, b.signal), joined(a.square, b.square)};
    }
    full_ = kBlocks / 2;
    length_ *= 2;
}

HannMeans GrowingHann::means() const noexcept {
    if (count_ == 0) return {};
    if (count_ == 1) return {blocks_[0].signal[0], blocks_[0].square[0]};
    const double step = 2.0 * kPi / static_cast<double>(count_);
    HannMeans means;
    const std::size_t used = full_ + (in_block_ > 0 ? 1 : 0);
    for (std::size_t k = 0; k < used; ++k) {
        const double centre =
            static_cast<double>(k * length_) + 0.5 * static_cast<double>(length_ - 1);
        const double c = std::cos(step * (centre + 0.5)), s = std::sin(step * (centre + 0.5));
        const auto weighted = [&](const std::array<double, 3>& m) {
            return m[0] - c * (m[0] - 0.5 * step * step * m[2]) + s * step * m[1];
        };
        means.mean += weighted(blocks_[k].signal);
        means.mean_square += weighted(blocks_[k].square);
    }
    means.mean /= static_cast<double>(count_);
    means.mean_square /= static_cast<double>(count_);
    return means;
}

}  // namespace vibrig::estimator
