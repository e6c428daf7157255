#pragma once

#include <string_view>

namespace vibrig::proto {

/// proto/vibrig.proto as it was built in: status and commands on the wire.
[[nodiscard]] std::string_view vibrig_proto_text() noexcept;

}  // namespace vibrig::proto
