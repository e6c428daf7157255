#pragma once

#include <algorithm>
#include <cstddef>

#include "drivers/base/clock.hpp"

namespace vibrig::campaign {

/// What is left of a campaign, from how long its stops took so far. The nominal time counts as one
/// of them; what was only waited for, such as a platform that warms up or a pause, is no pace.
class Pace {
  public:
    /// A campaign begins, or what was interrupted goes on.
    void begin(drivers::Time now) { *this = Pace{now}; }
    /// From now on a stop is worked at, or something is waited for.
    void enter(bool working, drivers::Time now) {
        worked_s_ = spent_s(now);
        since_ = now;
        working_ = working;
    }
    void stop_done(drivers::Time now) {
        done_s_ += spent_s(now);
        ++done_;
        worked_s_ = 0;
        since_ = now;
    }
    /// `stops`: not done, the present one among them, of which `least_s` are left at least.
    [[nodiscard]] double left_s(std::size_t stops, double nominal_s, double least_s,
                                drivers::Time now) const {
        if (stops == 0) return 0;
        const double each_s = (nominal_s + done_s_) / static_cast<double>(1 + done_);
        return std::max(each_s - spent_s(now), least_s) + static_cast<double>(stops - 1) * each_s;
    }

    Pace() = default;

  private:
    explicit Pace(drivers::Time now) : since_(now) {}
    [[nodiscard]] double spent_s(drivers::Time now) const {
        return worked_s_ + (working_ ? drivers::to_seconds(now - since_) : 0);
    }

    drivers::Time since_ = 0;
    bool working_ = false;
    double worked_s_ = 0;  ///< on the present stop, before `since_`
    double done_s_ = 0;    ///< on those that are done
    std::size_t done_ = 0;
};

}  // namespace vibrig::campaign
