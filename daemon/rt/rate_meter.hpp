#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "drivers/sample/sample.hpp"

namespace vibrig::rt {

/// Samples per second as they come, over the last ten seconds at most. Fixed memory.
class RateMeter {
  public:
    static constexpr std::size_t kSeconds = 10;

    void add(const drivers::Sample& sample) noexcept {
        const bool anew =
            filled_ > 0 && (sample.sequence < last_.sequence || sample.time <= last_.time ||
                            sample.time - last_.time > drivers::kSecond);
        if (anew) filled_ = next_ = 0;
        last_ = {sample.time, sample.sequence};
        if (filled_ > 0 && sample.time - newest().time < drivers::kSecond) return;
        past_[next_] = last_;
        next_ = (next_ + 1) % past_.size();
        if (filled_ < past_.size()) ++filled_;
    }
    /// How long it has been measured; 0: not yet.
    [[nodiscard]] double span_s() const noexcept {
        return filled_ == 0 ? 0 : drivers::to_seconds(last_.time - oldest().time);
    }
    /// 0: not measured for half a second yet.
    [[nodiscard]] double hz() const noexcept {
        return span_s() < 0.5 ? 0 : (last_.sequence - oldest().sequence) / span_s();
    }

  private:
    struct Point {
        drivers::Time time = 0;
        std::uint32_t sequence = 0;
    };
    [[nodiscard]] const Point& newest() const noexcept {
        return past_[(next_ + past_.size() - 1) % past_.size()];
    }
    [[nodiscard]] const Point& oldest() const noexcept {
        return past_[(next_ + past_.size() - filled_) % past_.size()];
    }
    std::array<Point, kSeconds + 1> past_{};
    Point last_;
    std::size_t next_ = 0, filled_ = 0;
};

}  // namespace vibrig::rt
