#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "estimator/filter/measurement.hpp"
#include "estimator/plan/model.hpp"
#include "estimator/spectrum/survey.hpp"

namespace vibrig::estimator::spectrum {

/// Positions of the sweeps of a plan.
inline constexpr std::size_t kSweptPositions = 3;

/// Those of a sweep's blocks (SweepBlocks::kBlock_s) that will be known.
struct UsableBlocks {
    std::size_t blocks = 0, known = 0;
    std::size_t rates = 0;  ///< between neighbours that are both known

    /// Share of the rates that the sweep would have were all of them known.
    [[nodiscard]] double share() const noexcept {
        return blocks > 1 ? static_cast<double>(rates) / static_cast<double>(blocks - 1) : 0;
    }
};
/// No harmonic of a known one falls near a multiple of `sample_hz`: clear_of_samples().
[[nodiscard]] UsableBlocks usable_blocks(const SweptSine& sweep, double sample_hz);

/// What sweeps at some positions see of the six products (xx, yy, zz, xy, xz, yz) of directions:
/// sums of u_i^2 u_j^2, 1 for a sweep along the axis of a square. Of each gyro they are the same
/// numbers in the order of its axes, so what is above 0 here every gyro's elastic part is seen by.
[[nodiscard]] std::array<double, 6> products_seen(const std::vector<plan::Vec3>& ups,
                                                  const Places& places);

/// Where to sweep: kSweptPositions of these directions of the vertical (platform axes, unit
/// vectors), growing. A sweep sees one combination of the six coefficients of an elastic part, and
/// any of them may be the one that yields; so those are chosen whose products_seen() have the
/// largest product, which is the determinant of what the sweeps tell of six elastic parts of which
/// one is there at a time, and whose rows have full rank. All threes are looked at. Throws
/// plan::PlanError where no three see all six (which one not is named) with rank 3, and for more
/// than 200 directions.
[[nodiscard]] Places sweep_places(const std::vector<plan::Vec3>& ups);

}  // namespace vibrig::estimator::spectrum
