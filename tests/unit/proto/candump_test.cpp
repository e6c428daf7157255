#include "proto/candump.hpp"
#include "tests/unit/support/temporary_folder.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <random>

namespace vibrig::proto {
namespace {

std::string error_in_line(std::string_view line) {
    try {
        (void)parse_candump_line(line);
    } catch (const CandumpError& failure) {
        return failure.what();
    }
    return "no error";
}

TEST(Candump, ReadsAndWritesTheLinesOfCanUtils) {
    for (const std::string line :
         {"(1436509052.249713) vcan0 123#1122334455667788", "(1436509052.249713) can0 1F334455#",
          "(0000000000.000001) can0 7FF#R", "(0000000012.000000) can0 123#R8",
          "(1436509053.000000) vcan0 123##1AABB", "(1436509053.000000) vcan0 00000123##0",
          "(1436509053.850870) vcan0 20000004#0004000000000000"}) {
        EXPECT_EQ(candump_line(parse_candump_line(line)), line);
    }
}

TEST(Candump, GivesTheFramesParts) {
    const LoggedFrame frame =
        parse_candump_line("(12.5) vcan0 1ABCDEF0##3" + std::string(24, 'f') + " T");
    EXPECT_EQ(frame.time_ns, 12'500'000'000);
    EXPECT_EQ(frame.interface, "vcan0");
    EXPECT_EQ(frame.id, 0x1abcdef0U);
    EXPECT_TRUE(frame.extended);
    EXPECT_TRUE(frame.fd);
    EXPECT_EQ(frame.fd_flags, 3);
    EXPECT_EQ(frame.size, 12);
    EXPECT_EQ(frame.data[11], 0xff);
    EXPECT_EQ(parse_candump_line("(0.000025) c 123#1122334455667788_F").size, 8);
    EXPECT_TRUE(parse_candump_line("(0.0) c 20000040#0000000000000000").error);
    EXPECT_FALSE(parse_candump_line("(0.0) c 00000001#").error);
    EXPECT_TRUE(parse_candump_line("(0.0) c 00000001#").extended);
}

TEST(Candump, GivesBackWhatItWrote) {
    const unsigned seed = 8;
    SCOPED_TRACE(testing::Message() << "seed " << seed);
    std::mt19937_64 random(seed);
    for (int i = 0; i < 2000; ++i) {
        LoggedFrame frame;
        frame.time_ns = static_cast<std::int64_t>(random() % 2'000'000'000'000'000) * 1000;
        frame.interface = "can" + std::to_string(random() % 10);
        frame.fd = random() % 2 == 0;
        frame.extended = random() % 2 == 0;
        frame.error = frame.extended && random() % 4 == 0;
        if (frame.error) frame.extended = false;
        frame.id = static_cast<std::uint32_t>(
            random() % (frame.extended || frame.error ? 0x20000000U : 0x800U));
        frame.remote = !frame.fd && random() % 4 == 0;
        if (frame.fd) frame.fd_flags = static_cast<std::uint8_t>(random() % 4);
        frame.size = static_cast<std::uint8_t>(frame.fd && random() % 2 == 0 ? 64 : random() % 9);
        for (std::size_t k = 0; k < frame.size && !frame.remote; ++k)
            frame.data.at(k) = static_cast<std::uint8_t>(random());
        ASSERT_EQ(parse_candump_line(candump_line(frame)), frame) << candump_line(frame);
    }
}

TEST(Candump, SaysWhatIsWrongWithALine) {
    EXPECT_EQ(error_in_line(""), "found '', expected a time such as (1700000000.123456)");
    EXPECT_EQ(error_in_line("1.5 can0 123#"),
              "found '1.5', expected a time such as (1700000000.123456)");
    EXPECT_EQ(error_in_line("(x.5) can0 123#"),
              "found '(x.5)', expected a time such as (1700000000.123456)");
    EXPECT_EQ(error_in_line("(5) can0 123#"),
              "found '(5)', expected a time such as (1700000000.123456)");
    EXPECT_EQ(error_in_line("("), "found '(', expected a time such as (1700000000.123456)");
    EXPECT_EQ(error_in_line("(99999999999999.0) can0 123#"),
              "found '(99999999999999.0)', expected a time such as (1700000000.123456)");
    EXPECT_EQ(error_in_line("(1.5)"),
              "found '', expected an interface's name of at most 15 letters");
    EXPECT_EQ(error_in_line("(1.5) can0"),
              "found '', expected a frame such as 123#1122 or 123##1AABB");
    const std::string id =
        "', expected an identifier of 3 hexadecimal digits (to 7FF) or 8 (to 1FFFFFFF)";
    EXPECT_EQ(error_in_line("(1.5) can0 12#"), "found '12" + id);
    EXPECT_EQ(error_in_line("(1.5) can0 800#"), "found '800" + id);
    EXPECT_EQ(error_in_line("(1.5) can0 40000000#"), "found '40000000" + id);
    EXPECT_EQ(error_in_line("(1.5) can0 -12#"), "found '-12" + id);
    EXPECT_EQ(error_in_line("(1.5) can0 123#1"),
              "found '1', expected data as pairs of hexadecimal digits");
    EXPECT_EQ(error_in_line("(1.5) can0 123#1g"),
              "found '1g', expected data as pairs of hexadecimal digits");
    EXPECT_EQ(error_in_line("(1.5) can0 123#-1"),
              "found '-1', expected data as pairs of hexadecimal digits");
    EXPECT_EQ(error_in_line("(1.5) can0 123#112233445566778899"),
              "found '112233445566778899', expected at most 8 bytes");
    EXPECT_EQ(error_in_line("(1.5) can0 123##0112233445566778899"),
              "found '112233445566778899', expected 0 to 8, 12, 16, 20, 24, 32, 48 or 64 bytes");
    EXPECT_EQ(error_in_line("(1.5) can0 123##"),
              "found '123##', expected a digit of CAN FD flags after ##");
    EXPECT_EQ(error_in_line("(1.5) can0 123#R9"),
              "found '123#R9', expected R and a length of at most 8");
    EXPECT_EQ(error_in_line("(1.5) can0 123#11 X"),
              "found 'X', expected the line's end, or R or T before it");
    EXPECT_EQ(error_in_line("(1.5) can0 123#11 R 5"),
              "found '5', expected the line's end, or R or T before it");
}

TEST(Candump, WritesNoFrameThatABusCannotCarry) {
    LoggedFrame sound;
    sound.interface = "can0";
    EXPECT_EQ(candump_line(sound), "(0000000000.000000) can0 000#");
    for (int fault = 0; fault < 7; ++fault) {
        LoggedFrame frame = sound;
        if (fault == 0) frame.id = 0x800;
        if (fault == 1) frame.size = 9;
        if (fault == 2) frame.interface = "can 0";
        if (fault == 3) frame.interface.clear();
        if (fault == 4) frame.time_ns = -1;
        if (fault == 5) frame.fd = frame.remote = true;
        if (fault == 6) frame.fd_flags = 16;
        EXPECT_THROW((void)candump_line(frame), CandumpError) << fault;
    }
}

TEST(Candump, IsReadFromAFileWithTheLineInItsErrors) {
    const TemporaryFolder folder;
    const std::string path = (folder / "candump.log").string();
    std::ofstream(path) << "(1.000000) can0 123#11\r\n\n(2.000000) can0 124#22\n(3.0) can0 zzz\n";
    CandumpReader reader(path);
    EXPECT_EQ(reader.next()->id, 0x123U);
    EXPECT_EQ(reader.next()->id, 0x124U);
    try {
        (void)reader.next();
        FAIL() << "no error";
    } catch (const CandumpError& failure) {
        EXPECT_EQ(failure.what(),
                  path + ":4: found 'zzz', expected a frame such as 123#1122 or 123##1AABB");
    }
    EXPECT_FALSE(reader.next().has_value());
    EXPECT_THROW(CandumpReader(path + ".none"), CandumpError);
}

}  // namespace
}  // namespace vibrig::proto
