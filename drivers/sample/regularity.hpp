#pragma once

#include "drivers/base/clock.hpp"

namespace vibrig::drivers {

/// Of a word that may be sent on change alone: whether it came each second for a while and comes no
/// more. Then it is not as it was said last, but unknown.
class Regularity {
  public:
    static constexpr Time kBetween = kSecond, kSilence = 3 * kSecond;
    static constexpr int kTimes = 20;

    void came(Time now) noexcept {
        times_ = now - last_ <= kBetween ? times_ + (times_ < kTimes ? 1 : 0) : 0;
        last_ = now;
    }
    [[nodiscard]] bool ceased(Time now) const noexcept {
        return times_ >= kTimes && now - last_ > kSilence;
    }

  private:
    Time last_ = 0;
    int times_ = 0;
};

}  // namespace vibrig::drivers
