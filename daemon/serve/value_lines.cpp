#include "daemon/serve/value_lines.hpp"

#include <google/protobuf/descriptor.h>
#include <google/protobuf/message.h>
#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <string_view>

#include "daemon/serve/render.hpp"
#include "daemon/status/values.hpp"
#include "proto/vibrig.pb.h"

namespace vibrig::serve {
namespace {

/// Of a field with the message it stands in, "shaker.measured_g".
StatusScalar value_of(const google::protobuf::Message& message, std::string_view field) {
    using Field = google::protobuf::FieldDescriptor;
    const auto& from = *message.GetReflection();
    const auto dot = field.find('.');
    const Field& one = *message.GetDescriptor()->FindFieldByName(std::string(field.substr(0, dot)));
    if (one.has_presence() && !from.HasField(message, &one)) return {};
    switch (one.cpp_type()) {
        case Field::CPPTYPE_MESSAGE:
            return value_of(from.GetMessage(message, &one), field.substr(dot + 1));
        case Field::CPPTYPE_BOOL:
            return from.GetBool(message, &one);
        case Field::CPPTYPE_UINT64:
            return from.GetUInt64(message, &one);
        case Field::CPPTYPE_UINT32:
            return std::uint64_t{from.GetUInt32(message, &one)};
        case Field::CPPTYPE_INT32:
            return static_cast<std::uint64_t>(from.GetInt32(message, &one));
        case Field::CPPTYPE_DOUBLE:
            return from.GetDouble(message, &one);
        default:
            return from.GetString(message, &one);
    }
}

std::string number_text(const StatusValue& row, double value) {
    if (row.duration) return render_duration(value);
    const std::string text =
        row.decimals < 0 ? fmt::format("{:g}", value) : fmt::format("{:.{}f}", value, row.decimals);
    return text + (*row.unit == '\0' ? "" : " ") + row.unit;
}

/// Empty: nothing is to be said.
std::string said(const StatusValue& row, const v1::Status& status) {
    const std::string otherwise = row.otherwise == nullptr ? "" : row.otherwise;
    const StatusScalar value = value_of(status, row.field);
    std::string text;
    if (const auto* const flag = std::get_if<bool>(&value)) return *flag ? row.words : otherwise;
    if (const auto* const words = std::get_if<std::string>(&value)) {
        text = *words;
        if (text.empty()) return otherwise;
    } else if (const auto* const count = std::get_if<std::uint64_t>(&value)) {
        text = std::to_string(*count);
    } else if (const auto* const number = std::get_if<double>(&value)) {
        text = number_text(row, *number);
    } else {
        // A flag that is not known is no flag that is not set.
        if (!is_number(row)) return {};
        if (row.otherwise != nullptr) return otherwise;
        text = *row.unit == '\0' ? std::string("-") : std::string("- ") + row.unit;
    }
    std::string all = row.words;
    if (const auto place = all.find("{}"); place != all.npos) all.replace(place, 2, text);
    return all;
}

/// What there is instead is said elsewhere.
bool silenced(const StatusValue& row, const v1::Status& status) {
    if (row.silenced_by == nullptr) return false;
    const StatusScalar by = value_of(status, row.silenced_by);
    const auto* const words = std::get_if<std::string>(&by);
    return words != nullptr && !words->empty();
}

}  // namespace

ValueLines::ValueLines(const v1::Status& status) {
    for (const StatusValue& row : status_values()) {
        if (row.line == nullptr) continue;
        if (silenced(row, status)) continue;
        const std::string text = said(row, status);
        if (text.empty()) continue;
        const auto same = std::ranges::find(lines_, row.line, &decltype(lines_)::value_type::first);
        if (same == lines_.end()) {
            lines_.emplace_back(row.line, text);
        } else {
            same->second += ", " + text;
        }
    }
}

std::string ValueLines::take(const std::string& line, const std::string& head) {
    const auto found = std::ranges::find(lines_, line, &decltype(lines_)::value_type::first);
    if (found == lines_.end()) return head;
    const std::string values = std::move(found->second);
    lines_.erase(found);
    return head.empty() ? values : head + ", " + values;
}

}  // namespace vibrig::serve
