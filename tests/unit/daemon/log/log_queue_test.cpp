#include "daemon/log/log_queue.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <array>
#include <csignal>
#include <string>
#include <thread>
#include <vector>

#include "daemon/log/log_sink.hpp"

namespace vibrig::log {
namespace {

using namespace std::chrono_literals;

struct Pipe {
    Pipe() {
        std::signal(SIGPIPE, SIG_IGN);
        EXPECT_EQ(::pipe2(ends.data(), O_CLOEXEC), 0);
        ::fcntl(ends[0], F_SETFL, O_NONBLOCK);
        // As small as it gets: 4096 bytes.
        ::fcntl(ends[1], F_SETPIPE_SZ, 1);
    }
    ~Pipe() {
        close_reader();
        if (ends[1] >= 0) ::close(ends[1]);
    }
    Pipe(const Pipe&) = delete;
    Pipe& operator=(const Pipe&) = delete;
    void close_reader() {
        if (ends[0] >= 0) ::close(ends[0]);
        ends[0] = -1;
    }
    [[nodiscard]] std::string read_some() const {
        std::string text(8192, '\0');
        const ssize_t n = ::read(ends[0], text.data(), text.size());
        text.resize(n > 0 ? static_cast<std::size_t>(n) : 0);
        return text;
    }
    std::array<int, 2> ends{-1, -1};
};

void expect_balance(const Counts& counts) {
    EXPECT_EQ(counts.taken, counts.written + counts.dropped + counts.waiting);
}

TEST(LogQueue, WritesEveryLineInOrder) {
    const Pipe pipe;
    LogQueue queue(pipe.ends[1]);
    queue.put("one\n");
    queue.put("two\n");
    EXPECT_TRUE(queue.end(10s));
    EXPECT_EQ(pipe.read_some(), "one\ntwo\n");
    EXPECT_EQ(queue.counts().written, 2u);
    expect_balance(queue.counts());
}

TEST(LogQueue, HoldsNobodyUpWhileNobodyReads) {
    // GIVEN a pipe that is full, and nobody who reads it
    Pipe pipe;
    LogQueue queue(pipe.ends[1], 10);
    // WHEN more is logged than there is room for, THEN putting returns all the same (a queue that
    // waited would hang here for ever) and every line is accounted for
    constexpr std::uint64_t kLines = 1000;
    for (std::uint64_t i = 0; i < kLines; ++i) {
        queue.put(std::to_string(i) + std::string(1000, '.') + '\n');
        expect_balance(queue.counts());
    }
    while (!queue.counts().blocked) std::this_thread::sleep_for(10ms);
    const Counts stuck = queue.counts();
    EXPECT_EQ(stuck.taken, kLines);
    EXPECT_GT(stuck.dropped, kLines / 2);
    EXPECT_LE(stuck.waiting, 11u);
    expect_balance(stuck);
    // AND WHEN somebody reads again, THEN the newest lines come, and how many are missing
    std::string text;
    while (queue.counts().waiting > 0) text += pipe.read_some();
    EXPECT_TRUE(queue.end(10s));
    text += pipe.read_some();
    EXPECT_NE(text.find("\n999..."), std::string::npos);
    EXPECT_NE(text.find(" lines lost here)\n99"), std::string::npos) << text.substr(0, 3000);
    EXPECT_FALSE(queue.counts().blocked);
    expect_balance(queue.counts());
}

TEST(LogQueue, EndsAlthoughNobodyReads) {
    Pipe pipe;
    {
        LogQueue queue(pipe.ends[1], 10);
        for (int i = 0; i < 100; ++i) queue.put(std::string(1000, '.') + '\n');
        EXPECT_FALSE(queue.end(50ms)) << "it reports that not all is written";
        EXPECT_LE(queue.counts().waiting, 1u) << "the line that the pipe has half of";
        expect_balance(queue.counts());
    }
    // and the thread that is left behind ends with its write; its descriptor stays its own
    pipe.close_reader();
    pipe.ends[1] = -1;
    std::this_thread::sleep_for(100ms);
}

TEST(LogQueue, CountsWhatADeadDescriptorRefuses) {
    Pipe pipe;
    pipe.close_reader();
    LogQueue queue(pipe.ends[1]);
    for (int i = 0; i < 5; ++i) queue.put("lost\n");
    EXPECT_TRUE(queue.end(10s));
    EXPECT_EQ(queue.counts().dropped, 5u);
    expect_balance(queue.counts());
}

TEST(LogQueue, IsWhereEverythingLoggedGoes) {
    const Pipe pipe;
    LogQueue queue(pipe.ends[1]);
    log_through(queue, "warning", false);
    spdlog::info("left out");
    spdlog::warn("the table shakes at {} g", 5);
    log_through(queue, "warning", true);
    spdlog::error("red");
    spdlog::shutdown();
    EXPECT_TRUE(queue.end(10s));
    const std::string text = pipe.read_some();
    EXPECT_EQ(text.find("left out"), std::string::npos);
    EXPECT_NE(text.find("Z warning the table shakes at 5 g\n"), std::string::npos) << text;
    EXPECT_NE(text.find("Z \033[31merror\033[0m red\n"), std::string::npos) << text;
}

}  // namespace
}  // namespace vibrig::log
