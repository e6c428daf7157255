#pragma once

#include <cstddef>
#include <vector>

#include "estimator/level/growing_blocks.hpp"

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

/// The same over all samples given, however many: n is not known in advance. The phase of a block
/// stays below 2 pi / 1024, so the third order is below 1e-8. Never allocates after construction.
class GrowingHann {
  public:
    void clear() noexcept { blocks_.clear(); }
    void add(double value) noexcept { blocks_.add({value, value * value}); }
    [[nodiscard]] HannMeans means() const noexcept;
    [[nodiscard]] std::size_t count() const noexcept { return blocks_.count(); }

  private:
    GrowingBlocks<2, 2048> blocks_;  ///< of the signal and its square
};

}  // namespace vibrig::estimator
