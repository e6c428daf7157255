#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>

#include "tests/plant/shaker_lies.hpp"

namespace vibrig::plant {

enum class ShakerState : std::uint16_t { idle, ramping, running, stopping, fault };

inline constexpr std::uint16_t kFaultWatchdog = 1;  ///< bits of the fault register
inline constexpr std::uint16_t kFaultEmergencyStop = 2;
inline constexpr std::uint16_t kFaultLimit = 4;
inline constexpr std::uint16_t kFaultInternal = 8;

/// The shaker's controller as its Modbus registers show it: set-points, ramps, watchdog, emergency
/// stop; and the table it drives, which need not do what they say. Addresses are those of
/// proto::ShakerRegisters.
class ShakerController {
  public:
    static constexpr std::size_t kHolding = 8;
    static constexpr std::size_t kInput = 5;
    enum class Answer : std::uint8_t { accepted, illegal_address, illegal_value };

    ShakerController(double limit_g, double limit_mm) : limit_g_(limit_g), limit_mm_(limit_mm) {}

    /// All or nothing, as one Modbus request.
    [[nodiscard]] Answer write(std::size_t address, std::span<const std::uint16_t> values) noexcept;
    [[nodiscard]] const std::array<std::uint16_t, kHolding>& holding() const noexcept {
        return holding_;
    }
    [[nodiscard]] std::array<std::uint16_t, kInput> input() const noexcept;

    void open_emergency_stop(bool open) noexcept;
    /// The table does this, whatever the controller drives: another controller has it. None: its
    /// own again.
    void drive_from_outside(std::optional<double> table_g) noexcept { outside_g_ = table_g; }
    /// From now on.
    void lie(const ShakerLies& lies) noexcept;
    /// Time goes on by dt; the table's amplitude follows its ramp.
    void advance(double dt_s) noexcept;

    [[nodiscard]] ShakerState state() const noexcept { return state_; }
    [[nodiscard]] std::uint16_t faults() const noexcept { return faults_; }
    [[nodiscard]] double amplitude_g() const noexcept;   ///< of the table now, peak, in truth
    [[nodiscard]] double frequency_hz() const noexcept;  ///< as its register says
    [[nodiscard]] double table_hz() const noexcept { return table_hz_; }  ///< in truth
    [[nodiscard]] double set_point_g() const noexcept;
    [[nodiscard]] double ramp_s() const noexcept;
    [[nodiscard]] bool at_rest() const noexcept { return amplitude_g() == 0; }

  private:
    void ramp_to(double target_g, double time_s) noexcept;
    void trip(std::uint16_t fault, double stop_s) noexcept;
    void stop(ShakerState state, double time_s) noexcept;

    double limit_g_;
    double limit_mm_;
    std::array<std::uint16_t, kHolding> holding_{0,   15000, 0, 0,
                                                 200, 0,     0, 0};  // 15 Hz, 0 g, 2 s, stopped
    ShakerState state_ = ShakerState::idle;
    std::uint16_t faults_ = 0;
    bool emergency_stop_open_ = false;
    ShakerLies lies_;
    std::optional<double> outside_g_;
    double drive_g_ = 0;  ///< what the controller believes the table does
    double target_g_ = 0;
    double slope_g_per_s_ = 0;  ///< positive
    double held_g_ = 0;         ///< what a contactor that is stuck keeps up when the drive goes
    double since_feed_s_ = 0;
    double table_hz_ = 15;
};

}  // namespace vibrig::plant
