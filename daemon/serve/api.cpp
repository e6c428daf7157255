#include "daemon/serve/api.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <exception>
#include <stdexcept>
#include <utility>

#include "daemon/serve/status_json.hpp"

namespace vibrig::serve {
namespace {

constexpr std::string_view kCommands = "/api/v1/commands";
constexpr std::array<std::string_view, 6> kReadable{"/api/v1/status",   "/api/v1/parameters",
                                                    "/api/v1/campaign", "/api/v1/events",
                                                    "/api/v1/config",   "/healthz"};
constexpr std::uint64_t kDefaultEvents = 1000;  // in one answer
constexpr std::uint64_t kMostEvents = 10'000;

const char* title_of(int status) {
    switch (status) {
        case 400:
            return "Bad Request";
        case 404:
            return "Not Found";
        case 405:
            return "Method Not Allowed";
        case 409:
            return "Conflict";
        case 413:
            return "Payload Too Large";
        case 415:
            return "Unsupported Media Type";
        case 431:
            return "Request Header Fields Too Large";
        case 503:
            return "Service Unavailable";
        default:
            return "Internal Server Error";
    }
}

/// Text of a stranger, fit for an error message.
std::string quoted(std::string_view text) {
    constexpr std::size_t kLongest = 60;
    std::string out = "'";
    for (const char c : text.substr(0, kLongest)) {
        const bool plain = c >= 0x20 && c < 0x7F;
        out.push_back(plain ? c : '?');
    }
    return out + (text.size() > kLongest ? "...'" : "'");
}

std::uint64_t count_in(std::string_view name, std::string_view text) {
    std::uint64_t value = 0;
    const char* end = text.data() + text.size();
    const auto [stop, error] = std::from_chars(text.data(), end, value);
    if (text.empty() || error != std::errc{} || stop != end) {
        throw std::invalid_argument(std::string(name) + ": found " + quoted(text) +
                                    ", expected a whole number");
    }
    return value;
}

struct EventQuery {
    std::uint64_t after = 0;
    std::uint64_t limit = kDefaultEvents;
};

EventQuery event_query(std::string_view query) {
    EventQuery result;
    while (!query.empty()) {
        const std::size_t end = std::min(query.find('&'), query.size());
        const std::string_view pair = query.substr(0, end);
        query.remove_prefix(std::min(end + 1, query.size()));
        const std::size_t equals = std::min(pair.find('='), pair.size());
        const std::string_view name = pair.substr(0, equals);
        const std::string_view value = pair.substr(std::min(equals + 1, pair.size()));
        if (name == "after") {
            result.after = count_in(name, value);
        } else if (name == "limit") {
            result.limit = std::clamp<std::uint64_t>(count_in(name, value), 1, kMostEvents);
        } else {
            throw std::invalid_argument("query: found " + quoted(name) +
                                        ", expected after or limit");
        }
    }
    return result;
}

bool is_json(std::string_view content_type) {
    constexpr std::string_view kJson = "application/json";
    const std::string_view type = content_type.substr(0, content_type.find_first_of("; "));
    return std::equal(type.begin(), type.end(), kJson.begin(), kJson.end(), [](char a, char b) {
        return std::tolower(static_cast<unsigned char>(a)) == b;
    });
}

}  // namespace

Api::Api(StatusSource& source, std::string instance)
    : source_(source), instance_(std::move(instance)) {}

ApiAnswer Api::problem(int status, const std::string& detail) {
    return {status, "application/problem+json", problem_json(status, title_of(status), detail), {}};
}

ApiAnswer Api::answer(const ApiRequest& request) {
    try {
        const std::size_t mark = std::min(request.target.find('?'), request.target.size());
        const std::string_view path = request.target.substr(0, mark);
        const std::string_view query =
            request.target.substr(std::min(mark + 1, request.target.size()));
        const bool takes_commands = path == kCommands;
        if (!takes_commands &&
            std::find(kReadable.begin(), kReadable.end(), path) == kReadable.end()) {
            return problem(404, "no such path: " + quoted(path));
        }
        const char* const method = takes_commands ? "POST" : "GET";
        if (request.method != method) {
            ApiAnswer refusal = problem(
                405, std::string(path) + " takes " + method + ", found " + quoted(request.method));
            refusal.allow = method;
            return refusal;
        }
        return takes_commands ? command(request) : get(path, query);
    } catch (const std::invalid_argument& error) {
        return problem(400, error.what());
    } catch (const std::exception& error) {
        return problem(500, error.what());
    }
}

ApiAnswer Api::get(std::string_view path, std::string_view query) {
    ApiAnswer answer;
    if (path == "/healthz") {
        answer.content_type = "text/plain";
        answer.body = "ok\n";
        return answer;
    }
    if (path == "/api/v1/events") {
        const EventQuery wanted = event_query(query);
        answer.body = events_json(instance_, source_.events(wanted.after, wanted.limit));
        return answer;
    }
    if (path == "/api/v1/parameters") {
        answer.body = parameters_json(source_.result());
    } else if (path == "/api/v1/campaign") {
        answer.body = campaign_json(source_.status());
    } else if (path == "/api/v1/config") {
        answer.body = configuration_json(source_.effective_configuration());
    } else {
        answer.body = status_json(source_.status());
    }
    return answer;
}

ApiAnswer Api::command(const ApiRequest& request) {
    if (!request.content_type.empty() && !is_json(request.content_type)) {
        return problem(415, "Content-Type: found " + quoted(request.content_type) +
                                ", expected application/json");
    }
    CommandRequest parsed = parse_command(request.body);
    // The name is what the person says; the uid is what the kernel says. The audit line has both.
    parsed.by += " (uid " + std::to_string(request.uid) + ")";
    const CommandReply reply = source_.command(parsed);
    if (!reply.accepted) return problem(409, reply.message);
    ApiAnswer answer;
    answer.body = reply_json(reply);
    return answer;
}

}  // namespace vibrig::serve
