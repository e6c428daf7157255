#include "daemon/serve/openapi.hpp"

#include <google/protobuf/descriptor.h>

#include <array>
#include <set>

#include "proto/vibrig.pb.h"

namespace vibrig::serve {
namespace {

namespace pb = google::protobuf;
using Names = std::set<std::string>;

std::string reference(const std::string& name) {
    return R"({"$ref":"#/components/schemas/)" + name + "\"}";
}

/// "Campaign.Dwell" as one word.
std::string schema_name(const pb::Descriptor& message) {
    std::string name = message.full_name().substr(message.file()->package().size() + 1);
    for (char& c : name) c = c == '.' ? '_' : c;
    return name;
}

/// What protobuf's JSON mapping makes of one value.
std::string value_schema(const pb::FieldDescriptor& field) {
    switch (field.cpp_type()) {
        case pb::FieldDescriptor::CPPTYPE_BOOL:
            return R"({"type":"boolean"})";
        case pb::FieldDescriptor::CPPTYPE_INT32:
        case pb::FieldDescriptor::CPPTYPE_UINT32:
            return R"({"type":"integer"})";
        case pb::FieldDescriptor::CPPTYPE_INT64:
        case pb::FieldDescriptor::CPPTYPE_UINT64:
            return R"({"type":"string","pattern":"^-?[0-9]+$"})";
        case pb::FieldDescriptor::CPPTYPE_FLOAT:
        case pb::FieldDescriptor::CPPTYPE_DOUBLE:
            return R"({"type":"number"})";
        case pb::FieldDescriptor::CPPTYPE_ENUM: {
            std::string words;
            for (int i = 0; i < field.enum_type()->value_count(); ++i) {
                words += (i > 0 ? ",\"" : "\"") + field.enum_type()->value(i)->name() + '"';
            }
            return R"({"type":"string","enum":[)" + words + "]}";
        }
        case pb::FieldDescriptor::CPPTYPE_MESSAGE:
            break;
        default:
            return R"({"type":"string"})";
    }
    const std::string& type = field.message_type()->full_name();
    if (type == "google.protobuf.Timestamp") return R"({"type":"string","format":"date-time"})";
    if (type == "google.protobuf.ListValue")
        return R"({"type":"array","items":{"type":["number","null"]}})";
    return reference(schema_name(*field.message_type()));
}

bool always_there(const pb::FieldDescriptor& field) {
    // Of a command, which comes in, the one field that may be left out is known here alone.
    if (field.containing_type() == v1::Command::descriptor()) return field.name() != "argument";
    // A status has all its parts, whatever the rig does, but for those that are not configured.
    if (field.containing_type() == v1::Status::descriptor())
        return field.name() != "guard" && field.name() != "archive" &&
               field.name() != "vibration" && field.name() != "annunciator" &&
               field.name() != "verdict";
    return !field.has_presence();
}

void add_schema(const pb::Descriptor& message, Names& done, std::string& out) {
    const std::string name = schema_name(message);
    if (!done.insert(name).second) return;
    std::string properties, required, inside;
    for (int i = 0; i < message.field_count(); ++i) {
        const pb::FieldDescriptor& field = *message.field(i);
        std::string schema;
        if (field.is_map()) {
            schema = R"({"type":"object","additionalProperties":)" +
                     value_schema(*field.message_type()->map_value()) + '}';
        } else if (field.is_repeated()) {
            schema = R"({"type":"array","items":)" + value_schema(field) + '}';
        } else {
            schema = value_schema(field);
        }
        properties += (i > 0 ? ",\"" : "\"") + field.name() + "\":" + schema;
        // What has no presence is always printed: a number, a text, a list, though it be empty.
        if (always_there(field)) required += (required.empty() ? "\"" : ",\"") + field.name() + '"';
        const pb::Descriptor* const type = field.message_type();
        if (type != nullptr && !field.is_map() && type->file() == message.file())
            add_schema(*type, done, inside);
    }
    if (!out.empty()) out += ',';
    out += '"' + name + R"(":{"type":"object","additionalProperties":false,"required":[)" +
           required + R"(],"properties":{)" + properties + "}}";
    if (!inside.empty()) out += ',' + inside;
}

struct Path {
    const char *path, *summary, *type, *schema;
    const char* parameters = "";
};

constexpr const char* kEventParameters =
    R"({"name":"after","in":"query","description":"events with a greater id","schema":{"type":"integer","minimum":0}},)"
    R"({"name":"limit","in":"query","schema":{"type":"integer","minimum":1,"maximum":10000}})";
constexpr const char* kStreamParameters =
    R"({"name":"rate_hz","in":"query","description":"of the status; may be changed by sending {\"rate_hz\": NUMBER}","schema":{"type":"number","minimum":0.1,"maximum":20,"default":1}},)"
    R"({"name":"status","in":"query","description":"false: events alone, looked for at the rate","schema":{"type":"boolean","default":true}},)"
    R"({"name":"after","in":"query","description":"events with a greater id","schema":{"type":"integer","minimum":0}})";

constexpr const char* kHistoryParameters =
    R"({"name":"channel","in":"query","required":true,"description":"one or more, with commas","schema":{"type":"string"}},)"
    R"({"name":"from","in":"query","description":"s of the daemon's clock","schema":{"type":"number"}})";

constexpr std::array<Path, 14> kPaths{{
    {"/api/v1/status", "The whole status.", "application/json", "Status"},
    {"/api/v1/parameters",
     "The result so far: 30 coefficients with their covariance, both of the filter's noise alone; "
     "under `assessed` with their uncertainties (u), as a result has them, once there are dwells "
     "enough.",
     "application/json", "Parameters"},
    {"/api/v1/campaign", "The campaign's part of the status.", "application/json", "Campaign"},
    {"/api/v1/events", "What happened, oldest first.", "application/json", "Events",
     kEventParameters},
    {"/api/v1/history",
     "The campaign so far as curves: least, greatest and mean of each channel in at most 1200 "
     "steps of equal length; null where nothing is known.",
     "application/json", nullptr, kHistoryParameters},
    {"/api/v1/surface",
     "Modified Allan and classical deviation of the residuals of each gyro in each of the newest "
     "128 dwells, by averaging time; those with an alarm too.",
     "application/json", "Surface"},
    {"/api/v1/unit",
     "The unit's earlier campaigns in the archive, as `vibrig trend SERIAL --json` prints them.",
     "application/json", nullptr},
    {"/api/v1/config", "The configuration in force, as vibrigd --check prints it.",
     "application/json", "Configuration"},
    {"/api/v1/plan", "What the campaign does, and the standard errors to be expected.",
     "application/json", "Plan"},
    {"/api/v1/selftest", "What is looked at before a campaign.", "application/json", "Readiness"},
    {"/api/v1/openapi.json", "This description.", "application/json", nullptr},
    {"/metrics", "For Prometheus.", "text/plain", nullptr},
    {"/healthz", "The server answers.", "text/plain", nullptr},
    {"/readyz", "As selftest; 503 unless everything is well.", "application/json", "Readiness"},
}};

constexpr const char* kProblem =
    R"("default":{"description":"what is wrong, RFC 9457","content":{"application/problem+json":)"
    R"({"schema":{"$ref":"#/components/schemas/Problem"}}}})";

std::string make() {
    std::string out =
        R"({"openapi":"3.1.0","info":{"title":"vibrigd","version":"1","description":)"
        R"("Status, events and commands of a vibration rig. Roles: a viewer reads, an operator )"
        R"(commands too. An admin may do what an operator may, nothing more so far; the audit tells )"
        R"(them apart, and root at the rig's own socket is one. Every command and every refusal is )"
        R"(audited: who, what, when, outcome. Who is what follows from the socket )"
        R"(and the peer's user, or from the organisational unit of the client's certificate."},)"
        R"("paths":{)";
    for (const Path& path : kPaths) {
        const std::string schema = path.schema != nullptr             ? reference(path.schema)
                                   : std::string(path.type)[0] == 't' ? R"({"type":"string"})"
                                                                      : R"({"type":"object"})";
        out += '"' + std::string(path.path) + R"(":{"get":{"summary":")" + path.summary +
               R"(","parameters":[)" + path.parameters + R"(],"responses":{"200":{"description":)" +
               R"("as it is now","content":{")" + path.type + R"(":{"schema":)" + schema + "}}}," +
               kProblem + "}}},";
    }
    out +=
        std::string(
            R"("/api/v1/stream":{"get":{"summary":"WebSocket. Text messages: hello (instance, )") +
        R"(role), status (once), then delta (patch: a JSON merge patch, RFC 7396, on the status so )" +
        R"(far) and events.","parameters":[)" + kStreamParameters +
        R"(],"responses":{"101":{"description":"a WebSocket from now on"},)" + kProblem + "}}}," +
        R"("/api/v1/commands":{"post":{"summary":"Commands the rig; for operators. A refusal is )" +
        R"(409.","requestBody":{"required":true,"content":{"application/json":{"schema":)" +
        reference("Command") +
        R"(}}},"responses":{"200":{"description":"done","content":{"application/json":{"schema":)" +
        reference("CommandReply") + "}}}," + kProblem + R"(}}}},"components":{"schemas":{)";
    Names done;
    std::string schemas;
    for (const pb::Descriptor* message :
         {v1::Status::descriptor(), v1::Parameters::descriptor(), v1::Events::descriptor(),
          v1::Configuration::descriptor(), v1::Plan::descriptor(), v1::Readiness::descriptor(),
          v1::Surface::descriptor(), v1::Command::descriptor(), v1::CommandReply::descriptor(),
          v1::Problem::descriptor()}) {
        std::string one;
        add_schema(*message, done, one);
        if (!one.empty()) schemas += (schemas.empty() ? "" : ",") + one;
    }
    return out + schemas + "}}}";
}

}  // namespace

const std::string& openapi_json() {
    static const std::string kText = make();
    return kText;
}

}  // namespace vibrig::serve
