#include "daemon/serve/api.hpp"

#include <algorithm>
#include <array>
#include <boost/beast/http/status.hpp>
#include <cctype>
#include <charconv>
#include <cmath>
#include <exception>
#include <stdexcept>
#include <utility>

#include "daemon/serve/metrics.hpp"
#include "daemon/serve/openapi.hpp"
#include "daemon/serve/page.hpp"
#include "daemon/serve/readiness.hpp"
#include "daemon/serve/status_json.hpp"
#include "estimator/identification/result.hpp"

namespace vibrig::serve {
namespace {

constexpr std::string_view kCommands = "/api/v1/commands";
/// What is read here, each with the keys that a query may have.
struct Readable {
    std::string_view path;
    std::array<std::string_view, 3> keys{};
};
constexpr std::array<Readable, 15> kReadable{{{"/api/v1/status"},
                                              {"/api/v1/parameters"},
                                              {"/api/v1/campaign"},
                                              {"/api/v1/events", {"after", "limit"}},
                                              {"/api/v1/history", {"channel", "from"}},
                                              {"/api/v1/config"},
                                              {"/api/v1/plan"},
                                              {"/api/v1/openapi.json"},
                                              {"/api/v1/selftest"},
                                              {"/api/v1/surface"},
                                              {"/api/v1/unit"},
                                              {"/api/v1/stream", {"rate_hz", "status", "after"}},
                                              {"/metrics"},
                                              {"/healthz"},
                                              {"/readyz"}}};
constexpr int kDeepestBody = 8;                 // levels of JSON; a command has one
constexpr std::uint64_t kDefaultEvents = 1000;  // in one answer
constexpr std::uint64_t kMostEvents = 10'000;

std::string title_of(int status) {
    namespace http = boost::beast::http;
    const http::status known = http::int_to_status(static_cast<unsigned>(status));
    return std::string(http::obsolete_reason(
        known == http::status::unknown ? http::status::internal_server_error : known));
}

/// Text of a stranger, fit for an error message.
std::string in_quotes(std::string_view text) {
    constexpr std::size_t kLongest = 60;
    std::string out = "'";
    for (const char c : text.substr(0, kLongest)) {
        const bool plain = c >= 0x20 && c < 0x7F;
        out.push_back(plain ? c : '?');
    }
    return out + (text.size() > kLongest ? "...'" : "'");
}

struct EventQuery {
    std::uint64_t after = 0;
    std::uint64_t limit = kDefaultEvents;
};

/// Without the escapes that a query needs: "a%2Cb" is "a,b". Throws std::invalid_argument.
std::string unescaped(std::string_view text) {
    std::string out;
    for (std::size_t i = 0; i < text.size(); ++i) {
        if (text[i] != '%') {
            out += text[i];
            continue;
        }
        const std::string_view escape = text.substr(i, 3);
        unsigned byte = 0;
        const char* const end = escape.data() + escape.size();
        const auto [stop, error] = std::from_chars(escape.data() + 1, end, byte, 16);
        if (escape.size() < 3 || error != std::errc{} || stop != end)
            throw std::invalid_argument("query: found " + in_quotes(escape) +
                                        ", expected % and two hexadecimal digits");
        out += static_cast<char>(byte);
        i += 2;
    }
    return out;
}

/// Name and value of each pair in "a=1&b=2".
void each_pair(std::string_view query, const auto& take) {
    while (!query.empty()) {
        const std::string_view pair = query.substr(0, query.find('&'));
        query.remove_prefix(std::min(pair.size() + 1, query.size()));
        const std::size_t equals = std::min(pair.find('='), pair.size());
        take(unescaped(pair.substr(0, equals)),
             unescaped(pair.substr(std::min(equals + 1, pair.size()))));
    }
}

EventQuery event_query(std::string_view query) {
    EventQuery result;
    each_pair(query, [&result](const std::string& name, const std::string& value) {
        const std::uint64_t number = parse_count(name, value);
        if (name == "after") {
            result.after = number;
        } else {
            if (number == 0 || number > kMostEvents)
                throw std::invalid_argument("limit: found " + std::to_string(number) +
                                            ", expected 1 to " + std::to_string(kMostEvents));
            result.limit = number;
        }
    });
    return result;
}

bool is_json(std::string_view content_type) {
    constexpr std::string_view kJson = "application/json";
    const std::string_view type = content_type.substr(0, content_type.find_first_of("; "));
    return std::equal(type.begin(), type.end(), kJson.begin(), kJson.end(), [](char a, char b) {
        return std::tolower(static_cast<unsigned char>(a)) == b;
    });
}

/// Levels of brackets outside of strings: before a parser recurses into them.
int depth_of(std::string_view json) {
    int depth = 0, deepest = 0;
    bool in_text = false;
    for (std::size_t i = 0; i < json.size(); ++i) {
        const char c = json[i];
        if (in_text) {
            if (c == '\\') ++i;
            in_text = c != '"';
        } else if (c == '"') {
            in_text = true;
        } else if (c == '{' || c == '[') {
            deepest = std::max(deepest, ++depth);
        } else if (c == '}' || c == ']') {
            --depth;
        }
    }
    return deepest;
}

/// "GET '/path'"
std::string asked_by(const ApiRequest& request) {
    return std::string(request.method) + ' ' +
           in_quotes(request.target.substr(0, request.target.find('?')));
}

}  // namespace

const char* name_of(Role role) noexcept {
    constexpr std::array<const char*, 4> kNames{"none", "viewer", "operator", "admin"};
    return kNames[static_cast<std::size_t>(role)];
}

Role role_named(const std::string& name) noexcept {
    for (const Role role : {Role::viewer, Role::operate, Role::administer}) {
        if (name == name_of(role)) return role;
    }
    return Role::none;
}

std::uint64_t parse_count(std::string_view name, std::string_view text) {
    std::uint64_t value = 0;
    const char* end = text.data() + text.size();
    const auto [stop, error] = std::from_chars(text.data(), end, value);
    if (text.empty() || error != std::errc{} || stop != end) {
        throw std::invalid_argument(std::string(name) + ": found " + in_quotes(text) +
                                    ", expected a whole number");
    }
    return value;
}

void check_query(std::string_view path, std::string_view query) {
    const auto* const of = std::find_if(kReadable.begin(), kReadable.end(),
                                        [&](const Readable& one) { return one.path == path; });
    std::string known;
    for (const std::string_view key : of == kReadable.end() ? Readable{}.keys : of->keys)
        if (!key.empty()) known += (known.empty() ? "" : " or ") + std::string(key);
    each_pair(query, [&](const std::string& name, const std::string&) {
        if (!name.empty() && of != kReadable.end() &&
            std::find(of->keys.begin(), of->keys.end(), name) != of->keys.end())
            return;
        throw std::invalid_argument("query: found " + in_quotes(name) + ", expected " +
                                    (known.empty() ? "none" : known));
    });
}

std::string query_value(std::string_view query, std::string_view name) {
    std::string found;
    each_pair(query, [&](const std::string& key, const std::string& value) {
        if (key == name && found.empty()) found = value;
    });
    return found;
}

Api::Api(StatusSource& source, std::string instance, CarryOut carry_out)
    : source_(source),
      instance_(std::move(instance)),
      carry_out_(std::move(carry_out)),
      feed_(source) {}

ApiAnswer Api::problem(int status, const std::string& detail) {
    ApiAnswer answer;
    answer.status = status;
    answer.content_type = "application/problem+json";
    answer.body = problem_json(status, title_of(status), detail);
    answer.try_later = status == 429 || status == 503;
    return answer;
}

ApiAnswer Api::check_browser(const ApiRequest& request, const Caller& caller) {
    // Which of them counts would be anybody's guess.
    if (!request.repeated.empty())
        return refuse(400, caller, asked_by(request),
                      std::string(request.repeated) + ": found it twice, expected it once");
    if (!caller.browser) return {};
    // Another name that resolves to this machine would make a stranger's page ours.
    if (!caller.host.empty()) {
        const std::string port = caller.host.substr(caller.host.rfind(':'));
        if (request.host != caller.host && request.host != "localhost" + port &&
            request.host != "127.0.0.1" + port && request.host != "[::1]" + port) {
            return refuse(
                421, caller, asked_by(request),
                "Host: found " + in_quotes(request.host) + ", expected " + in_quotes(caller.host));
        }
    }
    const std::string own = (caller.encrypted ? "https://" : "http://") + std::string(request.host);
    if (!request.origin.empty() && request.origin != own) {
        return refuse(403, caller, asked_by(request),
                      "Origin: found " + in_quotes(request.origin) + ", expected " +
                          in_quotes(own) + ": other pages are not answered");
    }
    return {};
}

bool Api::is_stop(const ApiRequest& request, const Caller& caller) {
    const std::string_view path =
        std::string_view(request.target).substr(0, request.target.find('?'));
    if (request.method != "POST" || path != kCommands || caller.role < Role::operate ||
        depth_of(request.body) > kDeepestBody)
        return false;
    try {
        return parse_command(request.body).kind == CommandRequest::Kind::abort;
    } catch (const std::invalid_argument&) {
        return false;
    }
}

void Api::answer(const ApiRequest& request, const Caller& caller, Done done) {
    ++traffic.requests;
    const std::size_t mark = std::min(request.target.find('?'), request.target.size());
    if (documents_ || request.method != "POST" || request.target.substr(0, mark) != kCommands)
        return done(answer_at_once(request, caller));
    auto found = command_of(request, caller);
    if (auto* const refusal = std::get_if<ApiAnswer>(&found)) return done(std::move(*refusal));
    const bool taken =
        carry_out_(std::get<CommandRequest>(found), [this, done](CommandReply reply) {
            feed_.forget();
            if (!reply.accepted) return done(problem(409, reply.message));
            ApiAnswer answer;
            answer.body = reply_json(reply);
            done(std::move(answer));
        });
    if (!taken) done(problem(503, "too many commands wait for their answers"));
}

ApiAnswer Api::without_a_command(const ApiRequest& request, const Caller& caller) {
    if (ApiAnswer refusal = check_browser(request, caller); refusal.status != 200) return refusal;
    if (caller.role == Role::none) {
        return refuse(403, caller, asked_by(request),
                      "the certificate names no role: its organisational unit is none of "
                      "viewer, operator, admin");
    }
    return {};
}

ApiAnswer Api::document(const ApiRequest& request, std::string_view path, std::string_view query) {
    if (request.method != "GET") {
        ApiAnswer refusal = problem(405, "here is only read: GET");
        refusal.allow = "GET";
        return refusal;
    }
    if (path == "/healthz") return get(path, query);
    Document found;
    try {
        found = documents_(path, query);
    } catch (const std::invalid_argument&) {
        throw;  // of the query
    } catch (const std::exception& error) {
        return problem(503, error.what());
    }
    if (found.status != 200) return problem(found.status, found.body);
    ApiAnswer answer;
    answer.content_type = std::move(found.content_type);
    answer.body = std::move(found.body);
    answer.is_page = answer.content_type.starts_with("text/html");
    return answer;
}

ApiAnswer Api::answer_at_once(const ApiRequest& request, const Caller& caller) {
    try {
        if (ApiAnswer refusal = without_a_command(request, caller); refusal.status != 200)
            return refusal;
        if (caller.expired)
            return refuse(403, caller, asked_by(request),
                          "the certificate has expired: only an abort is taken");
        const std::size_t mark = std::min(request.target.find('?'), request.target.size());
        const std::string_view path = request.target.substr(0, mark);
        const std::string_view query =
            request.target.substr(std::min(mark + 1, request.target.size()));
        if (documents_) return document(request, path, query);
        const bool takes_commands = path == kCommands;
        if (caller.browser && request.method == "GET") {
            const auto* const file = path == "/values.js" ? &page_values() : page_file(path);
            if (file != nullptr) {
                ApiAnswer page;
                page.content_type = file->content_type;
                page.body = file->text;
                page.is_page = true;
                return page;
            }
        }
        if (!takes_commands &&
            std::none_of(kReadable.begin(), kReadable.end(),
                         [&](const Readable& one) { return one.path == path; })) {
            return problem(404, "no such path: " + in_quotes(path));
        }
        const char* const method = takes_commands ? "POST" : "GET";
        if (request.method != method) {
            ApiAnswer refusal = problem(405, std::string(path) + " takes " + method + ", found " +
                                                 in_quotes(request.method));
            refusal.allow = method;
            return refusal;
        }
        check_query(path, query);
        return get(path, query);
    } catch (const std::invalid_argument& error) {
        return problem(400, error.what());
    } catch (const std::exception& error) {
        return problem(500, error.what());
    }
}

void Api::turned_away(const Caller& caller, const std::string& why, TokenBucket& logged) {
    ++traffic.turned_away;
    if (!logged.take(std::chrono::steady_clock::now())) return;
    // With TLS it begins with ", from" until there is a certificate.
    const bool nameless = caller.identity.rfind(',', 0) == 0;
    source_.refused((nameless ? "somebody" : "") + caller.identity, "a connection", why);
}

ApiAnswer Api::refuse(int status, const Caller& caller, const std::string& what,
                      const std::string& why) {
    ++traffic.refused;
    const auto now = std::chrono::steady_clock::now();
    if (TokenBucket& logged = logged_.of(caller.identity, now); logged.take(now)) {
        const std::uint64_t missed = logged.missed();
        source_.refused(
            caller.identity, what,
            missed == 0 ? why : why + "; before that " + std::to_string(missed) + " more");
    }
    return problem(status, why);
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
    if (path == "/api/v1/history") {
        double from_s = 0;
        if (const auto text = query_value(query, "from"); !text.empty()) {
            const auto [stop, error] =
                std::from_chars(text.data(), text.data() + text.size(), from_s);
            if (error != std::errc{} || stop != text.data() + text.size() || !std::isfinite(from_s))
                throw std::invalid_argument("from: found " + in_quotes(text) +
                                            ", expected s of the daemon's clock");
        }
        answer.body = history_.json(query_value(query, "channel"), from_s);
        return answer;
    }
    if (path == "/readyz" || path == "/api/v1/selftest") {
        const Readiness found = readiness(source_.status());
        if (!found.ready() && path == "/readyz") return problem(503, found.failures());
        answer.body = readiness_json(found);
    } else if (path == "/metrics") {
        answer.content_type = "text/plain; version=0.0.4; charset=utf-8";
        answer.body = metrics_text(source_.status(), traffic);
    } else if (path == "/api/v1/plan") {
        answer.body = plan_json(source_.plan());
    } else if (path == "/api/v1/openapi.json") {
        answer.body = openapi_json();
    } else if (path == "/api/v1/stream") {
        return problem(426, "this path takes a WebSocket");
    } else if (path == "/api/v1/parameters") {
        answer.body = parameters_json(source_.result(), source_.status().verdict);
    } else if (path == "/api/v1/campaign") {
        answer.body = campaign_json(source_.status());
    } else if (path == "/api/v1/unit") {
        answer.body = source_.unit_history();
        if (answer.body.empty()) answer.body = R"({"campaigns":[],"coefficients":[]})";
    } else if (path == "/api/v1/surface") {
        answer.body = surface_json(source_.status().noise);
    } else if (path == "/api/v1/config") {
        answer.body = configuration_json(source_.effective_configuration());
    } else {
        answer.body = feed_.newest_text();
    }
    return answer;
}

std::variant<ApiAnswer, CommandRequest> Api::command_of(const ApiRequest& request,
                                                        const Caller& caller) {
    if (ApiAnswer refusal = without_a_command(request, caller); refusal.status != 200)
        return refusal;
    // A page of another origin can send anything but this type without asking first.
    if ((!request.content_type.empty() || caller.browser) && !is_json(request.content_type)) {
        return refuse(415, caller, "a command",
                      "Content-Type: found " + in_quotes(request.content_type) +
                          ", expected application/json");
    }
    if (depth_of(request.body) > kDeepestBody) {
        return refuse(400, caller, "a command",
                      "body: JSON nested deeper than " + std::to_string(kDeepestBody) + " levels");
    }
    CommandRequest parsed;
    try {
        parsed = parse_command(request.body);
        // What is beside a stop does not keep it from being one.
        if (parsed.kind != CommandRequest::Kind::abort && request.target != kCommands)
            check_query(kCommands, request.target.substr(kCommands.size() + 1));
    } catch (const std::invalid_argument& error) {
        return refuse(400, caller, "a command", error.what());
    }
    const std::string what = std::string(word_of(parsed.kind)) + " by " + parsed.by;
    if (caller.role < Role::operate) {
        return refuse(403, caller, what,
                      std::string("commands take an operator; this connection is a ") +
                          name_of(caller.role) + "'s: " + caller.identity);
    }
    if (caller.expired && parsed.kind != CommandRequest::Kind::abort)
        return refuse(403, caller, what, "the certificate has expired: only an abort is taken");
    // Whoever lets gimbals move stands beside them.
    if (parsed.kind == CommandRequest::Kind::commission && (caller.encrypted || caller.browser))
        return refuse(403, caller, what, "a rig is commissioned at the local socket only");
    if (parsed.kind == CommandRequest::Kind::selftest && parsed.argument.starts_with("attended") &&
        (caller.encrypted || caller.browser))
        return refuse(403, caller, what,
                      "who attends stands at the rig: it is ordered at the local socket only");
    // A stop is never one too many.
    const auto now = std::chrono::steady_clock::now();
    if (parsed.kind != CommandRequest::Kind::abort &&
        !commands_.of(caller.identity, now).take(now)) {
        return refuse(429, caller, what, "more than 10 commands a second");
    }
    // The name is what the person says; the rest is what the kernel or a certificate says. The
    // audit line has both.
    parsed.by += " (" + caller.identity + ")";
    if (caller.expired)
        source_.log_event(Severity::warning,
                          "an abort is taken from an expired certificate: " + parsed.by);
    return parsed;
}

}  // namespace vibrig::serve
