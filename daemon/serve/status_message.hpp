#pragma once

#include <string_view>

#include "daemon/status/source.hpp"

namespace google::protobuf {
class Message;
}  // namespace google::protobuf

namespace vibrig::v1 {
class Campaign;
class Event;
class Parameters;
class Plan;
class Status;
class Verdict;
}  // namespace vibrig::v1

/// The daemon's structs carried into the messages of proto/vibrig.proto: SI and rad become the
/// units of the edge.
namespace vibrig::serve {

void fill(v1::Status& out, const StatusData& status);
/// Fills a part of it, "journal.", with what daemon/status/values.hpp has of it.
void fill_values(google::protobuf::Message& out, std::string_view part, const StatusData& status);
/// Part of it: the newest loop check and safe-state proof.
void fill_checks(v1::Status& out, const StatusData& status);
void fill(v1::Campaign& out, const StatusData& status);
void fill(v1::Parameters& out, const estimator::Result& result, const VerdictStatus& verdict);
void fill(v1::Verdict& out, const StatusData& status);
void fill(v1::Plan& out, const PlanData& plan);
void fill(v1::Event& out, const EventRecord& event);

}  // namespace vibrig::serve
