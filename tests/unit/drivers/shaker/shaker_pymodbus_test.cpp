#include <fcntl.h>
#include <gtest/gtest.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "test_bench.hpp"

extern char** environ;

namespace vibrig::drivers::test {
namespace {

/// The script as a child; ends when its standard input does.
class Child {
  public:
    explicit Child(const char* kind) {
        int to[2], from[2];
        if (::pipe2(to, O_CLOEXEC) != 0 || ::pipe2(from, O_CLOEXEC) != 0) return;
        posix_spawn_file_actions_t actions;
        ::posix_spawn_file_actions_init(&actions);
        ::posix_spawn_file_actions_adddup2(&actions, to[0], 0);
        ::posix_spawn_file_actions_adddup2(&actions, from[1], 1);
        std::string python = "/usr/bin/python3", script = VIBRIG_PYMODBUS_SHAKER, argument = kind;
        char* arguments[] = {python.data(), script.data(), argument.data(), nullptr};
        if (::posix_spawn(&pid_, python.c_str(), &actions, nullptr, arguments, environ) != 0)
            pid_ = -1;
        ::posix_spawn_file_actions_destroy(&actions);
        ::close(to[0]);
        ::close(from[1]);
        input_ = to[1];
        output_ = ::fdopen(from[0], "r");
    }
    ~Child() {
        end();
        if (output_ != nullptr) std::fclose(output_);
    }
    Child(const Child&) = delete;
    Child& operator=(const Child&) = delete;

    /// Empty at the end.
    [[nodiscard]] std::string line() {
        char text[256];
        if (std::fgets(text, sizeof text, output_) == nullptr) return {};
        std::string read = text;
        while (!read.empty() && read.back() == '\n') read.pop_back();
        return read;
    }
    /// Its exit status; 0 is good.
    int end() {
        if (input_ >= 0) ::close(input_);
        input_ = -1;
        int status = -1;
        if (pid_ > 0) ::waitpid(pid_, &status, 0);
        pid_ = -1;
        return status;
    }

  private:
    pid_t pid_ = -1;
    int input_ = -1;
    std::FILE* output_ = nullptr;
};

[[nodiscard]] bool have_pymodbus() {
    return std::system("/usr/bin/python3 -c 'import pymodbus.server.async_io' 2>/dev/null") ==
           0;  // NOLINT
}

class ShakerPymodbus : public testing::TestWithParam<const char*> {};

TEST_P(ShakerPymodbus, UnderstandsWhatIsWritten) {
    if (!have_pymodbus())
        GTEST_SKIP() << "python3-pymodbus or python3-serial-asyncio is not installed";
    // GIVEN a shaker controller of another make
    Child child(GetParam());
    const std::string place = child.line();
    ASSERT_FALSE(place.empty());
    ShakerSettings settings;
    settings.poll_period = 50 * kMillisecond;
    settings.response_timeout = 5 * kSecond;
    settings.baud = 115200;
    if (place[0] == '/') {
        settings.transport = ShakerSettings::Transport::rtu;
        settings.device = place;
    } else {
        settings.port = std::stoi(place);
    }
    // WHEN a set-point and a stop go through
    {
        Bench bench(settings);
        ASSERT_TRUE(bench.apply({15.0, 9.0, 12.5}));
        const ShakerReading reading = bench.shaker->reading();
        EXPECT_TRUE(reading.valid);
        EXPECT_TRUE(reading.running);
        EXPECT_DOUBLE_EQ(reading.measured_g, 9.0);
        bench.shaker->stop_now();
        ASSERT_TRUE(bench.eventually([&] { return !bench.shaker->stop_pending(); }));
        ASSERT_TRUE(bench.eventually([&] { return bench.shaker->reading().at_rest(); }));
    }
    ASSERT_EQ(child.end(), 0);
    // THEN it read what was meant: 15000 mHz, 1250 x 10 ms, 90000 x 1e-4 g high word first, run,
    // stop
    std::vector<std::string> lines;
    bool fed = false, guarded = false;
    for (std::string line = child.line(); !line.empty(); line = child.line()) {
        fed = fed || line.starts_with("write 6 ");
        guarded = guarded || line == "write 7 1500";
        if (!line.starts_with("write 6 ") && !line.starts_with("write 7 ")) lines.push_back(line);
    }
    EXPECT_EQ(lines, (std::vector<std::string>{"write 0 0 15000", "write 4 1250", "write 2 1 24464",
                                               "write 5 1", "write 4 0 0"}));
    EXPECT_TRUE(fed);
    EXPECT_TRUE(guarded);
}

INSTANTIATE_TEST_SUITE_P(Lines, ShakerPymodbus, testing::Values("tcp", "rtu"),
                         [](const auto& line) { return std::string(line.param); });

}  // namespace
}  // namespace vibrig::drivers::test
