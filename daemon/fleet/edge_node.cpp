#include "daemon/fleet/edge_node.hpp"

#include <cmath>

#include "daemon/serve/status_message.hpp"
#include "proto/sparkplug.pb.h"

namespace vibrig::fleet {
namespace {

using sparkplug::Payload;
using Value = EdgeNode::Value;

constexpr std::uint64_t kSequences = 256;
constexpr const char* kRebirth = "Node Control/Rebirth";
constexpr std::uint32_t kInt64 = 4, kBoolean = 11, kString = 12;
constexpr std::array<std::uint32_t, 4> kTypes{kBoolean, 8, 10, kString};  // in Value's order

struct Reading {
    std::string name;
    const char* unit;  ///< empty: none
    Value value;
};

std::uint64_t whole(int value) { return value < 0 ? 0 : static_cast<std::uint64_t>(value); }

/// The same rows in the same order for every status: an alias is a row's place.
std::vector<Reading> readings_of(const StatusData& s) {
    constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
    const auto& shaker = s.shaker;
    std::uint64_t alarms = 0;
    for (const auto& row : s.interlock.rows) alarms += row.raised ? 1 : 0;
    std::vector<Reading> readings{
        {"Properties/Version", "", s.version},
        {"Properties/Clock", "", s.clock},
        {"Properties/SIMULATED", "", s.simulated},
        {"Uptime", "s", drivers::to_seconds(s.uptime)},
        {"Campaign/Name", "", s.campaign_name},
        {"Campaign/State", "", std::string(name_of(s.state))},
        {"Campaign/Reason", "", s.reason},
        {"Campaign/Armed by", "", s.armed_by},
        {"Campaign/Run", "", whole(s.run)},
        {"Campaign/Runs", "", whole(s.runs)},
        {"Campaign/Position", "", whole(s.position)},
        {"Campaign/Positions", "", whole(s.positions)},
        {"Campaign/Progress", "%", 100 * s.progress},
        {"Campaign/Remaining", "s", s.remaining_s},
        {"Campaign/Dwells", "", static_cast<std::uint64_t>(s.dwells.size())},
        {"Shaker/Link up", "", s.shaker_link == drivers::LinkState::running},
        {"Shaker/Command", "g", s.command_table_g},
        {"Shaker/Measured", "g", shaker.valid ? shaker.measured_g : kNone},
        {"Shaker/Frequency", "Hz", shaker.valid ? shaker.frequency_hz : kNone},
        {"Shaker/Running", "", shaker.valid && shaker.running},
        {"Shaker/Emergency stop open", "", shaker.valid && shaker.emergency_stop_open},
        {"Shaker/Stop pending", "", s.stop_pending},
        {"Interlock/Tripped", "", s.interlock.tripped},
        {"Interlock/Raised", "", alarms},
        {"CAN/Link up", "", s.can == drivers::PortState::running},
        {"CAN/Received", "", s.can_counters.received},
        {"CAN/Dropped", "", s.can_counters.kernel_dropped},
        {"Samples/Taken", "", s.assembler.samples},
        {"Samples/Incomplete", "", s.assembler.incomplete},
        {"Samples/Gaps", "", s.assembler.gaps},
        {"Samples/Dropped", "", s.estimator_ring.dropped},
        {"Platform/Ready", "", s.platform.time != 0 && s.platform.ready},
        {"Platform/Temperature", "degC", s.platform.time != 0 ? s.platform.temperature_c : kNone},
        {"Journal/Writes", "", s.journal.path.empty() || s.journal.running},
        {"Recorder/Writes", "", !s.recorder.recording || s.recorder.good},
        {"Filter/NIS per degree of freedom", "", s.estimate.nis_per_dof}};
    for (std::size_t i = 0; i < estimator::kParameters; ++i) {
        const bool known = s.estimate.observable[i];
        const std::string name = std::string("Coefficients/") + estimator::parameter_names()[i];
        const char* const unit = estimator::parameter_unit(i);
        readings.push_back({name + "/Value", unit, known ? s.estimate.value[i] : kNone});
        readings.push_back({name + "/Sigma", unit, known ? s.estimate.sigma[i] : kNone});
    }
    for (Reading& reading : readings) {
        if (auto* const text = std::get_if<std::string>(&reading.value))
            *text = serve::mend_utf8(*text);
    }
    return readings;
}

bool same(const Value& a, const Value& b) {
    const auto* const x = std::get_if<double>(&a);
    const auto* const y = std::get_if<double>(&b);
    return a == b || (x != nullptr && y != nullptr && std::isnan(*x) && std::isnan(*y));
}

void set(Payload::Metric& metric, const Value& value) {
    metric.set_datatype(kTypes[value.index()]);
    if (const auto* const yes = std::get_if<bool>(&value)) {
        metric.set_boolean_value(*yes);
    } else if (const auto* const count = std::get_if<std::uint64_t>(&value)) {
        metric.set_long_value(*count);
    } else if (const auto* const text = std::get_if<std::string>(&value)) {
        metric.set_string_value(*text);
    } else if (const double number = std::get<double>(value); std::isfinite(number)) {
        metric.set_double_value(number);
    } else {
        metric.set_is_null(true);
    }
}

std::uint64_t milliseconds_of(std::int64_t utc_ns) {
    return static_cast<std::uint64_t>(utc_ns / 1'000'000);
}

void add_session(Payload& payload, std::uint64_t session) {
    Payload::Metric& metric = *payload.add_metrics();
    metric.set_name("bdSeq");
    metric.set_timestamp(payload.timestamp());
    metric.set_datatype(kInt64);
    metric.set_long_value(session);
}

}  // namespace

void EdgeNode::next_session() { session_ = (session_ + 1) % kSequences; }

std::string EdgeNode::death(std::int64_t utc_ns) const {
    Payload payload;
    payload.set_timestamp(milliseconds_of(utc_ns));
    add_session(payload, session_);
    return payload.SerializeAsString();
}

std::string EdgeNode::birth(const StatusData& status) {
    Payload payload;
    payload.set_timestamp(milliseconds_of(status.utc_ns));
    payload.set_seq(0);
    sequence_ = 1;
    add_session(payload, session_);
    Payload::Metric& rebirth = *payload.add_metrics();
    rebirth.set_name(kRebirth);
    rebirth.set_timestamp(payload.timestamp());
    rebirth.set_datatype(kBoolean);
    rebirth.set_boolean_value(false);
    told_.clear();
    for (Reading& reading : readings_of(status)) {
        Payload::Metric& metric = *payload.add_metrics();
        metric.set_name(reading.name);
        metric.set_alias(told_.size());
        metric.set_timestamp(payload.timestamp());
        if (*reading.unit != '\0') {
            metric.mutable_properties()->add_keys("engUnit");
            Payload::PropertyValue& unit = *metric.mutable_properties()->add_values();
            unit.set_type(kString);
            unit.set_string_value(reading.unit);
        }
        set(metric, reading.value);
        told_.push_back(std::move(reading.value));
    }
    return payload.SerializeAsString();
}

std::string EdgeNode::data(const StatusData& status) {
    Payload payload;
    payload.set_timestamp(milliseconds_of(status.utc_ns));
    std::vector<Reading> readings = readings_of(status);
    for (std::size_t i = 0; i < readings.size() && i < told_.size(); ++i) {
        if (same(readings[i].value, told_[i])) continue;
        Payload::Metric& metric = *payload.add_metrics();
        metric.set_alias(i);
        metric.set_timestamp(payload.timestamp());
        set(metric, readings[i].value);
        told_[i] = std::move(readings[i].value);
    }
    if (payload.metrics_size() == 0) return {};
    payload.set_seq(sequence_);
    sequence_ = (sequence_ + 1) % kSequences;
    return payload.SerializeAsString();
}

bool EdgeNode::asks_for_birth(std::string_view payload) {
    Payload command;
    if (!command.ParseFromArray(payload.data(), static_cast<int>(payload.size()))) return false;
    for (const Payload::Metric& metric : command.metrics()) {
        if (metric.name() == kRebirth && metric.boolean_value()) return true;
    }
    return false;
}

}  // namespace vibrig::fleet
