#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "daemon/archive/entry.hpp"
#include "daemon/archive/vibration.hpp"

namespace vibrig::archive {

inline constexpr std::int64_t kHour_ns = 3'600'000'000'000;
inline constexpr std::int64_t kFirst_ns = 1'767'225'600'000'000'000;

/// The `number`th campaign of a unit, all coefficients at `value` with `u`.
inline Entry entry_of(const std::string& serial, int number, double value = 1, double u = 0.1,
                      std::optional<double> at_hz = 15.0) {
    Entry one;
    one.key = "rig/" + serial + "-" + std::to_string(number);
    one.hash = "hash of " + one.key;
    one.rig = "rig";
    one.name = "test " + std::to_string(number);
    one.started_by = "A. Person";
    one.state = "finished";
    one.started_utc_ns = kFirst_ns + number * 24 * kHour_ns;
    one.ended_utc_ns = one.started_utc_ns + 2 * kHour_ns;
    one.unit_type = "GP-3";
    one.unit_serial = serial;
    one.verdict = "valid";
    for (std::size_t i = 0; i < one.coefficients.size(); ++i)
        one.coefficients[i] =
            Coefficient{value, u, u, u, 2 * u, estimator::is_quadratic(i) ? at_hz : std::nullopt};
    return one;
}

}  // namespace vibrig::archive
