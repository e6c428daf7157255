#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "tests/plant/bus.hpp"
#include "tests/plant/frames.hpp"
#include "tests/plant/shared_rig.hpp"

namespace vibrig::plant {

struct SimulationSettings {
    bool lockstep = true;                    ///< the rig's clock; else CLOCK_MONOTONIC
    std::optional<double> speed;             ///< lockstep: at most this many times real time
    std::optional<double> duration_s;        ///< simulated; none: until ordered to stop
    std::int64_t resend_ns = 1'000'000'000;  ///< lockstep: wall time without an acknowledgement
};

/// Ticks the rig and serves its bus. One thread; the rig is shared with the Modbus server.
class Simulation {
  public:
    /// `stop_descriptor` ends run() when it becomes readable (it is not read). `command_descriptor`
    /// (or -1) carries lines that `on_commands` is to read. Throws PlantError.
    Simulation(SharedRig& shared, Bus& bus, const proto::Dbc& dbc,
               const SimulationSettings& settings, int stop_descriptor, int command_descriptor = -1,
               std::function<bool()> on_commands = {});
    ~Simulation();
    Simulation(const Simulation&) = delete;
    Simulation& operator=(const Simulation&) = delete;

    void run();

    struct Counters {
        std::uint64_t ticks = 0, frames = 0, resent = 0, commands = 0;
    };
    [[nodiscard]] const Counters& counters() const noexcept { return counters_; }

  private:
    enum class Wake : std::uint8_t { event, deadline, stop };

    [[nodiscard]] double asked_speed(double now);
    void make_tick();
    void send_tick();
    [[nodiscard]] bool wait_while_held();
    [[nodiscard]] bool wait_for_acknowledgement();
    [[nodiscard]] bool wait_until(std::int64_t deadline_ns);
    void arm(std::optional<std::int64_t> at_ns);
    Wake wait(std::optional<std::int64_t> deadline_ns);
    void handle(const canfd_frame& frame);

    SharedRig& shared_;
    Bus& bus_;
    Frames frames_;
    SimulationSettings settings_;
    int stop_;
    int command_;
    std::function<bool()> on_commands_;
    int timer_;
    std::optional<std::int64_t> armed_ns_;
    std::vector<can_frame> tick_frames_;
    std::int64_t time_us_ = 0;
    std::optional<std::int64_t> acknowledged_us_;
    std::uint8_t command_echo_ = 0;
    std::uint8_t torque_echo_ = 0;
    Counters counters_;
};

}  // namespace vibrig::plant
