#include "daemon/lock/rig_lock.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <optional>
#include <thread>

namespace vibrig {
namespace {

using configuration::Configuration;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

Configuration rig(const std::string& interface, int port) {
    Configuration c;
    c.can.kind = drivers::CanPortSettings::Kind::socketcan;
    // Of this test run alone: other ones may be under way on the same machine.
    c.can.interface = interface + std::to_string(::getpid());
    c.shaker.port = port;
    c.shaker.host = "test-" + std::to_string(::getpid());
    return c;
}

std::string refusal_of(const Configuration& c) {
    try {
        const RigLock lock(c, "");
    } catch (const RigTaken& taken) {
        return taken.what();
    }
    return "";
}

/// A holder that answers, as a daemon does.
struct Holder {
    explicit Holder(const Configuration& c) : lock(c, "/etc/vibrig/first.toml") {}
    ~Holder() {
        quit = true;
        thread.join();
    }
    RigLock lock;
    std::atomic<bool> quit{false};
    std::thread thread{[this] {
        while (!quit) {
            lock.answer();
            std::this_thread::sleep_for(std::chrono::milliseconds(10));
        }
    }};
};

TEST(RigLock, TheSecondOnTheSameBusLearnsWhoTheFirstIs) {
    const Holder first(rig("can", 502));
    EXPECT_THAT(refusal_of(rig("can", 503)),
                AllOf(HasSubstr("can:can" + std::to_string(::getpid())),
                      HasSubstr("pid " + std::to_string(::getpid())),
                      HasSubstr("/etc/vibrig/first.toml"), HasSubstr("since 20")));
}

TEST(RigLock, TheSecondOnTheSameShakerIsRefusedWhateverItsBus) {
    const Holder first(rig("can", 502));
    EXPECT_THAT(refusal_of(rig("vcan", 502)), HasSubstr("modbus:test-"));
    EXPECT_EQ(refusal_of(rig("vcan", 503)), "") << "another rig is nobody's business";
}

TEST(RigLock, OneThatFailsHalfWayHoldsNothing) {
    const Holder first(rig("can", 502));
    EXPECT_NE(refusal_of(rig("vcan", 502)), "");
    EXPECT_EQ(refusal_of(rig("vcan", 503)), "");
}

TEST(RigLock, IsGoneWithItsProcessHoweverThatEnds) {
    // GIVEN a process that holds a rig, does not answer, and is killed
    const auto c = rig("killed", 502);
    int pipe[2]{};
    ASSERT_EQ(::pipe(pipe), 0);
    const pid_t child = ::fork();
    if (child == 0) {
        const RigLock lock(c, "");
        static_cast<void>(!::write(pipe[1], "x", 1));
        for (;;) ::pause();
    }
    char byte = 0;
    ASSERT_EQ(::read(pipe[0], &byte, 1), 1);
    // THEN the kernel says at least which process it is
    EXPECT_THAT(refusal_of(c), HasSubstr("pid " + std::to_string(child)));
    ASSERT_EQ(::kill(child, SIGKILL), 0);
    ASSERT_EQ(::waitpid(child, nullptr, 0), child);
    EXPECT_EQ(refusal_of(c), "");
    ::close(pipe[0]);
    ::close(pipe[1]);
}

TEST(RigLock, KnowsOneSpellingOfAnAddress) {
    Configuration c;
    c.can.kind = drivers::CanPortSettings::Kind::socketcan;
    c.can.interface = "can0";
    for (const char* host :
         {"LocalHost", "127.1", "0:0::1", "::ffff:127.0.0.1", "::ffff:7f00:1", "0.0.0.0", "::"}) {
        c.shaker.host = host;
        const auto all = RigLock::resources(c);
        ASSERT_EQ(all.size(), 3U) << host;
        EXPECT_EQ(all[1], "modbus:127.0.0.1:502") << host;
    }
    // Of a controller elsewhere the same
    c.shaker.host = "::FFFF:192.0.2.7";
    EXPECT_EQ(RigLock::resources(c)[1], "modbus:192.0.2.7:502");
    c.shaker.host = "LocalHost";
    EXPECT_THAT(RigLock::resources(c),
                ElementsAre("can:can0", "modbus:127.0.0.1:502", "modbus:localhost:502"));
    c.shaker.host = "127.0.0.1";
    EXPECT_THAT(RigLock::resources(c), ElementsAre("can:can0", "modbus:127.0.0.1:502"));
    c.shaker.transport = drivers::ShakerSettings::Transport::rtu;
    c.shaker.device = "/dev/../dev/null";
    EXPECT_THAT(RigLock::resources(c), ElementsAre("can:can0", "modbus:/dev/null"));
    c.can.kind = drivers::CanPortSettings::Kind::seqpacket;
    c.can.path = "@bus";
    EXPECT_EQ(RigLock::resources(c).front(), "can:@bus");
}

TEST(RigLock, ALongNameIsStillOneOfItsOwn) {
    auto c = rig("x", 502);
    c.can.kind = drivers::CanPortSettings::Kind::seqpacket;
    c.can.path = "@" + std::string(300, 'a') + "1";
    const Holder first(c);
    EXPECT_NE(refusal_of(c), "");
    c.can.path.back() = '2';
    c.shaker.port = 503;
    EXPECT_EQ(refusal_of(c), "");
}

}  // namespace
}  // namespace vibrig
