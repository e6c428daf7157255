#include <gtest/gtest.h>

#include <array>
#include <cstdio>
#include <filesystem>
#include <string>

#include "tests/unit/support/temporary_folder.hpp"

namespace vibrig::plant {
namespace {

/// What vibrig-plant says, with its exit status at the end.
std::string output_of(const std::string& arguments) {
    const std::string command =
        "timeout 20 " VIBRIG_PLANT " " + arguments + " 2>&1; echo status $?";
    FILE* pipe = popen(command.c_str(), "r");
    if (pipe == nullptr) return "popen failed";
    std::string text;
    std::array<char, 256> part{};
    while (std::fgets(part.data(), part.size(), pipe) != nullptr) text += part.data();
    pclose(pipe);
    return text;
}

std::string said(const std::string& options) {
    const TemporaryFolder folder;
    const bool clock = options.find("--clock") != std::string::npos;
    return output_of(std::string("run ") + (clock ? "" : "--clock real") +
                     " --duration 0 --modbus tcp:127.0.0.1:0 --can seqpacket:" +
                     folder.file("bus.sock") + " " + options);
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

TEST(RunCommand, NamesPlaceValueAndExpectation) {
    const TemporaryFolder folder;
    const auto expect = [](const std::string& options, const std::string& words) {
        const std::string text = said(options);
        EXPECT_NE(text.find(words), std::string::npos) << text;
        EXPECT_NE(text.find("status 2"), std::string::npos) << text;
    };
    expect("--truth " + folder.string(),
           folder.string() + ": cannot be read: Is a directory, expected a truth file (JSON)");
    for (const char* speed : {"0", "1e-9", "nan", "0x10", "fast"})
        expect(std::string("--clock rig --speed ") + speed,
               std::string("--speed: found \"") + speed +
                   "\", expected max or a factor from 0.001 to 1e6");
    // AND leaves nothing behind
    const std::string ready = folder.file("ready");
    std::filesystem::create_directory(ready);
    expect("--ready-file " + ready, ready + ": cannot be written: Is a directory");
    EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.string()), {}), 1);
}

TEST(RunCommand, OfAnotherWordIsToldThatItIsNoCommand) {
    const std::string text = output_of("foo");
    EXPECT_NE(text.find("found \"foo\", expected a command; vibrig-plant --help lists them"),
              std::string::npos)
        << text;
}

TEST(RecordCommand, NamesPlaceValueAndExpectation) {
    const TemporaryFolder folder;
    const auto expect = [](const std::string& options, const std::string& words) {
        const std::string text = output_of("record --dwell 1 " + options);
        EXPECT_NE(text.find(words), std::string::npos) << text;
        EXPECT_NE(text.find("status 2"), std::string::npos) << text;
    };
    expect("-o /dev/full", "/dev/full: cannot be written: No space left on device");
    expect("-o " + folder.string(), folder.string() + ": cannot be written: Is a directory");
    expect("-o - --profile -1", "--profile: Value -1 not in range 0 to 65535");
    expect("-o - --positions " + folder.string(),
           folder.string() + ": cannot be read: Is a directory, expected \"table1\" or a CSV file");
    const std::string text = output_of("judge " + folder.string());
    EXPECT_NE(text.find(folder.string() + ": cannot be read: Is a directory, expected an"),
              std::string::npos)
        << text;
}

TEST(RunCommand, ExplainsEveryFault) {
    const std::string text = said("--help");
    EXPECT_NE(text.find("go, speed F, speed max, status, help"), std::string::npos);
    for (const char* name : {"ack-without-stop", "timeout-ignored", "timeout-scaled",
                             "amplitude-scaled", "readback-echo", "stuck-contactor", "slow-ramp",
                             "unit-rms", "dead-table", "timeout-register", "latched-fault"}) {
        EXPECT_NE(text.find(name), std::string::npos) << name;
    }
}

}  // namespace
}  // namespace vibrig::plant
