#include "daemon/app/watchdog.hpp"

#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <cstddef>
#include <cstdlib>
#include <string>

namespace vibrig {
namespace {

/// A service manager's socket, known to this process alone.
class ServiceManagerTest : public testing::Test {
  protected:
    ServiceManagerTest() {
        sockaddr_un address{};
        address.sun_family = AF_UNIX;
        const std::string name = "vibrig-test-notify-" + std::to_string(::getpid());
        name.copy(address.sun_path + 1, sizeof address.sun_path - 2);
        const auto length =
            static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + 1 + name.size());
        EXPECT_EQ(::bind(manager_, reinterpret_cast<const sockaddr*>(&address), length), 0);
        ::setenv("NOTIFY_SOCKET", ("@" + name).c_str(), 1);
    }
    ~ServiceManagerTest() override {
        for (const char* variable : {"NOTIFY_SOCKET", "WATCHDOG_USEC", "WATCHDOG_PID"})
            ::unsetenv(variable);
        ::close(manager_);
    }
    /// What was reported to it; empty: nothing.
    std::string reported() const {
        std::array<char, 512> text{};
        const ssize_t size = ::recv(manager_, text.data(), text.size(), MSG_DONTWAIT);
        return size < 0 ? "" : std::string(text.data(), static_cast<std::size_t>(size));
    }

    int manager_ = ::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
};

TEST_F(ServiceManagerTest, IsReportedInItsOwnWords) {
    const ServiceManager service;
    service.ready("idle");
    EXPECT_EQ(reported(), "READY=1\nSTATUS=idle");
    service.status("recording");
    EXPECT_EQ(reported(), "STATUS=recording");
    service.alive();
    EXPECT_EQ(reported(), "WATCHDOG=1");
    service.reloading();
    EXPECT_EQ(reported().find("RELOADING=1\nMONOTONIC_USEC="), 0U);
    // A ramp of 600 s down is longer than the service manager would wait by itself.
    service.stopping(612.5);
    EXPECT_EQ(reported(), "STOPPING=1\nSTATUS=stopping\nEXTEND_TIMEOUT_USEC=612500000");
}

TEST_F(ServiceManagerTest, IsNotifiedTwiceInTheTimeThatItWaits) {
    EXPECT_EQ(ServiceManager().period_s(), 0) << "it does not wait";
    ::setenv("WATCHDOG_USEC", "3000000", 1);
    EXPECT_EQ(ServiceManager().period_s(), 1.5);
    // For another process
    ::setenv("WATCHDOG_PID", std::to_string(::getppid()).c_str(), 1);
    EXPECT_EQ(ServiceManager().period_s(), 0);
}

/// Whoever takes the signals must not wait for it.
TEST_F(ServiceManagerTest, OneThatHangsHoldsNobodyUp) {
    const ServiceManager service;
    for (int n = 0; n < 10'000; ++n) service.alive();  // more than its socket holds
    EXPECT_EQ(reported(), "WATCHDOG=1");
}

TEST_F(ServiceManagerTest, WithoutOneNothingHappens) {
    ::unsetenv("NOTIFY_SOCKET");
    const ServiceManager service;
    service.ready("idle");
    ::setenv("NOTIFY_SOCKET", "relative", 1);
    service.ready("idle");
    ::setenv("NOTIFY_SOCKET", ("/" + std::string(200, 'x')).c_str(), 1);
    service.ready("idle");
    EXPECT_EQ(reported(), "");
}

}  // namespace
}  // namespace vibrig
