#pragma once

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>

#include "daemon/campaign/opening_check.hpp"
#include "estimator/commissioning/opening.hpp"
#include "estimator/filter/encoder_angles.hpp"
#include "tests/plant/platform_model.hpp"
#include "tests/unit/daemon/campaign/campaign_fixture.hpp"

namespace vibrig::campaign {

/// A platform that does what is commanded and drifts when it is let go, held against a
/// configuration that may be another rig's.
inline constexpr double kOpeningRad = std::numbers::pi / 180;

struct OpeningTest : CampaignTest {
    plant::Truth truth;  ///< its encoders count as its gimbals do
    plant::PlatformModel model{truth};

    void open_with(const std::function<void(estimator::Settings&)>& change) {
        settings.rig = {};
        change(settings.rig);
        settings.opening.clear();
        for (const auto& at : estimator::commissioning::kOpeningDrifts_deg)
            settings.opening.push_back({estimator::encoder_deg(settings.rig, at), true});
        settings.opening.push_back(
            {estimator::encoder_deg(settings.rig, estimator::commissioning::kOpeningGravity_deg),
             false});
        second = [this] { return look(); };
        make();
    }

    /// The last whole second: where the newest command has brought the platform, and its drift.
    rt::MeanMotion look() {
        using plant::operator*;
        using plant::operator+;
        rt::MeanMotion mean;
        mean.from = now / kSecond * kSecond - kSecond;
        mean.to = mean.from + kSecond;
        if (port.frames.empty()) return mean;
        const bool released = (port.frames.back().data[6] & 0x0f) == 0;
        for (; looked_at < port.frames.size(); ++looked_at) {
            const auto& frame = port.frames[looked_at];
            drifts_since = now;
            if ((frame.data[6] & 0x0f) != 1) continue;
            for (std::size_t i = 0; i < 3; ++i) {
                const auto raw =
                    static_cast<std::int16_t>(frame.data[2 * i] | (frame.data[2 * i + 1] << 8));
                stands[i] = 0.01 * raw * kOpeningRad;
            }
        }
        mean.good = released || platform.in_position;
        const auto rate = model.angle_rates(stands, 0, {});
        const double s = released ? drivers::to_seconds(mean.from - drifts_since) + 0.5 : 0;
        mean.angle = stands + s * rate;
        mean.force = model.up_at(mean.angle);
        return mean;
    }

    /// To the end of the check.
    void run_check() {
        EXPECT_TRUE(command(Kind::arm).accepted);
        EXPECT_TRUE(command(Kind::start).accepted);
        for (int n = 0; n < 6000; ++n) {
            run_rig();
            const auto state = status().state;
            if (state == CampaignState::aborted || state == CampaignState::slewing) return;
        }
        FAIL() << status().reason;
    }

    double highest_asked() const {
        double most = 0;
        for (const auto& request : shaker.requests) most = std::max(most, request.amplitude_g);
        return most;
    }

    plant::Vec3 stands{};
    Time drifts_since = 0;
    std::size_t looked_at = 0;
};

}  // namespace vibrig::campaign
