#pragma once

#include "drivers/base/clock.hpp"

namespace vibrig::rt {

/// CLOCK_MONOTONIC. Waiters sleep in ppoll on an eventfd.
class RealClock final : public drivers::Clock {
  public:
    [[nodiscard]] drivers::Time now() const noexcept override;
    /// Throws std::system_error when no descriptor can be had.
    [[nodiscard]] std::unique_ptr<drivers::Waiter> make_waiter() override;
};

}  // namespace vibrig::rt
