#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

namespace vibrig::estimator::allan {

/// Weights of a window's differences by where their centre lies: alike; sin^2, so that what enters
/// and leaves counts little; or falling by e in a third of the window, so that the newest count
/// most.
enum class WindowShape : unsigned char { rectangular, hann, exponential };
/// Degrees of freedom over those of a rectangular window: (sum w)^2 / (n sum w^2).
[[nodiscard]] double share_of(WindowShape shape) noexcept;

/// Overlapping Allan and classical variance of the last `window` samples of a stream. One addition
/// costs a fixed number of operations per averaging factor; add() allocates and throws nothing.
class SlidingVariance {
  public:
    /// Factors from 1 to window / 2. Throws DataError when the window is too short for them.
    SlidingVariance(double tau0, std::size_t window, std::vector<std::size_t> factors);

    /// Rate; not finite means missing, and no difference will span it.
    void add(double rate) noexcept;

    [[nodiscard]] bool full() const noexcept { return newest_ >= window_; }
    [[nodiscard]] std::uint64_t samples() const noexcept { return newest_; }
    [[nodiscard]] std::size_t missing() const noexcept { return missing_; }
    [[nodiscard]] const std::vector<std::size_t>& factors() const noexcept { return factors_; }

    /// NaN when all samples are missing.
    [[nodiscard]] double mean() const noexcept;
    /// Rate unit squared, NaN when gaps leave no difference.
    [[nodiscard]] double allan(std::size_t k) const noexcept;
    /// The same with the weights of `shape`. Costs one pass over the window.
    [[nodiscard]] double allan(std::size_t k, WindowShape shape) const noexcept;
    /// Variance of overlapping averages about `mean`.
    [[nodiscard]] double classical(std::size_t k, double mean) const noexcept;
    struct Tiled {
        double variance = std::numeric_limits<double>::quiet_NaN();  ///< about the tiles' mean
        std::size_t covered = 0;  ///< samples, 0: fewer than two tiles between gaps
    };
    /// Classical variance of averages side by side in the longest part without gaps, averaged over
    /// all positions of the first. Costs one pass over the window.
    [[nodiscard]] Tiled tiled(std::size_t k) const noexcept;
    /// Degrees of freedom of allan(k) over those of a window without gaps, for white noise; 0:
    /// none.
    [[nodiscard]] double share(std::size_t k) const;

    /// Once per window the sums are computed anew: how often they were off by more than 1e-9.
    [[nodiscard]] std::uint64_t faults() const noexcept { return faults_; }

  private:
    struct Sums {
        double second = 0;  ///< squares of second differences
        double first = 0;
        double first_squares = 0;
        std::size_t seconds = 0;  ///< terms
        std::size_t firsts = 0;
    };

    [[nodiscard]] std::uint64_t oldest() const noexcept {
        return newest_ > window_ ? newest_ - window_ : 0;
    }
    void enter(std::size_t m, std::uint64_t end, double sign, Sums& sums) const noexcept;
    void recompute() noexcept;
    /// First and last angle of each part without gaps.
    template <typename Visit>
    void each_part(const Visit& visit) const;

    double tau0_;
    std::size_t window_;
    std::vector<std::size_t> factors_;
    std::size_t mask_;
    std::vector<double> angle_;         ///< ring, relative to the oldest at the last recomputation
    std::vector<std::uint64_t> start_;  ///< ring: first angle without a gap before this one
    std::vector<Sums> sums_;
    double offset_ = 0;         ///< rate taken out of the angles
    std::uint64_t newest_ = 0;  ///< index of the newest angle
    std::size_t missing_ = 0;
    std::uint64_t faults_ = 0;
};

}  // namespace vibrig::estimator::allan
