#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace vibrig::estimator {

/// Distinguishes an accelerometer that stops at the end of its range from one that turns round
/// there: noise spreads the crests of a vibration over neighbouring values, while a saturated one
/// shows its highest or lowest value again and again. One dwell at a time. Without a known range
/// nothing is reported of a converter whose steps are as large as the noise, which repeats itself
/// everywhere, of noise added after the saturation, and of an axis with a single wild reading
/// beyond the end.
class SaturationDetector {
  public:
    /// `noise_g`: 1 sigma of one reading. `range_g`: readings of this size are saturated; 0: not
    /// known.
    SaturationDetector(double noise_g, double range_g) noexcept
        : noise_g_(noise_g), range_g_(range_g) {}

    void clear() noexcept { axes_ = {}; }
    /// Raw readings, before zeros and matrix.
    void add(const std::array<double, 3>& force_g) noexcept;
    /// Axis that is saturated, or -1.
    [[nodiscard]] int axis() const noexcept;

  private:
    static constexpr std::size_t kKept = 100;  ///< readings that a new one is compared with

    /// Readings at an end of the range: direction +1 for the highest, -1 for the lowest.
    struct End {
        double extreme = 0;
        std::uint32_t at = 0,
                      next_to = 0;  ///< exactly there; within the noise of an extreme so far
        void add(double reading, double spread) noexcept;
    };
    struct Axis {
        std::array<double, kKept> kept{};    ///< the last readings
        std::uint32_t count = 0, moved = 0;  ///< moved: unlike all of those kept
        std::uint32_t beyond = 0;            ///< of the range
        End highest, lowest;
        /// Distance of the nearest of those kept; there must be one.
        [[nodiscard]] double nearest(double reading) const noexcept;
        [[nodiscard]] bool enough(std::uint32_t readings) const noexcept;
        [[nodiscard]] bool saturated(const End& end) const noexcept;
    };

    double noise_g_, range_g_;
    std::array<Axis, 3> axes_{};
};

}  // namespace vibrig::estimator
