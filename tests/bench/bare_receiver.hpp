#pragma once

#include "tests/bench/rig_bus.hpp"

namespace vibrig::bench {

/// The least that any receiver of a rig's samples does, with the daemon's threads and priorities:
/// one takes frames as they come, with time stamps, in batches, and wakes another one for each
/// sample. Ends the process when the bus does.
[[noreturn]] void receive_only(const RigBus& bus);

}  // namespace vibrig::bench
