#include "daemon/guard/modbus_tcp.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <string>
#include <vector>

#include "tests/unit/support/host_names.hpp"
#include "tests/unit/support/mute_host.hpp"

namespace vibrig::guard {
namespace {

using std::chrono::steady_clock;
using Takes = MuteHost::Takes;

TEST(ModbusTcp, GoesThroughAllAddressesOfAName) {
    const MuteHost last("127.0.0.1");
    const HostName name("controller.test", {"127.0.0.3", "127.0.0.2", "127.0.0.1"});
    ModbusTcp line("controller.test", last.port(), 1);
    EXPECT_TRUE(line.connect()) << line.note();
    EXPECT_TRUE(last.called());
}

TEST(ModbusTcp, GoesToTheAddressFirstThatAnsweredLast) {
    const MuteHost last("127.0.0.1");
    const HostName name("controller.test", {"127.0.0.2", "127.0.0.1"});
    ModbusTcp line("controller.test", last.port(), 1);
    ASSERT_TRUE(line.connect()) << line.note();
    line.is_well();
    // WHEN somebody is at the other one, too, and the connection is lost
    const MuteHost first("127.0.0.2", last.port());
    line.lose("reset");
    // THEN it is not his
    ASSERT_TRUE(line.connect()) << line.note();
    EXPECT_FALSE(first.called());
    // AND where nothing has answered since then, the order is that of before
    line.lose("mute");
    ASSERT_TRUE(line.connect()) << line.note();
    EXPECT_FALSE(first.called());
}

TEST(ModbusTcp, AnAddressThatHasAnsweredNothingIsNotPreferred) {
    const MuteHost last("127.0.0.1");
    const HostName name("controller.test", {"127.0.0.2", "127.0.0.1"});
    ModbusTcp line("controller.test", last.port(), 1);
    ASSERT_TRUE(line.connect()) << line.note();
    const MuteHost first("127.0.0.2", last.port());
    line.lose("mute");
    ASSERT_TRUE(line.connect()) << line.note();
    EXPECT_TRUE(first.called());
}

TEST(ModbusTcp, OneThatSwallowsWhatComesLeavesTheOthersTheirTime) {
    const MuteHost last("127.0.0.1");
    const MuteHost first("127.0.0.2", last.port(), Takes::nothing);
    const HostName name("controller.test", {"127.0.0.2", "127.0.0.1"});
    ModbusTcp line("controller.test", last.port(), 1, 2000);
    EXPECT_TRUE(line.connect()) << line.note();
    EXPECT_TRUE(last.called());
}

TEST(ModbusTcp, AllAddressesTogetherTakeTheTimeOfOne) {
    // GIVEN a name that would take 10 s if each of its addresses did
    const MuteHost mute("127.0.0.1", 0, Takes::nothing);
    const HostName name("controller.test", std::vector<std::string>(10, "127.0.0.1"));
    ModbusTcp line("controller.test", mute.port(), 1, 1000);
    const auto begun = steady_clock::now();
    EXPECT_FALSE(line.connect());
    EXPECT_LT(steady_clock::now() - begun, std::chrono::seconds(5));
    EXPECT_NE(line.note().find("timed out"), std::string::npos) << line.note();
}

}  // namespace
}  // namespace vibrig::guard
