#pragma once

#include <string>
#include <vector>

#include "daemon/status/source.hpp"

/// The daemon's answers as JSON text: the messages of proto/vibrig.proto in protobuf's mapping,
/// original field names, zeros printed. What is not valid is absent; NaN and infinity never appear.
/// Text that is not UTF-8 is mended.
namespace vibrig::serve {

[[nodiscard]] std::string status_json(const StatusData& status);
[[nodiscard]] std::string campaign_json(const StatusData& status);
[[nodiscard]] std::string parameters_json(const estimator::Result& result,
                                          const VerdictStatus& verdict);
[[nodiscard]] std::string surface_json(const NoiseStatus& noise);
[[nodiscard]] std::string events_json(const std::string& instance,
                                      const std::vector<EventRecord>& events);
struct Readiness;
[[nodiscard]] std::string plan_json(const PlanData& plan);
[[nodiscard]] std::string readiness_json(const Readiness& readiness);
[[nodiscard]] std::string event_json(const EventRecord& event);
[[nodiscard]] std::string reply_json(const CommandReply& reply);
[[nodiscard]] std::string configuration_json(const std::string& text);
[[nodiscard]] std::string problem_json(int status, const std::string& title,
                                       const std::string& detail);

/// Takes a Command message. Throws std::invalid_argument with one line that names the field and
/// what was expected.
[[nodiscard]] CommandRequest parse_command(const std::string& json);

}  // namespace vibrig::serve
