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
    Essential{"server.operator_group", Fill::shown, "\"vibrig-operator\""},
    Essential{"server.page", Fill::shown, "\"127.0.0.1:8090\""},
};

const Key& key_named(const std::string& name) {
    const auto found = std::ranges::find(schema(), name, &Key::name);
    if (found == schema().end()) throw std::logic_error("no key " + name);
    return *found;
}

/// The built-in map is that of the simulated rig: the address is a blank of every register, the
/// rest stands there to be looked at.
std::string registers() {
    static constexpr std::string_view kPrefix = "shaker.registers.", kAddress = ".address";
    std::string text =
        "\n[shaker.registers]   # the controller's map; `vibrigd --schema` says more of each "
        "word\n";
    Configuration defaults;
    for (const Key& first : schema()) {
        if (!first.name.starts_with(kPrefix) || !first.name.ends_with(kAddress)) continue;
        // Registers that a controller need not have stand in the keys' reference.
        if (first.write(defaults).empty()) continue;
        const std::string role =
            first.name.substr(kPrefix.size(), first.name.size() - kPrefix.size() - kAddress.size());
        std::string row = role + " = { address = \"" + kBlank + '"';
        bool bits = false;
        for (const char* word : {"type", "word_order", "table", "access", "scale", "mask"}) {
            const Key& key = key_named(std::string(kPrefix) + role + "." + word);
            const std::string value = key.write(defaults);
            bits = bits || value == "\"bits\"";
            if (std::string_view(word) == "mask" && !bits) continue;
            row += std::string(", ") + word + " = " + value;
        }
        text +=
            "# " + first.doc + "\n# for instance: " + first.write(defaults) + "\n" + row + " }\n";
    }
    return text;
}

std::string comment_of(const Key& key) {
    std::string text = "# " + key.doc;
    if (!key.unit.empty()) text += " [" + key.unit + "]";
    if (!key.bounds.empty()) text += "; " + key.bounds;
    return text + "\n";
}

}  // namespace

std::string format_essentials() {
    std::string text;
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
    text += registers();
    std::size_t blanks = 0;
    for (std::size_t at = text.find(kBlank); at != std::string::npos;
         at = text.find(kBlank, at + 1))
        ++blanks;
    return "# vibrigd: the keys that a rig needs; `vibrigd --schema` lists all.\n# " +
           std::to_string(blanks) + " blanks stand as \"" + kBlank +
           "\": put what your rig has in their place, then\n"
           "#   vibrigd --config FILE --check\n"
           "# It names each blank that is left, and what else cannot be.\n" +
           text;
}

}  // namespace vibrig::configuration
