#include "tests/plant/foreign_map.hpp"

#include <gtest/gtest.h>
#include <modbus/modbus.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <fstream>
#include <string>
#include <vector>

#include "tests/plant/modbus_server.hpp"
#include "tests/unit/plant/replaced.hpp"
#include "tests/unit/support/temporary_folder.hpp"

namespace vibrig::plant {
namespace {

using Answer = ShakerController::Answer;
using Words = std::vector<std::uint16_t>;

const std::string kForeign = R"(
[shaker.registers]
frequency = { address = 100, type = "f32", word_order = "little", scale = 1 }
amplitude = { address = 60, type = "u32", word_order = "little", scale = 1e-6 }
ramp_time = { address = 70, type = "u16", scale = 0.1 }
run = { address = 72, type = "bits", mask = 2 }
watchdog = { address = 80, type = "u16" }
watchdog_timeout = { address = 90, type = "u16", scale = 1e-3 }
state = { address = 20, type = "u16", table = "input" }
fault = { address = 21, type = "u16", table = "input" }
emergency_stop = { address = 22, type = "bits", table = "input", mask = 8 }
measured_amplitude = { address = 30, type = "f32", word_order = "big", table = "input", scale = 1 }
)";

class ForeignMapTest : public testing::Test {
  protected:
    std::string write_map(const std::string& text) {
        std::ofstream(folder_.file("map.toml")) << text;
        return folder_.file("map.toml");
    }
    /// Why it is no map; empty: it is one.
    std::string complaint(const std::string& text) {
        try {
            static_cast<void>(read_map(write_map(text)));
        } catch (const PlantError& error) {
            return error.what();
        }
        return "";
    }
    Answer write(const proto::Register& reg, double value) {
        Words words(reg.words());
        const auto now = map_.holding(shaker_).subspan(reg.address, reg.words());
        std::ranges::copy(now, words.begin());
        EXPECT_TRUE(proto::encode(reg, value, words));
        return map_.write(shaker_, reg.address, words);
    }
    double value(const proto::Register& reg) {
        const auto image = reg.table == proto::RegisterTable::holding ? map_.holding(shaker_)
                                                                      : map_.input(shaker_);
        return proto::decode(reg, image.subspan(reg.address, reg.words()));
    }
    void run_for(double seconds) {
        for (double t = 0; t < seconds - 1e-9; t += 0.025) shaker_.advance(0.025);
    }

    TemporaryFolder folder_;
    proto::ShakerRegisters at_ = read_map(write_map(kForeign));
    ForeignMap map_{at_};
    ShakerController shaker_{20, 25};
};

TEST_F(ForeignMapTest, TheTableDoesWhatIsCommandedThere) {
    EXPECT_NEAR(value(at_.frequency), 15, 1e-6);
    EXPECT_EQ(write(at_.frequency, 16.5), Answer::accepted);
    EXPECT_EQ(write(at_.amplitude, 9), Answer::accepted);
    EXPECT_EQ(write(at_.ramp_time, 1), Answer::accepted);
    EXPECT_EQ(write(at_.run, 1), Answer::accepted);
    EXPECT_EQ(value(at_.state), 1);
    run_for(1);
    EXPECT_EQ(value(at_.state), 2);
    EXPECT_NEAR(shaker_.amplitude_g(), 9, 1e-9);
    EXPECT_NEAR(shaker_.frequency_hz(), 16.5, 1e-9);
    EXPECT_NEAR(value(at_.measured_amplitude), 9, 1e-6);
    EXPECT_EQ(write(at_.run, 0), Answer::accepted);
    run_for(1);
    EXPECT_EQ(shaker_.amplitude_g(), 0);
}

TEST_F(ForeignMapTest, ReadsBackAsWrittenThoughTheControllerIsCoarser) {
    EXPECT_EQ(write(at_.amplitude, 0.123456), Answer::accepted);
    EXPECT_NEAR(value(at_.amplitude), 0.123456, 1e-9);
    EXPECT_NEAR(shaker_.set_point_g(), 0.1235, 1e-9);
    // BUT not what has become of it by itself
    EXPECT_EQ(write(at_.run, 1), Answer::accepted);
    shaker_.open_emergency_stop(true);
    EXPECT_EQ(value(at_.run), 0);
    EXPECT_EQ(value(at_.emergency_stop), 1);
}

TEST_F(ForeignMapTest, OnlyWhatTheMapHasIsWritten) {
    const Words two{1, 2}, one{1};
    const auto before = shaker_.holding();
    EXPECT_EQ(map_.write(shaker_, 0, one), Answer::illegal_address) << "Vibrig's own frequency";
    EXPECT_EQ(map_.write(shaker_, 72, two), Answer::illegal_address) << "one beyond run";
    EXPECT_EQ(map_.write(shaker_, 5000, one), Answer::illegal_address);
    EXPECT_EQ(write(at_.amplitude, 20.5), Answer::illegal_value) << "beyond its limit";
    EXPECT_EQ(write(at_.frequency, 1e30), Answer::illegal_value) << "no such number of its own";
    EXPECT_EQ(shaker_.holding(), before);
}

TEST_F(ForeignMapTest, AFeedAcknowledgesNoFault) {
    shaker_.open_emergency_stop(true);
    shaker_.open_emergency_stop(false);
    EXPECT_EQ(write(*at_.watchdog, 7), Answer::accepted);
    EXPECT_EQ(value(at_.state), 4);
    EXPECT_EQ(write(at_.run, 0), Answer::accepted);
    EXPECT_EQ(value(at_.state), 0);
}

TEST_F(ForeignMapTest, WhatIsNoMapIsNamed) {
    EXPECT_EQ(complaint(kForeign), "");
    const auto expect = [&](const std::string& from, const std::string& to,
                            const std::string& word) {
        const auto text = complaint(replaced(kForeign, from, to));
        EXPECT_NE(text.find(word), std::string::npos) << text;
    };
    expect("[shaker.registers]", "[shaker]", "shaker.registers: missing");
    expect("fault =", "fault_ =", "shaker.registers.fault: missing");
    expect("state =", "stat = { address = 1, type = \"u16\" }\nstate =",
           "shaker.registers.stat: unknown");
    expect("address = 80,", "", "shaker.registers.watchdog: expected address and type");
    expect("address = 80", "address = 65536", "watchdog.address: expected a whole number");
    expect("\"f32\"", "\"f64\"", "expected one of u16, i16, u32, i32, f32, bits");
    expect("scale = 0.1", "scale = 0", "ramp_time.scale: expected above 0");
    expect("mask = 8", "msk = 8", "emergency_stop.msk: unknown");
    expect("{ address = 80", "[ address = 80", "map.toml: ");
    EXPECT_THROW(static_cast<void>(read_map("/no/such/map.toml")), PlantError);
}

TEST_F(ForeignMapTest, IsServedOverModbus) {
    // GIVEN a rig whose truth names the file
    Truth truth;
    truth.map = write_map(kForeign);
    SharedRig shared(truth);
    ModbusServer server("tcp:127.0.0.1:0", shared);
    modbus_t* client = modbus_new_tcp("127.0.0.1", server.port());
    ASSERT_EQ(modbus_connect(client), 0);
    modbus_set_response_timeout(client, 5, 0);
    // THEN its registers are there
    std::array<std::uint16_t, 2> words{};
    ASSERT_EQ(modbus_read_registers(client, 100, 2, words.data()), 2);
    EXPECT_EQ(words, (std::array<std::uint16_t, 2>{0, 0x4170})) << "15.0, low word first";
    const std::array<std::uint16_t, 2> nine{0x5440, 0x0089};  // 9 000 000
    EXPECT_EQ(modbus_write_registers(client, 60, 2, nine.data()), 2);
    EXPECT_NEAR(shared.rig.shaker().set_point_g(), 9, 1e-9);
    // AND others are refused
    EXPECT_EQ(modbus_write_register(client, 2, 1), -1);
    EXPECT_EQ(errno, EMBXILADD);
    EXPECT_EQ(modbus_read_registers(client, 105, 16, words.data()), -1);
    EXPECT_EQ(errno, EMBXILADD);
    EXPECT_EQ(modbus_read_input_registers(client, 60, 1, words.data()), -1);
    modbus_close(client);
    modbus_free(client);
}

}  // namespace
}  // namespace vibrig::plant
