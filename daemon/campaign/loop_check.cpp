#include "daemon/campaign/loop_check.hpp"

#include <spdlog/fmt/fmt.h>

#include <cmath>
#include <numbers>

#include "daemon/rt/amplitude_witness.hpp"

namespace vibrig::campaign {

namespace {
constexpr double kGravityTolerance = 0.05;  // of 1 g, at rest
constexpr double kStill = 0.05;             // g, at rest
constexpr double kDecibel = rt::AmplitudeWitness::kDecibel;
constexpr double kMostBad = 0.1;  // of the samples
}  // namespace

LoopCheck::LoopCheck(const LoopCheckSettings& settings, const estimator::Settings& rig)
    : settings_(settings), rig_(rig), frame_(rig) {}

std::string LoopCheck::beyond_limits(const Settings& settings) {
    const double omega = 2 * std::numbers::pi * settings.frequency_hz;
    const double mps2 = settings.loop.table_g * settings.rig.gravity_mps2;
    const std::string what =
        fmt::format("{:g} g at {:g} Hz: ", settings.loop.table_g, settings.frequency_hz);
    if (settings.loop.table_g > settings.max_acceleration_g)
        return what + fmt::format("{:g} g at most", settings.max_acceleration_g);
    if (mps2 / omega > settings.max_velocity_mps)
        return what + fmt::format("{:g} m/s at most", settings.max_velocity_mps);
    if (mps2 / (omega * omega) * 1e3 > settings.max_displacement_mm)
        return what + fmt::format("{:g} mm at most", settings.max_displacement_mm);
    return {};
}

void LoopCheck::begin(const std::string& by) {
    readings_.clear();
    bad_ = 0;
    status_ = {};
    status_.by = by;
    status_.verdict = "running";
}

void LoopCheck::add(const rt::Motion& motion) {
    if (!motion.good) {
        ++bad_;
        return;
    }
    angle_rad_ = motion.angle;
    readings_.push_back({drivers::to_seconds(motion.time), frame_.force(motion.force, 1),
                         motion.table, motion.table_good});
}

std::string LoopCheck::look(std::array<double, 3>& position_deg) const {
    if (readings_.empty() ||
        static_cast<double>(bad_) > kMostBad * static_cast<double>(bad_ + readings_.size()))
        return "no good samples at rest";
    Vector mean{};
    for (const auto& reading : readings_) {
        for (std::size_t i = 0; i < 3; ++i)
            mean[i] += reading.force_g[i] / static_cast<double>(readings_.size());
    }
    const double gravity = std::sqrt(dot(mean, mean));
    if (!(std::abs(gravity - 1) <= kGravityTolerance))
        return fmt::format("specific force {:.3f} g at rest, expected 1 g within {:g} g", gravity,
                           kGravityTolerance);
    for (const auto& reading : readings_) {
        for (std::size_t i = 0; i < 3; ++i) {
            if (!(std::abs(reading.force_g[i] - mean[i]) <= kStill))
                return fmt::format(
                    "the platform moves by {:.3f} g at rest, expected {:g} g at most",
                    std::abs(reading.force_g[i] - mean[i]), kStill);
        }
    }
    for (std::size_t i = 0; i < 3; ++i) position_deg[i] = angle_rad_[i] * 180 / std::numbers::pi;
    return {};
}

void LoopCheck::row(const char* name, const char* unit, double value, double low, double high) {
    const bool passed = value >= low && value <= high;
    status_.rows.push_back({name, unit, value, low, high, passed});
    if (passed) return;
    out_of_band_ +=
        fmt::format("{}{} {:.4g}{}{}, expected {:.4g} to {:.4g}", out_of_band_.empty() ? "" : "; ",
                    name, value, *unit == '\0' ? "" : " ", unit, low, high);
}

void LoopCheck::finish(double shaker_g) {
    const auto found = estimator::loop_response(readings_, rig_.frequency_hz);
    const double commanded_g = settings_.table_g;
    const double table_g = found.table_known ? found.table_g : commanded_g;
    const double tolerance = settings_.transmission_tolerance;
    out_of_band_.clear();
    transmission_ = table_g > 0 ? found.platform_g / table_g : 0;
    row("transmission", "", transmission_, rig_.transmission * (1 - tolerance),
        rig_.transmission * (1 + tolerance));
    row("controller over command", "", shaker_g / commanded_g, 1 / kDecibel, kDecibel);
    if (found.table_known)
        row("table over command", "", found.table_g / commanded_g, 1 / kDecibel, kDecibel);
    row("platform over command", "", found.platform_g / (rig_.transmission * commanded_g),
        (1 - tolerance) / kDecibel, (1 + tolerance) * kDecibel);
    row("frequency", "Hz", found.frequency_hz, rig_.frequency_hz - settings_.frequency_tolerance_hz,
        rig_.frequency_hz + settings_.frequency_tolerance_hz);
    row("distortion", "", found.distortion, 0, settings_.distortion);
    row("cross-axis share", "", found.cross_share, 0, settings_.cross_share);
    if (found.table_known) {
        // The nearest to the middle of the band of all that are the same phase.
        row("phase", "deg",
            settings_.phase_deg + std::remainder(found.phase_deg - settings_.phase_deg, 360.0),
            settings_.phase_deg - settings_.phase_tolerance_deg,
            settings_.phase_deg + settings_.phase_tolerance_deg);
    }
    passed_ = out_of_band_.empty();
}

void LoopCheck::conclude() {
    status_.verdict = passed_ ? "in band" : "out of band";
    status_.message = out_of_band_;
}

void LoopCheck::not_completed(const std::string& why) {
    status_.verdict = "not completed";
    status_.message = why;
}

void LoopCheck::take_over(const std::string& out_of_band) {
    out_of_band_ = out_of_band;
    if (out_of_band.empty()) return;
    status_.verdict = "out of band";
    status_.message = out_of_band;
}

std::string LoopCheck::refusal() const {
    if (!out_of_band_.empty()) return "the loop check was out of band: " + out_of_band_;
    if (settings_.required && !passed_)
        return "no loop check in band since the start: make one (vibrig selftest --by NAME)";
    return {};
}

}  // namespace vibrig::campaign
