#pragma once

#include <atomic>

#include "daemon/app/events.hpp"
#include "daemon/app/fitness.hpp"
#include "daemon/campaign/ports.hpp"
#include "daemon/interlock/interlock.hpp"
#include "daemon/interlock/rest_monitor.hpp"
#include "daemon/rt/acquisition.hpp"

namespace vibrig {

/// The real rig, or the simulated one, as the campaign sees it.
class CampaignRig final : public campaign::Rig {
  public:
    CampaignRig(drivers::Gimbal& moved, drivers::Shaker& excited,
                const rt::Acquisition& acquisition, const rt::RestMonitor& at_rest,
                const Fitness& fitness, rt::Interlock& interlock, Events& events)
        : Rig(moved, excited),
          acquisition_(acquisition),
          rest_(at_rest),
          fitness_(fitness),
          interlock_(interlock),
          events_(events) {}

    [[nodiscard]] drivers::PlatformStatus platform() const override {
        return acquisition_.view().platform;
    }
    [[nodiscard]] rt::Rest rest(drivers::Time now) const override { return rest_.rest(now); }
    [[nodiscard]] std::optional<rt::MeanMotion> second() const override {
        return interlock_.second();
    }
    [[nodiscard]] std::string unfit() const override { return fitness_.misfit(); }

    void guard(rt::Guard level) override;
    void commanded(double table_g, const std::array<double, 3>& position_deg) override {
        interlock_.command(table_g, position_deg);
    }
    void ramping(const rt::Ramp& ramp) override { interlock_.ramp(ramp); }
    void transmission(double measured) override { interlock_.transmission(measured); }
    void disobeyed(bool now_so) override;
    void uncommanded() override { interlock_.uncommanded(); }
    void gimbals_led() override { interlock_.trip(rt::Trip::gimbal_off); }
    void gimbals_silent() override { interlock_.trip(rt::Trip::stale_platform); }
    void wrong_vibration() override {
        interlock_.wrong_vibration(true);
        interlock_.wrong_vibration(false);  // seen once, before a dwell
    }
    void grown(std::optional<std::array<double, 2>> times) override {
        if (times)
            interlock_.growth((*times)[0], (*times)[1]);
        else
            interlock_.no_growth();
    }
    [[nodiscard]] std::array<double, 2> grown_limits() const override {
        return {interlock_.least_limit(rt::Trip::motion_in_step),
                interlock_.least_limit(rt::Trip::cross_growth)};
    }
    void proving(campaign::Proving what) override;

    /// Any thread: the campaign is between ramp and rest.
    [[nodiscard]] bool excitation() const noexcept { return excitation_.load(); }
    /// Any thread: the proof does not let the watchdog be fed.
    [[nodiscard]] bool starving() const noexcept { return starving_.load(); }
    /// Control thread: by the table, now.
    [[nodiscard]] bool is_disobeyed() const noexcept { return disobeyed_; }

  private:
    const rt::Acquisition& acquisition_;
    const rt::RestMonitor& rest_;
    const Fitness& fitness_;
    rt::Interlock& interlock_;
    Events& events_;
    std::atomic<bool> excitation_{false}, starving_{false};
    bool disobeyed_ = false;
};

}  // namespace vibrig
