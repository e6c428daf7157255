#include "drivers/sample/sample.hpp"

namespace vibrig::drivers {

const char* name_of(Channel channel) noexcept {
    switch (channel) {
        case Channel::outer:
            return "outer";
        case Channel::inner:
            return "inner";
        case Channel::azimuth:
            return "azimuth";
        case Channel::accel_x:
            return "accel_x";
        case Channel::accel_y:
            return "accel_y";
        case Channel::accel_z:
            return "accel_z";
        case Channel::table_accel:
            return "table_accel";
    }
    return "?";
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
