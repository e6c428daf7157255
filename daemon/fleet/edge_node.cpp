#include "daemon/fleet/edge_node.hpp"

#include <array>
#include <cmath>
#include <limits>

#include "daemon/status/values.hpp"
#include "proto/sparkplug.pb.h"
#include "proto/text.hpp"

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

/// What is not known now: a number is null, the others are what they are without it.
Value known_value(const StatusValue& row, const StatusData& status) {
    static const std::array<Value, 4> kUnknown{
        false, std::uint64_t{0}, std::numeric_limits<double>::quiet_NaN(), std::string()};
    const StatusScalar value = row.value(status);
    if (const auto* const flag = std::get_if<bool>(&value)) return *flag;
    if (const auto* const count = std::get_if<std::uint64_t>(&value)) return *count;
    if (const auto* const number = std::get_if<double>(&value)) return *number * row.mqtt_factor;
    if (const auto* const text = std::get_if<std::string>(&value)) return *text;
    return kUnknown[row.kind - 1];
}

/// The same rows in the same order for every status: an alias is a row's place.
std::vector<Reading> readings_of(const StatusData& s) {
    constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
    std::vector<Reading> readings;
    for (const StatusValue& row : status_values())
        if (row.mqtt_name != nullptr)
            readings.push_back({row.mqtt_name, row.unit, known_value(row, s)});
    for (std::size_t i = 0; i < estimator::kParameters; ++i) {
        const bool known = s.estimate.observable[i];
        const std::string name = std::string("Coefficients/") + estimator::parameter_names()[i];
        const char* const unit = estimator::parameter_unit(i);
        readings.push_back({name + "/Value", unit, known ? s.estimate.value[i] : kNone});
        readings.push_back({name + "/Sigma", unit, known ? s.estimate.sigma[i] : kNone});
    }
    for (Reading& reading : readings) {
        if (auto* const text = std::get_if<std::string>(&reading.value))
            *text = proto::mend_utf8(*text);
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
        set(metric, reading.value);
        published_.push_back(std::move(reading.value));
    }
    return payload.SerializeAsString();
}

std::string EdgeNode::data(const StatusData& status) {
    Payload payload;
    payload.set_timestamp(milliseconds_of(status.utc_ns));
    std::vector<Reading> readings = readings_of(status);
    for (std::size_t i = 0; i < readings.size() && i < published_.size(); ++i) {
        if (same(readings[i].value, published_[i])) continue;
        Payload::Metric& metric = *payload.add_metrics();
        metric.set_alias(i);
        metric.set_timestamp(payload.timestamp());
        set(metric, readings[i].value);
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
