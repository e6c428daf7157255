#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "drivers/base/clock.hpp"
#include "proto/register_map.hpp"

namespace vibrig::drivers {

/// Settings or a register map that cannot work; names the configuration key.
class ShakerError : public std::runtime_error {
  public:
    using std::runtime_error::runtime_error;
};

struct ShakerSettings {
    enum class Transport : std::uint8_t { tcp, rtu } transport = Transport::tcp;
    std::string host = "127.0.0.1";  ///< numeric address or name
    int port = 502;
    std::string device;                          ///< rtu: serial device
    int baud = 19200;                            ///< rtu: 8E1
    int unit = 1;                                ///< Modbus unit (slave) id
    Time response_timeout = 500 * kMillisecond;  ///< of one request, wall time
    Time poll_period = 200 * kMillisecond;       ///< read-back
    Time watchdog_period = 500 * kMillisecond;   ///< feed
    Time backoff_min = 100 * kMillisecond;       ///< reconnect, doubled up to backoff_max
    Time backoff_max = 5 * kSecond;
    /// Most that the ramp may cost in a stop where ramp time and run are not written in one
    /// request.
    Time stop_ramp_timeout = 100 * kMillisecond;
    /// Each new link is asked who it is, at rest (function 17): how long for; 0: it is not.
    Time identify = 0;
    proto::ShakerRegisters registers;  ///< the register map of the configuration
};

/// Longest timeout of the controller's watchdog that is any use, and longest feed period: three of
/// them are the timeout.
inline constexpr Time kLongestWatchdogTimeout = 3 * kSecond;
inline constexpr Time kLongestWatchdogPeriod = kLongestWatchdogTimeout / 3;
/// An emergency-stop chain that opens is to be seen within half a second.
inline constexpr Time kLongestPollPeriod = 500 * kMillisecond;

/// A profile that the controller knows, and how it is to be played.
struct RandomSetPoint {
    std::uint16_t profile = 0;   ///< its number
    double level_db = 0;         ///< about it
    std::uint32_t checksum = 0;  ///< of its breakpoints; what the controller shows has to be this

    [[nodiscard]] bool operator==(const RandomSetPoint&) const = default;
};

/// A sweep of a sine: where it begins and ends.
struct SweepSetPoint {
    double from_hz = 0, to_hz = 0;
    double octaves_per_minute = 0;

    [[nodiscard]] bool operator==(const SweepSetPoint&) const = default;
};

/// What is asked of the shaker. Frequency may only change while the amplitude is zero (checked by
/// the campaign).
struct ShakerSetPoint {
    double frequency_hz = 0;
    double amplitude_g = 0;  ///< peak, at the table; of random vibration its rms
    double ramp_s = 0;       ///< from the present amplitude to this one
    /// In place of a sine; the frequency is left alone then. Like it chosen at rest only.
    std::optional<RandomSetPoint> random{};
    /// run = 1 although the amplitude is 0: the controller runs, the table stands. Else 0 g is
    /// run = 0.
    bool run_at_zero = false;
    /// In place of a sine that stands; likewise.
    std::optional<SweepSetPoint> sweep{};
};

/// Values of the state register.
inline constexpr std::uint16_t kShakerIdle = 0, kShakerRamping = 1;
inline constexpr std::uint16_t kShakerRunning = 2;
inline constexpr std::uint16_t kShakerFault = 4;

/// The register that gives after how long without a feed the controller stops.
enum class WatchdogTimeout : std::uint8_t {
    unread,   ///< not read since the link was made
    kept,     ///< what was written; of a register that is only read: short enough
    changed,  ///< another value, or none to be had
};

/// State of a controller with registers for random vibration, as read back.
struct RandomReading {
    enum class State : std::uint8_t { idle, levelling, at_level, aborted };
    bool random = false;  ///< the mode
    std::uint16_t profile = 0;
    double level_db = 0;
    std::uint32_t checksum = 0;
    double measured_g_rms = 0;
    State state = State::idle;
    bool bands_armed = false;  ///< it stops by itself where the level is not right
    std::uint8_t abort_reason = 0;
};

/// State of a controller with registers for sweeps, as read back.
struct SweepReading {
    bool on = false;  ///< the mode
    double from_hz = 0, to_hz = 0, octaves_per_minute = 0;
    double actual_hz = 0;  ///< reported by it; not finite: it reports none

    /// This sweep is what is commanded, as far as registers resolve it.
    [[nodiscard]] bool is(const SweepSetPoint& wanted) const noexcept {
        return on && std::abs(from_hz - wanted.from_hz) < 0.01 &&
               std::abs(to_hz - wanted.to_hz) < 0.01 &&
               std::abs(octaves_per_minute - wanted.octaves_per_minute) <
                   0.01 + 0.02 * wanted.octaves_per_minute;
    }
};

/// Identity that the controller at the newest link reports.
struct ShakerIdentity {
    bool known = false;  ///< it was asked, and has answered or not
    std::string text{};  ///< empty: it reports none
};

/// What the controller reports that it measured of the last random vibration.
struct ShakerPsd {
    std::uint64_t request = 0;  ///< of read_psd() that this answers; 0: of none yet
    /// Hz and g^2/Hz of each pair, all that there are, as they came; empty: `why_not`.
    std::vector<std::array<double, 2>> pairs{};
    std::string why_not{};
};

/// The newest read-back. Nothing of it is valid while `valid` is false.
struct ShakerReading {
    Time time = 0;
    bool fresh = false;       ///< not older than 3 polls and 2 feeds: its words are known
    bool valid = false;       ///< fresh, and its numbers are numbers
    double frequency_hz = 0;  ///< set-point read back
    double amplitude_g = 0;   ///< set-point read back, peak at the table
    double measured_g = 0;    ///< measured, peak at the table
    std::uint16_t state =
        0;  ///< register value, named by the map: 0 idle, 1 ramping, 2 running, 3 stopping, 4 fault
    std::uint16_t fault = 0;
    bool running = false;  ///< the run register read back
    bool emergency_stop_open = false;
    WatchdogTimeout watchdog = WatchdogTimeout::unread;
    double watchdog_timeout_s = 0;          ///< as read
    std::optional<RandomReading> random{};  ///< none: no registers for it
    std::optional<SweepReading> sweep{};    ///< likewise
    [[nodiscard]] bool still() const { return valid && measured_g < 0.05; }
    [[nodiscard]] bool at_rest() const { return still() && !running && state == 0; }
};

/// By its state register: on the way to a level, or there.
[[nodiscard]] inline bool is_excited(const ShakerReading& reading) {
    return reading.state == kShakerRamping || reading.state == kShakerRunning;
}

enum class LinkState : std::uint8_t { absent, connecting, running, degraded, fault };
[[nodiscard]] const char* name_of(LinkState state) noexcept;

/// requests = replies + timeouts + exceptions + wrong_replies + lost + the one in flight.
struct ShakerCounters {
    std::uint64_t requests = 0, replies = 0, timeouts = 0, exceptions = 0, reconnects = 0,
                  set_points_discarded = 0, feeds = 0, stops_written = 0, read_back_mismatches = 0;
    std::uint64_t wrong_replies = 0;  ///< of another transaction, unit, function or length, damaged
    std::uint64_t lost = 0;           ///< connection lost, or cut off by a stop, during a request
    std::uint64_t set_points_written = 0;  ///< every step of them read back as written
};

/// The shaker over Modbus, on a thread of its own behind a queue of at most one set-point.
/// A stop outranks everything: it overtakes, never expires, is the first write after a reconnect,
/// and until it is read back as done the watchdog is not fed. States: absent before start();
/// connecting until every register has been read once; running; degraded while the device answers
/// with exceptions, and after a write that was refused or did not read back until a stop is read
/// back as done; fault when this process is out of usable descriptors.
class Shaker {
  public:
    using StateHandler = std::function<void(LinkState, const char* text)>;

    virtual ~Shaker() = default;
    /// Starts the thread. `may_feed` is asked in that thread before each watchdog feed.
    virtual void start(std::function<bool()> may_feed, StateHandler on_state) = 0;
    /// Replaces a waiting set-point; false if a stop is pending or was asked for since `stops` was
    /// read, the link is not running, the table moves at another frequency and is to go on, or a
    /// value does not fit its register (nothing is kept then). Who arms the shaker reads stops()
    /// then and asks under that number: a stop that came in between is not undone, however long the
    /// caller slept before it asked.
    [[nodiscard]] virtual bool request(const ShakerSetPoint& set_point,
                                       std::uint64_t stops) noexcept = 0;
    /// Any thread; never blocks. Cuts off a request in flight.
    virtual void stop_now() noexcept = 0;
    /// Nobody talks to the device until then; its watchdog is on its own. A stop ends that at once:
    /// it connects again and is written first. Any thread; never blocks.
    virtual void hang_up_until(Time /*time*/) noexcept {}
    /// From now on, or no longer, nothing is written but a stop: no set-point is taken, the
    /// watchdog is neither fed nor given its timeout. Any thread; never blocks.
    virtual void read_only(bool /*on*/) noexcept {}
    /// How often stop_now() was called.
    [[nodiscard]] virtual std::uint64_t stops() const noexcept = 0;
    [[nodiscard]] virtual bool stop_pending() const noexcept = 0;
    /// True while a request() waits or is being written.
    [[nodiscard]] virtual bool busy() const noexcept = 0;
    [[nodiscard]] virtual ShakerReading reading() const noexcept = 0;
    [[nodiscard]] virtual ShakerCounters counters() const noexcept = 0;
    [[nodiscard]] virtual LinkState state() const noexcept = 0;
    /// Not known where settings do not ask. Any thread.
    [[nodiscard]] virtual ShakerIdentity identity() const { return {}; }
    /// Asks for the block of pairs of a random vibration that is over. It is read at rest, behind
    /// everything else and a part at a time; what it costs a request that is more urgent is half a
    /// feed's period at most, and a stop nothing. Returns the request's number, 0: there are no
    /// such registers. Any thread; never blocks.
    virtual std::uint64_t read_psd() noexcept { return 0; }
    /// The answer to the newest request that has one. Any thread.
    [[nodiscard]] virtual ShakerPsd psd() const { return {}; }
    /// Called in the shaker's thread after every completed read-back, to wake whoever waits for
    /// one. Before start().
    virtual void on_reading(std::function<void()> wake) = 0;
    /// Called in the shaker's thread with every completed read-back, before reading() has it:
    /// whoever acts on a reading finds it judged. Before start().
    virtual void on_judging(std::function<void(const ShakerReading&)> /*judge*/) {}
    /// Rounds of the shaker's thread so far: it lives as long as they grow.
    [[nodiscard]] virtual std::uint64_t beats() const noexcept { return 0; }
    /// Called in the shaker's thread when the device has confirmed a stop. Before start().
    virtual void on_stop_written(std::function<void()> /*confirmed*/) {}
    /// Ends the thread. Does not stop the shaker: call stop_now() and wait for stop_pending() to
    /// clear first.
    virtual void shut_down() noexcept = 0;
};

/// Throws ShakerError, naming the configuration key, for settings that cannot work.
[[nodiscard]] std::unique_ptr<Shaker> make_shaker(Clock& clock, const ShakerSettings& settings);

}  // namespace vibrig::drivers
