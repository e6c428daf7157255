#include "daemon/campaign/loop_check.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

#include "daemon/interlock/amplitude_witness.hpp"
#include "estimator/filter/angles.hpp"

namespace vibrig::campaign {

namespace {
constexpr double kGravityTolerance = 0.05;  // of 1 g, at rest
constexpr double kStill = 0.05;             // g, at rest
constexpr double kDecibel = rt::AmplitudeWitness::kDecibel;
constexpr double kMostBad = 0.1;  // of the samples
constexpr const char* kMotionInStep = "motion in step";
constexpr const char* kArcsecPerG = "arcsec/g";
}  // namespace

LoopCheck::LoopCheck(const LoopCheckSettings& settings, const estimator::Settings& rig)
    : settings_(settings), rig_(rig), frame_(rig) {}

std::vector<Stop> LoopCheck::further_frequencies(const Settings& settings) {
    std::vector<Stop> list;
    for (const Stop& stop : settings.stops) {
        const double hz = stop.frequency_hz;
        if (!(hz > 0 && stop.table_g > 0) || estimator::at_reference(settings.rig, hz) ||
            std::ranges::count(list, hz, &Stop::frequency_hz) > 0)
            continue;
        list.push_back(stop);
    }
    std::ranges::sort(list, {}, &Stop::frequency_hz);
    return list;
}

std::string LoopCheck::beyond_limits(const Settings& settings) {
    const auto at = [&](double hz) -> std::string {
        const double omega = 2 * std::numbers::pi * hz;
        const double mps2 = settings.loop.table_g * settings.rig.gravity_mps2;
        const std::string what = fmt::format("{:g} g at {:g} Hz: ", settings.loop.table_g, hz);
        if (settings.loop.table_g > settings.max_acceleration_g)
            return what + fmt::format("{:g} g at most", settings.max_acceleration_g);
        if (mps2 / omega > settings.max_velocity_mps)
            return what + fmt::format("{:g} m/s at most", settings.max_velocity_mps);
        if (mps2 / (omega * omega) * 1e3 > settings.max_displacement_mm)
            return what + fmt::format("{:g} mm at most", settings.max_displacement_mm);
        return {};
    };
    std::string why = at(settings.frequency_hz);
    for (const Stop& stop : further_frequencies(settings))
        if (why.empty()) why = at(stop.frequency_hz);
    return why;
}

void LoopCheck::begin(const std::string& by) {
    readings_.clear();
    found_wrong_.clear();
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
                         motion.table, motion.table_good, motion.angle});
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
    for (std::size_t i = 0; i < 3; ++i) position_deg[i] = angle_rad_[i] * estimator::kDegPerRad;
    return {};
}

namespace {

double norm(const estimator::LoopReading& reading) {
    return std::sqrt(dot(reading.force_g, reading.force_g));
}

void subtract_mean(std::vector<double>& values) {
    double mean = 0;
    for (const double value : values) mean += value / static_cast<double>(values.size());
    for (double& value : values) value -= mean;
}

double rms(const std::vector<double>& values) {
    double squares = 0;
    for (const double value : values) squares += value * value;
    return values.empty() ? 0 : std::sqrt(squares / static_cast<double>(values.size()));
}

}  // namespace

std::vector<double> LoopCheck::motion() const {
    const bool table = std::ranges::all_of(readings_, &estimator::LoopReading::table_good);
    std::vector<double> values;
    values.reserve(readings_.size());
    for (const auto& reading : readings_) values.push_back(table ? reading.table_g : norm(reading));
    subtract_mean(values);
    return values;
}

LoopCheck::Noise LoopCheck::noise() const {
    std::vector<double> platform, table;
    for (const auto& reading : readings_) {
        platform.push_back(norm(reading));
        if (reading.table_good) table.push_back(reading.table_g);
    }
    subtract_mean(platform);
    subtract_mean(table);
    return {rms(platform), rms(table)};
}

double LoopCheck::mean_force_g() const {
    double sum = 0;
    for (const auto& reading : readings_) sum += norm(reading);
    return sum / static_cast<double>(std::max<std::size_t>(readings_.size(), 1));
}

LoopCheck::Noise LoopCheck::peak() const {
    const auto of = [](double value, double noise) {
        return std::sqrt(2 * std::max(0.0, value * value - noise * noise));
    };
    const Noise all = noise();
    return {of(all.platform_g, at_rest_.platform_g), of(all.table_g, at_rest_.table_g)};
}

drivers::Time LoopCheck::last_at_half() const {
    const auto values = motion();
    double highest = 0;
    for (const double value : values) highest = std::max(highest, std::abs(value));
    for (std::size_t i = values.size(); i-- > 0;) {
        if (2 * std::abs(values[i]) >= highest) return drivers::from_seconds(readings_[i].time_s);
    }
    return 0;
}

std::span<const estimator::LoopReading> LoopCheck::readings_since(drivers::Time time) const {
    const auto first = std::ranges::lower_bound(readings_, drivers::to_seconds(time), {},
                                                &estimator::LoopReading::time_s);
    return {first, readings_.end()};
}

estimator::RingDown LoopCheck::ring_down_since(drivers::Time time) const {
    // What is there at rest as well, noise or the hum of a blower, does not decay: a platform that
    // is bolted hard would be waited for for minutes. The crests of three sines side by side are
    // less than three times their rms.
    const double floor_g = std::max(6 * rig_.accelerometer_g, 3 * at_rest_.platform_g);
    return estimator::ring_down(readings_since(time), floor_g);
}

std::string unit_of_ratio(double ratio) {
    struct Unit {
        double ratio;
        const char* words;
    };
    // The controller counts in what is named first, the configuration in what is named second.
    static constexpr std::array<Unit, 6> kUnits{{
        {std::numbers::sqrt2, "g rms for g peak? (shaker.amplitude_unit)"},
        {1 / std::numbers::sqrt2, "g peak for g rms? (shaker.amplitude_unit)"},
        {9.80665, "g for m/s2? (shaker.amplitude_unit)"},
        {1 / 9.80665, "m/s2 for g? (shaker.amplitude_unit)"},
        {0.5, "peak to peak for peak? (scale of shaker.registers.amplitude)"},
        {2, "peak for peak to peak? (scale of shaker.registers.amplitude)"},
    }};
    constexpr double kNear = 0.12;
    for (const Unit& unit : kUnits) {
        if (ratio > 0 && std::abs(std::log(ratio / unit.ratio)) < kNear) return unit.words;
    }
    return {};
}

std::array<double, 2> isolator_ratio(double transmission, double from_hz, double to_hz) {
    if (!(transmission < 1)) return {1, 1};
    constexpr double kMostDamping = 0.5;
    constexpr int kSteps = 10;
    const double square = transmission * transmission;
    std::array<double, 2> found{1e9, 0};
    for (int i = 0; i <= kSteps; ++i) {
        const double z = std::pow(2 * kMostDamping * i / kSteps, 2);
        const double b = square * (z - 2) - z;
        const double x = (-b + std::sqrt(b * b + 4 * square * (1 - square))) / (2 * square);
        const double there = x * (to_hz / from_hz) * (to_hz / from_hz);
        const double at_there =
            std::sqrt((1 + z * there) / ((1 - there) * (1 - there) + z * there));
        found = {std::min(found[0], at_there / transmission),
                 std::max(found[1], at_there / transmission)};
    }
    return found;
}

double LoopCheck::over_command(drivers::Time asked, double ramp_s) const {
    // The slope of the amplitude, from the energy of two halves of what came: neither the phase nor
    // when the controller began need be known.
    const double from_s = drivers::to_seconds(asked) + 0.3 * ramp_s;
    const auto first =
        std::ranges::lower_bound(readings_, from_s, {}, &estimator::LoopReading::time_s);
    const auto count = static_cast<std::size_t>(readings_.end() - first);
    constexpr std::size_t kFewest = 16;
    if (count < kFewest) return 0;
    const auto amplitude = [&](std::size_t begin, std::size_t end) {
        double square = 0;
        for (std::size_t i = begin; i < end; ++i) {
            const auto& reading = first[static_cast<std::ptrdiff_t>(i)];
            const auto& f = reading.force_g;
            const double along = std::sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2]) - 1;
            const double value = reading.table_good ? reading.table_g : along / rig_.transmission;
            square += value * value;
        }
        return std::sqrt(2 * square / static_cast<double>(end - begin));
    };
    const std::size_t half = count / 2;
    const double apart_s = first[static_cast<std::ptrdiff_t>(half)].time_s - first->time_s;
    const double slope = (amplitude(half, 2 * half) - amplitude(0, half)) / apart_s;
    return slope * ramp_s / settings_.table_g;
}

CheckRow LoopCheck::judged(const char* name, const char* unit, double value, double low,
                           double high, const std::string& at) {
    CheckRow row{name, unit, value, low, high};
    if (!row.passed())
        found_wrong_ += fmt::format("{}{}{} {:.4g}{}{}, expected {:.4g} to {:.4g}",
                                    found_wrong_.empty() ? "" : "; ", at, name, value,
                                    *unit == '\0' ? "" : " ", unit, low, high);
    return row;
}

void LoopCheck::row(const char* name, const char* unit, double value, double low, double high) {
    status_.rows.push_back(judged(name, unit, value, low, high, ""));
}

/// A platform that turns with the vibration has gravity go across its vertical, 1 g times the
/// angle.
double LoopCheck::most_in_step() const { return settings_.cross_share / estimator::kRadPerArcsec; }

LoopCheck::AtFrequency LoopCheck::finish_at(double hz, double low, double high) {
    const auto found = estimator::loop_response(readings_, hz);
    const double table_g = found.table_known ? found.table_g : settings_.table_g;
    const std::string at = fmt::format("at {:g} Hz ", hz);
    AtFrequency out{hz, table_g > 0 ? found.platform_g / table_g : 0, {}, {}};
    const auto row = [&](const char* name, const char* unit, double value, double from, double to) {
        out.rows.push_back(judged(name, unit, value, from, to, at));
    };
    row("transmission", "", out.transmission, low, high);
    if (found.table_known)
        row("table over command", "", found.table_g / settings_.table_g, 1 / kDecibel, kDecibel);
    row("frequency", "Hz", found.frequency_hz, hz - settings_.frequency_tolerance_hz,
        hz + settings_.frequency_tolerance_hz);
    row("distortion", "", found.distortion, 0, settings_.distortion);
    row("cross-axis share", "", found.cross_share, 0, settings_.cross_share);
    out.in_step = estimator::in_step(readings_, found.frequency_hz, rig_);
    if (out.in_step.platform_g > 0)
        row(kMotionInStep, kArcsecPerG, out.in_step.motion_arcsec_g, 0, most_in_step());
    return out;
}

void LoopCheck::finish(double shaker_g) {
    const auto found = estimator::loop_response(readings_, rig_.frequency_hz);
    const double commanded_g = settings_.table_g;
    const double table_g = found.table_known ? found.table_g : commanded_g;
    const double tolerance = settings_.transmission_tolerance;
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
    in_step_ = estimator::in_step(readings_, found.frequency_hz, rig_);
    if (in_step_.platform_g > 0)
        row(kMotionInStep, kArcsecPerG, in_step_.motion_arcsec_g, 0, most_in_step());
    if (found.table_known) {
        // The nearest to the middle of the band of all that are the same phase.
        row("phase", "deg",
            settings_.phase_deg + std::remainder(found.phase_deg - settings_.phase_deg, 360.0),
            settings_.phase_deg - settings_.phase_tolerance_deg,
            settings_.phase_deg + settings_.phase_tolerance_deg);
    }
    if (const auto unit = unit_of_ratio(found.platform_g / (rig_.transmission * commanded_g));
        !unit.empty() && !found_wrong_.empty())
        found_wrong_ += "; " + unit;
    out_of_band_ = std::exchange(found_wrong_, {});
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
