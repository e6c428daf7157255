#include <algorithm>
#include <array>
#include <stdexcept>
#include <string>
#include <string_view>

#include "daemon/configuration/configuration.hpp"
#include "daemon/configuration/forms.hpp"
#include "daemon/configuration/schema.hpp"

namespace vibrig::configuration {

namespace {

enum class Fill { blank, shown };  ///< blank: only the rig's people know; shown: with this value

struct Essential {
    const char* key;
    Fill fill;
    const char* value = "";  ///< example of a blank, or what is written; empty: the default
};

constexpr std::array kEssentials{
    Essential{"campaign.name", Fill::shown},
    Essential{"campaign.results", Fill::blank, "\"/var/lib/vibrig\""},
    Essential{"campaign.table_g", Fill::blank},
    Essential{"campaign.dwell_s", Fill::shown},
    Essential{"campaign.zeroing", Fill::shown},
    Essential{"campaign.levelling", Fill::shown},
    Essential{"unit.type", Fill::shown},
    Essential{"unit.serial", Fill::shown},
    Essential{"site.latitude_deg", Fill::blank},
    Essential{"site.azimuth_deg", Fill::blank},
    Essential{"site.gravity_mps2", Fill::shown},
    Essential{"vibration.frequency_hz", Fill::blank},
    Essential{"vibration.transmission", Fill::blank},
    Essential{"platform.up", Fill::shown},
    Essential{"platform.encoder_sign", Fill::shown},
    Essential{"platform.encoder_zero_deg", Fill::shown},
    Essential{"accelerometer.range_g", Fill::blank, "20.0"},
    Essential{"can.interface", Fill::blank, "\"can0\""},
    Essential{"can.dbc", Fill::shown},
    Essential{"can.sample_rate_hz", Fill::blank},
    Essential{"shaker.transport", Fill::shown},
    Essential{"shaker.host", Fill::blank, "\"192.168.1.40\""},
    Essential{"shaker.amplitude_unit", Fill::blank},
    Essential{"shaker.limits.acceleration_g", Fill::blank},
    Essential{"shaker.limits.velocity_mps", Fill::blank},
    Essential{"shaker.limits.displacement_mm", Fill::blank},
    Essential{"shaker.registers.watchdog.address", Fill::blank},
    Essential{"server.operator_group", Fill::shown, "\"vibrig-operator\""},
    Essential{"server.page", Fill::shown, "\"127.0.0.1:8090\""},
};

const Key& key_named(const std::string& name) {
    const auto found = std::ranges::find(schema(), name, &Key::name);
    if (found == schema().end()) throw std::logic_error("no key " + name);
    return *found;
}

std::string comment_of(const Key& key) {
    std::string text = "# " + key.doc;
    if (!key.unit.empty()) text += " [" + key.unit + "]";
    if (!key.bounds.empty()) text += "; " + key.bounds;
    return text + "\n";
}

}  // namespace

std::string format_essentials() {
    const auto blanks = std::ranges::count(kEssentials, Fill::blank, &Essential::fill);
    std::string text = "# vibrigd: the keys that a rig needs; `vibrigd --schema` lists all.\n# " +
                       std::to_string(blanks) + " blanks stand as \"" + kBlank +
                       "\": put what your rig has in their place, then\n"
                       "#   vibrigd --config FILE --check\n"
                       "# It names each blank that is left, and what else cannot be.\n";
    Configuration defaults;
    std::string section;
    for (const Essential& essential : kEssentials) {
        const std::string name = essential.key;
        const std::size_t dot = name.rfind('.');
        if (name.substr(0, dot) != section) {
            section = name.substr(0, dot);
            text += "\n[" + section + "]\n";
        }
        const Key& key = key_named(name);
        const std::string value = *essential.value != '\0' ? essential.value : key.write(defaults);
        text += comment_of(key);
        if (essential.fill == Fill::blank) text += "# for instance: " + value + "\n";
        text += name.substr(dot + 1) + " = " +
                (essential.fill == Fill::blank ? '"' + std::string(kBlank) + '"' : value) + "\n";
    }
    return text;
}

}  // namespace vibrig::configuration
