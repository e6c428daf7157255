#pragma once

#include <cstdint>
#include <string>

#include "drivers/shaker/modbus_link.hpp"

namespace vibrig::drivers {

/// What horn and lamp show, the most urgent last.
///   alarm      lamp on, horn 0.5 s in 10 s
///   abort      lamp on, horn 1 s in 2 s
///   disobeyed  lamp and horn on without a pause: press the emergency stop
enum class HornPattern : std::uint8_t { none, alarm, abort, disobeyed };
[[nodiscard]] const char* name_of(HornPattern pattern) noexcept;
/// Whether the horn sounds so long after the pattern began.
[[nodiscard]] bool horn_sounds(HornPattern pattern, Time since) noexcept;

/// Horn and lamp as coils of a Modbus device (TCP).
struct HornSettings {
    std::string host;  ///< empty: there is none
    int port = 502;
    int unit = 1;
    int horn_coil = 0;
    int lamp_coil = -1;  ///< -1: none
    Time response_timeout = 500 * kMillisecond;
};

/// Writes the coils and reads them back. Another master may sound the same horn: this one says off
/// only once. One thread; a request takes a response timeout at most.
class Horn {
  public:
    /// Throws ShakerError for settings that cannot work.
    explicit Horn(const HornSettings& settings);
    /// What is to be shown now; writes what is due, reads back. False: a coil that should be on
    /// does not read back as on, or the device is not reached.
    bool show(HornPattern pattern, Time now);
    /// When show() has something to do at the latest.
    [[nodiscard]] Time next(Time now) const noexcept;
    /// Why the last show() failed; empty: it did not.
    [[nodiscard]] const std::string& note() const noexcept { return note_; }

  private:
    struct Coil {
        const char* name;
        int address;
        bool on = false;  ///< as last commanded
    };
    [[nodiscard]] bool reach(Time now);
    [[nodiscard]] bool set(Coil& coil, bool on);
    [[nodiscard]] bool lose(const Reply& reply);

    ModbusLink link_;
    Coil horn_, lamp_;
    HornPattern pattern_ = HornPattern::none;
    Time begun_ = 0;
    Time next_attempt_ = 0;
    std::string note_;
};

}  // namespace vibrig::drivers
