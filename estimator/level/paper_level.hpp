#pragma once

#include <cstddef>

namespace vibrig::estimator {

/// Vibration amplitude of Tang et al. 2009, eqs 12-13 and 17-18: Fourier sums of the squared
/// specific force at the nominal frequency over samples 1..n of a dwell, blended with a start
/// value. For the two-step route only: it needs the exact frequency and whole blocks of samples.
class PaperLevel {
  public:
    PaperLevel(double frequency_hz, double forgetting) noexcept;

    /// Plain eq. 13: the first run, and wherever eq. 17 has nothing to start from.
    void begin() noexcept;
    /// Start value a1 * a(2) / a(1): amplitude of the same position in the first run, scaled by the
    /// commanded levels.
    void begin(double start_amplitude_g) noexcept;
    /// `square` is |f|^2, g^2.
    void add(double time_s, double square) noexcept;

    [[nodiscard]] double amplitude_g() const noexcept { return blended_; }
    [[nodiscard]] double kappa() const noexcept { return 1.0 + 0.5 * blended_ * blended_; }

  private:
    double omega_, forgetting_;
    double start_ = 0, power_ = 1, blended_ = 0;
    double cosine_ = 0, sine_ = 0, first_time_ = 0;
    std::size_t n_ = 0;
    bool has_start_ = false;
};

}  // namespace vibrig::estimator
