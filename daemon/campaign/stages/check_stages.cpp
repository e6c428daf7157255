// Whether the stages' settings can work, how long they take and what they are fed.
#include <spdlog/fmt/fmt.h>

#include "daemon/campaign/campaign.hpp"
#include "daemon/campaign/position_leveller.hpp"
#include "daemon/campaign/zero_calibration.hpp"
#include "estimator/levelling/design.hpp"

namespace vibrig::campaign {

std::string check_stages(const Settings& settings, const proto::Dbc& dbc, drivers::CanPort& port) {
    if (!settings.levelling && !settings.zeroing) return {};
    try {
        double limit = settings.level.torquer_limit_deg_h;
        if (settings.levelling) {
            const drivers::Torquer torquer(dbc, settings.level.torquer, port);
            limit = torquer.limit();
            const PositionLeveller stage(settings.level, settings.rig, settings.sample_s, limit);
            if (auto why = stage.refusal(); !why.empty()) return why;
        }
        if (settings.zeroing) {
            const ZeroCalibration stage(settings.zero, settings.rig, settings.sample_s);
            if (auto why = stage.refusal(); !why.empty()) return why;
        }
        const rt::StageFeed feed(dbc, stage_feed_settings(settings), nullptr);
        const auto& level = settings.level;
        if (settings.levelling && level.velocity_north.empty() != (level.velocity_noise_mps == 0))
            return fmt::format(
                "levelling.velocity_noise_mps: found {:g}, expected {}", level.velocity_noise_mps,
                level.velocity_north.empty()
                    ? "0: levelling.velocity_north and velocity_east are not configured"
                    : "above 0: no reading of the base's velocity is exact");
    } catch (const estimator::levelling::DesignError& error) {
        return error.what();
    } catch (const estimator::zeros::ZeroError& error) {
        return std::string("zeroing: ") + error.what();
    }
    return {};
}

StageTimes stage_times(const Settings& settings) {
    StageTimes times;
    if (settings.levelling) {
        const PositionLeveller stage(settings.level, settings.rig, settings.sample_s,
                                     settings.level.torquer_limit_deg_h);
        times.levelling_s = stage.expected_s();
    }
    if (settings.zeroing) {
        // The gimbals go half a turn at most to where each way begins, and are levelled there.
        const double before_s = 180 / settings.zero.slew_deg_per_s + times.levelling_s;
        times.closing_s =
            ZeroCalibration(settings.zero, settings.rig, settings.sample_s).expected_s() +
            static_cast<double>(ways_of(settings.zero).size()) * before_s;
    }
    return times;
}

rt::StageFeedSettings stage_feed_settings(const Settings& settings) {
    rt::StageFeedSettings feed;
    feed.increments = settings.zeroing;
    feed.gyro_message = settings.zero.gyro_message;
    feed.accelerometer_message = settings.zero.accelerometer_message;
    feed.block = levelling_block(settings.sample_s);
    if (settings.levelling)
        feed.velocity = {settings.level.velocity_north, settings.level.velocity_east};
    return feed;
}

}  // namespace vibrig::campaign
