#pragma once

#include <CLI/App.hpp>
#include <CLI/Validators.hpp>
#include <iosfwd>
#include <string>

#include "daemon/results/exit_status.hpp"
#include "daemon/serve/client.hpp"
#include "proto/vibrig.pb.h"

/// What the commands that talk to a running daemon share.
namespace vibrig::tool {

/// Of a name or a word that goes to the daemon: what it would refuse, bytes that are not UTF-8,
/// control characters and blanks alone, is refused before anybody is asked. `what`: "a name".
[[nodiscard]] CLI::Validator one_line(const std::string& what);
/// VIBRIG_SOCKET, else the socket of the installed daemon.
[[nodiscard]] std::string default_socket();
/// --socket, --host, --identity.
void add_socket(CLI::App& command, serve::Address& at);
/// What the daemon says about an answer other than 200.
[[nodiscard]] std::string problem_of(const serve::Reply& reply);
/// The daemon understands and says no: not now, not you, not so often. Remotely as locally.
[[nodiscard]] bool is_no(int status);
[[nodiscard]] v1::Command command_of(v1::Command::Kind kind, const std::string& by,
                                     const std::string& argument = "");
/// As the daemon takes it. Throws serve::ClientError where a name is not UTF-8.
[[nodiscard]] std::string json_of(const v1::Command& command);
/// Parses an answer; throws serve::ClientError with the daemon's own words when it is a problem.
void parse_answer(const serve::Reply& reply, google::protobuf::Message& message);
[[nodiscard]] v1::Status ask_status(serve::Client& client);

/// Why the daemon does not take it; empty: it has. After an acknowledgement the controller has
/// forgotten its fault.
[[nodiscard]] std::string refusal_of(serve::Client& client, const v1::Command& command);
/// Before arming, or before gimbals move: a stop that was just ordered, such as the one of the
/// daemon's start, is done when rest is measured, which takes a window. What lasts longer is the
/// daemon's to explain.
void wait_for_rest(serve::Client& client);
/// The opening check alone; exit code.
[[nodiscard]] int check_at_rest(const serve::Address& at, const std::string& by, bool json);
/// Loop check and safe-state proof, with what they find to `out`; `argument` as the selftest's. The
/// daemon ends it where this process is gone, or stopped, for 2 s.
/// Why it has not passed; empty: it has.
[[nodiscard]] std::string prove_safe_state(serve::Client& client, const std::string& by,
                                           const std::string& argument, std::ostream& out);

struct WatchOptions {
    serve::Address at;
    bool until_finished = false;
    bool strict = false;  ///< a doubtful result is a no, too
    bool json = false;    ///< a status as JSON, one line for each query
    double interval_s = 1.0;
};
/// Returns the exit code.
int watch(const WatchOptions& options);

struct EventOptions {
    serve::Address at;
    bool follow = false;
    bool json = false;
};
int show_events(const EventOptions& options);

}  // namespace vibrig::tool
