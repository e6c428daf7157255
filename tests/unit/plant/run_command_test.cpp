#include <gtest/gtest.h>

#include <array>
#include <cstdio>
#include <string>

#include "tests/unit/support/temporary_folder.hpp"

namespace vibrig::plant {
namespace {

/// What vibrig-plant run says, with its exit status at the end.
std::string said(const std::string& options) {
    const TemporaryFolder folder;
    const std::string command = VIBRIG_PLANT
                                " run --clock real --duration 0 --modbus "
                                "tcp:127.0.0.1:0 --can seqpacket:" +
                                folder.file("bus.sock") + " " + options + " 2>&1; echo status $?";
    FILE* pipe = popen(command.c_str(), "r");
    if (pipe == nullptr) return "popen failed";
    std::string text;
    std::array<char, 256> part{};
    while (std::fgets(part.data(), part.size(), pipe) != nullptr) text += part.data();
    pclose(pipe);
    return text;
}

TEST(RunCommand, TakesSeveralFaultsEachWithItsOwnOption) {
    const std::string text = said("--fault lose=0.01 --fault stuck:outer@300..301 --fault estop");
    EXPECT_NE(text.find("status 0"), std::string::npos) << text;
    // AND looks at each
    for (const char* options :
         {"--fault nonsense --fault estop", "--fault estop --fault nonsense"}) {
        const std::string wrong = said(options);
        EXPECT_NE(wrong.find("unknown fault \"nonsense\""), std::string::npos) << wrong;
        EXPECT_NE(wrong.find("status 2"), std::string::npos) << wrong;
    }
    // AND a second word is no fault
    EXPECT_NE(said("--fault estop loop-open").find("status 2"), std::string::npos);
}

TEST(RunCommand, ExplainsEveryFault) {
    const std::string text = said("--help");
    for (const char* name : {"ack-without-stop", "timeout-ignored", "timeout-scaled",
                             "amplitude-scaled", "readback-echo", "stuck-contactor", "slow-ramp",
                             "unit-rms", "dead-table", "timeout-register", "latched-fault"}) {
        EXPECT_NE(text.find(name), std::string::npos) << name;
    }
}

}  // namespace
}  // namespace vibrig::plant
