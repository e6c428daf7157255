#include "daemon/tool/analysis/seen_plan.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <iostream>
#include <optional>
#include <utility>

#include "estimator/filter/angles.hpp"
#include "estimator/filter/encoder_angles.hpp"
#include "estimator/level/hann.hpp"
#include "estimator/level/vibration_level.hpp"
#include "estimator/plan/positions.hpp"

namespace vibrig::tool {

/// A dwell as a plan would have it: where it begins, and its level by its own accelerometers.
class SeenPlan::Dwell {
  public:
    explicit Dwell(const estimator::Settings& settings) : settings_(settings) {}

    void add(const estimator::Measurement& measurement) {
        if (!begin_s_) begin_s_ = measurement.time_s;
        end_s_ = measurement.time_s;
        if (times_s_.size() < kTimesEnough) times_s_.push_back(end_s_);
        std::array<double, 3> angle_deg{};
        double all = 0;
        for (std::size_t i = 0; i < 3; ++i) {
            angle_deg[i] = measurement.angle_rad[i] * estimator::kDegPerRad;
            all += angle_deg[i] + measurement.force_g[i];
        }
        const bool good = measurement.angles_good && measurement.force_good;
        if (!good || !std::isfinite(all)) return;
        if (!up_) {
            angles_deg_ = estimator::gimbal_deg(settings_, angle_deg);
            up_ = estimator::plan::up_at(settings_, angle_deg);
        }
        double along = 0;
        for (std::size_t i = 0; i < 3; ++i) {
            for (std::size_t j = 0; j < 3; ++j) {
                along += (*up_)[i] * settings_.accelerometer_matrix[i][j] *
                         (measurement.force_g[j] - settings_.accelerometer_zero_g[j]);
            }
        }
        force_.add(along);
    }

    /// Nothing without a good sample.
    [[nodiscard]] std::optional<estimator::PlannedDwell> planned() const {
        if (!up_) return std::nullopt;
        const auto means = force_.means();
        double kappa = means.mean_square / (means.mean * means.mean) -
                       settings_.accelerometer_g * settings_.accelerometer_g;
        if (kappa - 1 < 1e-4) kappa = 1;  // at rest
        const double duration_s = end_s_ - *begin_s_;
        if (!(duration_s > 0) || !std::isfinite(kappa)) return std::nullopt;
        return estimator::PlannedDwell{angles_deg_, kappa, duration_s, 1};
    }

    /// Between its samples, s; 0: not known. Once.
    [[nodiscard]] double period_s() { return estimator::median_interval(times_s_); }

  private:
    static constexpr std::size_t kTimesEnough = 1001;

    const estimator::Settings& settings_;
    std::vector<double> times_s_;
    std::optional<double> begin_s_;
    double end_s_ = 0;
    std::array<double, 3> angles_deg_{};
    std::optional<std::array<double, 3>> up_;
    estimator::GrowingHann force_;
};

SeenPlan::SeenPlan(const estimator::Settings& settings) : settings_(settings) {}
SeenPlan::~SeenPlan() = default;

void SeenPlan::begin_dwell(int run) {
    end_dwell();
    dwell_ = std::make_unique<Dwell>(settings_);
    run_ = run;
}

void SeenPlan::add(const estimator::Measurement& measurement) { dwell_->add(measurement); }

void SeenPlan::end_dwell() {
    const auto dwell = std::exchange(dwell_, nullptr);
    if (!dwell) return;
    if (!(period_s_ > 0)) period_s_ = dwell->period_s();
    if (auto one = dwell->planned()) {
        one->run = run_;
        plan_.push_back(*one);
    }
}

void SeenPlan::tell() {
    end_dwell();
    if (plan_.empty() || !(period_s_ > 0)) return;
    for (const std::string& line :
         estimator::plan_warnings(estimator::report_plan(settings_, plan_, period_s_))) {
        std::cerr << "before the run: " << line << '\n';
    }
    const bool vibrating =
        std::any_of(plan_.begin(), plan_.end(), [](const auto& one) { return one.kappa > 1; });
    const std::string alias = estimator::VibrationLevel::aliasing(settings_.frequency_hz, period_s_,
                                                                  settings_.level_window_s);
    // A level is that of seconds: whose time is in ms has none, and no suspects either.
    constexpr double kSlowest_s = 1;
    if (vibrating && period_s_ >= kSlowest_s) {
        std::cerr << "before the run: time_s: found " << period_s_
                  << " s from one sample to the next, expected several samples a second: is it in "
                     "ms?\n";
    } else if (vibrating && !alias.empty()) {
        std::cerr << "before the run: " << alias << '\n';
    }
}

}  // namespace vibrig::tool
