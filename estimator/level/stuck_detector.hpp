#pragma once

#include <array>
#include <cstddef>

#include "estimator/filter/settings.hpp"

namespace vibrig::estimator {

/// Distinguishes a resolver that shows one value for ever from one that is quiet: noise moves the
/// last bits of a working one all the time. Where all three stand still nothing is reported: that
/// is a source without noise, or one whose samples do not come any more, which is not this class's
/// business.
class StuckDetector {
  public:
    explicit StuckDetector(const Settings& settings) noexcept;

    void clear() noexcept { repeats_ = moves_ = {}; }
    /// True while one of the angles has not changed for longer than chance allows and another
    /// moves.
    [[nodiscard]] bool stuck(const std::array<double, 3>& angle_rad) noexcept;

  private:
    std::size_t limit_ = 0;  ///< equal readings in a row; 0: the noise is too small to tell
    std::array<double, 3> last_{};
    std::array<std::size_t, 3> repeats_{}, moves_{};
};

}  // namespace vibrig::estimator
