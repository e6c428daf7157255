#include "drivers/can/can_port.hpp"

#include <gtest/gtest.h>

#include <boost/asio/io_context.hpp>
#include <string>

namespace vibrig::test {
namespace {

TEST(CanPortSettingsCheck, RefusesNamesThatCannotBe) {
    boost::asio::io_context io;
    drivers::CanPortSettings settings;
    settings.kind = drivers::CanPortSettings::Kind::seqpacket;
    for (const std::string& path :
         {std::string(), std::string("bus"), std::string("@"),
          std::string("/") + std::string(200, 'x'), std::string("/a\0b", 4)}) {
        settings.path = path;
        EXPECT_THROW(static_cast<void>(drivers::make_can_port(io, settings)), drivers::CanError)
            << path;
    }
    settings.kind = drivers::CanPortSettings::Kind::socketcan;
    for (const char* name : {"", "a name", "can0/1", "averyveryverylongname", ".."}) {
        settings.interface = name;
        EXPECT_THROW(static_cast<void>(drivers::make_can_port(io, settings)), drivers::CanError)
            << name;
    }
}

TEST(CanPortSettingsCheck, NamesAnInterfaceThatIsNoCan) {
    // GIVEN the loopback interface, or a kernel without CAN
    boost::asio::io_context io;
    drivers::CanPortSettings settings;
    settings.interface = "lo";
    const auto port = drivers::make_can_port(io, settings);
    try {
        port->start(nullptr, nullptr, nullptr);
        FAIL() << "started on lo";
    } catch (const drivers::CanError& error) {
        EXPECT_TRUE(std::string(error.what()).starts_with("lo: ")) << error.what();
    }
}

}  // namespace
}  // namespace vibrig::test
