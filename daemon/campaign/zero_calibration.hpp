#pragma once

#include <optional>
#include <string>
#include <vector>

#include "daemon/campaign/rig_frame.hpp"
#include "daemon/campaign/settings.hpp"
#include "daemon/rt/stage_feed.hpp"
#include "daemon/status/status.hpp"
#include "estimator/zeros/calibration.hpp"
#include "estimator/zeros/observability.hpp"

namespace vibrig::campaign {

/// In which the zeros are taken one after the other.
[[nodiscard]] std::vector<estimator::zeros::Way> ways_of(const ZeroingSettings& settings);
/// Encoder angles in deg at which the slews of a way end, in turn; the last two are repeated.
[[nodiscard]] std::vector<Vector> slews_of(const estimator::zeros::Way& way, const RigFrame& frame);

/// One calibration of the accelerometers' zeros by azimuth slews: where the gimbals go next, what
/// the filter makes of the increments, and the comparison of the end with the start. Control thread
/// only.
class ZeroCalibration {
  public:
    /// Throws estimator::SettingsError or estimator::zeros::ZeroError if the plan cannot work.
    /// `sample_s`: between two samples, for which rig.accelerometer_g holds.
    ZeroCalibration(const ZeroingSettings& settings, const estimator::Settings& rig,
                    double sample_s);

    /// Which key of [zeroing] cannot work with these figures, what was found and expected; empty:
    /// none. Runs a simulated unit.
    [[nodiscard]] std::string refusal() const;
    /// The filter's settings: the unit, the slews and the noise.
    [[nodiscard]] estimator::zeros::CalibrationSettings plan(
        const estimator::zeros::Way& way = {}) const;
    void reset() { first_.reset(), present_ = {}; }  ///< a new campaign
    void begin();
    /// Encoder angles to slew to, deg; after the last one of the plan there and back again.
    [[nodiscard]] Vector target_deg() const;
    /// The platform was brought level at the first target: outer and inner gimbal stay there.
    void levelled_at(const Vector& encoder_rad);
    [[nodiscard]] bool levelled() const { return level_deg_.has_value(); }
    void arrived() { ++target_; }
    void add(const rt::Motion& motion);
    /// The planned time is over, or the filter has given up.
    [[nodiscard]] bool over() const;
    /// A further run is to follow.
    [[nodiscard]] bool another() const { return way_ + 1 < ways_.size(); }
    void begin_other_way();
    /// Takes the result over; the reason why it is not to be used, else empty.
    [[nodiscard]] std::string finish(bool at_end);
    [[nodiscard]] double time_s() const;
    [[nodiscard]] std::string words() const;
    [[nodiscard]] const ZeroStatus& status() const { return present_; }
    /// On top of the configuration's zeros, as the raw readings show them, g.
    [[nodiscard]] Vector raw_zero_g() const;
    /// Relative standard deviation of the vibration level at these angles that the zeros leave:
    /// delta = u.b.
    [[nodiscard]] double level_sigma(const Vector& encoder_deg) const;
    void fill(ZeroStatus& status) const;
    [[nodiscard]] double expected_s() const {
        return settings_.duration_s * static_cast<double>(ways_.size());
    }

  private:
    struct Found {
        Vector zero_mg{}, filter_sigma_mg{};
    };
    void start_run();

    ZeroingSettings settings_;
    estimator::Settings rig_;
    double sample_s_;
    RigFrame frame_;
    std::optional<estimator::zeros::Calibration> calibration_;
    std::vector<estimator::zeros::CalibrationResult> results_;  ///< of the runs that are over
    std::vector<estimator::zeros::Way> ways_;
    std::vector<Vector> slews_;  ///< of this run
    std::size_t way_ = 0, target_ = 0;
    std::optional<Vector> level_deg_;  ///< encoder angles of this run
    drivers::Time first_time_ = 0, last_time_ = 0;
    std::optional<Found> first_;  ///< of the campaign's start
    ZeroStatus present_;
    ZeroStatus last_;  ///< what the last calibration found, in force or not
    std::string failure_;
};

}  // namespace vibrig::campaign
