#pragma once

#include <memory>
#include <string>

#include "daemon/guard/judge.hpp"
#include "daemon/guard/settings.hpp"

struct _modbus;
struct addrinfo;

namespace vibrig::guard {

/// The guard's own connection to the shaker's controller: reads run and measured amplitude, and
/// writes run = 0. It starts nothing and never feeds the watchdog. Each request blocks half a
/// second at most, a connection attempt as long.
class ShakerLine {
  public:
    /// Throws std::runtime_error for a host that cannot be resolved (now): later no look-up stands
    /// between a stop and the shaker.
    explicit ShakerLine(const ShakerLineSettings& settings);
    ~ShakerLine();
    ShakerLine(const ShakerLine&) = delete;
    ShakerLine& operator=(const ShakerLine&) = delete;

    /// Does what is due: connects, stops, reads.
    void step(drivers::Time now, bool stop);
    [[nodiscard]] ShakerWord word(drivers::Time now) const;
    /// Why there is no connection or no answer; empty: all is well.
    [[nodiscard]] const std::string& note() const noexcept { return note_; }
    [[nodiscard]] std::uint64_t stops_written() const noexcept { return stops_; }

  private:
    struct FreeModbus {
        void operator()(_modbus* context) const noexcept;
    };
    struct FreeAddresses {
        void operator()(addrinfo* addresses) const noexcept;
    };
    [[nodiscard]] bool connect();
    void close() noexcept;
    [[nodiscard]] bool read(const proto::Register& reg, double& value);
    [[nodiscard]] bool write_stop();
    bool lose(const std::string& what);

    ShakerLineSettings settings_;
    std::string name_;
    std::unique_ptr<_modbus, FreeModbus> context_;
    std::unique_ptr<addrinfo, FreeAddresses> addresses_;
    bool connected_ = false;
    drivers::Time due_ = 0;   ///< next attempt or poll
    drivers::Time read_ = 0;  ///< when word_ was; 0: never
    ShakerWord word_;
    std::string note_ = "not connected yet";
    std::uint64_t stops_ = 0;
    bool stopping_ = false;
};

}  // namespace vibrig::guard
