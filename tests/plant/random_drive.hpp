#pragma once

#include <complex>
#include <cstdint>
#include <span>
#include <vector>

#include "tests/plant/isolator.hpp"
#include "tests/plant/random.hpp"
#include "tests/plant/shaker_profile.hpp"

namespace vibrig::plant {

/// What a random controller plays: Gaussian and stationary, of a profile's shape and of rms 1.
/// Frames with random spectra, half of each laid over the next.
class RandomDrive {
  public:
    RandomDrive(std::uint64_t seed, double step_s) : step_s_(step_s), random_(seed, 11) {}

    /// The shape from the next frame on.
    void shape(const ShakerProfile& profile);
    /// The next steps.
    void next(std::span<Shake> out);
    /// Mean power of each line over the frames since the last call of forget(), of a sum of about
    /// 1; empty: there was none.
    [[nodiscard]] std::vector<double> heard() const;
    void forget() noexcept;
    [[nodiscard]] double line_hz() const noexcept {
        return 1 / (step_s_ * static_cast<double>(kFrame));
    }

  private:
    static constexpr std::size_t kFrame = 8192;  ///< steps

    void make_frame();

    double step_s_;
    Random random_;
    std::vector<double> heard_;      ///< sums
    std::size_t frames_ = 0;         ///< in them
    std::vector<double> amplitude_;  ///< of each line, of either of its two parts, 1 sigma
    std::vector<std::complex<double>> spectrum_, frame_;
    std::vector<Shake> ahead_;  ///< of the frame before and this one, then of this one alone
    std::size_t at_ = 0;
};

}  // namespace vibrig::plant
