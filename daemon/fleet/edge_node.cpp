#include "daemon/fleet/edge_node.hpp"

#include <array>
#include <cmath>

#include "proto/sparkplug.pb.h"
#include "proto/text.hpp"

namespace vibrig::fleet {
namespace {

using sparkplug::Payload;

constexpr std::uint64_t kSequences = 256;
constexpr const char* kRebirth = "Node Control/Rebirth";
constexpr std::uint32_t kInt64 = 4, kBoolean = 11, kString = 12;
constexpr std::array<std::uint32_t, 4> kTypes{kBoolean, 8, 10, kString};  // by StatusValue::kind
constexpr std::size_t kNumber = 3;                                        // kind of a double

struct Reading {
    std::string name;
    const char* unit;  ///< empty: none
    std::size_t kind;  ///< of the value where it is known: its type is that of the birth
    StatusScalar value;
};

/// The same rows in the same order for every status: an alias is a row's place.
std::vector<Reading> readings_of(const StatusData& s) {
    std::vector<Reading> readings;
    for (const StatusValue& row : status_values()) {
        if (row.mqtt_name == nullptr) continue;
        Reading& reading =
            readings.emplace_back(Reading{row.mqtt_name, row.unit, row.kind, row.value(s)});
        if (auto* const number = std::get_if<double>(&reading.value)) *number *= row.mqtt_factor;
        if (auto* const text = std::get_if<std::string>(&reading.value))
            *text = proto::mend_utf8(*text);
    }
    for (std::size_t i = 0; i < estimator::kParameters; ++i) {
        const auto known = [&](double value) {
            return s.estimate.observable[i] && std::isfinite(value) ? StatusScalar(value)
                                                                    : StatusScalar();
        };
        const std::string name = std::string("Coefficients/") + estimator::parameter_names()[i];
        const char* const unit = estimator::parameter_unit(i);
        readings.push_back({name + "/Value", unit, kNumber, known(s.estimate.value[i])});
        readings.push_back({name + "/Sigma", unit, kNumber, known(s.estimate.sigma[i])});
    }
    return readings;
}

/// What is not known now is null, whatever it is: a flag that nobody has read is not `false`.
void set(Payload::Metric& metric, const Reading& reading) {
    metric.set_datatype(kTypes[reading.kind - 1]);
    if (const auto* const yes = std::get_if<bool>(&reading.value)) {
        metric.set_boolean_value(*yes);
    } else if (const auto* const count = std::get_if<std::uint64_t>(&reading.value)) {
        metric.set_long_value(*count);
    } else if (const auto* const text = std::get_if<std::string>(&reading.value)) {
        metric.set_string_value(*text);
    } else if (const auto* const number = std::get_if<double>(&reading.value)) {
        metric.set_double_value(*number);
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
    published_.clear();
    for (Reading& reading : readings_of(status)) {
        Payload::Metric& metric = *payload.add_metrics();
        metric.set_name(reading.name);
        metric.set_alias(published_.size());
        metric.set_timestamp(payload.timestamp());
        if (*reading.unit != '\0') {
            metric.mutable_properties()->add_keys("engUnit");
            Payload::PropertyValue& unit = *metric.mutable_properties()->add_values();
            unit.set_type(kString);
            unit.set_string_value(reading.unit);
        }
        set(metric, reading);
        published_.push_back(std::move(reading.value));
    }
    return payload.SerializeAsString();
}

std::string EdgeNode::data(const StatusData& status) {
    Payload payload;
    payload.set_timestamp(milliseconds_of(status.utc_ns));
    std::vector<Reading> readings = readings_of(status);
    for (std::size_t i = 0; i < readings.size() && i < published_.size(); ++i) {
        if (readings[i].value == published_[i]) continue;
        Payload::Metric& metric = *payload.add_metrics();
        metric.set_alias(i);
        metric.set_timestamp(payload.timestamp());
        set(metric, readings[i]);
        published_[i] = std::move(readings[i].value);
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
