#include "daemon/serve/status_json.hpp"

#include <google/protobuf/util/json_util.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>
#include <stdexcept>

#include "daemon/serve/readiness.hpp"
#include "daemon/serve/status_message.hpp"
#include "estimator/identification/result.hpp"
#include "proto/person_name.hpp"
#include "proto/text.hpp"
#include "proto/vibrig.pb.h"

namespace vibrig::serve {
namespace {

constexpr std::size_t kLongestName = 100;  // bytes
constexpr std::size_t kLongestArgument = 200;
constexpr std::size_t kLongestScript = 4096;

std::string to_json(const google::protobuf::Message& message) {
    google::protobuf::util::JsonPrintOptions options;
    options.always_print_primitive_fields = true;
    options.preserve_proto_field_names = true;
    std::string text;
    const auto done = google::protobuf::util::MessageToJsonString(message, &text, options);
    if (!done.ok()) throw std::runtime_error(done.ToString());
    return text;
}

/// What goes into the audit line must stay one readable line.
void check_line(const std::string& field, const std::string& text, std::size_t longest) {
    if (text.size() > longest) {
        throw std::invalid_argument(field + ": " + std::to_string(text.size()) +
                                    " bytes, expected " + std::to_string(longest) + " at most");
    }
    if (proto::printable(text, longest) != text) {
        throw std::invalid_argument(field + ": contains a control character, expected one line");
    }
}

/// protobuf takes the last of two, whoever read it before may have taken the first.
void refuse_repeated_keys(const std::string& json) {
    std::set<std::string> keys;
    const auto look = [&](int depth, nlohmann::json::parse_event_t event, nlohmann::json& parsed) {
        if (event == nlohmann::json::parse_event_t::key && depth == 1 &&
            !keys.insert(parsed.get<std::string>()).second) {
            throw std::invalid_argument("found \"" + parsed.get<std::string>() +
                                        "\" twice, expected it once");
        }
        return true;
    };
    try {
        const nlohmann::json whole = nlohmann::json::parse(json, look);
    } catch (const nlohmann::json::parse_error& error) {
        throw std::invalid_argument("not a Command in JSON: wrong at byte " +
                                    std::to_string(error.byte));
    } catch (const nlohmann::json::exception&) {
        throw std::invalid_argument("not a Command in JSON: a number out of range");
    }
}

CommandRequest::Kind kind_of(v1::Command::Kind kind) {
    const auto found = std::ranges::find(kCommandWords, v1::Command::Kind_Name(kind));
    if (found == kCommandWords.end())
        throw std::invalid_argument(
            "kind: missing or unknown, expected arm, start, pause, resume, abort, acknowledge, "
            "selftest, commission or certificate");
    return static_cast<CommandRequest::Kind>(found - kCommandWords.begin());
}

/// As to_json(), the campaign's dwells one by one: protobuf makes an object of every field before
/// it writes the first, 4 kB of a dwell, and a campaign has hundreds.
std::string with_dwells(const google::protobuf::Message& whole, v1::Campaign& campaign) {
    google::protobuf::RepeatedPtrField<v1::Dwell> dwells;
    dwells.Swap(campaign.mutable_dwells());
    std::string text = to_json(whole);
    // A text would have its quotes escaped.
    constexpr std::string_view kNoDwells = "\"dwells\":[]";
    const std::size_t at = text.find(kNoDwells);
    if (dwells.empty() || at == std::string::npos) return text;
    const std::string behind = text.substr(at + kNoDwells.size() - 1);
    text.resize(at + kNoDwells.size() - 1);
    for (const v1::Dwell& dwell : dwells) {
        if (text.back() != '[') text += ',';
        text += to_json(dwell);
    }
    return text += behind;
}

}  // namespace

std::string status_json(const StatusData& status) {
    v1::Status message;
    fill(message, status);
    return with_dwells(message, *message.mutable_campaign());
}

std::string campaign_json(const StatusData& status) {
    v1::Campaign message;
    fill(message, status);
    return with_dwells(message, message);
}

std::string parameters_json(const estimator::Result& result, const VerdictStatus& verdict) {
    v1::Parameters message;
    fill(message, result, verdict);
    return to_json(message);
}

std::string surface_json(const NoiseStatus& noise) {
    v1::Surface message;
    for (const NoiseStatus::Curve& curve : *noise.surface) {
        v1::Surface::Curve& to = *message.add_curves();
        to.set_run(static_cast<std::uint32_t>(curve.run));
        to.set_position(static_cast<std::uint32_t>(curve.position));
        to.set_alarm(curve.alarm);
        for (std::size_t i = 0; i < curve.tau_s.size(); ++i) {
            const auto& [x, y, z] = curve.deviation_deg_h;
            if (!std::isfinite(x[i] + y[i] + z[i])) continue;
            to.add_tau_s(curve.tau_s[i]);
            to.add_x_deg_h(x[i]);
            to.add_y_deg_h(y[i]);
            to.add_z_deg_h(z[i]);
            to.add_x_classical_deg_h(curve.classical_deg_h[0][i]);
            to.add_y_classical_deg_h(curve.classical_deg_h[1][i]);
            to.add_z_classical_deg_h(curve.classical_deg_h[2][i]);
        }
    }
    return to_json(message);
}

std::string events_json(const std::string& instance, const std::vector<EventRecord>& events) {
    v1::Events message;
    message.set_instance(instance);
    for (const EventRecord& event : events) fill(*message.add_events(), event);
    return to_json(message);
}

std::string plan_json(const PlanData& plan) {
    v1::Plan message;
    fill(message, plan);
    return to_json(message);
}

std::string readiness_json(const Readiness& readiness) {
    v1::Readiness message;
    message.set_ready(readiness.ready());
    for (const Readiness::Check& check : readiness.checks) {
        v1::Readiness::Check& to = *message.add_checks();
        to.set_name(check.name);
        to.set_passed(check.passed);
        to.set_text(proto::mend_utf8(check.text));
    }
    return to_json(message);
}

std::string event_json(const EventRecord& event) {
    v1::Event message;
    fill(message, event);
    return to_json(message);
}

std::string reply_json(const CommandReply& reply) {
    v1::CommandReply message;
    message.set_accepted(reply.accepted);
    message.set_message(proto::mend_utf8(reply.message));
    return to_json(message);
}

std::string configuration_json(const std::string& text) {
    v1::Configuration message;
    message.set_text(proto::mend_utf8(text));
    return to_json(message);
}

std::string problem_json(int status, const std::string& title, const std::string& detail) {
    v1::Problem message;
    message.set_type("about:blank");
    message.set_title(title);
    message.set_status(status);
    message.set_detail(proto::mend_utf8(detail));
    return to_json(message);
}

CommandRequest parse_command(const std::string& json) {
    refuse_repeated_keys(json);
    v1::Command message;
    if (const auto parsed = google::protobuf::util::JsonStringToMessage(json, &message);
        !parsed.ok()) {
        google::protobuf::util::JsonParseOptions lenient;
        lenient.ignore_unknown_fields = true;
        message.Clear();
        if (!google::protobuf::util::JsonStringToMessage(json, &message, lenient).ok() ||
            message.kind() != v1::Command::abort)
            throw std::invalid_argument("not a Command in JSON: " + std::string(parsed.message()));
    }
    CommandRequest request;
    request.kind = kind_of(message.kind());
    request.by = message.by();
    request.argument = message.argument();
    const bool nameless = proto::plain_name(request.by).empty();
    if (request.kind == CommandRequest::Kind::abort) {
        // A stop does not wait for a better name, nor for what is beside it.
        request.by = nameless ? "somebody" : proto::printable(request.by, kLongestName);
        request.argument = proto::printable(request.argument, kLongestArgument);
        return request;
    }
    if (nameless) {
        throw std::invalid_argument("by: empty, expected the name of the person who commands");
    }
    check_line("by", request.by, kLongestName);
    // Of commissioning it is a script's answers, too; of a certificate its hashes.
    const bool json_inside = request.kind == CommandRequest::Kind::commission ||
                             request.kind == CommandRequest::Kind::certificate;
    check_line("argument", request.argument, json_inside ? kLongestScript : kLongestArgument);
    if (request.kind == CommandRequest::Kind::acknowledge && request.argument.empty()) {
        throw std::invalid_argument("argument: empty, expected what is acknowledged");
    }
    return request;
}

}  // namespace vibrig::serve
