#include "drivers/sample/sample.hpp"

#include "drivers/sample/channels.hpp"

namespace vibrig::drivers {

const char* name_of(Channel channel) noexcept {
    const auto index = static_cast<std::size_t>(channel);
    return index < kChannels ? kChannelTable[index].name : "?";
}

const char* name_of(Quality quality) noexcept {
    switch (quality) {
        case Quality::good:
            return "good";
        case Quality::missing:
            return "missing";
        case Quality::stale:
            return "stale";
        case Quality::flagged:
            return "flagged";
        case Quality::out_of_range:
            return "out_of_range";
        case Quality::unbound:
            return "unbound";
    }
    return "?";
}

}  // namespace vibrig::drivers
