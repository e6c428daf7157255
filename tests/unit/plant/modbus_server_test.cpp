#include "tests/plant/modbus_server.hpp"

#include <gtest/gtest.h>
#include <modbus/modbus.h>

#include <array>
#include <cerrno>
#include <memory>

namespace vibrig::plant {
namespace {

struct Free {
    void operator()(modbus_t* context) const {
        modbus_close(context);
        modbus_free(context);
    }
};
using Client = std::unique_ptr<modbus_t, Free>;

class ModbusServerTest : public testing::Test {
  protected:
    [[nodiscard]] Client connect() const {
        Client client(modbus_new_tcp("127.0.0.1", server_.port()));
        EXPECT_EQ(modbus_connect(client.get()), 0) << modbus_strerror(errno);
        modbus_set_response_timeout(client.get(), 5, 0);
        return client;
    }
    [[nodiscard]] std::array<std::uint16_t, 5> input(modbus_t* client) const {
        std::array<std::uint16_t, 5> words{};
        EXPECT_EQ(modbus_read_input_registers(client, 0, 5, words.data()), 5)
            << modbus_strerror(errno);
        return words;
    }
    void run_for(double seconds) {
        const std::scoped_lock lock(shared_.mutex);
        for (double t = 0; t < seconds - 1e-9; t += 0.025) shared_.rig.advance();
    }
    void inject(const char* spec) {
        const std::scoped_lock lock(shared_.mutex);
        shared_.faults.add(parse_fault(spec, shared_.now_s()));
    }

    SharedRig shared_{Truth{}};
    ModbusServer server_{"tcp:127.0.0.1:0", shared_};
};

TEST_F(ModbusServerTest, StartsAndStopsTheShaker) {
    // GIVEN a client that sets 9 g and a ramp of 1 s
    const Client client = connect();
    const std::array<std::uint16_t, 3> set{1, 24464, 100};
    ASSERT_EQ(modbus_write_registers(client.get(), 2, 3, set.data()), 3);
    ASSERT_EQ(modbus_write_register(client.get(), 5, 1), 1);
    EXPECT_EQ(input(client.get())[0], 1);
    // WHEN simulated time goes on THEN it runs at 9 g
    run_for(1);
    EXPECT_EQ(input(client.get()), (std::array<std::uint16_t, 5>{2, 0, 0, 1, 24464}));
    ASSERT_EQ(modbus_write_register(client.get(), 5, 0), 1);
    EXPECT_EQ(input(client.get())[0], 3);
    run_for(1);
    EXPECT_EQ(input(client.get())[0], 0);
    std::array<std::uint16_t, 8> holding{};
    ASSERT_EQ(modbus_read_registers(client.get(), 0, 8, holding.data()), 8);
    EXPECT_EQ(holding, (std::array<std::uint16_t, 8>{0, 15000, 1, 24464, 100, 0, 0, 0}));
}

TEST_F(ModbusServerTest, AnswersIllegalRequestsWithExceptions) {
    const Client client = connect();
    ASSERT_EQ(modbus_write_register(client.get(), 3, 100), 1);
    ASSERT_EQ(modbus_write_register(client.get(), 5, 1), 1);
    run_for(0.1);
    const std::array<std::uint16_t, 2> frequency{0, 20000};
    EXPECT_EQ(modbus_write_registers(client.get(), 0, 2, frequency.data()), -1);
    EXPECT_EQ(errno, EMBXILVAL);
    EXPECT_EQ(modbus_write_register(client.get(), 16, 1), -1);
    EXPECT_EQ(errno, EMBXILADD);
    std::array<std::uint16_t, 17> words{};
    EXPECT_EQ(modbus_read_registers(client.get(), 0, 17, words.data()), -1);
    EXPECT_EQ(errno, EMBXILADD);
    EXPECT_EQ(input(client.get())[0], 1);
}

TEST_F(ModbusServerTest, ServesSeveralClientsAndSurvivesOneThatGoes) {
    Client a = connect();
    const Client b = connect();
    EXPECT_EQ(modbus_write_register(a.get(), 6, 77), 1);
    a.reset();
    std::uint16_t feed = 0;
    EXPECT_EQ(modbus_read_registers(b.get(), 6, 1, &feed), 1);
    EXPECT_EQ(feed, 77);
}

TEST_F(ModbusServerTest, WritesByMaskAndWriteAndReadGoThroughTheSameChecks) {
    const Client client = connect();
    EXPECT_EQ(modbus_mask_write_register(client.get(), 6, 0xff00, 0x0012), 1);
    const std::array<std::uint16_t, 1> ramp{300};
    std::array<std::uint16_t, 3> back{};
    EXPECT_EQ(modbus_write_and_read_registers(client.get(), 4, 1, ramp.data(), 4, 3, back.data()),
              3);
    EXPECT_EQ(back, (std::array<std::uint16_t, 3>{300, 0, 0x12}));
    const std::array<std::uint16_t, 1> run{2};
    EXPECT_EQ(modbus_write_and_read_registers(client.get(), 5, 1, run.data(), 4, 3, back.data()),
              -1);
    EXPECT_EQ(errno, EMBXILVAL);
}

TEST_F(ModbusServerTest, FallsSilentOrAnswersWronglyOnCommand) {
    const Client client = connect();
    inject("modbus-wrong=exception");
    std::uint16_t word = 0;
    EXPECT_EQ(modbus_read_input_registers(client.get(), 0, 1, &word), -1);
    EXPECT_EQ(errno, EMBXSFAIL);
    {
        const std::scoped_lock lock(shared_.mutex);
        shared_.faults.clear();
    }
    inject("modbus-wrong=value");
    EXPECT_EQ(modbus_read_input_registers(client.get(), 0, 1, &word), 1);
    EXPECT_NE(word, 0);
    {
        const std::scoped_lock lock(shared_.mutex);
        shared_.faults.clear();
    }
    inject("modbus-silent");
    modbus_set_response_timeout(client.get(), 0, 100'000);
    EXPECT_EQ(modbus_read_input_registers(client.get(), 0, 1, &word), -1);
    EXPECT_EQ(errno, ETIMEDOUT);
}

TEST(ModbusServer, NamesABadAddress) {
    SharedRig shared{Truth{}};
    for (const char* address :
         {"", "tcp", "tcp:", "tcp:127.0.0.1", "tcp:127.0.0.1:x", "tcp:127.0.0.1:70000",
          "tcp:localhost:1502", "rtu:", "rtu:/no/such/device", "udp:1.2.3.4:5"}) {
        EXPECT_THROW(ModbusServer(address, shared), PlantError) << address;
    }
}

}  // namespace
}  // namespace vibrig::plant
