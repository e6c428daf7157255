#pragma once

#include <string>
#include <string_view>

#include "proto/dbc.hpp"

namespace vibrig::drivers {

/// A signal of a DBC and the message it comes in. Null: not bound.
struct BoundSignal {
    const proto::Message* message = nullptr;
    const proto::Signal* signal = nullptr;
    explicit operator bool() const noexcept { return signal != nullptr; }
};

/// Finds "Message.Signal"; an empty name binds nothing. Throws BindingError with the names closest
/// to what was asked for.
[[nodiscard]] BoundSignal bind_signal(const proto::Dbc& dbc, const std::string& key,
                                      const std::string& name);

/// Throws BindingError where the DBC states another unit, one that is known here, than `unit`,
/// which the value is taken in. No unit, counts, or a word that nobody knows says nothing, and is
/// left to commissioning; an empty `unit` expects none.
void expect_unit(const BoundSignal& bound, const std::string& key, const std::string& name,
                 std::string_view unit);
/// The one and the other.
[[nodiscard]] BoundSignal bind_signal(const proto::Dbc& dbc, const std::string& key,
                                      const std::string& name, std::string_view unit);

}  // namespace vibrig::drivers
