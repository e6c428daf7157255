#include "daemon/guard/witnesses.hpp"

#include <algorithm>
#include <cmath>

namespace vibrig::guard {

namespace {

// A simulated rig that says nothing for so long stands still, or is not heard.
constexpr double kSilentOnTheWall_s = 1;

/// At a low sample rate the window has to be longer to hold enough.
double window_of(const WitnessSettings& settings) {
    constexpr double kSamples = 16;
    if (!(settings.sample_rate_hz > 0))
        throw SettingsError(key_error("can.sample_rate_hz", "none", "samples per second"));
    return std::max(settings.window_s, kSamples / settings.sample_rate_hz);
}

/// With the key's place in the file; a default that does not fit is the fault of the DBC's.
std::string placed(const WitnessSettings& settings, const std::string& key,
                   const std::string& found, const std::string& expected) {
    auto at = settings.places.find(key);
    const bool stated = at != settings.places.end();
    if (!stated) at = settings.places.find("can.dbc");
    const auto& place = at == settings.places.end() ? settings.file : at->second;
    const bool by_default = !stated && !settings.file.empty();
    return (place.empty() ? "" : place + ": ") +
           key_error(key, by_default ? found + " (default)" : found, expected) + "\n";
}

proto::Dbc dbc_of(const WitnessSettings& settings) {
    if (settings.dbc.empty()) return proto::parse_dbc(proto::rig_dbc_text(), "rig.dbc");
    try {
        return proto::read_dbc(settings.dbc);
    } catch (const proto::DbcError& error) {
        // What is in the file has a place of its own.
        if (error.line() > 0) throw;
        std::string why = error.what();
        if (why.starts_with(settings.dbc + ": ")) why.erase(0, settings.dbc.size() + 2);
        throw SettingsError(placed(settings, "can.dbc", '"' + settings.dbc + "\" (" + why + ")",
                                   "a DBC file that can be read"));
    }
}

}  // namespace

Witnesses::Witnesses(const WitnessSettings& settings)
    : settings_(settings),
      dbc_(dbc_of(settings)),
      platform_motion_(window_of(settings), 3),
      table_motion_(window_of(settings), 1),
      platform_watch_(3, {}, window_of(settings)),
      table_watch_(1, {}, window_of(settings)) {
    std::string problems;
    parts_.resize(static_cast<std::size_t>(std::max(settings.samples_per_frame, 1)));
    for (std::size_t part = 0; part < parts_.size(); ++part) find_part(part, problems);
    const auto& platform = parts_.front().platform;
    const auto& table = parts_.front().table;
    if (problems.empty() && !table && !(platform[0] && platform[1] && platform[2]))
        problems += placed(settings, "can.signals.table_accel",
                           "\"\" and not three accelerometers on the platform",
                           "one of both at least: the guard would see nothing");
    if (settings.rig_time) {
        rig_time_ = dbc_.find("RigTime");
        if (rig_time_ != nullptr) rig_time_us_ = rig_time_->find("TimeUs");
        if (rig_time_us_ == nullptr)
            problems += placed(settings, "clock.source", "\"rig\" and no RigTime.TimeUs in the DBC",
                               "the simulated rig's message");
    }
    if (!problems.empty()) throw SettingsError(problems);
    const double window_s = window_of(settings);
    platform_watch_ = StuckWatch(
        3, {count_of(platform[0]), count_of(platform[1]), count_of(platform[2])}, window_s);
    table_watch_ = StuckWatch(1, {count_of(table), 0, 0}, window_s);
}

/// Of several samples in a frame signal S carries the first one's value, S_1, S_2, ... the others'.
void Witnesses::find_part(std::size_t number, std::string& problems) {
    constexpr std::array<const char*, 3> kKeys{"can.signals.accel_x", "can.signals.accel_y",
                                               "can.signals.accel_z"};
    const auto place_of = [this, number, &problems](const std::string& key,
                                                    const std::string& name) {
        return find(key, name.empty() || number == 0 ? name : name + '_' + std::to_string(number),
                    problems);
    };
    Part& part = parts_[number];
    for (std::size_t i = 0; i < 3; ++i) {
        Place& axis = part.platform[i];
        axis = place_of(kKeys[i], settings_.platform[i]);
        if (!axis || settings_.platform_valid[i].empty()) continue;
        const Place valid = place_of(std::string(kKeys[i]) + "_valid", settings_.platform_valid[i]);
        // One that comes in another message would have to be joined; it is left out.
        if (valid.message == axis.message) axis.valid = valid.value;
    }
    part.table = place_of("can.signals.table_accel", settings_.table);
}

Witnesses::Place Witnesses::find(const std::string& key, const std::string& name,
                                 std::string& problems) const {
    if (name.empty()) return {};
    const auto dot = name.find('.');
    const auto* message = dbc_.find(std::string_view(name).substr(0, dot));
    if (message != nullptr && dot != std::string::npos)
        for (const auto& signal : message->signals)
            if (signal.name == std::string_view(name).substr(dot + 1))
                return {message, &signal, nullptr};
    problems +=
        placed(settings_, key, '"' + name + '"', "a signal of the DBC, as \"Message.Signal\"");
    return {};
}

std::optional<double> Witnesses::value_of(const Place& place,
                                          std::span<const std::uint8_t> payload) noexcept {
    if (!proto::present(*place.message, *place.value, payload)) return {};
    if (place.valid != nullptr) {
        const auto valid = proto::decode(*place.valid, payload);
        if (!valid || *valid == 0 || proto::out_of_range(*place.valid, *valid)) return {};
    }
    const auto value = proto::decode(*place.value, payload);
    // A code for an error stands as still as a table at rest.
    if (!value || proto::out_of_range(*place.value, *value)) return {};
    return value;
}

double Witnesses::count_of(const Place& place) noexcept {
    if (!place || place.value->type != proto::ValueType::integer) return 0;
    return std::abs(place.value->scale);
}

void Witnesses::take(std::span<const drivers::ReceivedFrame> frames) {
    for (const auto& frame : frames) take(frame);
}

void Witnesses::take(const drivers::ReceivedFrame& received) {
    const auto& frame = received.frame;
    if ((frame.can_id & CAN_RTR_FLAG) != 0) return;
    const bool extended = (frame.can_id & CAN_EFF_FLAG) != 0;
    const auto* message =
        dbc_.find(frame.can_id & (extended ? CAN_EFF_MASK : CAN_SFF_MASK), extended);
    if (message == nullptr) return;
    const std::span<const std::uint8_t> payload(frame.data, frame.len);
    if (message == rig_time_) {
        if (const auto us = proto::decode_raw(*rig_time_us_, payload))
            rig_now_ = *us * drivers::kMicrosecond;
        return;
    }
    const auto at = [&](std::size_t part, const Last& last) {
        return time_of(part, time(received.time), last);
    };
    for (std::size_t number = 0; number < parts_.size(); ++number) {
        Part& part = parts_[number];
        if (message == part.table.message)
            if (const auto value = value_of(part.table, payload)) {
                table_last_ = {at(number, table_last_), received.time};
                table_motion_.add(drivers::to_seconds(table_last_.at), {*value, 0, 0});
                table_watch_.add(table_last_.at, {*value, 0, 0});
            }
        for (std::size_t i = 0; i < 3; ++i)
            if (message == part.platform[i].message)
                if (const auto value = value_of(part.platform[i], payload))
                    take_platform(part, i, *value, {at(number, platform_last_), received.time});
    }
}

drivers::Time Witnesses::time_of(std::size_t part, drivers::Time frame, const Last& last) const {
    const auto later = static_cast<double>(parts_.size() - 1 - part);
    const auto at = frame - drivers::from_seconds(later / settings_.sample_rate_hz);
    // A clock that was set back begins anew.
    return last.at <= frame ? std::max(at, last.at) : at;
}

void Witnesses::take_platform(Part& part, std::size_t axis, double value, const Last& now) {
    // An axis that comes again before the others have: theirs were lost, and this begins anew.
    if (part.seen[axis]) part.seen = {};
    part.raw[axis] = value - settings_.zero_g[axis];
    part.seen[axis] = true;
    if (!(part.seen[0] && part.seen[1] && part.seen[2])) return;
    part.seen = {};
    std::array<double, 3> force{};
    for (std::size_t i = 0; i < 3; ++i)
        for (std::size_t j = 0; j < 3; ++j) force[i] += settings_.matrix[i][j] * part.raw[j];
    platform_last_ = now;
    platform_motion_.add(drivers::to_seconds(now.at), force);
    platform_watch_.add(now.at, part.raw);
}

/// Where the rig owns the time its silence ages by the wall: no time passes there without its word.
Motion Witnesses::seen_by(const MotionWindow& motion, const Last& last, bool frozen,
                          drivers::Time now) const {
    const bool silent =
        rig_time_ != nullptr && drivers::to_seconds(now - last.wall) > kSilentOnTheWall_s;
    return silent || frozen ? Motion{} : motion.at(drivers::to_seconds(time(now)));
}

Sight Witnesses::sight(drivers::Time now) const {
    Sight sight;
    const auto& axes = parts_.front().platform;
    sight.has_table = static_cast<bool>(parts_.front().table);
    sight.has_platform = axes[0] && axes[1] && axes[2];
    sight.table_frozen = sight.has_table && table_watch_.frozen();
    sight.platform_frozen = sight.has_platform && platform_watch_.frozen();
    if (sight.has_table) sight.table = seen_by(table_motion_, table_last_, sight.table_frozen, now);
    if (sight.has_platform)
        sight.platform = seen_by(platform_motion_, platform_last_, sight.platform_frozen, now);
    sight.table_stuck = sight.has_table && table_watch_.doubted();
    sight.platform_stuck = sight.has_platform && platform_watch_.doubted();
    sight.by_platform_g = sight.platform.peak_g / shown();
    sight.table_g = std::max(sight.table.peak_g, sight.by_platform_g);
    return sight;
}

void Witnesses::doubt(drivers::Time now, double shaker_g) noexcept {
    const Moment moment{now, time(now)};
    const Sight seen = sight(now);
    // Less is no vibration: hands, noise, a slew.
    const auto over = [](double g) { return g >= safety::kMoving_g ? g : 0; };
    const double by_platform =
        seen.platform.rest_g >= safety::kMoving_g ? seen.platform.peak_g / shown() : 0;
    const double by_table = seen.table.rest_g >= safety::kMoving_g ? seen.table.peak_g : 0;
    table_watch_.expect(moment, std::max(over(shaker_g), by_platform));
    platform_watch_.expect(moment, shown() * std::max(over(shaker_g), by_table));
}

}  // namespace vibrig::guard
