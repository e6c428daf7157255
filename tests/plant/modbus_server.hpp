#pragma once

#include <memory>
#include <string>
#include <thread>

#include "tests/plant/foreign_map.hpp"
#include "tests/plant/shared_rig.hpp"

namespace vibrig::plant {

/// The shaker's Modbus server on a thread of its own: TCP with several connections, or RTU on a
/// serial device.
class ModbusServer {
  public:
    /// "tcp:HOST:PORT" (port 0: any free one) or "rtu:DEVICE" (19200 baud, 8E1, unit 1). The rig's
    /// truth may have a foreign map. Throws PlantError.
    ModbusServer(const std::string& address, SharedRig& rig);
    ~ModbusServer();
    ModbusServer(const ModbusServer&) = delete;
    ModbusServer& operator=(const ModbusServer&) = delete;

    [[nodiscard]] int port() const noexcept { return port_; }  ///< 0: RTU
    [[nodiscard]] const std::string& address() const noexcept { return address_; }

  private:
    struct Link;
    struct Outcome;
    [[nodiscard]] Outcome apply(const std::uint8_t* pdu, std::size_t length);
    void serve_tcp();
    void tell_linked(bool linked);
    void serve_rtu();
    /// One request of the current socket; false when the connection is over.
    bool answer();
    [[nodiscard]] int reply_other(const std::uint8_t* query, std::size_t header);

    std::string address_;
    SharedRig& rig_;
    std::unique_ptr<ForeignMap> foreign_;  ///< none: Vibrig's own
    std::unique_ptr<Link> link_;
    int listener_ = -1;
    int stop_event_ = -1;
    int port_ = 0;
    std::thread thread_;
};

}  // namespace vibrig::plant
