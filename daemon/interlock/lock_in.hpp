#pragma once

#include <array>
#include <cmath>
#include <cstddef>

namespace vibrig::rt {

/// Least squares of a constant and a sine of known frequency on N channels over the newest blocks
/// of samples. Fixed memory, whatever the sample rate; no allocation.
template <std::size_t N>
class LockIn {
  public:
    static constexpr std::size_t kBlocks = 6;
    struct Fit {
        std::array<double, N> mean{}, cosine{}, sine{};
    };

    void clear() noexcept { *this = {}; }
    void add(double cosine, double sine, const std::array<double, N>& value) noexcept {
        Sums& s = blocks_[at_];
        const std::array<double, 3> basis{1, cosine, sine};
        for (std::size_t i = 0; i < 3; ++i) {
            for (std::size_t j = 0; j <= i; ++j) s.normal[i][j] += basis[i] * basis[j];
            for (std::size_t n = 0; n < N; ++n) s.right[n][i] += basis[i] * value[n];
        }
        for (std::size_t n = 0; n < N; ++n) {
            if (s.normal[0][0] == 1 || value[n] < s.low[n]) s.low[n] = value[n];
            if (s.normal[0][0] == 1 || value[n] > s.high[n]) s.high[n] = value[n];
        }
    }
    /// The newest block is complete; the oldest is forgotten.
    void next_block() noexcept {
        at_ = (at_ + 1) % kBlocks;
        blocks_[at_] = {};
    }

    /// Largest less smallest value of a channel in the newest blocks; infinite with fewer than
    /// `fewest` samples.
    [[nodiscard]] double range(std::size_t channel, std::size_t blocks,
                               double fewest) const noexcept {
        double low = 0, high = 0, count = 0;
        for (std::size_t b = 0; b < blocks; ++b) {
            const Sums& s = blocks_[(at_ + kBlocks - b) % kBlocks];
            if (s.normal[0][0] == 0) continue;
            low = count == 0 ? s.low[channel] : std::fmin(low, s.low[channel]);
            high = count == 0 ? s.high[channel] : std::fmax(high, s.high[channel]);
            count += s.normal[0][0];
        }
        return count < fewest ? INFINITY : high - low;
    }

    /// False where the samples do not determine it.
    [[nodiscard]] bool fit(Fit& out, double fewest) const noexcept {
        Sums all;
        for (const Sums& s : blocks_) {
            for (std::size_t i = 0; i < 3; ++i) {
                for (std::size_t j = 0; j <= i; ++j) all.normal[i][j] += s.normal[i][j];
                for (std::size_t n = 0; n < N; ++n) all.right[n][i] += s.right[n][i];
            }
        }
        if (all.normal[0][0] < fewest) return false;
        // Cholesky, in place.
        auto& l = all.normal;
        for (std::size_t i = 0; i < 3; ++i) {
            for (std::size_t j = 0; j <= i; ++j) {
                double sum = l[i][j];
                for (std::size_t k = 0; k < j; ++k) sum -= l[i][k] * l[j][k];
                if (i != j) {
                    l[i][j] = sum / l[j][j];
                } else if (sum > kLeastPivot * all.normal[0][0]) {
                    l[i][i] = std::sqrt(sum);
                } else {
                    return false;
                }
            }
        }
        for (std::size_t n = 0; n < N; ++n) {
            std::array<double, 3> x = all.right[n];
            for (std::size_t i = 0; i < 3; ++i) {
                for (std::size_t k = 0; k < i; ++k) x[i] -= l[i][k] * x[k];
                x[i] /= l[i][i];
            }
            for (std::size_t i = 3; i-- > 0;) {
                for (std::size_t k = i + 1; k < 3; ++k) x[i] -= l[k][i] * x[k];
                x[i] /= l[i][i];
            }
            out.mean[n] = x[0];
            out.cosine[n] = x[1];
            out.sine[n] = x[2];
        }
        return true;
    }

  private:
    static constexpr double kLeastPivot = 1e-6;
    struct Sums {
        std::array<std::array<double, 3>, 3> normal{};  ///< lower triangle; [0][0] counts
        std::array<std::array<double, 3>, N> right{};
        std::array<double, N> low{}, high{};
    };
    std::array<Sums, kBlocks> blocks_{};
    std::size_t at_ = 0;
};

}  // namespace vibrig::rt
