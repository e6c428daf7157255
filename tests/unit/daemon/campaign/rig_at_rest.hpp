#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <string>

#include "daemon/campaign/position_leveller.hpp"
#include "daemon/campaign/rig_frame.hpp"
#include "daemon/campaign/zero_calibration.hpp"
#include "tests/plant/rig.hpp"

namespace vibrig::campaign {

/// The simulated rig and the stages at rest in lock step, without bus, processes or campaign: what
/// goes over the wires is rounded as the frames round it.
class RigAtRest {
  public:
    explicit RigAtRest(const plant::Truth& truth)
        : rig_(truth), second_(static_cast<int>(std::lround(truth.sample_rate_hz))) {}

    void slew(const Vector& encoder_deg, plant::GimbalMode mode) {
        plant::Vec3 target{};
        for (std::size_t i = 0; i < 3; ++i)
            target[i] = std::round(100 * std::remainder(encoder_deg[i], 360.0)) / 100;
        rig_.slew_to(target, mode);
    }

    /// At these angles, as the campaign does it; the reason why not, else empty.
    std::string level(PositionLeveller& stage, const Vector& encoder_deg, const ZeroStatus& zeros,
                      Vector& encoder_rad, std::uint32_t block = 4) {
        rig_.release();
        stage.begin(encoder_deg, zeros);
        while (!stage.done() && stage.failure().empty()) {
            rt::Motion motion;
            for (std::uint32_t i = 0; i < block; ++i) {
                rig_.advance();
                for (std::size_t k = 0; k < 3; ++k)
                    motion.force[k] += rig_.readings().raw_g[k] / block;
            }
            motion.angle = encoder_rad = angle();
            motion.good = true;
            motion.time = rig_.time_us() * drivers::kMicrosecond;
            const Vector rate = stage.step(motion);
            plant::Vec3 torque{};
            for (std::size_t k = 0; k < 3; ++k) torque[k] = 0.1 * std::round(10 * rate[k]);
            rig_.torque(torque);
        }
        rig_.torque({});
        for (int i = 0; i < second_ / 5; ++i) rig_.advance();
        return stage.failure();
    }

    /// All ways that the stage asks for; begun before.
    std::string zero_all(ZeroCalibration& stage, PositionLeveller* levelling) {
        auto why = zero(stage, levelling);
        while (why.empty() && stage.another()) {
            stage.begin_other_way();
            why = zero(stage, levelling);
        }
        return why;
    }

    /// One run, begun before.
    std::string zero(ZeroCalibration& stage, PositionLeveller* levelling) {
        slew(stage.target_deg(), plant::GimbalMode::slew);
        settle();
        if (levelling != nullptr) {
            Vector encoder{};
            if (auto why = level(*levelling, stage.target_deg(), stage.status(), encoder);
                !why.empty())
                return "levelling: " + why;
            stage.levelled_at(encoder);
            slew(stage.target_deg(), plant::GimbalMode::slew);
            settle();
        }
        stage.arrived();
        slew(stage.target_deg(), plant::GimbalMode::calibrate);
        while (!stage.over()) {
            rig_.advance();
            for (const auto& increment : rig_.increments()) {
                rt::Motion motion;
                motion.time =
                    static_cast<drivers::Time>(increment.count + 1) * 10 * drivers::kMillisecond;
                for (std::size_t k = 0; k < 3; ++k) {
                    motion.turn[k] = increment.turn_arcsec[k] / 3600 * std::numbers::pi / 180;
                    motion.force[k] = increment.velocity_mps[k];
                }
                motion.angle = angle();
                motion.good = motion.increment = true;
                if (!stage.over()) stage.add(motion);
            }
            if (rig_.gimbals().in_position()) {
                stage.arrived();
                slew(stage.target_deg(), plant::GimbalMode::calibrate);
            }
        }
        slew(stage.target_deg(), plant::GimbalMode::slew);
        return {};
    }

    plant::Rig& rig() { return rig_; }

  private:
    [[nodiscard]] Vector angle() const {
        Vector rad{};
        for (std::size_t k = 0; k < 3; ++k)
            rad[k] = rig_.readings().encoder_deg[k] * std::numbers::pi / 180;
        return rad;
    }
    void settle() {
        do {
            rig_.advance();
        } while (!rig_.gimbals().in_position());
        for (int i = 0; i < second_; ++i) rig_.advance();
    }

    plant::Rig rig_;
    int second_;  ///< in samples
};

}  // namespace vibrig::campaign
