#include "drivers/sample/sample.hpp"

#include <array>
#include <stdexcept>
#include <string>

#include "drivers/sample/channels.hpp"
#include "proto/word_of.hpp"

namespace vibrig::drivers {

const char* name_of(Channel channel) noexcept {
    const auto index = static_cast<std::size_t>(channel);
    return index < kChannels ? kChannelTable[index].name : "?";
}

const char* name_of(Quality quality) noexcept {
    static constexpr std::array kWords{"good",    "missing",      "stale",
                                       "flagged", "out_of_range", "unbound"};
    return proto::word_of(kWords, quality);
}

Time checked_period(const char* of, Time period) {
    if (period <= 0)
        throw std::invalid_argument(std::string(of) + ": sample period: found " +
                                    std::to_string(period) + " ns, expected above 0");
    return period;
}

}  // namespace vibrig::drivers
