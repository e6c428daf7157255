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
/// messages of proto/vibrig.proto and so JSON, Prometheus, MQTT, `vibrig status` and the live page.
struct StatusValue {
    /// Field of v1::Status, with the message it stands in: "shaker.measured_g". Empty: in none as
    /// such.
    const char* field;
    const char* unit;  ///< for people and MQTT; empty: none
    std::size_t kind;  ///< of the value where it is known, as index of StatusScalar
    StatusScalar (*value)(const StatusData&);
    const char* mqtt_name = nullptr;  ///< null: not published there
    double mqtt_factor = 1;
    const char* metric = nullptr;  ///< null: likewise
    const char* help = nullptr;    ///< of the metric
    double metric_factor = 1;      ///< to its base unit
    bool counts = false;           ///< a counter, else a gauge
    const char* line = nullptr;    ///< in which people read it; null: in none
    /// How it is said there: "{}" is the value with its unit, of a flag the words are what is said
    /// when it is set. Otherwise, of a flag that is not set, an empty text, a number that is not
    /// known; null: a dash for the number, nothing for the others.
    const char* words = nullptr;
    const char* otherwise = nullptr;
    int decimals = -1;                  ///< -1: as many as it has
    bool duration = false;              ///< s, as "1 h 02 min"
    bool alarming = false;              ///< beyond 0 the page marks it
    const char* silenced_by = nullptr;  ///< a text: where it is not empty this is not said
    bool on_page = true;  ///< else in a terminal alone: the page shows it somewhere else

    [[nodiscard]] constexpr StatusValue mqtt(const char* name, double factor = 1) const {
        StatusValue row = *this;
        row.mqtt_name = name;
        row.mqtt_factor = factor;
        return row;
    }
    [[nodiscard]] constexpr StatusValue gauge(const char* name, const char* meaning,
                                              double factor = 1) const {
        StatusValue row = *this;
        row.metric = name;
        row.help = meaning;
        row.metric_factor = factor;
        return row;
    }
    [[nodiscard]] constexpr StatusValue shown(const char* where, const char* text,
                                              const char* else_text = nullptr) const {
        StatusValue row = *this;
        row.line = where;
        row.words = text;
        row.otherwise = else_text;
        return row;
    }
    [[nodiscard]] constexpr StatusValue with_decimals(int count) const {
        return with(&StatusValue::decimals, count);
    }
    [[nodiscard]] constexpr StatusValue as_duration() const {
        return with(&StatusValue::duration, true);
    }
    [[nodiscard]] constexpr StatusValue alarms() const {
        return with(&StatusValue::alarming, true);
    }
    [[nodiscard]] constexpr StatusValue unless(const char* other) const {
        return with(&StatusValue::silenced_by, other);
    }
    [[nodiscard]] constexpr StatusValue off_page() const {
        return with(&StatusValue::on_page, false);
    }
    [[nodiscard]] constexpr StatusValue counter(const char* name, const char* meaning) const {
        return gauge(name, meaning).with(&StatusValue::counts, true);
    }

  private:
    template <typename Value>
    [[nodiscard]] constexpr StatusValue with(Value StatusValue::*member, Value is) const {
        StatusValue row = *this;
        row.*member = is;
        return row;
    }
};

[[nodiscard]] constexpr bool is_number(const StatusValue& row) {
    return row.kind == StatusScalar(std::uint64_t{}).index() ||
           row.kind == StatusScalar(double{}).index();
}

/// All of them; those with a name for MQTT in the order in which they are published.
[[nodiscard]] std::span<const StatusValue> status_values();

}  // namespace vibrig
