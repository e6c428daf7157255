#pragma once

#include <linux/can.h>

#include <cstdint>
#include <deque>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "tests/plant/random.hpp"
#include "tests/plant/sensors.hpp"
#include "tests/plant/shaker_lies.hpp"

namespace vibrig::plant {

enum class FaultKind : std::uint8_t {
    lose,
    stuck,
    late,
    out_of_range,
    flag,
    duplicate,
    reorder,
    shorten,
    bus_silent,
    modbus_silent,
    modbus_wrong,
    estop,
    loop_open,
    platform_fault,
    spike,
    gyro_noise,
    sync_growth,
    cross_growth,
    distorted,
    ack_without_stop,
    timeout_ignored,
    timeout_scaled,
    timeout_if_linked,
    timeout_if_unlinked,
    estop_contact_only,
    estop_unseen,
    estop_restarts,
    other_device,
    amplitude_scaled,
    readback_echo,
    stuck_contactor,
    slow_ramp,
    unit_rms,
    unit_mps2,
    dead_table,
    frequency_ignored,
    wrong_profile,
    profile_level_wrong,
    no_abort_bands,
    profile_tilted,
    psd_stale,
    psd_nan,
    psd_scaled,
    psd_refused,
    sweep_rate_scaled,
    actual_as_told,
    timeout_register,
    latched_fault
};

/// Channels of a sample: outer, inner, azimuth, then the accelerometers x, y, z.
inline constexpr std::size_t kChannels = 6;

/// One fault over a range of simulated time.
struct Fault {
    FaultKind kind = FaultKind::lose;
    std::optional<std::size_t> channel;  ///< none: all
    double value = 0;                    ///< a rate, ms or deg, as the kind says
    double rate = 1;                     ///< share of samples hit, where `value` is something else
    double hz = 0;                       ///< the table's, at which alone; 0: at each
    double from_s = 0;
    double to_s = std::numeric_limits<double>::infinity();

    /// Whether it concerns a table that is set to this frequency.
    [[nodiscard]] bool at(double table_hz) const noexcept { return at(hz, table_hz); }
    [[nodiscard]] static bool at(double hz, double table_hz) noexcept {
        return hz == 0 || (table_hz > hz - 0.01 && table_hz < hz + 0.01);
    }
};

/// NAME[:CHANNEL][=VALUE[,RATE]][@FROM[..TO]], for instance "lose=0.01@100..200" or
/// "stuck:outer@50"; a name may be written with _ for -; the times are simulated seconds, from
/// `now_s` on where none are given. Throws PlantError saying what was found and expected.
[[nodiscard]] Fault parse_fault(std::string_view spec, double now_s);
/// One line per fault, for --help and error messages.
[[nodiscard]] std::string fault_help();
[[nodiscard]] std::string_view name_of(FaultKind kind) noexcept;

/// A sample as it goes out: what the instruments show and the valid bits.
struct Sample {
    Readings readings;
    std::array<bool, kChannels> valid{true, true, true, true, true, true};
};

/// Spoils samples and frames as set. Deterministic for a seed.
class Faults {
  public:
    explicit Faults(std::uint64_t seed) : random_(seed, 4) {}

    void add(const Fault& fault) { faults_.push_back(fault); }
    /// Ends all faults, or those of one kind. Throws PlantError for an unknown name.
    void clear(std::string_view name = {});
    /// The fault of this kind in force at a time, or none.
    [[nodiscard]] const Fault* active(FaultKind kind, double time_s) const noexcept;

    void spoil(Sample& sample, double time_s);
    /// Loses, doubles, delays, shortens and swaps the frames of one tick.
    void spoil(std::vector<can_frame>& frames, double time_s);
    [[nodiscard]] std::uint64_t lost() const noexcept { return lost_; }

  private:
    struct Delayed {
        double due_s;
        can_frame frame;
    };

    [[nodiscard]] bool hit(double rate) { return rate >= 1 || random_.uniform() < rate; }

    std::vector<Fault> faults_;
    std::deque<Delayed> delayed_;
    std::array<std::optional<double>, kChannels> held_;
    Random random_;
    std::uint64_t lost_ = 0;
};

/// The shaker's lies at a time: those of the rig from the start, and the faults on top.
[[nodiscard]] ShakerLies lies_at(double time_s, ShakerLies from_start,
                                 const Faults& faults) noexcept;

}  // namespace vibrig::plant
