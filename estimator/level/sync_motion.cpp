#include "estimator/level/sync_motion.hpp"

#include <algorithm>
#include <cmath>

#include "estimator/filter/kinematics.hpp"

namespace vibrig::estimator {
namespace {

/// A vibration half a hertz off the nominal loses 2 % over such a block.
constexpr double kBlock_s = 0.2;

}  // namespace

SyncMotion::SyncMotion(double nominal_hz)
    : nominal_hz_(nominal_hz), block_s_(kBlock_s), blocks_(kBlocks) {}

void SyncMotion::clear() noexcept {
    block_s_ = kBlock_s;
    std::fill_n(blocks_.begin(), used_, Block{});
    used_ = 0;
}

void SyncMotion::add(double time_s, const std::array<double, 3>& innovation_arcsec) noexcept {
    if (!(time_s >= 0)) return;
    while (time_s >= block_s_ * static_cast<double>(kBlocks)) merge();
    const auto at = static_cast<std::size_t>(time_s / block_s_);
    used_ = std::max(used_, at + 1);
    Block& block = blocks_[at];
    const double phase = 2.0 * kPi * nominal_hz_ * time_s;
    const double c = std::cos(phase), s = std::sin(phase);
    block.samples += 1;
    for (std::size_t k = 0; k < 3; ++k) {
        block.phasor[k][0] += c * innovation_arcsec[k];
        block.phasor[k][1] -= s * innovation_arcsec[k];
    }
}

void SyncMotion::merge() noexcept {
    for (std::size_t b = 0; b < kBlocks / 2; ++b) {
        Block joined = blocks_[2 * b];
        const Block& other = blocks_[2 * b + 1];
        joined.samples += other.samples;
        for (std::size_t k = 0; k < 3; ++k) {
            for (std::size_t part = 0; part < 2; ++part)
                joined.phasor[k][part] += other.phasor[k][part];
        }
        blocks_[b] = joined;
    }
    std::fill(blocks_.begin() + kBlocks / 2, blocks_.end(), Block{});
    used_ = (used_ + 1) / 2;
    block_s_ *= 2;
}

SyncMotion::Sums SyncMotion::sums(double frequency_hz) const noexcept {
    const double turn = 2.0 * kPi * (frequency_hz - nominal_hz_) * block_s_;
    Sums out;
    for (std::size_t b = 0; b < used_; ++b) {
        const double middle = static_cast<double>(b) + 0.5;
        const double half = std::sin(kPi * middle / static_cast<double>(used_));
        const double weight = half * half;
        const double c = std::cos(turn * middle), s = std::sin(turn * middle);
        out.weights += weight * blocks_[b].samples;
        out.squares += weight * weight * blocks_[b].samples;
        for (std::size_t k = 0; k < 3; ++k) {
            const auto& [x, y] = blocks_[b].phasor[k];
            out.re[k] += weight * (c * x + s * y);
            out.im[k] += weight * (c * y - s * x);
        }
    }
    return out;
}

double SyncMotion::amplitude_arcsec(double frequency_hz, double variance) const noexcept {
    const auto [re, im, weights, squares] = sums(frequency_hz);
    if (!(weights > 0)) return 0;
    double sum = 0;
    for (std::size_t k = 0; k < 3; ++k) sum += re[k] * re[k] + im[k] * im[k];
    // White noise leaves 4 sigma^2 sum w^2 / (sum w)^2 in the square of each axis.
    const double square = 4.0 * (sum - 3.0 * variance * squares) / (weights * weights);
    return std::sqrt(std::max(0.0, square));
}

SyncMotion::Lines SyncMotion::lines(double frequency_hz) const noexcept {
    const auto [re, im, weights, squares] = sums(frequency_hz);
    Lines out;
    if (!(weights > 0)) return out;
    for (std::size_t k = 0; k < 3; ++k)
        out.amplitude[k] = {2.0 * re[k] / weights, 2.0 * im[k] / weights};
    out.noise_square = 4.0 * squares / (weights * weights);
    return out;
}

}  // namespace vibrig::estimator
