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

HannMeans GrowingHann::means() const noexcept {
    const auto blocks = blocks_.used();
    const auto count = static_cast<double>(blocks_.count());
    if (count == 0) return {};
    if (count == 1) return {blocks[0][0][0], blocks[0][0][1]};
    const double step = 2.0 * kPi / count;
    HannMeans means;
    const std::size_t length = blocks_.length();
    for (std::size_t k = 0; k < blocks.size(); ++k) {
        const double centre =
            static_cast<double>(k * length) + 0.5 * static_cast<double>(length - 1);
        const double c = std::cos(step * (centre + 0.5)), s = std::sin(step * (centre + 0.5));
        const auto weighted = [&](std::size_t channel) {
            const double zeroth = blocks[k][0][channel];
            return zeroth - c * (zeroth - 0.5 * step * step * blocks[k][2][channel]) +
                   s * step * blocks[k][1][channel];
        };
        means.mean += weighted(0);
        means.mean_square += weighted(1);
    }
    means.mean /= count;
    means.mean_square /= count;
    return means;
}

}  // namespace vibrig::estimator
