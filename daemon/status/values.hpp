#pragma once

#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <type_traits>
#include <utility>
#include <variant>

#include "daemon/status/status.hpp"

namespace vibrig {

/// Nothing: not known now.
using StatusScalar = std::variant<std::monostate, bool, std::uint64_t, double, std::string>;

/// A single value of the status under all its names. What shows the status takes it from here: the
/// messages of proto/vibrig.proto and so JSON, Prometheus, MQTT.
struct StatusValue {
    /// Of v1::Status, with the message it stands in: "shaker.measured_g". Empty: in none as such.
    const char* field;
    const char* unit;  ///< as told by MQTT; empty: none
    std::size_t kind;  ///< of the value where it is known, as index of StatusScalar
    StatusScalar (*value)(const StatusData&);
    const char* mqtt_name = nullptr;  ///< null: not told there
    double mqtt_factor = 1;
    const char* metric = nullptr;  ///< null: likewise
    const char* help = nullptr;    ///< of the metric
    double metric_factor = 1;      ///< to its base unit
    bool counts = false;           ///< a counter, else a gauge

    [[nodiscard]] constexpr StatusValue mqtt(const char* name, double factor = 1) const {
        StatusValue row = *this;
        row.mqtt_name = name;
        row.mqtt_factor = factor;
        return row;
    }
    [[nodiscard]] constexpr StatusValue gauge(const char* name, const char* words,
                                              double factor = 1) const {
        StatusValue row = *this;
        row.metric = name;
        row.help = words;
        row.metric_factor = factor;
        return row;
    }
    [[nodiscard]] constexpr StatusValue counter(const char* name, const char* words) const {
        StatusValue row = gauge(name, words);
        row.counts = true;
        return row;
    }
};

/// All of them; those with a name for MQTT in the order in which they are told there.
[[nodiscard]] std::span<const StatusValue> status_values();

}  // namespace vibrig
