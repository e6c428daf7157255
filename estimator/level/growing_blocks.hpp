#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

namespace vibrig::estimator {

/// Sums over all samples given, however many, for means with a weight that is known only in the
/// end: of x, x tau and x tau^2 of each channel over blocks of samples, tau from the block's
/// centre, about which the weight is developed to second order. Blocks merge in pairs when there
/// are too many. Never allocates after construction.
template <std::size_t Channels, std::size_t Blocks>
class GrowingBlocks {
  public:
    using Values = std::array<double, Channels>;
    using Block = std::array<Values, 3>;

    GrowingBlocks() : blocks_(Blocks) {}
    void clear() noexcept {
        full_ = in_block_ = count_ = 0;
        length_ = 1;
        blocks_[0] = {};
    }
    void add(const Values& x) noexcept {
        const double tau = static_cast<double>(in_block_) - 0.5 * static_cast<double>(length_ - 1);
        Block& block = blocks_[full_];
        for (std::size_t c = 0; c < Channels; ++c) {
            block[0][c] += x[c];
            block[1][c] += x[c] * tau;
            block[2][c] += x[c] * tau * tau;
        }
        add_missing();
    }
    /// The time of a sample that there is not passes.
    void add_missing() noexcept {
        ++count_;
        if (++in_block_ < length_) return;
        in_block_ = 0;
        if (++full_ == Blocks) merge();
        blocks_[full_] = {};
    }

    [[nodiscard]] std::size_t count() const noexcept { return count_; }
    /// Samples of a block; the last may have fewer yet.
    [[nodiscard]] std::size_t length() const noexcept { return length_; }
    [[nodiscard]] std::span<const Block> used() const noexcept {
        return std::span(blocks_).first(full_ + (in_block_ > 0 ? 1 : 0));
    }

  private:
    void merge() noexcept {
        const double half = 0.5 * static_cast<double>(length_);
        for (std::size_t k = 0; k < Blocks / 2; ++k) {
            const Block a = blocks_[2 * k], b = blocks_[2 * k + 1];
            for (std::size_t c = 0; c < Channels; ++c) {
                blocks_[k][0][c] = a[0][c] + b[0][c];
                blocks_[k][1][c] = a[1][c] - half * a[0][c] + b[1][c] + half * b[0][c];
                blocks_[k][2][c] = a[2][c] - 2.0 * half * a[1][c] + half * half * a[0][c] +
                                   b[2][c] + 2.0 * half * b[1][c] + half * half * b[0][c];
            }
        }
        full_ = Blocks / 2;
        length_ *= 2;
    }

    std::vector<Block> blocks_;
    std::size_t full_ = 0;      ///< complete blocks
    std::size_t length_ = 1;    ///< samples per block
    std::size_t in_block_ = 0;  ///< samples in the block that grows
    std::size_t count_ = 0;
};

}  // namespace vibrig::estimator
