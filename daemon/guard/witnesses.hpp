#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "daemon/guard/motion.hpp"
#include "daemon/guard/settings.hpp"
#include "daemon/guard/stuck.hpp"
#include "drivers/can/can_port.hpp"
#include "proto/dbc.hpp"

namespace vibrig::guard {

/// What all accelerometers show together at one moment.
struct Sight {
    bool has_table = false, has_platform = false;
    Motion table, platform;
    bool table_stuck = false, platform_stuck = false;    ///< stillness of it is no rest
    bool table_frozen = false, platform_frozen = false;  ///< it is not known: it shows the same
    double table_g = 0;        ///< the largest peak at the table that any of them shows
    double by_platform_g = 0;  ///< the same by the platform's alone

    [[nodiscard]] bool known() const {
        return (table.known && !table_stuck) || (platform.known && !platform_stuck);
    }
    /// One of them moves by more than so much, rms.
    [[nodiscard]] bool moves(double g) const {
        return (table.known && table.rest_g > g) || (platform.known && platform.rest_g > g);
    }
    [[nodiscard]] bool table_rests(double g) const {
        return !has_table || table_stuck || (table.known && table.rest_g < g);
    }
    [[nodiscard]] bool platform_rests(double g) const {
        return !has_platform || platform_stuck || (platform.known && platform.rest_g < g);
    }
    /// Measured, by all there are; beside one that is stuck the other alone decides.
    [[nodiscard]] bool rests(double g) const {
        const bool any = (has_table && !table_stuck) || (has_platform && !platform_stuck);
        return any && table_rests(g) && platform_rests(g);
    }
};

/// The accelerometers on the bus, decoded anew from the DBC.
class Witnesses {
  public:
    /// Throws SettingsError with all that is wrong, DbcError for a DBC that is none.
    explicit Witnesses(const WitnessSettings& settings);
    void take(std::span<const drivers::ReceivedFrame> frames);
    [[nodiscard]] Sight sight(drivers::Time now) const;
    /// Whether one of them should move and does not: by the other one, and by what the shaker's
    /// controller reports that it does, peak at the table.
    void doubt(drivers::Time now, double shaker_g) noexcept;
    /// What is judged by: CLOCK_MONOTONIC, or the simulated rig's time where it owns the time.
    [[nodiscard]] drivers::Time time(drivers::Time now) const {
        return rig_time_ == nullptr ? now : rig_now_;
    }

  private:
    struct Place {
        const proto::Message* message = nullptr;
        const proto::Signal* value = nullptr;
        const proto::Signal* valid = nullptr;
        explicit operator bool() const noexcept { return value != nullptr; }
    };
    /// One of the samples that a frame carries.
    struct Part {
        std::array<Place, 3> platform;
        Place table;
        std::array<double, 3> raw{};  ///< of the platform, until all three are there
        std::array<bool, 3> seen{};
    };
    /// What was taken last of a witness.
    struct Last {
        drivers::Time at = 0;    ///< of the sample
        drivers::Time wall = 0;  ///< CLOCK_MONOTONIC
    };
    /// What the platform's accelerometers show, over the table.
    [[nodiscard]] double shown() const noexcept { return settings_.transmission * settings_.seen; }
    [[nodiscard]] Place find(const std::string& key, const std::string& name,
                             std::string& problems) const;
    void take(const drivers::ReceivedFrame& frame);
    void take_platform(Part& part, std::size_t axis, double value, const Last& now);
    void find_part(std::size_t number, std::string& problems);
    /// Of a frame's sample: the frame comes with its last one. Frames that come in a bunch have one
    /// stamp, and no sample is before the one that was taken last.
    [[nodiscard]] drivers::Time time_of(std::size_t part, drivers::Time frame,
                                        const Last& last) const;
    [[nodiscard]] Motion seen_by(const MotionWindow& motion, const Last& last, bool frozen,
                                 drivers::Time now) const;
    /// What one count is, g; 0: the bus carries a floating-point number, or nothing.
    [[nodiscard]] static double count_of(const Place& place) noexcept;
    [[nodiscard]] static std::optional<double> value_of(
        const Place& place, std::span<const std::uint8_t> payload) noexcept;

    WitnessSettings settings_;
    proto::Dbc dbc_;
    std::vector<Part> parts_;
    const proto::Message* rig_time_ = nullptr;
    const proto::Signal* rig_time_us_ = nullptr;
    drivers::Time rig_now_ = 0;
    Last platform_last_, table_last_;
    MotionWindow platform_motion_, table_motion_;
    StuckWatch platform_watch_, table_watch_;
};

}  // namespace vibrig::guard
