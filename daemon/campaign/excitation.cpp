#include "daemon/campaign/excitation.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "daemon/campaign/rig_frame.hpp"
#include "estimator/spectrum/mount.hpp"

namespace vibrig::campaign {

using drivers::from_seconds;
using drivers::Time;

namespace {

drivers::SweepSetPoint set_point_of(const estimator::SweptSine& sweep) {
    return {sweep.from_hz, sweep.to_hz,
            60 * std::abs(std::log2(sweep.to_hz / sweep.from_hz)) / sweep.seconds};
}

/// What a controller at random says of itself; of its reason it alone knows the number.
std::string text_of(const drivers::RandomReading& reading) {
    constexpr std::array kWords{"idle", "levelling", "at level", "aborted"};
    const auto state = static_cast<std::size_t>(reading.state);
    return fmt::format(
        "random control {}{}, profile {} at {:g} dB", kWords.at(state),
        reading.abort_reason == 0 ? "" : fmt::format(" (its reason {})", reading.abort_reason),
        reading.random ? reading.profile : 0, reading.level_db);
}

}  // namespace

void Excitation::follow(Time begun, double octaves_per_s, Time now) {
    // What a lock-in over its window does not tell.
    constexpr double kAlike_hz = 0.2;
    rt::Sweep next = follows_;
    next.begin = begun;
    next.octaves_per_s = octaves_per_s;
    if (std::abs(next.hz(now) - follows_.hz(now)) <= kAlike_hz) return;
    follows_ = next;
    tell_ramp(asked_g_, now);
}

void Excitation::from_rest(const Stop& stop, Time now) {
    sweep_ = stop.sweep;
    frequency_hz_ = sweep_.any()            ? sweep_.from_hz
                    : stop.frequency_hz > 0 ? stop.frequency_hz
                                            : settings_.frequency_hz;
    follows_ = {};
    if (sweep_.any()) follows_ = {sweep_.from_hz, sweep_.to_hz, 0, now, stop.along};
    const auto measured = measured_.find(stop.frequency_hz);
    random_ = stop.random;
    transmission_ = measured != measured_.end() && !random_ ? measured->second : stop.transmission;
    if (random_) {
        const double ratio = power_ratio(*random_);
        random_->at_platform.mean_square_g2 *= ratio;
        transmission_ *= std::sqrt(ratio);
    }
    asked_g_ = 0;
    tell_ramp(0, now);
}

double Excitation::power_ratio(const RandomStop& of) const {
    std::vector<std::pair<double, double>> ratios;
    for (const auto& [hz, found] : measured_) {
        const auto same = [hz = hz](const Stop& stop) { return stop.frequency_hz == hz; };
        const auto stop = std::ranges::find_if(settings_.stops, same);
        const bool stated = stop != settings_.stops.end() && stop->transmission > 0;
        if (!stated && hz != settings_.frequency_hz) continue;  // of the loop check alone
        // As the accelerometers show it, which a stop's has in it.
        const auto& rig = settings_.rig;
        const double expected =
            stated ? stop->transmission
                   : rig.transmission * std::sqrt(rig.accelerometer_response.power(hz));
        ratios.emplace_back(hz, found / expected);
    }
    return estimator::spectrum::power_ratio(ratios, of.bands);
}

drivers::ShakerSetPoint Excitation::set_point(double table_g, bool run_at_zero) const {
    drivers::ShakerSetPoint point{
        frequency_hz_, table_g, settings_.ramp_s, {}, run_at_zero && !random_};
    if (random_) point.random = random_->set_point;
    if (sweep_.any()) point.sweep = set_point_of(sweep_);
    return point;
}

bool Excitation::ask(double table_g, Time now, bool run_at_zero) {
    stop_.excited(table_g);
    if (!rig_.shaker.request(set_point(table_g, run_at_zero), armed_under_)) return false;
    asked_ = true;
    tell_ramp(table_g, now);
    return true;
}

std::string Excitation::climb(double table_g, Time now, bool& reached) {
    reached = false;
    if (!asked_) return ask(table_g, now, table_g == 0) ? "" : "the shaker takes no set-point";
    reached = !rig_.shaker.busy() && as_commanded(table_g);
    if (reached || now - since_ <= from_seconds(settings_.ramp_s) + kRampGrace) return {};
    if (random_) return off_command(table_g, now);
    const bool degraded = rig_.shaker.state() == drivers::LinkState::degraded;
    return fmt::format(
        "shaker: measured {:.3f} g, expected {:g} g within {:g} %{}",
        rig_.shaker.reading().measured_g, table_g, 100 * settings_.amplitude_tolerance,
        degraded ? "; a register was refused, or reads back otherwise: vibrig events" : "");
}

void Excitation::tell_ramp(double table_g, Time now) {
    const double start_g = std::exchange(asked_g_, table_g);
    asked_at_ = now;
    const RigFrame frame(settings_.rig);
    rig_.ramping({start_g, table_g, now, from_seconds(settings_.ramp_s), highest_g_, campaign_,
                  frame.to_raw(frame.up_at_deg(position_deg_)), frequency_hz_, transmission_,
                  random_ ? random_->place : std::uint16_t{0}, follows_});
}

Excitation::Rests Excitation::come_to_rest(Time now) {
    const auto reading = rig_.shaker.reading();
    if (!rig_.shaker.busy() && !stop_.stopping() && reading.at_rest() && reading.time > since_ &&
        stop_.rest(now).measured_since(since_)) {
        stop_.at_rest();
        return Rests::at_rest;
    }
    if (!asked_ && !stop_.stopping() && !ask(0, now)) {  // no ramp to be had: the hard way
        stop_sent_ = true;
        tell_ramp(0, now);
        stop("no ramp down was to be had");
    }
    if (stop_sent_ || now - since_ <= from_seconds(settings_.ramp_s + settings_.stop.deadline_s))
        return Rests::not_yet;
    stop_sent_ = true;
    return Rests::overdue;
}

void Excitation::stop(const std::string& by) {
    stopped_by_ = by;
    rig_.shaker.stop_now();
    ++armed_under_;
    asked_g_ = 0;
    tell_ramp(0, rig_.shaker.reading().time);
}

void Excitation::order_stop(const std::string& by) {
    stopped_by_ = by;
    rig_.shaker.stop_now();
}

bool Excitation::stopped_by_another(Time now) {
    if (rig_.shaker.stops() == armed_under_) return false;
    if (stopped_under_ != rig_.shaker.stops()) {
        stopped_under_ = rig_.shaker.stops();
        stopped_since_ = now;
    }
    return now - stopped_since_ < drivers::kSecond;
}

/// Its own mean of squares strays, and is no witness: that it is at the level is its word here, and
/// that it is so the accelerometers' abort bands tell.
bool Excitation::plays_as_commanded(const drivers::ShakerReading& reading) const {
    return reading.random->state == drivers::RandomReading::State::at_level && chosen();
}

bool Excitation::chosen() const {
    constexpr double kWritten_hz = 1e-3;  // a register resolves 1 mHz
    constexpr double kWritten_db = 0.05;  // or 0.1 dB
    const auto reading = rig_.shaker.reading();
    if (!reading.valid) return false;
    const bool plays = reading.random && reading.random->random;
    const bool sweeps = reading.sweep && reading.sweep->on;
    if (sweep_.any()) return !plays && sweeps && reading.sweep->is(set_point_of(sweep_));
    if (sweeps) return false;
    if (!random_) return !plays && std::abs(reading.frequency_hz - frequency_hz_) <= kWritten_hz;
    const auto& wanted = random_->set_point;
    return plays && reading.random->profile == wanted.profile &&
           reading.random->checksum == wanted.checksum &&
           std::abs(reading.random->level_db - wanted.level_db) < kWritten_db;
}

bool Excitation::as_commanded(double table_g) const {
    constexpr double kFrequencyToleranceHz = 0.01;  // read back; a register resolves 1 mHz
    const auto reading = rig_.shaker.reading();
    const bool running =
        reading.valid && reading.running && reading.state == drivers::kShakerRunning;
    if (random_) return running && reading.random && plays_as_commanded(reading);
    if ((reading.random && reading.random->random) ||
        (reading.sweep && reading.sweep->on != sweep_.any()))
        return false;
    const bool there = reading.state == drivers::kShakerRunning ||
                       (table_g == 0 && reading.state == drivers::kShakerRamping);
    const double tolerance_g = table_g > 0 ? settings_.amplitude_tolerance * table_g : kAtZero_g;
    return reading.valid && reading.running && there &&
           (sweep_.any()
                ? chosen()
                : std::abs(reading.frequency_hz - frequency_hz_) <= kFrequencyToleranceHz) &&
           std::abs(reading.measured_g - table_g) <= tolerance_g;
}

std::string Excitation::off_command(double table_g, Time now) {
    if (as_commanded(table_g) || stopped_by_another(now)) return {};
    const auto reading = rig_.shaker.reading();
    if (random_)
        return fmt::format(
            "shaker off command: state {}, {}; expected profile {} at {:g} dB, at level",
            reading.state,
            reading.random ? text_of(*reading.random) : "no registers of random vibration",
            random_->set_point.profile, random_->set_point.level_db);
    return fmt::format("shaker off command: state {}, measured {:.3f} g, expected {:g} g",
                       reading.state, reading.measured_g, table_g);
}

bool Excitation::refuses_frequency(double frequency_hz, double table_g) {
    return !rig_.shaker.request({frequency_hz, table_g, settings_.ramp_s}, armed_under_);
}

}  // namespace vibrig::campaign
