#include <gtest/gtest.h>
#include <poll.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <boost/asio/io_context.hpp>
#include <boost/asio/local/stream_protocol.hpp>
#include <boost/asio/write.hpp>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <stop_token>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "daemon/serve/status_json.hpp"
#include "daemon/serve/status_server.hpp"
#include "tests/unit/daemon/serve/fake_source.hpp"
#include "tests/unit/daemon/serve/raw_connection.hpp"
#include "tests/unit/support/temporary_folder.hpp"

namespace vibrig::serve {
namespace {

struct Outcome {
    int code = -1;
    std::string output;  ///< standard output and error
};

Outcome vibrig(const std::string& arguments) {
    const std::string command = std::string(VIBRIG_PROGRAM) + ' ' + arguments + " 2>&1";
    FILE* const pipe = popen(command.c_str(), "r");
    Outcome outcome;
    std::array<char, 4096> block{};
    while (const std::size_t got = std::fread(block.data(), 1, block.size(), pipe)) {
        outcome.output.append(block.data(), got);
    }
    const int status = pclose(pipe);
    outcome.code = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
    return outcome;
}

class Tool : public testing::Test {
  protected:
    /// Until the program that was just started has asked: under a sanitizer that takes a while.
    void wait_until_asked() {
        const int before = source.asked;
        for (int i = 0; i < 3000 && source.asked == before; ++i)
            std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    /// The server shows a status for a moment before it asks for another one.
    void show(const StatusData& status) {
        source.set(status);
        std::this_thread::sleep_for(std::chrono::milliseconds(50));
    }

    void tell(const std::string& text) {
        EventRecord event;
        event.source = "campaign";
        event.text = text;
        source.log.append(event);
    }

    FakeSource source;
    TemporaryFolder folder;
    std::string path = folder.file("s");
    std::string at = " --socket " + path;
};

TEST_F(Tool, PrintsTheStatusAsTheServerSaysIt) {
    const StatusServer server(source, path);
    const Outcome json = vibrig("status --json" + at);
    EXPECT_EQ(json.code, 0) << json.output;
    EXPECT_EQ(json.output, status_json(source.status()) + '\n');
    const Outcome table = vibrig("status" + at);
    EXPECT_EQ(table.code, 0) << table.output;
    EXPECT_NE(table.output.find("RECORDING  run 1/2, position 3/14"), std::string::npos)
        << table.output;
    EXPECT_EQ(table.output.find('\x1b'), std::string::npos) << "no colours into a pipe";
    // Which keys would explain a pause, and what acknowledges a trip, stands at the end.
    StatusData status = source.status();
    status.reason = std::string(300, 'r') + ": the last word";
    show(status);
    EXPECT_NE(vibrig("status" + at).output.find("r: the last word"), std::string::npos);
}

/// One who has exported VIBRIG_HOST for a day's work would stop, or arm, another rig.
TEST_F(Tool, AsksTheRigWhoseSocketIsNamedWhateverTheEnvironmentSays) {
    const StatusServer server(source, path);
    ::setenv("VIBRIG_HOST", "another-rig.invalid", 1);
    const Outcome named = vibrig("abort --by Ada" + at);
    const Outcome unnamed = vibrig("status");
    const Outcome both = vibrig("status --host another-rig.invalid" + at);
    ::unsetenv("VIBRIG_HOST");
    EXPECT_EQ(named.code, 0) << named.output;
    EXPECT_EQ(source.requests().size(), 1U);
    EXPECT_NE(unnamed.output.find("--host needs --identity"), std::string::npos) << unnamed.output;
    EXPECT_EQ(both.code, 2);
    EXPECT_NE(both.output.find("--socket excludes --host"), std::string::npos) << both.output;
}

TEST_F(Tool, SaysWhenNoDaemonRuns) {
    for (const char* command : {"status", "status --json", "watch", "events", "arm --by Ada",
                                "abort --by Ada", "ack trip --by Ada"}) {
        const Outcome outcome = vibrig(command + at);
        EXPECT_EQ(outcome.code, 2) << command;
        EXPECT_NE(outcome.output.find("no vibrigd answers at " + path + " (is it running?"),
                  std::string::npos)
            << outcome.output;
    }
}

/// Some other server at a socket: it answers one connection after the other with `body`, until it
/// is stopped.
void answer(const std::stop_token& stop, const std::string& path, const std::string& body) {
    using Local = boost::asio::local::stream_protocol;
    boost::asio::io_context io;
    Local::acceptor acceptor(io, Local::endpoint(path));
    while (!stop.stop_requested()) {
        ::pollfd waiting{acceptor.native_handle(), POLLIN, 0};
        if (::poll(&waiting, 1, 50) <= 0) continue;
        Local::socket client = acceptor.accept();
        std::array<char, 4096> request{};
        static_cast<void>(client.read_some(boost::asio::buffer(request)));
        boost::asio::write(client,
                           boost::asio::buffer("HTTP/1.1 200 OK\r\nContent-Length: " +
                                               std::to_string(body.size()) + "\r\n\r\n" + body));
    }
}

TEST_F(Tool, SaysInOneLineThatAnAnswerIsNone) {
    const std::array<std::string, 4> commands{"status", "status --json", "watch", "selftest"};
    const std::jthread other([&](const std::stop_token& stop) {
        answer(stop, path, "<html>\n<body>Hello</body>\n</html>\n");
    });
    while (!std::filesystem::exists(path)) std::this_thread::yield();
    for (const auto& command : commands) {
        const Outcome outcome = vibrig(command + at);
        EXPECT_EQ(outcome.code, 2) << command;
        EXPECT_EQ(std::ranges::count(outcome.output, '\n'), 1) << outcome.output;
        EXPECT_NE(outcome.output.find("the daemon's answer: found '<html>"), std::string::npos)
            << outcome.output;
        EXPECT_NE(outcome.output.find("expected JSON of vibrig.v1."), std::string::npos)
            << outcome.output;
    }
}

TEST_F(Tool, SendsCommandsAndReportsRefusals) {
    const StatusServer server(source, path);
    EXPECT_EQ(vibrig("arm --by 'Ada Lovelace'" + at).code, 0);
    EXPECT_EQ(vibrig("start" + at).output, "done\n");
    EXPECT_EQ(vibrig("pause" + at).code, 0);
    EXPECT_EQ(vibrig("resume" + at).code, 0);
    EXPECT_EQ(vibrig("abort" + at).code, 0);
    EXPECT_EQ(vibrig("ack trip" + at).code, 0);
    const auto requests = source.requests();
    ASSERT_EQ(requests.size(), 6u);
    for (std::size_t i = 0; i < 6; ++i) EXPECT_EQ(static_cast<std::size_t>(requests[i].kind), i);
    EXPECT_EQ(requests[0].by.rfind("Ada Lovelace (uid ", 0), 0u) << requests[0].by;
    EXPECT_GT(requests[1].by.size(), std::string(" (uid 0)").size()) << "the login name";
    EXPECT_EQ(requests[5].argument, "trip");

    source.answer_commands_with({false, "the shaker is not armed"});
    const Outcome refused = vibrig("start" + at);
    EXPECT_EQ(refused.code, 1);
    EXPECT_EQ(refused.output, "vibrig: the shaker is not armed\n");
    const Outcome nothing = vibrig("ack --by Ada" + at);
    EXPECT_EQ(nothing.code, 2);
    EXPECT_NE(nothing.output.find("found nothing to acknowledge, expected trip, shaker, or the "
                                  "name of an alarm"),
              std::string::npos)
        << nothing.output;
    EXPECT_EQ(vibrig("arm --by ''" + at).code, 2);
    EXPECT_EQ(source.requests().size(), 7u);
}

TEST_F(Tool, WhatTheDaemonWouldRefuseIsRefusedBefore) {
    // GIVEN a daemon, and names that are no line of UTF-8
    const StatusServer server(source, path);
    const struct {
        const char *arguments, *words;
    } lines[] = {
        {"arm --by '\xff\xfe'", R"(--by: found "\xff\xfe", expected a name, one line of UTF-8)"},
        {"start --by 'a\nb'", R"(--by: found "a\nb", expected a name, one line of UTF-8)"},
        {"pause --by '  '", R"(--by: found "  ", expected a name)"},
        {"ack '\xff'", R"(what: found "\xff", expected what `vibrig status` names)"},
        {"selftest --by '\xff'", R"(--by: found "\xff", expected a name)"},
        {"commission gyros --by '\xff' --second Bo", R"(--by: found "\xff", expected a name)"},
        {"commission gyros --by Ada --second '\xff'", R"(--second: found "\xff", expected a name)"},
        {"commission accept --by '\xff' --second Bo", R"(--by: found "\xff", expected a name)"},
    };
    for (const auto& [arguments, words] : lines) {
        // WHEN they command THEN the tool says so, and the daemon never hears of it
        const Outcome outcome = vibrig(arguments + at);
        EXPECT_EQ(outcome.code, 2) << arguments;
        EXPECT_NE(outcome.output.find(words), std::string::npos) << outcome.output;
        EXPECT_EQ(outcome.output.find("libprotobuf"), std::string::npos) << outcome.output;
    }
    EXPECT_TRUE(source.requests().empty());
    // BUT a stop does not wait for a better name
    for (const char* name : {"'\xff'", "'  '"})
        EXPECT_EQ(vibrig("abort --by " + std::string(name) + at).code, 0) << name;
    EXPECT_EQ(source.requests().size(), 2U);
    // AND a name in another script is one
    EXPECT_EQ(vibrig("arm --by 'Žofie Ångström'" + at).code, 0);
}

TEST_F(Tool, WatchesUntilTheCampaignEnds) {
    const StatusServer server(source, path);
    StatusData status = full_status();
    const std::string watch = "watch --until-finished --interval 0.05" + at;
    status.state = CampaignState::finished;
    show(status);
    EXPECT_EQ(vibrig(watch).code, 0);
    for (const CampaignState bad : {CampaignState::aborted, CampaignState::tripped}) {
        status.state = bad;
        show(status);
        const Outcome outcome = vibrig(watch);
        EXPECT_EQ(outcome.code, 1);
        EXPECT_NE(outcome.output.find(name_of(bad)), std::string::npos) << outcome.output;
    }
    // GIVEN a campaign under way WHEN it goes on and ends THEN each place is one line
    status.state = CampaignState::recording;
    show(status);
    Outcome outcome;
    {
        const std::jthread watcher([&] { outcome = vibrig(watch); });
        wait_until_asked();
        status.state = CampaignState::finished;
        source.set(status);
    }
    EXPECT_EQ(outcome.code, 0) << outcome.output;
    EXPECT_NE(outcome.output.find("finished"), std::string::npos) << outcome.output;
    EXPECT_NE(outcome.output.find("verdict: doubtful"), std::string::npos) << outcome.output;
    EXPECT_LE(std::count(outcome.output.begin(), outcome.output.end(), '\n'), 3) << outcome.output;
    // AND a result that is not valid is a no
    status.verdict.level = 2;
    show(status);
    EXPECT_EQ(vibrig(watch).code, 1);
}

TEST_F(Tool, WatchesAsJsonLineByLine) {
    const StatusServer server(source, path);
    StatusData status = full_status();
    status.state = CampaignState::recording;
    show(status);
    const std::string before = status_json(source.status());
    Outcome outcome;
    {
        const std::jthread watcher(
            [&] { outcome = vibrig("watch --json --until-finished --interval 0.05" + at); });
        wait_until_asked();
        status.state = CampaignState::finished;
        source.set(status);
    }
    EXPECT_EQ(outcome.code, 0) << outcome.output;
    // THEN each line is what `vibrig status --json` prints, and the verdict stands on standard
    // error
    const std::string after = status_json(source.status());
    std::vector<std::string> said;
    std::istringstream lines(outcome.output);
    for (std::string line; std::getline(lines, line);)
        if (!line.starts_with("verdict: ")) said.push_back(line);
    ASSERT_GE(said.size(), 2U) << outcome.output;
    EXPECT_EQ(said.front(), before);
    EXPECT_EQ(said.back(), after);
    for (const auto& line : said) EXPECT_TRUE(line == before || line == after) << line;
}

TEST_F(Tool, WatchFindsARestartedDaemonAgain) {
    auto server = std::make_unique<StatusServer>(source, path);
    StatusData status = full_status();
    source.set(status);
    Outcome outcome;
    {
        const std::jthread watcher(
            [&] { outcome = vibrig("watch --until-finished --interval 0.05" + at); });
        wait_until_asked();
        server.reset();
        // The tool runs and asks twenty times a second: it sees that nobody answers.
        std::this_thread::sleep_for(std::chrono::seconds(2));
        status.state = CampaignState::finished;
        source.set(status);
        server = std::make_unique<StatusServer>(source, path);
    }
    EXPECT_EQ(outcome.code, 0) << outcome.output;
    EXPECT_NE(outcome.output.find("NO ANSWER FROM vibrigd"), std::string::npos) << outcome.output;
    EXPECT_NE(outcome.output.find("answers again"), std::string::npos) << outcome.output;
}

TEST_F(Tool, ListsEvents) {
    const StatusServer server(source, path);
    for (int i = 1; i <= 2500; ++i) tell("event " + std::to_string(i));
    const Outcome outcome = vibrig("events" + at);
    EXPECT_EQ(outcome.code, 0);
    EXPECT_EQ(std::count(outcome.output.begin(), outcome.output.end(), '\n'), 2500);
    EXPECT_NE(outcome.output.find("event 2500\n"), std::string::npos);
    const Outcome json = vibrig("events --json" + at);
    EXPECT_EQ(json.output.rfind("{\"id\":\"1\"", 0), 0u) << json.output.substr(0, 200);
}

/// Something is told between any two questions, for a thousand of them.
class NeverQuiet : public FakeSource {
  public:
    mutable std::atomic<int> questions{0};

    [[nodiscard]] std::vector<EventRecord> events(std::uint64_t after_id,
                                                  std::size_t /*at_most*/) const override {
        if (++questions > 1000) return {};
        EventRecord event;
        event.id = after_id + 1;
        event.text = "one more";
        return {event};
    }
};

TEST_F(Tool, PrintsTheEventsUntilNowOfADaemonThatIsNeverQuiet) {
    NeverQuiet never_quiet;
    const StatusServer server(never_quiet, path);
    const Outcome outcome = vibrig("events" + at);
    EXPECT_EQ(outcome.code, 0) << outcome.output;
    EXPECT_EQ(never_quiet.questions, 1);
}

TEST_F(Tool, PrintsMoreEventsThanOneAnswerHas) {
    for (int i = 1; i <= 2500; ++i) tell("event " + std::to_string(i) + " of 2500");
    const StatusServer server(source, path);
    const Outcome outcome = vibrig("events" + at);
    EXPECT_EQ(std::ranges::count(outcome.output, '\n'), 2500);
    EXPECT_NE(outcome.output.find("event 2500 of 2500"), std::string::npos);
}

/// `vibrig events --follow`, until it goes out of scope.
class Follower {
  public:
    Follower(const std::string& at, std::string file) : file_(std::move(file)) {
        const std::string command = "exec " + std::string(VIBRIG_PROGRAM) + " events --follow" +
                                    at + " >" + file_ + " 2>&1";
        process_ = fork();
        if (process_ == 0) {
            execl("/bin/sh", "sh", "-c", command.c_str(), nullptr);
            _exit(127);
        }
    }
    ~Follower() {
        kill(process_, SIGKILL);
        waitpid(process_, nullptr, 0);
    }
    Follower(const Follower&) = delete;
    Follower& operator=(const Follower&) = delete;

    [[nodiscard]] testing::AssertionResult printed(const std::string& text) const {
        std::string all;
        for (int i = 0; i < 3000; ++i) {
            std::ifstream input(file_);
            all.assign(std::istreambuf_iterator<char>(input), {});
            if (all.find(text) != std::string::npos) return testing::AssertionSuccess();
            std::this_thread::sleep_for(std::chrono::milliseconds(10));
        }
        return testing::AssertionFailure() << '"' << text << "\" is not in:\n" << all;
    }

  private:
    std::string file_;
    pid_t process_ = -1;
};

TEST_F(Tool, FollowsEventsAcrossARestart) {
    auto server = std::make_unique<StatusServer>(source, path);
    tell("first event");
    const Follower follower(at, folder.file("events"));
    EXPECT_TRUE(follower.printed("first event"));
    tell("second event");
    EXPECT_TRUE(follower.printed("second event"));
    server.reset();
    EXPECT_TRUE(follower.printed("trying again"));
    server = std::make_unique<StatusServer>(source, path);
    EXPECT_TRUE(follower.printed("the daemon has started anew"));
    tell("third event");
    EXPECT_TRUE(follower.printed("third event"));
}

TEST_F(Tool, FollowsEventsThoughItsSecondQuestionIsNotAnswered) {
    ServerLimits limits;
    limits.requests_per_s = 1;
    const StatusServer server(source, path, limits);
    tell("first event");
    const Follower follower(at, folder.file("events"));
    EXPECT_TRUE(follower.printed("first event"));
    EXPECT_TRUE(follower.printed("trying again"));
    tell("second event");
    EXPECT_TRUE(follower.printed("second event"));
}

/// On a terminal, as a person has it.
Outcome on_terminal(const std::string& environment, const std::string& arguments) {
    const std::string command = "TERM=xterm " + environment + " script -qec '" + VIBRIG_PROGRAM +
                                ' ' + arguments + "' /dev/null </dev/null 2>&1";
    FILE* const pipe = popen(command.c_str(), "r");
    Outcome outcome;
    std::array<char, 4096> block{};
    while (const std::size_t got = std::fread(block.data(), 1, block.size(), pipe))
        outcome.output.append(block.data(), got);
    pclose(pipe);
    return outcome;
}

TEST_F(Tool, HasColoursOnATerminalThatWantsThem) {
    const StatusServer server(source, path);
    for (const char* command : {"status", "selftest"}) {
        SCOPED_TRACE(command);
        const std::string line = command + at;
        EXPECT_NE(on_terminal("", line).output.find("\x1b["), std::string::npos);
        for (const char* none : {"NO_COLOR=1", "NO_COLOR=1 FORCE_COLOR=1"})
            EXPECT_EQ(on_terminal(none, line).output.find("\x1b["), std::string::npos);
        EXPECT_NE(on_terminal("NO_COLOR=", line).output.find("\x1b["), std::string::npos)
            << "empty is as not set";
        EXPECT_EQ(vibrig(line).output.find("\x1b["), std::string::npos) << "into a pipe";
        EXPECT_EQ(on_terminal("NO_COLOR=1", line + " --json").output.find("\x1b["),
                  std::string::npos);
    }
}

}  // namespace
}  // namespace vibrig::serve
