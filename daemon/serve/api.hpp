#pragma once

#include <functional>
#include <string>
#include <string_view>
#include <variant>

#include "daemon/serve/caller.hpp"
#include "daemon/serve/documents.hpp"
#include "daemon/serve/history.hpp"
#include "daemon/serve/rate_limit.hpp"
#include "daemon/serve/stream_feed.hpp"
#include "daemon/status/source.hpp"

namespace vibrig::serve {

/// One request, as far as the answer depends on it.
struct ApiRequest {
    std::string_view method;        ///< "GET", "POST", ...
    std::string_view target;        ///< path and query
    std::string_view content_type;  ///< may be empty
    std::string_view host;
    std::string_view origin;  ///< empty: not from a page
    std::string body;
    std::string_view repeated = {};  ///< a header that comes twice and may not; empty: none does
};

struct ApiAnswer {
    int status = 200;
    std::string content_type = "application/json";
    std::string body;
    std::string allow;       ///< for 405: the methods that would do
    bool is_page = false;    ///< part of the live page: a browser may show it
    bool try_later = false;  ///< for 429 and 503
};

/// What each path answers, whatever carries it. Server thread only.
class Api {
  public:
    /// `instance` names this start of the daemon: event ids are unique within it.
    /// `carry_out`: as StatusSource::command, but it calls back later, on the server's thread;
    /// false: too many commands wait.
    using CarryOut = std::function<bool(CommandRequest, std::function<void(CommandReply)>)>;
    Api(StatusSource& source, std::string instance, CarryOut carry_out);
    /// From now on these are what is read here, and no command is taken.
    void show(Documents documents) { documents_ = std::move(documents); }
    using Done = std::function<void(ApiAnswer)>;
    /// Calls back at once, unless it is a command. Never throws for what a client sends; a failing
    /// source is a 500.
    void answer(const ApiRequest& request, const Caller& caller, Done done);
    /// A stop is never one too many: who orders one needs no free place.
    [[nodiscard]] static bool is_stop(const ApiRequest& request, const Caller& caller);
    /// Why a browser's request is refused before it is looked at; status 200: it is not.
    [[nodiscard]] ApiAnswer check_browser(const ApiRequest& request, const Caller& caller);

    /// One who did not get as far as a request; logged while `logged` lasts.
    void turned_away(const Caller& caller, const std::string& why, TokenBucket& logged);

    [[nodiscard]] static ApiAnswer problem(int status, const std::string& detail);
    [[nodiscard]] const std::string& instance() const noexcept { return instance_; }
    [[nodiscard]] StreamFeed& feed() noexcept { return feed_; }
    [[nodiscard]] History& history() noexcept { return history_; }

    /// What the server itself counts, for /metrics.
    struct Traffic {
        std::uint64_t requests = 0, refused = 0, turned_away = 0, streams_dropped = 0;
        std::size_t connections = 0, streams = 0;
    };
    Traffic traffic;

  private:
    ApiAnswer get(std::string_view path, std::string_view query);
    [[nodiscard]] ApiAnswer answer_at_once(const ApiRequest& request, const Caller& caller);
    [[nodiscard]] ApiAnswer document(const ApiRequest& request, std::string_view path,
                                     std::string_view query);
    [[nodiscard]] ApiAnswer without_a_command(const ApiRequest& request, const Caller& caller);
    /// The command of the request; else why there is none to be carried out.
    [[nodiscard]] std::variant<ApiAnswer, CommandRequest> command_of(const ApiRequest& request,
                                                                     const Caller& caller);
    /// What is logged is limited: a flood must not drown the events.
    ApiAnswer refuse(int status, const Caller& caller, const std::string& what,
                     const std::string& why);

    StatusSource& source_;
    std::string instance_;
    CarryOut carry_out_;
    Documents documents_;
    StreamFeed feed_;
    History history_;
    TokenBuckets commands_{10, 50};
    TokenBuckets logged_{0.1, 20};  ///< refusals that are logged
};

/// Throws std::invalid_argument that names what `path` does not know in its query, and what it
/// does; or an escape that is none.
void check_query(std::string_view path, std::string_view query);

/// The value of `name` in "a=1&b=2", its escapes taken out; empty: it is not there. Throws
/// std::invalid_argument for an escape that is none.
[[nodiscard]] std::string query_value(std::string_view query, std::string_view name);

/// Throws std::invalid_argument that names it unless it is a whole number.
[[nodiscard]] std::uint64_t parse_count(std::string_view name, std::string_view text);

}  // namespace vibrig::serve
