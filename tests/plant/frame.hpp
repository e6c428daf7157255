#pragma once

#include "tests/plant/truth.hpp"

namespace vibrig::plant {

/// Directions of the reference frame, that is platform axes at zero gimbal angles.
struct Frame {
    Vec3 north{}, up{}, east{};

    explicit Frame(const Truth& truth) noexcept {
        // North is the axis before `up`, east the axis after it; turning `up` over turns east too.
        const auto axis = static_cast<std::size_t>(truth.up.index);
        const double sign = truth.up.sign;
        up[axis] = sign;
        north[(axis + 2) % 3] = 1;
        east[(axis + 1) % 3] = sign;
    }
};

}  // namespace vibrig::plant
