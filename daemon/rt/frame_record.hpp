#pragma once

#include <linux/can.h>

#include <cstdint>

#include "drivers/base/clock.hpp"

namespace vibrig::rt {

/// One frame on its way to the recorder.
struct FrameRecord {
    canfd_frame frame{};
    drivers::Time time = 0;
    bool fd = false;
    bool sent = false;  ///< by this daemon
    std::uint32_t dropped_before = 0;
    std::uint64_t published_to = 0;  ///< the ring's own
};

}  // namespace vibrig::rt
