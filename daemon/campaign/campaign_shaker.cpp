// The highest level of an arming, and whether stops were obeyed.
#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>

#include "daemon/campaign/campaign.hpp"
#include "daemon/campaign/stages/small_level.hpp"

namespace vibrig::campaign {

using drivers::Time;
using State = CampaignState;

double Campaign::highest_level() const {
    if (state_ == State::checking) return std::max(small_level_->level_g, Excitation::kAtZero_g);
    if (settings_.stops.empty()) return *std::ranges::max_element(settings_.table_g);
    // Of random vibration the peaks that it hardly goes beyond: three sigma.
    double highest_g = 0;
    for (const auto& [table_g, kind] : levels_)
        highest_g = std::max(highest_g, kind < 0 ? 3 * table_g : table_g);
    return highest_g;
}

double Campaign::ratio_at_platform(const Settings& settings) {
    const auto& rig = settings.rig;
    const double reference =
        rig.transmission * std::sqrt(rig.accelerometer_response.power(rig.frequency_hz));
    double largest = 1;
    for (const Stop& stop : settings.stops) {
        largest = std::max(largest, stop.transmission / reference);
        for (const double along : stop.along) largest = std::max(largest, along / reference);
    }
    return largest;
}

void Campaign::hold_writes() noexcept {
    writes_held_ = true;
    ports_.rig.shaker.read_only(true);
}

/// Gimbals move at rest only, and the platform says so all the time. Whoever else commands them is
/// seen before they are anywhere.
void Campaign::watch_gimbals(Time now) {
    constexpr Time kLasts = 300 * drivers::kMillisecond;  // and is no single status
    const auto status = ports_.rig.platform();
    const auto drift = active() && stop_.excited() && !stop_.stopping()
                           ? ports_.rig.gimbal.drift(status, now)
                           : drivers::Drift::free;
    if (drift == drivers::Drift::free) {
        gimbals_off_since_ = 0;
        return;
    }
    if (gimbals_off_since_ == 0) gimbals_off_since_ = now;
    const bool silent = drift == drivers::Drift::silent;
    if (!silent && now - gimbals_off_since_ < kLasts) return;
    excitation_.order_stop(silent ? "no gimbal status" : "gimbals are led by another");
    ports_.log.event(
        Severity::trip,
        silent ? fmt::format("no gimbal status for {:.1f} s while the table shakes",
                             drivers::to_seconds(now - status.gimbal_time))
               : fmt::format("the gimbals are not left alone while the table shakes: {}, command "
                             "{} echoed",
                             status.slewing ? "slewing" : "not slewing yet",
                             status.gimbal_command_echo));
    if (silent)
        ports_.rig.gimbals_silent();
    else
        ports_.rig.gimbals_led();
}

void Campaign::watch_stop(Time now) {
    // A slew or a torquer is no shaker. A pause is rest like any other, however long it takes.
    const bool handled = state_ == State::slewing || state_ == State::zeroing ||
                         state_ == State::levelling || opening() || commissioning();
    switch (stop_.update(now, handled)) {
        case StopMonitor::News::none:
            return;
        case StopMonitor::News::uncommanded:
            ports_.log.event(Severity::trip, "motion without a command: " + stop_.what_moves(now));
            ports_.rig.uncommanded();
            return;
        case StopMonitor::News::confirmed:
            ports_.rig.disobeyed(false);
            return ports_.log.event(Severity::info,
                                    fmt::format("stop confirmed: rest measured {:.2f} s after the "
                                                "order ({})",
                                                stop_.took_s(), excitation_.stopped_by()));
        case StopMonitor::News::disobeyed: {
            const auto what =
                fmt::format("stop not obeyed within {:.1f} s ({}): {}: press the emergency stop",
                            stop_.took_s(), excitation_.stopped_by(), stop_.what_moves(now));
            ports_.log.event(Severity::trip, what);
            if (state_ == State::tripped) reason_ += "; " + what;
            ports_.rig.disobeyed(true);
        }
    }
}

}  // namespace vibrig::campaign
