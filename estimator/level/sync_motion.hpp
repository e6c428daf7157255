#pragma once

#include <array>
#include <cstddef>
#include <vector>

namespace vibrig::estimator {

/// Amplitude of what the angles do in step with the vibration: the innovations, which hold all of
/// it but next to nothing of the slow motion, Hann-weighted at the vibration's frequency. That is
/// known only in the end: phasors of short blocks are kept at the nominal one. Never allocates
/// after construction.
class SyncMotion {
  public:
    explicit SyncMotion(double nominal_hz);
    void clear() noexcept;
    /// Frequency of the vibration to come; after clear().
    void nominal(double hz) noexcept { nominal_hz_ = hz; }
    /// One reading, time from the beginning of the dwell.
    void add(double time_s, const std::array<double, 3>& innovation_arcsec) noexcept;
    /// Amplitude of the three axes together, arcsec; `variance`: of one innovation, arcsec^2, whose
    /// share is taken out.
    [[nodiscard]] double amplitude_arcsec(double frequency_hz, double variance) const noexcept;
    /// The same axis by axis: what goes with the cosine and against the sine of the vibration's
    /// phase from time 0, peak, arcsec, noise and all; white noise of variance 1 leaves
    /// `noise_square` in the square of each axis on average.
    struct Lines {
        std::array<std::array<double, 2>, 3> amplitude{};
        double noise_square = 0;
    };
    [[nodiscard]] Lines lines(double frequency_hz) const noexcept;

  private:
    static constexpr std::size_t kBlocks = 512;
    struct Block {
        double samples = 0;
        std::array<std::array<double, 2>, 3> phasor{};  ///< cosine, minus sine
    };
    struct Sums {
        std::array<double, 3> re{}, im{};
        double weights = 0, squares = 0;
    };
    [[nodiscard]] Sums sums(double frequency_hz) const noexcept;
    void merge() noexcept;

    double nominal_hz_;
    double block_s_;
    std::vector<Block> blocks_;
    std::size_t used_ = 0;
};

}  // namespace vibrig::estimator
