#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "daemon/campaign/safety_proof.hpp"
#include "estimator/filter/settings.hpp"
#include "estimator/level/in_step.hpp"

namespace vibrig::campaign {

/// During a sine dwell: whether motion in step with the vibration and motion across the vertical
/// are still what the loop check found at this frequency, window by window. Control thread only.
class InStepWatch {
  public:
    /// The time of readings that count; docs/theory/spectrum.md has what noise does to one window.
    static constexpr double kWindow_s = 5;

    /// `limits`: times what was found, of motion in step and across, beyond which it is said.
    InStepWatch(const estimator::Settings& rig, double sample_s, FoundInStep before, double hz,
                std::array<double, 2> limits);

    struct Look {
        std::array<double, 2> times{};  ///< what was found before, of motion in step and across
        std::vector<std::string> said;  ///< what has grown and was not said yet
    };
    /// With the last reading of a window what became of it; nothing of a window with less than half
    /// of its readings, or without vibration.
    [[nodiscard]] std::optional<Look> add(const estimator::LoopReading& reading);

  private:
    [[nodiscard]] Look judge(const estimator::InStep& now);

    estimator::Settings rig_;
    double sample_s_;
    FoundInStep before_;
    double hz_;
    std::array<double, 2> limits_;
    std::array<bool, 2> said_{};
    std::vector<estimator::LoopReading> window_;
};

/// Among those found the one that a vibration at `hz` is held against: the reference frequency's
/// too where `hz` stands for it. Nothing: the loop check has not looked there.
[[nodiscard]] std::optional<FoundInStep> found_at(const std::vector<FoundInStep>& found, double hz,
                                                  const estimator::Settings& rig);

}  // namespace vibrig::campaign
