#include "daemon/campaign/stop_monitor.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace vibrig::campaign {

using drivers::Time;
using rt::RestVerdict;
using rt::RestWitness;

namespace {

/// By the controller itself.
bool controller_moves(const drivers::ShakerReading& reading) {
    return reading.valid && (reading.running || !reading.still());
}

/// More than slews and torquers make of the platform. The norm of the specific force hardly shows
/// them: half a second of a slew at 30 deg/s is 0.08 g rms where an axis counts double, 0.03 g at
/// 0.1 m from the axes, and at the usual 5 deg/s below 0.02 g.
constexpr double kHandled_g = 0.2;

/// Seen to move, whatever was ordered: more than a hand on the table does.
bool moves(const RestWitness& witness, double above_g = safety::kMoving_g) {
    return witness.verdict == RestVerdict::moving && witness.rms_g > above_g;
}

/// After an excitation silence is no rest.
bool not_at_rest(const RestWitness& witness) {
    return witness.verdict == RestVerdict::moving || witness.verdict == RestVerdict::unknown;
}

}  // namespace

double PadRingDown::from_s(double table_g) const {
    if (!(rate_per_s > 0) || !(level_g > 0)) return safety::kRingDown_s;
    return time_s + std::max(0.0, std::log(table_g / level_g)) / rate_per_s;
}

StopMonitor::StopMonitor(const drivers::Shaker& shaker, Rest rest, const StopSettings& settings)
    : shaker_(shaker), rest_(std::move(rest)), settings_(settings) {}

bool StopMonitor::uncommanded(Time now, bool handled) {
    const auto measured = rest(now);
    // A platform on its pads does not move by itself: where the table below it is seen to be still
    // it was a hand.
    const bool table_tells = measured.table.verdict == RestVerdict::still ||
                             measured.table.verdict == RestVerdict::moving;
    const bool moving = table_tells
                            ? moves(measured.table)
                            : moves(measured.platform, handled ? kHandled_g : safety::kMoving_g);
    if (!moving) {
        moves_since_ = 0;
        uncommanded_reported_ = false;
        return false;
    }
    if (moves_since_ == 0) moves_since_ = now;
    return now - moves_since_ >= drivers::from_seconds(safety::kUnarmedMotion_s) &&
           !std::exchange(uncommanded_reported_, true);
}

StopMonitor::News StopMonitor::update(Time now, bool handled) {
    const std::uint64_t stops = shaker_.stops();  // first: one that comes meanwhile stays open
    if (stops == rested_.load()) {
        if (!excited()) return uncommanded(now, handled) ? News::uncommanded : News::none;
        moves_since_ = 0;
        return News::none;
    }
    moves_since_ = 0;
    uncommanded_reported_ = false;
    if (since_ == 0) since_ = now;
    took_s_ = drivers::to_seconds(now - since_);
    const auto reading = shaker_.reading();
    if (!shaker_.stop_pending() && reading.valid && reading.time > since_ &&
        !controller_moves(reading) && rest(now).measured_since(since_)) {
        rested_.store(stops);
        since_ = 0;
        level_g_ = 0;
        return News::confirmed;
    }
    if (disobeyed_ || !late(now)) return News::none;
    disobeyed_ = true;
    return News::disobeyed;
}

bool StopMonitor::late(Time now) const {
    const double waited_s = drivers::to_seconds(now - since_);
    if (waited_s <= settings_.deadline_s) return false;
    const auto measured = rest(now);
    if (controller_moves(shaker_.reading())) return true;
    const bool table_tells = excited() && !measured.table.doubted;
    if (table_tells ? not_at_rest(measured.table) : moves(measured.table)) return true;
    if (waited_s <= longest_s(level_g_)) return false;
    return excited() ? not_at_rest(measured.platform) : moves(measured.platform);
}

bool StopMonitor::unsettled(Time now) const {
    const auto measured = rest(now);
    if (controller_moves(shaker_.reading()) || moves(measured.table) || moves(measured.platform))
        return true;
    return stopping() && excited();
}

std::string StopMonitor::what_moves(Time now) const {
    std::string text;
    const auto add = [&text](const std::string& what) {
        text += (text.empty() ? "" : ", ") + what;
    };
    const auto reading = shaker_.reading();
    if (!reading.valid) {
        add("no read-back from the controller");
    } else if (controller_moves(reading)) {
        add(fmt::format("controller run {}, {:.3f} g", reading.running ? 1 : 0,
                        reading.measured_g));
    }
    const auto measured = rest(now);
    const auto tell = [&add](const char* name, const RestWitness& witness) {
        if (witness.verdict == RestVerdict::moving)
            add(fmt::format("{} {:.3f} g rms", name, witness.rms_g));
        if (witness.verdict == RestVerdict::unknown)
            add(witness.doubted
                    ? fmt::format("accelerometer on the {} is doubted, and does not move", name)
                    : fmt::format("no good accelerometer on the {}", name));
    };
    tell("table", measured.table);
    tell("platform", measured.platform);
    return text;
}

}  // namespace vibrig::campaign
