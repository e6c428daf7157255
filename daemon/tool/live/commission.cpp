// The dialogue of commissioning: shows what the daemon says, passes on what a person answers. What
// moves is decided in the daemon, so that a tool that dies moves nothing.
#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <chrono>
#include <iomanip>
#include <iostream>
#include <iterator>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <sstream>
#include <string_view>
#include <thread>

#include "daemon/commission/shaker_parts.hpp"
#include "daemon/configuration/configuration.hpp"
#include "daemon/tool/commands.hpp"
#include "daemon/tool/live/answers.hpp"
#include "daemon/tool/live/commission_client.hpp"
#include "daemon/tool/live/key_by_key.hpp"
#include "daemon/tool/live/remote.hpp"
#include "daemon/tool/live/toml_edit.hpp"
#include "proto/json_text.hpp"
#include "proto/person_name.hpp"
#include "proto/text.hpp"

namespace vibrig::tool {

namespace {

constexpr const char* kCommission = "vibrig commission: ";
constexpr auto kCommissionPoll = std::chrono::milliseconds(250);
constexpr std::size_t kColumns = 79;

}  // namespace

std::string commission_command(serve::Client& client, const std::string& by,
                               const CommissionJson& what) {
    const serve::Reply reply = client.post(
        "/api/v1/commands", json_of(command_of(v1::Command::commission, by, what.dump())));
    if (reply.status == 409 || reply.status == 403) throw CommissionRefused(problem_of(reply));
    v1::CommandReply answer;
    parse_answer(reply, answer);
    return answer.message();
}

CommissionJson commission_state(serve::Client& client, const std::string& by, std::size_t after) {
    return CommissionJson::parse(
        commission_command(client, by, {{"do", "read"}, {"after", after}}));
}

void print_wrapped(std::ostream& out, const std::string& line) {
    std::string rest = line;
    const std::string indent = "   ";
    while (rest.size() > kColumns) {
        auto at = rest.rfind(' ', kColumns);
        if (at == std::string::npos || at <= indent.size()) at = kColumns;
        out << rest.substr(0, at) << '\n';
        rest = indent + rest.substr(std::min(rest.size(), at + (rest[at] == ' ' ? 1 : 0)));
    }
    out << rest << std::endl;
}

namespace {

class Dialogue {
  public:
    Dialogue(const CommissionOptions& options, std::ostream& out)
        : options_(options), client_(options.at), out_(out) {
        if (!options.answers.empty()) answers_.emplace(options.answers);
    }

    /// Returns what was found.
    CommissionJson run() {
        auto state = commission_state(client_, options_.by, 0);
        if (answers_ && state["simulated"] != true)
            throw std::runtime_error("--answers: persons answer on a real rig");
        if (state["simulated"] == true)
            out_ << "SIMULATED: what is found of this rig counts on no real one.\n";
        const bool going_on = !state["procedure"].is_null() && state["procedure"]["active"] == true;
        if (going_on) {
            const std::string began = state["procedure"]["by"];
            if (!proto::same_person(began, options_.by))
                throw CommissionRefused("the rig is being commissioned by " + began +
                                        ", who answers; vibrig abort ends it");
            print_wrapped(out_, "Going on with what " + began + " began.");
            if (answers_)
                commission_command(client_, options_.by,
                                   {{"do", "answers"}, {"answers", answers_->all()}});
        } else {
            CommissionJson begin{{"do", "begin"}, {"by_hand", options_.by_hand}};
            if (options_.resume || !options_.ask.empty()) begin["resume"] = true;
            if (!options_.ask.empty()) begin["ask"] = options_.ask;
            if (answers_) begin["answers"] = answers_->all();
            commission_command(client_, options_.by, begin);
            out_ << "While a gimbal moves any key stops it.\n";
        }
        for (;;) {
            state = commission_state(client_, options_.by, shown_);
            const CommissionJson& procedure = state["procedure"];
            for (const auto& line : procedure["lines"])
                print_wrapped(out_, line.get<std::string>());
            shown_ = procedure["next"];
            if (procedure["active"] != true) {
                CommissionJson result = procedure["result"];
                result["parts"] = state["record"]["parts"];
                result["simulated"] = state["simulated"];
                return result;
            }
            const bool asked = !procedure["question"].is_null();
            if (asked && !answers_)
                ask(procedure["question"]);
            else if (asked)
                expect_answer(procedure["question"]);
            else if (KeyByKey keys; keys.pressed(kCommissionPoll))
                commission_command(client_, options_.by, {{"do", "stop"}});
        }
    }

  private:
    /// The daemon gives it, unless there is none.
    void expect_answer(const CommissionJson& question) {
        try {
            answers_->expect_one_to(question);
        } catch (const std::runtime_error&) {
            commission_command(client_, options_.by, {{"do", "end"}});
            throw;
        }
        std::this_thread::sleep_for(kCommissionPoll / 2);  // 10 commands a second
    }

    void ask(const CommissionJson& question) {
        const std::string usual = question["usual"];
        std::string text = question["text"].get<std::string>() + " [" +
                           question["expected"].get<std::string>() +
                           (usual.empty() ? "" : "; Enter: " + usual) + "]";
        print_wrapped(out_, "? " + text);
        const std::string answer = typed();
        if (!proto::is_utf8(answer)) {
            print_wrapped(out_, "  found \"" + proto::printable(answer) + "\", expected UTF-8");
            return;
        }
        try {
            commission_command(client_, options_.by,
                               {{"do", "answer"}, {"id", question["id"]}, {"value", answer}});
        } catch (const CommissionRefused& refused) {
            print_wrapped(out_, std::string("  ") + refused.what());
        }
    }

    /// A line; meanwhile the daemon hears that somebody is there.
    std::string typed() {
        out_ << "> " << std::flush;
        for (;;) {
            if (const auto end = waiting_.find('\n'); end != std::string::npos) {
                const std::string line = waiting_.substr(0, end);
                waiting_.erase(0, end + 1);
                return line;
            }
            pollfd in{STDIN_FILENO, POLLIN, 0};
            if (poll(&in, 1, static_cast<int>(kCommissionPoll.count())) > 0) {
                std::array<char, 256> some{};
                const auto got = read(STDIN_FILENO, some.data(), some.size());
                if (got <= 0) {
                    commission_command(client_, options_.by, {{"do", "end"}});
                    throw CommissionRefused("nobody answers: ended");
                }
                waiting_.append(some.data(), static_cast<std::size_t>(got));
            } else {
                static_cast<void>(commission_state(client_, options_.by, shown_));
            }
        }
    }

    const CommissionOptions& options_;
    serve::Client client_;
    std::ostream& out_;
    std::optional<Answers> answers_;
    std::size_t shown_ = 0;
    std::string waiting_;
};

void print_found(std::ostream& out, const CommissionJson& result) {
    std::string table;
    auto values = values_of(result["found"], result["found_by"], mark_of(result));
    std::ranges::stable_sort(values, {},
                             [](const TomlValue& v) { return v.key.substr(0, v.key.rfind('.')); });
    for (const auto& value : values) {
        const auto dot = value.key.rfind('.');
        if (value.key.substr(0, dot) != table) {
            table = value.key.substr(0, dot);
            out << '[' << table << "]\n";
        }
        const std::string line = value.key.substr(dot + 1) + " = " + value.value;
        if (line.size() + value.comment.size() + 4 <= kColumns)
            out << line << "  # " << value.comment << '\n';
        else
            out << "# " << value.comment << '\n' << line << '\n';
    }
}

/// "3 days old, until 2027-11-23".
std::string age_text(const CommissionJson& age) {
    const auto days = static_cast<long>(age["days"].get<double>());
    return std::to_string(days) + (days == 1 ? " day" : " days") + " old, until " +
           age["expires"].get<std::string>();
}

/// Keys that may be wrong, and the position that would tell two descriptions apart.
void print_doubts(std::ostream& out, const CommissionJson& result) {
    std::string keys;
    for (const auto& key : result.value("suspects", CommissionJson::array()))
        keys += (keys.empty() ? "" : ", ") + key.get<std::string>();
    if (!keys.empty()) print_wrapped(out, "   suspects: " + keys);
    const auto& position = result.value("would_separate", CommissionJson());
    if (!position.is_object()) return;
    std::ostringstream text;
    text << std::fixed << std::setprecision(1) << "   what would tell: the readings";
    for (const auto& one : position["position_deg"]) text << ' ' << one.get<double>();
    text << " deg, by " << position["by_mg"].get<double>() << " mg";
    print_wrapped(out, text.str());
}

int commission_rig(const CommissionOptions& options) {
    std::ostream& out = options.json ? std::cerr : std::cout;
    const CommissionJson result = Dialogue(options, out).run();
    if (options.json) std::cout << proto::json_text(result, 1) << '\n';
    const bool decided = result["outcome"] == "decided";
    std::string head = mark_of(result) + result["outcome"].get<std::string>();
    std::ranges::transform(head, head.begin(),
                           [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
    print_wrapped(out, head + (decided ? "" : ": " + result["why"].get<std::string>()));
    if (!decided) {
        print_doubts(out, result);
        return kNo;
    }
    print_found(out, result);
    for (const auto& correction : result["corrections"])
        print_wrapped(out, "The DBC first: " + correction.get<std::string>());
    if (!result["corrections"].empty()) {
        out << "Then commission anew.\n";
        return kNo;
    }
    print_wrapped(out, "Nothing is recorded yet: vibrig commission accept --by '" + options.by +
                           "' --second NAME");
    return 0;
}

int show_commission(const CommissionOptions& options) {
    serve::Client client(options.at);
    const auto state = commission_state(client, options.by, 0);
    const auto& record = state["record"];
    if (options.json) std::cout << proto::json_text(record, 1) << '\n';
    bool all = true;
    // As the live page has it.
    if (const std::string now = state.value("progress", std::string());
        !options.json && !now.empty())
        print_wrapped(std::cout, "now: " + now);
    for (const auto& [name, part] : record["parts"].items()) {
        const bool proven = part["proven"];
        all = all && proven;
        if (options.json) continue;
        std::string text = name + std::string(16 - std::min<std::size_t>(15, name.size()), ' ');
        if (proven) {
            text += "proven " + part["utc"].get<std::string>().substr(0, 10) + " by ";
            std::string by;
            for (const auto& one : part["by"])
                by += (by.empty() ? "" : ", ") + one.get<std::string>();
            text += by;
            if (part.contains("age")) text += ", " + age_text(part["age"]);
            if (const std::string person = part["signed_by"]; !person.empty())
                text += ", signed with the certificate of " + person;
            if (const std::string moved = part["told"]; !moved.empty()) text += "; " + moved;
        } else {
            text += "NOT: " + part["why"].get<std::string>();
        }
        print_wrapped(std::cout, text);
    }
    if (!options.json) {
        if (const std::string trouble = record["trouble"]; !trouble.empty())
            print_wrapped(std::cout, trouble);
        if (record["simulated"] == true)
            std::cout << "SIMULATED: "
                      << (record["demanded"] == true ? "this record counts on no real rig\n"
                                                     : "arming demands no record\n");
    }
    return all ? 0 : kNo;
}

int commission(const CommissionOptions& options) {
    constexpr std::array<std::string_view, 4> kShaker{"watchdog", "stop", "units", "excitation"};
    const auto of_shaker = [&kShaker](const std::string& part) {
        return std::ranges::find(kShaker, part) != kShaker.end();
    };
    const auto shaker = std::ranges::count_if(options.parts, of_shaker);
    if (shaker > 0 && shaker == std::ssize(options.parts)) return commission_shaker(options);
    constexpr std::array<std::string_view, 4> kMeasured{"bus", "gimbals", "accelerometers",
                                                        "earth"};
    bool gyros = false;
    for (const auto& part : options.parts) {
        if (of_shaker(part))
            throw std::runtime_error(part +
                                     ": found parts of the platform beside it, expected it "
                                     "after them");
        gyros = gyros || part == "gyros";
        if (part != "gyros" && std::ranges::find(kMeasured, part) == kMeasured.end())
            throw std::runtime_error("found \"" + proto::printable(part) +
                                     "\", expected bus, gimbals, accelerometers, earth, gyros, "
                                     "watchdog, stop, units or excitation");
    }
    if (gyros && options.parts.size() > 1)
        throw std::runtime_error("gyros: found other parts beside it, expected it alone");
    return gyros ? state_gyros(options) : commission_rig(options);
}

/// The daemon that says no is an answer, not bad input.
template <class Run>
int guarded_commission(Run run, bool json) {
    return guarded(
        [&] {
            try {
                return run();
            } catch (const CommissionRefused& refused) {
                std::cerr << kCommission << refused.what() << '\n';
                if (json)
                    std::cout << proto::json_text(CommissionJson{{"outcome", "refused"},
                                                                 {"why", refused.what()}},
                                                  1)
                              << '\n';
                return kNo;
            }
        },
        kCommission);
}

template <class Run>
void run_as(CLI::App& command, int& exit_code, std::shared_ptr<CommissionOptions> options,
            Run run) {
    command.callback([&exit_code, options, run] {
        exit_code = guarded_commission([&] { return run(*options); }, options->json);
    });
}

void add_identity(CLI::App& command, CommissionOptions& options) {
    command.add_option("--identity", options.identity,
                       "Sign what is recorded: FOLDER/NAME of `vibrig pki init`");
}

void add_local_socket(CLI::App& command, CommissionOptions& options) {
    options.at.socket = default_socket();
    command.add_option("--socket", options.at.socket, "Unix socket of the daemon")
        ->capture_default_str();
}

void add_persons(CLI::App& command, CommissionOptions& options) {
    add_local_socket(command, options);
    command.add_option("--by", options.by, "Who stands at the rig; goes into the record")
        ->required()
        ->check(one_line("a name"));
}

}  // namespace

void add_commission(CLI::App& app, int& exit_code) {
    CLI::App& commissioning = *app.add_subcommand(
        "commission",
        "Find out how a rig is wired, by moving its gimbals one by one, and record it. By command "
        "where its angles are in degrees, else by hand (--by-hand)");
    auto options = std::make_shared<CommissionOptions>();
    commissioning
        .add_option(
            "parts", options->parts,
            "gimbals accelerometers earth and the bus: measured together; gyros: stated by two "
            "persons; then watchdog stop units excitation: the shaker's, by proofs of the safe "
            "state at a small level. Without: all of the first")
        ->expected(0, 5);
    add_local_socket(commissioning, *options);
    commissioning.add_option("--by", options->by, "Who stands at the rig; goes into the record")
        ->check(one_line("a name"));
    commissioning.add_option("--second", options->second, "Another person, for gyros")
        ->check(one_line("a name"));
    add_identity(commissioning, *options);
    commissioning.add_flag("--by-hand", options->by_hand,
                           "Nothing is commanded: a person turns the gimbals");
    commissioning.add_flag("--resume", options->resume,
                           "Go on where the daemon ended, by a new permission; where there is "
                           "nothing to go on with it begins anew");
    commissioning
        .add_option("--ask", options->ask,
                    "Ask once more what was answered, or was not: latitude, compass, drawing or "
                    "sense; nothing else is measured again")
        ->check(CLI::IsMember({"latitude", "compass", "drawing", "sense"}));
    commissioning.add_flag("--yes", options->yes,
                           "gyros and the shaker's parts: do not ask; simulated rigs only");
    auto* const display =
        commissioning
            .add_option("--display", options->display,
                        "units: the unit of amplitude that the controller's display shows")
            ->check(CLI::IsMember(commission::amplitude_units()));
    auto* const reference = add_number(
        commissioning, "--reference", options->reference_g,
        "units: peak g at the table by a reference, at the level of the proof", kAboveZero, 1000);
    display->needs(reference);
    reference->needs(display);
    commissioning.add_flag("--json", options->json,
                           "The finding as JSON; the dialogue goes to standard error");
    commissioning.add_option("--answers", options->answers,
                             "JSON file, question to answer; simulated rigs only");
    commissioning.footer(
        "Example: vibrig commission --by 'Ada Lovelace'\n"
        "Exit code 0: decided; 1: undecided, refused or unfinished. A rig is commissioned at the\n"
        "local socket only.");

    auto shown = std::make_shared<CommissionOptions>();
    CLI::App& status = *commissioning.add_subcommand(
        "status", "Which parts are proven; exit code 1 unless all are");
    shown->by = "status";
    add_local_socket(status, *shown);
    status.add_flag("--json", shown->json, "As JSON");
    status.footer("Example: vibrig commission status");
    run_as(status, exit_code, shown, show_commission);

    auto accepted = std::make_shared<CommissionOptions>();
    CLI::App& accepting = *commissioning.add_subcommand(
        "accept", "Write what was found into the configuration, and record it by two persons");
    add_persons(accepting, *accepted);
    accepting.add_option("--second", accepted->second, "Another person")
        ->required()
        ->check(one_line("a name"));
    add_identity(accepting, *accepted);
    accepting.add_option("--config", accepted->configuration,
                         "The daemon's configuration file; default: as the daemon names it");
    accepting.add_flag(
        "--bus", accepted->bus,
        "Of vibrig commission bus --find: can.* only, without a daemon, into --config");
    accepting.add_flag("--yes", accepted->yes, "Do not ask");
    accepting.add_flag("--json", accepted->json,
                       "The outcome as JSON; what is said and asked goes to standard error");
    accepting.footer("Example: vibrig commission accept --by 'Ada Lovelace' --second 'Bo Ek'");
    run_as(accepting, exit_code, accepted, accept_commission);

    add_commission_bus(commissioning, exit_code);
    add_commission_registers(commissioning, exit_code);

    commissioning.callback([&commissioning, &exit_code, options] {
        if (!commissioning.get_subcommands().empty()) return;  // it has done its own
        exit_code = guarded_commission(
            [&] {
                if (options->by.empty())
                    throw std::runtime_error("--by: found nothing, expected a name");
                return commission(*options);
            },
            options->json);
    });
}

}  // namespace vibrig::tool
