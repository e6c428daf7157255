#pragma once

#include <array>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "daemon/rt/angle_blocks.hpp"
#include "daemon/status.hpp"
#include "estimator/allan/dwell_monitor.hpp"
#include "estimator/dwell_residual.hpp"

namespace vibrig::noise {

/// Watches the gyros' noise over a campaign: takes the block means of each dwell, lets the drift
/// model with the newest coefficients leave the residual, compares it with the earlier dwells,
/// learns from it, and says what the filter should use from the next dwell on. Control thread only.
class NoiseMonitor {
  public:
    using Event = std::function<void(Severity, const std::string&)>;
    NoiseMonitor(const estimator::Settings& settings, Event event);

    /// A new campaign: everything is forgotten, the settings' noise is in force.
    void reset();
    void add(const rt::BlockRecord& block);
    /// The blocks of this dwell are complete. True: its noise is not that of the earlier ones.
    [[nodiscard]] bool end_dwell(const estimator::DwellSummary& dwell,
                                 const std::array<double, estimator::kParameters>& coefficients);
    /// Levels that differ from those in force, once; they are taken as in force from now on. A
    /// level changes only if the data contradict it, by a factor of 2 at most, never by a dwell
    /// with an alarm.
    [[nodiscard]] std::optional<estimator::NoiseLevels> take_new_levels();
    /// One event for each gyro.
    void report() const;

    [[nodiscard]] const NoiseStatus& status() const { return status_; }

  private:
    [[nodiscard]] std::vector<estimator::AngleBlock> usable_blocks() const;
    [[nodiscard]] const std::shared_ptr<const estimator::allan::DwellBasis>& basis_of(
        std::vector<std::size_t> present);
    bool check(const estimator::DwellSummary& dwell,
               const std::array<estimator::allan::DwellAngles, 3>& angles);
    void learn(const std::array<estimator::allan::DwellAngles, 3>& angles);
    void propose_levels();

    estimator::Settings settings_;
    Event event_;
    std::vector<rt::BlockRecord> blocks_;
    std::vector<estimator::allan::DwellMonitor> gyros_;
    std::shared_ptr<const estimator::allan::DwellBasis> basis_;
    estimator::NoiseLevels in_force_;
    bool changed_ = false;
    NoiseStatus status_;
};

}  // namespace vibrig::noise
