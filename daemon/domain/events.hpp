#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "drivers/base/clock.hpp"

namespace vibrig {

enum class Severity : std::uint8_t { info, warning, alarm, trip };
[[nodiscard]] const char* name_of(Severity severity) noexcept;

struct EventRecord {
    std::uint64_t id = 0;
    std::int64_t utc_ns = 0;
    drivers::Time time = 0;
    Severity severity = Severity::info;
    std::string source;  ///< "campaign", "can", "shaker", ...
    std::string text;
};

/// Where a part reports an event of its own; whoever hands it out knows the source's name.
using EventSink = std::function<void(Severity, const std::string& text)>;

}  // namespace vibrig
