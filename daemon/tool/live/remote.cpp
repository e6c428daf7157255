#include "daemon/tool/live/remote.hpp"

#include <google/protobuf/util/json_util.h>
#include <pwd.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <functional>
#include <iostream>
#include <iterator>
#include <thread>

#include "daemon/serve/render.hpp"
#include "daemon/tool/colour.hpp"
#include "daemon/tool/commands.hpp"
#include "proto/text.hpp"

namespace vibrig::tool {
namespace {

constexpr const char* kWho = "vibrig: ";  // before what a daemon has refused, too
constexpr int kLongestLine = 1000;        // columns; what to do stands at its end

using Steady = std::chrono::steady_clock;

struct StatusOptions {
    serve::Address at;
    bool json = false;
};

struct CommandOptions {
    serve::Address at;
    v1::Command::Kind kind = v1::Command::unspecified;
    std::string by;
    std::string argument;
    bool json = false;
};

struct TestOptions {
    serve::Address at;
    std::string by;
    bool json = false, emergency_stop = false, at_zero = false, rest = false;
};

std::string login_name() {
    const passwd* const entry = getpwuid(getuid());
    return entry != nullptr ? entry->pw_name : "uid " + std::to_string(getuid());
}

int width_of_output() {
    constexpr int kUsual = 100;
    winsize size{};
    return ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0 ? size.ws_col : kUsual;
}

/// What somebody has to see first.
std::string painted(const std::string& line, bool head, v1::Campaign::State state) {
    if (head)
        return state == v1::Campaign::tripped || state == v1::Campaign::aborted
                   ? colour::bad(line)
                   : colour::strong(line);
    const auto has = [&line](const char* words) { return line.find(words) != std::string::npos; };
    if (line.starts_with("latched") || has("FAULT") || has("MISFIT") || has("NOT HEARD"))
        return colour::bad(line);
    if (line.starts_with("why: ") || has("SILENT") || has(": DOWN, ")) return colour::warning(line);
    return line;
}

google::protobuf::util::Status parsed(const std::string& json, google::protobuf::Message& message) {
    google::protobuf::util::JsonParseOptions options;
    options.ignore_unknown_fields = true;  // a newer daemon may say more
    return google::protobuf::util::JsonStringToMessage(json, &message, options);
}

int show_status(const StatusOptions& options) {
    serve::Client client(options.at);
    if (options.json) {
        const serve::Reply reply = client.get("/api/v1/status");
        v1::Status status;
        parse_answer(reply, status);
        std::cout << reply.body << '\n';
        return 0;
    }
    // Two queries a moment apart give the rates.
    constexpr auto kBetween = std::chrono::milliseconds(300);
    const v1::Status before = ask_status(client);
    const auto began = Steady::now();
    std::this_thread::sleep_for(kBetween);
    const v1::Status status = ask_status(client);
    const double wall_s = std::chrono::duration<double>(Steady::now() - began).count();
    const serve::Rates rates = serve::rates_between(before, status, wall_s);
    // Printed once it may go on in the next row of a terminal: what to do stands at a line's end.
    auto lines = serve::render_summary(status, rates, kLongestLine);
    lines.emplace_back();
    std::ranges::copy(serve::render_coefficients(status, width_of_output()),
                      std::back_inserter(lines));
    for (std::size_t i = 0; i < lines.size(); ++i)
        std::cout << painted(lines[i], i == 0, status.campaign().state()) << '\n';
    return 0;
}

std::string mark_of(bool passed) {
    return passed ? colour::good("  ok    ") : colour::bad("  NOT   ");
}

void show_rows(std::ostream& out,
               const google::protobuf::RepeatedPtrField<v1::LoopCheck::Row>& rows) {
    for (const auto& row : rows) {
        out << mark_of(row.passed()) << row.name() << ": " << row.value()
            << (row.unit().empty() ? "" : " ") << row.unit() << ", band " << row.low() << " to "
            << row.high() << '\n';
    }
}

/// The proof's entry in the journal, once it is on disk. `before`: that of the proof that there
/// was.
void show_signed_record(std::ostream& out, serve::Client& client, const std::string& before) {
    constexpr auto kLook = std::chrono::milliseconds(100);
    for (int queries = 0; queries < 30; ++queries) {
        const auto journal = ask_status(client).journal();
        if (journal.path().empty()) return;
        if (!journal.proof_head().empty() && journal.proof_head() != before) {
            out << "signed record: " << serve::clipped(journal.proof_head(), kLongestLine) << '\n';
            return;
        }
        std::this_thread::sleep_for(kLook);
    }
}

/// Waits for the end of loop check and safe-state proof; their rows. `then`: the status before.
/// `attend`: tells the daemon that somebody is there. Returns the proof.
v1::Proof show_loop_check(std::ostream& out, serve::Client& client, const v1::Status& then,
                          const std::function<void()>& attend = {}) {
    const std::int64_t before = then.proof().utc_ns();
    constexpr auto kLook = std::chrono::milliseconds(300);
    constexpr int kQueries = 100;  // after the check, for the proof's last rows
    v1::Status status;
    std::string asked;
    int queries = 0;
    do {
        std::this_thread::sleep_for(kLook);
        if (attend) attend();
        status = ask_status(client);
        if (status.proof().asks() != asked) {
            asked = status.proof().asks();
            if (!asked.empty()) out << ">>> " << asked << std::endl;
        }
        const bool over = status.loop_check().verdict() != "running" &&
                          status.campaign().state() != v1::Campaign::checking;
        if (over && asked.empty()) ++queries;
    } while (queries == 0 || (status.proof().utc_ns() == before && queries < kQueries));
    if (status.proof().table_g() > 0) show_rows(out, status.loop_check().rows());
    show_rows(out, status.proof().rows());
    if (!status.proof().passed()) out << "not proved: " << status.proof().message() << '\n';
    if (status.proof().utc_ns() != before)
        show_signed_record(out, client, then.journal().proof_head());
    return status.proof();
}

int self_test(const TestOptions& options) {
    if (options.rest)
        return check_at_rest(options.at, options.by.empty() ? login_name() : options.by,
                             options.json);
    serve::Client client(options.at);
    if (!options.by.empty()) {
        const auto command = command_of(v1::Command::selftest, options.by,
                                        std::string(options.at_zero ? "at_zero" : "") +
                                            (options.at_zero && options.emergency_stop ? " " : "") +
                                            (options.emergency_stop ? "emergency_stop" : ""));
        wait_for_rest(client);
        const auto before = ask_status(client);
        const serve::Reply begun = client.post("/api/v1/commands", json_of(command));
        if (begun.status != 200) {
            std::cerr << kWho << problem_of(begun) << '\n';
            return is_no(begun.status) ? kNo : kBadInput;
        }
        static_cast<void>(show_loop_check(std::cout, client, before));
    }
    const serve::Reply reply = client.get("/api/v1/selftest");
    v1::Readiness found;
    parse_answer(reply, found);
    if (options.json) {
        std::cout << reply.body << '\n';
    } else {
        for (const v1::Readiness::Check& check : found.checks()) {
            std::cout << mark_of(check.passed())
                      << serve::clipped(check.name() + ": " + check.text(), kLongestLine) << '\n';
        }
        std::cout << (found.ready() ? colour::good("ready for a campaign")
                                    : colour::bad("not ready for a campaign"))
                  << '\n';
    }
    return found.ready() ? 0 : kNo;
}

/// After an acknowledgement, until the controller has forgotten its fault: who arms next is not
/// refused because of what is only on its way.
void wait_for_shaker(serve::Client& client) {
    constexpr auto kLook = std::chrono::milliseconds(100);
    for (int queries = 0; queries < 30; ++queries) {
        const v1::Status status = ask_status(client);
        const auto& shaker = status.shaker();
        if (!shaker.stop_pending() && shaker.fault() == 0) return;
        std::this_thread::sleep_for(kLook);
    }
    std::cerr << kWho << "the shaker has not confirmed it yet: vibrig status\n";
}

int send_command(const CommandOptions& options) {
    if (options.kind == v1::Command::acknowledge && options.argument.empty())
        throw std::runtime_error(
            "what: found nothing to acknowledge, expected trip, shaker, or the name of an alarm or "
            "of what is latched, as `vibrig status` has them");
    serve::Client client(options.at);
    // Who types the one right after the other is not refused because of a stop on its way.
    if (options.kind == v1::Command::arm || options.kind == v1::Command::acknowledge)
        wait_for_rest(client);
    const serve::Reply reply = client.post(
        "/api/v1/commands", json_of(command_of(options.kind, options.by, options.argument)));
    if (options.json) std::cout << reply.body << '\n';
    if (reply.status == 200) {
        v1::CommandReply answer;
        parse_answer(reply, answer);
        if (!options.json) {
            std::cout << (answer.message().empty() ? "accepted" : answer.message()) << '\n';
        }
        if (options.kind == v1::Command::acknowledge) wait_for_shaker(client);
        return 0;
    }
    std::cerr << kWho << problem_of(reply) << '\n';
    return is_no(reply.status) ? kNo : kBadInput;
}

void add_order(CLI::App& app, int& exit_code, v1::Command::Kind kind, const char* name,
               const char* help) {
    const auto [command, options] =
        add_command<CommandOptions>(app, exit_code, name, help, send_command, kWho);
    options.kind = kind;
    options.at.expired_too = kind == v1::Command::abort;
    options.by = login_name();
    add_socket(command, options.at);
    auto* const by =
        command.add_option("--by", options.by, "Who commands; goes into the event log")
            ->capture_default_str();
    // A stop does not wait for a better name.
    if (kind == v1::Command::abort)
        by->transform([](const std::string& text) {
            const bool blank = text.find_first_not_of(' ') == std::string::npos;
            return blank && !text.empty() ? "somebody" : proto::printable(text, text.size());
        });
    else
        by->check(one_line("a name"));
    command.add_flag("--json", options.json, "Print the daemon's answer as JSON");
    std::string example = std::string("Example: vibrig ") + name;
    if (kind == v1::Command::acknowledge) {
        command
            .add_option("what", options.argument,
                        "What is acknowledged: trip, shaker, or the name of an alarm or of what is "
                        "latched, as `vibrig status` has them")
            ->check(one_line("what `vibrig status` names"));
        example += " trip";
    }
    command.footer(example + " --by 'Ada Lovelace'");
}

}  // namespace

void wait_for_rest(serve::Client& client) {
    constexpr auto kLook = std::chrono::milliseconds(100);
    for (int queries = 0; queries < 30 && ask_status(client).shaker().stop_pending(); ++queries)
        std::this_thread::sleep_for(kLook);
}

CLI::Validator one_line(const std::string& what) {
    return CLI::Validator(
        [what](const std::string& text) {
            // Nothing at all is refused for every option, by proto::refuse_empty_values().
            const bool blank = !text.empty() && text.find_first_not_of(' ') == std::string::npos;
            if (!blank && proto::printable(text, text.size()) == text) return std::string();
            return "found \"" + proto::printable(text) + "\", expected " + what +
                   (blank ? "" : ", one line of UTF-8 without control characters");
        },
        "");
}

v1::Command command_of(v1::Command::Kind kind, const std::string& by, const std::string& argument) {
    v1::Command command;
    command.set_kind(kind);
    command.set_by(by);
    command.set_argument(argument);
    return command;
}

std::string json_of(const v1::Command& command) {
    std::string json;
    // protobuf would say so by itself, too, on standard error.
    if (!proto::is_utf8(command.by()))
        throw serve::ClientError("--by: found \"" + proto::printable(command.by()) +
                                 "\", expected a name in UTF-8");
    if (!google::protobuf::util::MessageToJsonString(command, &json).ok())
        throw serve::ClientError("the command cannot be written as JSON");
    return json;
}

bool is_no(int status) { return status == 403 || status == 409 || status == 429; }

std::string problem_of(const serve::Reply& reply) {
    v1::Problem problem;
    if (parsed(reply.body, problem).ok() && !problem.detail().empty()) return problem.detail();
    return "HTTP status " + std::to_string(reply.status);
}

void add_socket(CLI::App& command, serve::Address& at) {
    at.socket = default_socket();
    if (const char* const host = std::getenv("VIBRIG_HOST"); host != nullptr) at.host = host;
    auto* const socket =
        command
            .add_option("--socket", at.socket,
                        "Unix socket of the daemon; VIBRIG_SOCKET sets another default")
            ->capture_default_str();
    // Who names a socket means the rig that is there, whatever is in the environment.
    socket->each([&at](const std::string& /*path*/) { at.host.clear(); });
    command
        .add_option("--host", at.host,
                    "Another machine, HOST[:8443], over TLS, instead of a socket; VIBRIG_HOST "
                    "sets a default")
        ->excludes(socket);
    command
        .add_option("--identity", at.identity,
                    "Who you are there: FOLDER/NAME of `vibrig pki init`")
        ->envname("VIBRIG_IDENTITY");
}

std::string default_socket() {
    const char* const other = std::getenv("VIBRIG_SOCKET");
    if (other != nullptr && *other != '\0') return other;
    constexpr const char* kControl = "/run/vibrig/vibrigd.sock";
    constexpr const char* kStatus = "/run/vibrig/status.sock";
    // Who may not command may look.
    const bool reads_only = access(kControl, W_OK) != 0 && access(kStatus, W_OK) == 0;
    return reads_only ? kStatus : kControl;
}

void parse_answer(const serve::Reply& reply, google::protobuf::Message& message) {
    if (reply.status != 200) throw serve::ClientError("vibrigd: " + problem_of(reply));
    const auto found = parsed(reply.body, message);
    if (found.ok()) return;
    // Below its first line protobuf draws the place.
    const std::string why(found.message());
    throw serve::ClientError("the daemon's answer: found '" + proto::printable(reply.body) +
                             "', expected JSON of " + message.GetTypeName() + ": " +
                             proto::printable(why.substr(0, why.find('\n')), kLongestLine));
}

v1::Status ask_status(serve::Client& client) {
    v1::Status status;
    parse_answer(client.get("/api/v1/status"), status);
    return status;
}

void add_remote(CLI::App& app, int& exit_code) {
    const auto [status, status_options] = add_command<StatusOptions>(
        app, exit_code, "status", "What a running vibrigd does", show_status, kWho);
    add_socket(status, status_options.at);
    status.add_flag("--json", status_options.json, "As JSON (vibrig.v1.Status)");
    status.footer(
        "Example: vibrig status --json\n"
        "Remotely: vibrig status --host rig.lab --identity vibrig-pki/ada");

    const auto [testing, test_options] = add_command<TestOptions>(
        app, exit_code, "selftest",
        "What is looked at before a campaign; exit code 1 unless all is well", self_test, kWho);
    testing
        .add_option("--by", test_options.by,
                    "Who orders a loop check and a proof of the safe state first, about a minute "
                    "at selftest.table_g: the bands of [selftest], then whether the table stops "
                    "by order and when nobody feeds its watchdog")
        ->check(one_line("a name"));
    testing
        .add_flag("--emergency-stop", test_options.emergency_stop,
                  "Ask for the emergency stop at the end, too; it trips as ever")
        ->needs("--by");
    testing
        .add_flag(
            "--at-zero", test_options.at_zero,
            "Instead: the controller runs at 0 g, and its watchdog stops it twice, the second "
            "time with the link closed; half a minute, and nothing moves")
        ->needs("--by");
    testing
        .add_flag(
            "--rest", test_options.rest,
            "Instead: the opening check of a campaign alone, 4 minutes. Gimbals move, nothing "
            "shakes; it ends with this tool. Exit code 1: something is off, with the keys "
            "that would explain it")
        ->excludes("--at-zero", "--emergency-stop");
    add_socket(testing, test_options.at);
    testing.add_flag("--json", test_options.json, "As JSON (vibrig.v1.Readiness)");
    testing.footer(
        "Example: vibrig selftest\n"
        "With loop check and proof, which vibrig abort ends at any moment: vibrig selftest --by "
        "'Ada "
        "Lovelace' && vibrig arm --by 'Ada Lovelace'");

    const auto [watching, watch_options] = add_command<WatchOptions>(
        app, exit_code, "watch", "The status as a live table", watch, kWho);
    add_socket(watching, watch_options.at);
    watching.add_flag(
        "--until-finished", watch_options.until_finished,
        "End with the campaign: exit code 0 when it finished and its result is valid or doubtful, "
        "1 when that is not valid, or when it was aborted or tripped");
    watching.add_flag("--strict", watch_options.strict,
                      "With --until-finished: a doubtful result is a no as well");
    watching.add_flag("--json", watch_options.json,
                      "One JSON object per line (vibrig.v1.Status), each time it is asked");
    add_number(watching, "--interval", watch_options.interval_s, "Time between two queries, s",
               0.05, 3600)
        ->capture_default_str();
    watching.footer("Example: vibrig watch --until-finished\nInto a pipe: one line per change.");

    const auto [events, event_options] = add_command<EventOptions>(
        app, exit_code, "events", "What happened, oldest first", show_events, kWho);
    add_socket(events, event_options.at);
    events.add_flag("--follow", event_options.follow, "Go on with what comes");
    events.add_flag("--json", event_options.json, "One JSON object per line (vibrig.v1.Event)");
    events.footer("Example: vibrig events --follow");

    add_order(app, exit_code, v1::Command::arm, "arm", "Arm the shaker for one campaign");
    add_order(app, exit_code, v1::Command::start, "start", "Start the armed campaign");
    add_order(app, exit_code, v1::Command::pause, "pause",
              "Pause at rest before the next position");
    add_order(app, exit_code, v1::Command::resume, "resume", "Go on after a pause");
    add_order(app, exit_code, v1::Command::abort, "abort", "Stop the shaker and end the campaign");
    add_order(app, exit_code, v1::Command::acknowledge, "ack", "Acknowledge a trip or an alarm");
}

std::string refusal_of(serve::Client& client, const v1::Command& command) {
    const serve::Reply reply = client.post("/api/v1/commands", json_of(command));
    if (reply.status != 200) return problem_of(reply);
    if (command.kind() == v1::Command::acknowledge) wait_for_shaker(client);
    return {};
}

std::string prove_safe_state(serve::Client& client, const std::string& by,
                             const std::string& argument, std::ostream& out) {
    wait_for_rest(client);
    const auto before = ask_status(client);
    const auto command = command_of(v1::Command::selftest, by, "attended " + argument);
    if (auto why = refusal_of(client, command); !why.empty()) return why;
    const auto attending = command_of(v1::Command::commission, by, R"({"do":"attend"})");
    const auto proof = show_loop_check(out, client, before, [&] {
        static_cast<void>(client.post("/api/v1/commands", json_of(attending)));
    });
    if (proof.utc_ns() == before.proof().utc_ns()) return "no proof was made";
    return proof.passed() ? "" : proof.message();
}

}  // namespace vibrig::tool
