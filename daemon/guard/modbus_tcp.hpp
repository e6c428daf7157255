#pragma once

#include <memory>
#include <string>
#include <vector>

struct _modbus;
struct addrinfo;

namespace vibrig::guard {

/// The guard's own connection to a Modbus/TCP device, with deadlines: connecting and each request
/// wait half a second at most, unless another time is stated. One thread.
class ModbusTcp {
  public:
    /// Throws SettingsError for what libmodbus refuses.
    ModbusTcp(std::string host, int port, int unit, int wait_ms = 500);
    ~ModbusTcp();
    ModbusTcp(const ModbusTcp&) = delete;
    ModbusTcp& operator=(const ModbusTcp&) = delete;

    /// Looks the host up, once; that may take long. False: note() says why.
    [[nodiscard]] bool resolve();
    /// Looks up what has not been looked up. All addresses of the name are tried, the one that
    /// answered last first; they share the time of one.
    [[nodiscard]] bool connect();
    /// What the kernel has not sent yet is forgotten: an order that comes late is none.
    void close() noexcept;
    /// Closes, since a late answer could be taken for the next one's. False.
    bool lose(const std::string& what);
    /// Limit of one request, from now on.
    void wait_for_ms(int time) noexcept;
    void wait_as_ever() noexcept { wait_for_ms(wait_ms_); }

    [[nodiscard]] bool connected() const noexcept { return connected_; }
    [[nodiscard]] _modbus* get() const noexcept { return context_.get(); }
    [[nodiscard]] const std::string& name() const noexcept { return name_; }
    /// Why there is no connection or no answer; empty: all is well.
    [[nodiscard]] const std::string& note() const noexcept { return note_; }
    /// It answers as it should.
    void is_well();

  private:
    struct FreeModbus {
        void operator()(_modbus* context) const noexcept;
    };
    struct FreeAddresses {
        void operator()(addrinfo* addresses) const noexcept;
    };
    [[nodiscard]] std::vector<const addrinfo*> in_turn() const;

    std::string host_;
    int port_, wait_ms_;
    std::string name_;
    std::unique_ptr<_modbus, FreeModbus> context_;
    std::unique_ptr<addrinfo, FreeAddresses> addresses_;
    // Of those: a peer that takes connections and answers nothing is not preferred.
    const addrinfo* address_ = nullptr;   ///< of the newest connection
    const addrinfo* answered_ = nullptr;  ///< whose peer answered last
    bool connected_ = false;
    std::string note_ = "not connected yet";
};

}  // namespace vibrig::guard
