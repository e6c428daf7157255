#pragma once

#include <array>
#include <cstddef>
#include <vector>

namespace vibrig::estimator {

/// Hann-weighted means of a signal and of its square, weights sin^2(pi (i + 1/2) / n).
struct HannMeans {
    double mean = 0, mean_square = 0;
};

/// Over a window of a ring. The weights stay for the next window if that is as long. Never
/// allocates after construction.
class HannWindow {
  public:
    explicit HannWindow(std::size_t most) { weights_.reserve(most); }
    /// Means over `count` samples of a ring of `capacity`, the first at index `begin`.
    [[nodiscard]] HannMeans means(const double* ring, std::size_t capacity, std::size_t begin,
                                  std::size_t count) noexcept;

  private:
    void weigh(std::size_t count) noexcept;
    std::vector<double> weights_;
};

/// The same over all samples given, however many: n is not known in advance, so moments of blocks
/// are kept and the weight is developed to second order about each block's centre. Blocks merge in
/// pairs when there are too many; the phase of a block stays below 2 pi / 1024, so the third order
/// is below 1e-8. Never allocates after construction.
class GrowingHann {
  public:
    GrowingHann();
    void clear() noexcept;
    void add(double value) noexcept;
    [[nodiscard]] HannMeans means() const noexcept;
    [[nodiscard]] std::size_t count() const noexcept { return count_; }

  private:
    /// Sums of x, x tau, x tau^2 for x = signal and its square, tau from the block's centre.
    struct Block {
        std::array<double, 3> signal{}, square{};
    };
    void merge() noexcept;

    static constexpr std::size_t kBlocks = 2048;
    std::vector<Block> blocks_;
    std::size_t full_ = 0;      ///< complete blocks
    std::size_t length_ = 1;    ///< samples per block
    std::size_t in_block_ = 0;  ///< samples in the block that grows
    std::size_t count_ = 0;
};

}  // namespace vibrig::estimator
