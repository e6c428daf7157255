#pragma once

#include <deque>
#include <string>
#include <utility>

#include "daemon/campaign/stages/stage.hpp"

namespace vibrig::campaign {

/// For the platform: ready, and its temperature steady.
class Waiting : public Stage {
  public:
    Waiting(const Settings& settings, Rig& rig) : settings_(settings), rig_(rig) {}

    void begin(drivers::Time now) override;
    [[nodiscard]] StageStep step(drivers::Time now) override;
    void leave() override {}
    /// What it waits for.
    [[nodiscard]] const std::string& words() const { return words_; }

  private:
    void look_at(const drivers::PlatformStatus& platform, drivers::Time now);
    [[nodiscard]] bool steady(drivers::Time now) const;

    const Settings& settings_;
    Rig& rig_;
    drivers::Time begun_ = 0;
    std::string words_;
    std::deque<std::pair<drivers::Time, double>> temperatures_;  ///< degC, of one window
};

}  // namespace vibrig::campaign
