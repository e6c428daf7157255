// The frequency of a dwell: written at measured rest, and shown by the accelerometers before it
// begins.
#include <spdlog/fmt/fmt.h>

#include <cmath>
#include <utility>

#include "daemon/campaign/campaign.hpp"
#include "daemon/campaign/rig_frame.hpp"

namespace vibrig::campaign {

using drivers::Time;

namespace {
constexpr double kWritten_hz = 1e-3;  // a register resolves 1 mHz
// Of the settling, left for what follows when it is not shown.
constexpr Time kAhead = 200 * drivers::kMillisecond;
constexpr double kRestsG = 1e-9;
}  // namespace

bool Campaign::frequency_may_change(Time now) {
    const auto reading = ports_.rig.shaker.reading();
    const bool same = reading.valid && std::abs(reading.frequency_hz - excited_hz_) <= kWritten_hz;
    if (same || table_g() <= kRestsG) return true;
    if (reading.at_rest() && stop_.rest(now).measured()) return true;
    if (now - entered_ > kRampGrace)
        abort(fmt::format("rest is not measured ({}): {:g} Hz are not written",
                          stop_.what_moves(now), excited_hz_),
              now);
    return false;
}

/// Of a plan that says no frequency there is one only, which the loop check has measured.
void Campaign::watch_vibration() {
    watching_ = here().stop.frequency_hz > 0 && table_g() > kRestsG && ports_.rig.feed != nullptr;
    shown_.clear();
    if (watching_) ports_.rig.feed->order(rt::StageFeed::Mode::samples);
}

void Campaign::look_at_vibration(Time now) {
    if (!watching_) return;
    const RigFrame frame(settings_.rig);
    rt::Motion motion;
    while (take_motion(motion, now)) {
        if (motion.good)
            shown_.push_back({drivers::to_seconds(motion.time), frame.force(motion.force, 1),
                              motion.table, motion.table_good});
    }
    if (now < dwell_from_ - kAhead) return;
    watching_ = false;
    ports_.rig.feed->order(rt::StageFeed::Mode::off);
    const auto found = estimator::loop_response(shown_, excited_hz_);
    if (found.platform_g > 0 &&
        std::abs(found.frequency_hz - excited_hz_) <= settings_.loop.frequency_tolerance_hz)
        return;
    ports_.log.event(Severity::trip,
                     fmt::format("the accelerometers show {:.3f} Hz, {:.3f} Hz were asked for and "
                                 "read back",
                                 found.frequency_hz, excited_hz_));
    ports_.rig.wrong_vibration();
    order_stop("another vibration than was asked for");
}

}  // namespace vibrig::campaign
