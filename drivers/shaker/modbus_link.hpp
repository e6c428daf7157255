#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "drivers/shaker/shaker.hpp"

struct _modbus;
struct addrinfo;

namespace vibrig::drivers {

/// How a request ended. After timeout, wrong or lost the link is of no use any more and must be
/// closed: a reply that comes late would otherwise be taken for the next one.
enum class ReplyKind : std::uint8_t {
    ok,
    exception,  ///< the device answered with an exception, 1 to 6; the link stays
    timeout,    ///< no complete reply within the response timeout
    wrong,      ///< transaction, unit, function, length or checksum of another request
    lost,       ///< connection reset, closed or cut off
    overtaken,  ///< not sent: something more urgent came first
};

struct Reply {
    ReplyKind kind = ReplyKind::ok;
    int code = 0;  ///< exception: its number; else errno
    [[nodiscard]] bool ok() const noexcept { return kind == ReplyKind::ok; }
    [[nodiscard]] std::string text() const;
};

/// One Modbus connection, TCP or RTU, with deadlines of its own. Used by one thread; only cut() and
/// abort() are for others. Blocks at most one response timeout per request (wall time), and twice
/// that per address to connect.
class ModbusLink {
  public:
    /// Throws ShakerError for settings that cannot work.
    explicit ModbusLink(const ShakerSettings& settings);
    ~ModbusLink();
    ModbusLink(const ModbusLink&) = delete;
    ModbusLink& operator=(const ModbusLink&) = delete;

    enum class Connection : std::uint8_t { open, failed, out_of_descriptors };
    /// One attempt at each address of the name, the one that answered last first; `why` gets one
    /// line when it fails.
    [[nodiscard]] Connection connect(std::string& why);
    void close() noexcept;
    [[nodiscard]] bool connected() const noexcept { return connected_; }

    [[nodiscard]] Reply read(proto::RegisterTable table, std::uint16_t address,
                             std::span<std::uint16_t> words) noexcept;
    /// One word is written with function 6, more with function 16.
    [[nodiscard]] Reply write(std::uint16_t address, std::span<const std::uint16_t> words) noexcept;

    /// What the device calls itself by function 17; `text`: its printable part, at most 200
    /// characters. Many a device does not know the function: exception or timeout.
    [[nodiscard]] Reply identify(std::string& text) noexcept;

    /// One coil; write uses function 5.
    [[nodiscard]] Reply read_coil(std::uint16_t address, bool& on) noexcept;
    [[nodiscard]] Reply write_coil(std::uint16_t address, bool on) noexcept;

    /// Response timeout from the next request on.
    void respond_within(Time timeout) noexcept;

    /// Ends a TCP request in flight, which then returns lost. Any thread; never blocks. On a serial
    /// line nothing may be sent while a device may still be answering, so there it does nothing:
    /// the response timeout ends the request.
    void cut() noexcept;
    /// cut(), and no connection succeeds from now on. Any thread.
    void abort() noexcept;

    /// "127.0.0.1:502" or "/dev/ttyS0"
    [[nodiscard]] const std::string& name() const noexcept { return name_; }

  private:
    struct FreeModbus {
        void operator()(_modbus* context) const noexcept;
    };
    struct FreeAddresses {
        void operator()(addrinfo* addresses) const noexcept;
    };
    [[nodiscard]] Connection connect_tcp(std::string& why);
    [[nodiscard]] Connection connect_address(const addrinfo& address, std::string& why);
    [[nodiscard]] Connection connect_rtu(std::string& why);
    void arm_cutter(int socket) noexcept;
    [[nodiscard]] Reply hindered() noexcept;
    [[nodiscard]] Reply reply_of(int result, int expected, int error) noexcept;

    ShakerSettings settings_;
    std::string name_;
    std::unique_ptr<_modbus, FreeModbus> context_;
    std::unique_ptr<addrinfo, FreeAddresses>
        addresses_;  ///< kept while they work: a name server may be gone
    // Of those: a peer that takes connections and answers nothing is not preferred.
    const addrinfo* address_ = nullptr;   ///< of the newest connection
    const addrinfo* answered_ = nullptr;  ///< whose peer answered last
    // cut() shuts down whatever this number refers to: dup3() makes it the present socket or, while
    // there is none, something inert. The number itself lives as long as the link, so it can never
    // hit a foreign descriptor.
    int cutter_ = -1;
    int inert_ = -1;
    bool connected_ = false;
    std::atomic<bool> aborted_{false};
};

}  // namespace vibrig::drivers
