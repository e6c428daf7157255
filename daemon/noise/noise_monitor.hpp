#pragma once

#include <array>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "daemon/domain/events.hpp"
#include "daemon/domain/positions.hpp"
#include "daemon/noise/found.hpp"
#include "daemon/noise/noise_status.hpp"
#include "daemon/rt/angle_blocks.hpp"
#include "estimator/allan/dwell_monitor.hpp"
#include "estimator/identification/dwell_residual.hpp"
#include "estimator/identification/identification.hpp"

namespace vibrig::noise {

/// Watches the gyros' noise over a campaign: takes the block means of each dwell, lets the drift
/// model with the newest coefficients leave the residual, compares it with the earlier dwells,
/// learns from it, and says what the filter should use from the next dwell on. Control thread only.
class NoiseMonitor {
  public:
    /// Knowledge of the coefficients, order of parameter_names(); the covariance 30 x 30,
    /// row-major.
    struct Knowledge {
        std::array<double, estimator::kParameters> coefficients{};
        std::vector<double> covariance;
    };
    /// Without an `event` nobody hears or looks: of the terms only Q and N are found, what they are
    /// taken for is the same.
    NoiseMonitor(const estimator::Settings& settings, EventSink event);

    /// A new campaign: everything is forgotten, the settings' noise is in force.
    void reset();
    void add(const rt::BlockRecord& block);
    /// The blocks of this dwell are complete; `now` is known with it. True: its noise, or its mean
    /// drift, is not that of the earlier ones.
    [[nodiscard]] bool end_dwell(const estimator::DwellSummary& dwell, Knowledge now);
    /// One more innovation: the drift that a levelling found against the coefficients'.
    void levelled(const LevelDrift& drift);
    /// Levels that differ from those in force, once; they are taken as in force from now on. A
    /// level changes only if the data contradict it, by a factor of 2 at most, never by a dwell
    /// with an alarm.
    [[nodiscard]] std::optional<estimator::NoiseLevels> take_new_levels();
    /// What all dwells say, once they contradict the settings: with it the campaign is to be
    /// identified anew. Nothing: the settings' noise was right all the time, or nobody knows.
    [[nodiscard]] std::optional<Found> found() const;
    /// All of that between two dwells: flags a dwell whose noise is not that of the earlier ones,
    /// and the filter takes what it should use from the next one on.
    void conclude(estimator::DwellSummary& dwell, estimator::Identification& identification);
    /// Goes on with what another one has learnt.
    void continue_from(NoiseMonitor&& other);
    /// One event for each gyro.
    void report() const;

    [[nodiscard]] const NoiseStatus& status() const { return status_; }

  private:
    [[nodiscard]] std::vector<estimator::AngleBlock> usable_blocks() const;
    [[nodiscard]] const std::shared_ptr<const estimator::allan::DwellBasis>& basis_of(
        std::vector<std::size_t> present);
    bool mean_has_stepped(const estimator::DwellSummary& dwell, const Knowledge& before,
                          const std::vector<estimator::AngleBlock>& blocks,
                          const std::array<estimator::allan::DwellAngles, 3>& angles);
    void raise(const NoiseStatus::Alarm& alarm, const std::string& what);
    bool check(const estimator::DwellSummary& dwell,
               const std::array<estimator::allan::DwellAngles, 3>& angles);
    void learn(const std::array<estimator::allan::DwellAngles, 3>& angles);
    void draw(const estimator::DwellSummary& dwell,
              const std::array<estimator::allan::DwellAngles, 3>& angles, bool alarm);
    struct MeanAngle {
        double value, sigma;  ///< arcsec
    };
    /// Mean of the three gyros' fits: the resolvers are of one kind.
    [[nodiscard]] MeanAngle mean_angle() const;
    void propose_levels();
    template <typename Words>
    void tell(const Words& words) const;

    estimator::Settings settings_;
    EventSink event_;
    std::vector<rt::BlockRecord> blocks_;
    std::vector<estimator::allan::DwellMonitor> gyros_;
    std::shared_ptr<const estimator::allan::DwellBasis> basis_;
    estimator::NoiseLevels in_force_;
    bool changed_ = false;
    Knowledge prior_, known_;
    double level_squares_ = 0;
    NoiseStatus status_;
};

}  // namespace vibrig::noise
