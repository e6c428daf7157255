#include "drivers/shaker/modbus_link.hpp"

#include <gtest/gtest.h>

#include <array>
#include <optional>

#include "test_bench.hpp"
#include "tests/unit/support/host_names.hpp"
#include "tests/unit/support/mute_host.hpp"

namespace vibrig::drivers::test {
namespace {

/// A name with two addresses, of which the server has the second.
class LinkToAName : public testing::Test {
  protected:
    LinkToAName() : link_(settings()) {}
    [[nodiscard]] bool connects() {
        std::string why;
        const bool open = link_.connect(why) == ModbusLink::Connection::open;
        EXPECT_TRUE(open) << why;
        return open;
    }
    [[nodiscard]] ReplyKind asks() {
        std::array<std::uint16_t, 1> words{};
        return link_.read(proto::RegisterTable::holding, kRun, words).kind;
    }
    [[nodiscard]] ShakerSettings settings() const {
        ShakerSettings settings = settings_for(*server_);
        settings.host = "shaker.test";
        return settings;
    }

    std::optional<TestServer> server_{std::in_place};
    const int port_ = server_->port();
    const HostName name_{"shaker.test", {"127.0.0.2", "127.0.0.1"}};
    ModbusLink link_;
};

TEST_F(LinkToAName, GoesToTheAddressFirstThatAnsweredLast) {
    ASSERT_TRUE(connects());
    ASSERT_EQ(asks(), ReplyKind::ok);
    const MuteHost first("127.0.0.2", port_);
    ASSERT_TRUE(connects());
    EXPECT_EQ(asks(), ReplyKind::ok);
    EXPECT_FALSE(first.called());
}

TEST_F(LinkToAName, GoesToTheOthersWhereThatOneIsGoneAndComesBackToIt) {
    // GIVEN a server that goes away, and another address where somebody takes connections
    ASSERT_TRUE(connects());
    ASSERT_EQ(asks(), ReplyKind::ok);
    server_.reset();
    const MuteHost first("127.0.0.2", port_);
    ASSERT_TRUE(connects());
    EXPECT_TRUE(first.called());
    // WHEN he answers nothing, and the server is there again
    link_.respond_within(100 * kMillisecond);
    EXPECT_EQ(asks(), ReplyKind::timeout);
    link_.respond_within(5 * kSecond);
    server_.emplace(TestServer::Line::tcp, port_);
    // THEN a connection alone has not made him the better one
    ASSERT_TRUE(connects());
    EXPECT_EQ(asks(), ReplyKind::ok);
}

}  // namespace
}  // namespace vibrig::drivers::test
