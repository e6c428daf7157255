#pragma once

#include <cstdint>
#include <string>

#include "daemon/guard/judge.hpp"
#include "daemon/guard/modbus_tcp.hpp"
#include "daemon/guard/settings.hpp"

namespace vibrig::guard {

/// The guard's own connection to the shaker's controller: reads run and measured amplitude, and
/// writes run = 0 with a ramp of 0, as fast as the controller's own soft stop. It starts nothing
/// and never feeds the watchdog. Each request blocks half a second at most, a connection attempt as
/// long; what the ramp may cost is 100 ms.
class ShakerLine {
  public:
    /// Throws std::runtime_error for a host that cannot be resolved (now): later no look-up stands
    /// between a stop and the shaker.
    explicit ShakerLine(const ShakerLineSettings& settings);

    /// Does what is due: connects, stops, reads.
    void step(drivers::Time now, bool stop);
    [[nodiscard]] ShakerWord word(drivers::Time now) const;
    /// Why there is no connection or no answer; empty: all is well.
    [[nodiscard]] const std::string& note() const noexcept { return line_.note(); }
    [[nodiscard]] std::uint64_t stops_written() const noexcept { return stops_; }

  private:
    [[nodiscard]] bool read(const proto::Register& reg, double& value);
    [[nodiscard]] bool write_stop();
    [[nodiscard]] bool look(drivers::Time now);
    [[nodiscard]] int write(int address, const std::uint16_t* words, std::size_t count);
    [[nodiscard]] bool stop_in_one(const std::uint16_t* run);
    [[nodiscard]] bool ramp_at_once();

    ShakerLineSettings settings_;
    ModbusTcp line_;
    drivers::Time due_ = 0;   ///< next attempt or poll
    drivers::Time read_ = 0;  ///< when word_ was; 0: never
    ShakerWord word_;
    std::uint64_t stops_ = 0;
    bool stopping_ = false;
    bool ramp_tried_ = false;     ///< in a request of its own, for this stop
    bool joint_refused_ = false;  ///< the device takes one register at a time
    bool joint_in_vain_ = false;  ///< for this stop: ordered so, and run was not read as 0
};

}  // namespace vibrig::guard
