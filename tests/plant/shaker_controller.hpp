#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "tests/plant/shaker_lies.hpp"
#include "tests/plant/shaker_profile.hpp"

namespace vibrig::plant {

enum class ShakerState : std::uint16_t { idle, ramping, running, stopping, fault };

inline constexpr std::uint16_t kFaultWatchdog = 1;  ///< bits of the fault register
inline constexpr std::uint16_t kFaultEmergencyStop = 2;
inline constexpr std::uint16_t kFaultLimit = 4;
inline constexpr std::uint16_t kFaultInternal = 8;

/// Of the register control_state: what the random control does, with kBandsArmed, and from bit 8 on
/// why it aborted.
enum class RandomState : std::uint16_t { idle, levelling, at_level, aborted };
inline constexpr std::uint16_t kBandsArmed = 0x10;
inline constexpr std::uint16_t kAbortAbove = 1, kAbortBelow = 2, kAbortStopped = 3;

/// The shaker's controller as its Modbus registers show it: set-points, ramps, watchdog, emergency
/// stop; and the table it drives, which need not do what they say. Addresses are those of
/// proto::ShakerRegisters, and for random vibration kMode to kControlState.
class ShakerController {
  public:
    static constexpr std::size_t kHolding = 16;
    static constexpr std::size_t kPsdBlock = 16, kPsdPairs = 200;  ///< input: f32, Hz and g^2/Hz
    static constexpr std::size_t kInput = kPsdBlock + 4 * kPsdPairs;
    /// Holding: 0 sine, 1 random, 2 sweep; a number; i16, 0.1 dB. Input: u32; u32, 1e-4 g; u16.
    static constexpr std::size_t kMode = 8, kProfileNumber = 9, kProfileLevel = 10;
    static constexpr std::size_t kProfileChecksum = 5, kMeasuredRms = 7, kControlState = 9;
    /// Of a sweep, holding: u32, mHz, where it begins and ends; u16, 0.01 octaves a minute. Input:
    /// u32, mHz, where it is. It begins kSweepRests_s after the level is there, and stays at its
    /// end.
    static constexpr std::size_t kSweepFrom = 11, kSweepTo = 13, kSweepRate = 15;
    static constexpr std::size_t kActualFrequency = 10;
    static constexpr double kSweepRests_s = 5;
    enum class Answer : std::uint8_t { accepted, illegal_address, illegal_value };

    ShakerController(double limit_g, double limit_mm, std::vector<ShakerProfile> profiles = {})
        : limit_g_(limit_g), limit_mm_(limit_mm), profiles_(std::move(profiles)) {}

    /// All or nothing, as one Modbus request.
    [[nodiscard]] Answer write(std::size_t address, std::span<const std::uint16_t> values) noexcept;
    [[nodiscard]] const std::array<std::uint16_t, kHolding>& holding() const noexcept {
        return holding_;
    }
    [[nodiscard]] std::array<std::uint16_t, kInput> input() const noexcept;

    void open_emergency_stop(bool open) noexcept;
    /// Whether somebody is connected to its registers; a serial line always is.
    void linked(bool linked) noexcept { linked_ = linked; }
    /// The table does this, whatever the controller drives: another controller has it. None: its
    /// own again.
    void drive_from_outside(std::optional<double> table_g) noexcept { outside_g_ = table_g; }
    /// From now on.
    void lie(const ShakerLies& lies) noexcept;
    /// What is played where random vibration is asked for; none: sine.
    [[nodiscard]] const ShakerProfile* played() const noexcept;
    /// The mean square of what is played over the last tick, of a mean of 1.
    void felt(double mean_square) noexcept { felt_ = mean_square; }
    /// What was played since the level was there, at its end: power of each line, of a sum of about
    /// 1. The controller's PSD is that, at the level that it believes in, in fewer lines.
    void measured(std::span<const double> power, double line_hz);
    [[nodiscard]] bool psd_refused() const noexcept { return lies_.psd_refused; }
    [[nodiscard]] double profile_tilted() const noexcept { return lies_.profile_tilted; }
    /// Time goes on by dt; the table's amplitude follows its ramp.
    void advance(double dt_s) noexcept;

    [[nodiscard]] ShakerState state() const noexcept { return state_; }
    [[nodiscard]] std::uint16_t faults() const noexcept { return faults_; }
    /// Of the table now in truth: peak of a sine, rms of random vibration.
    [[nodiscard]] double amplitude_g() const noexcept;
    /// The highest of it that there ever was.
    [[nodiscard]] double highest_g() const noexcept { return highest_g_; }
    [[nodiscard]] double frequency_hz() const noexcept;                   ///< as its register says
    [[nodiscard]] double table_hz() const noexcept { return table_hz_; }  ///< in truth
    [[nodiscard]] bool sweeps() const noexcept { return holding_[kMode] == 2; }
    [[nodiscard]] double set_point_g() const noexcept;
    [[nodiscard]] double ramp_s() const noexcept;
    [[nodiscard]] bool at_rest() const noexcept { return amplitude_g() == 0; }

  private:
    [[nodiscard]] const ShakerProfile* of_number(std::uint16_t number) const noexcept;
    [[nodiscard]] double profile_level_db() const noexcept;
    [[nodiscard]] bool may_be(const std::array<std::uint16_t, kHolding>& next) const noexcept;
    [[nodiscard]] double commanded_g() const noexcept;
    void watch_bands(double dt_s) noexcept;
    void sweep(double dt_s) noexcept;
    [[nodiscard]] double swept(double hz, double octaves) const noexcept;
    [[nodiscard]] std::uint16_t control_state() const noexcept;
    void ramp_to(double target_g, double time_s) noexcept;
    void trip(std::uint16_t fault, double stop_s) noexcept;
    void stop(ShakerState state, double time_s) noexcept;

    double limit_g_;
    double limit_mm_;
    std::vector<ShakerProfile> profiles_;
    std::array<std::uint16_t, kHolding> holding_{0,   15000, 0, 0,
                                                 200, 0,     0, 0};  // 15 Hz, 0 g, 2 s, stopped
    ShakerState state_ = ShakerState::idle;
    std::uint16_t faults_ = 0;
    bool emergency_stop_open_ = false;
    bool linked_ = true;
    ShakerLies lies_;
    std::optional<double> outside_g_;
    double drive_g_ = 0;  ///< what the controller believes the table does
    double highest_g_ = 0;
    double target_g_ = 0;
    double slope_g_per_s_ = 0;  ///< positive
    double held_g_ = 0;         ///< what a contactor that is stuck keeps up when the drive goes
    double since_feed_s_ = 0;
    double table_hz_ = 15;
    double felt_ = 1;         ///< of the last tick
    double mean_square_ = 0;  ///< of the table as the controller's accelerometer has it, g^2
    double outside_bands_s_ = 0, at_level_s_ = 0;
    double swept_s_ = 0;                      ///< at the level of a sweep
    double commanded_hz_ = 15;                ///< where a sweep would be as it is commanded
    std::uint16_t aborted_ = 0;               ///< why
    std::vector<std::array<double, 2>> psd_;  ///< measured last: Hz, g^2/Hz at the table
};

}  // namespace vibrig::plant
