#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <string>

#include "daemon/rt/ring.hpp"
#include "drivers/base/clock.hpp"
#include "drivers/base/snapshot.hpp"
#include "drivers/can/can_port.hpp"
#include "drivers/sample/sample.hpp"
#include "drivers/sample/signal_binding.hpp"
#include "proto/dbc.hpp"

namespace vibrig::rt {

/// What a stage of the campaign with the table at rest is fed with.
struct Motion {
    drivers::Time time = 0;         ///< of its end, device time
    std::array<double, 3> force{};  ///< raw: mean over the block, g; of an increment m/s
    std::array<double, 3> turn{};   ///< of an increment, rad
    std::array<double, 3> angle{};  ///< encoders, the last good ones, rad
    std::uint32_t generation = 0;   ///< of the order it belongs to
    std::uint32_t dropped_before = 0;
    std::uint64_t published_to = 0;  ///< the ring's own
    bool good = false;               ///< force and angles
    bool increment = false;
    double table = 0;  ///< table accelerometer of a single sample, g
    bool table_good = false;
    std::array<double, 2> velocity{};  ///< of the base, north and east, the newest, m/s
    double velocity_age_s = 0;         ///< at `time`; infinite: none has come
};

/// The platform's word on its torquers.
struct TorqueView {
    drivers::Time time = 0;  ///< 0: none yet
    bool torquing = false;
    std::uint8_t echo = 0;
};

/// Increment frames: received = 2 x pairs + alone + unasked + one that waits for its partner.
struct IncrementCounters {
    std::uint64_t received = 0, pairs = 0, alone = 0, unasked = 0;
};

struct StageFeedSettings {
    bool increments = false;                      ///< bind their messages, signals X, Y, Z, Counter
    std::string gyro_message = "GyroIncrements";  ///< arcsec
    std::string accelerometer_message = "AccelerometerIncrements";  ///< m/s
    drivers::Time increment_period = 10 * drivers::kMillisecond;
    /// Carries Torquing and TorqueEcho; what the DBC does not have is not bound.
    std::string status_message = "GimbalStatus";
    std::uint32_t block = 0;  ///< samples per mean; to be stated
    /// "Message.Signal" of the base's velocity, m/s; empty: the base stands.
    std::array<std::string, 2> velocity;
};

/// Acquisition to control: means of the specific force, increments, or samples one by one, while a
/// stage asks for them. In the acquisition thread it neither allocates, locks, logs nor formats.
class StageFeed {
  public:
    static constexpr std::size_t kCapacity = 1024;  ///< of what was not taken yet
    /// watched: samples, whose coming does not wake the control thread.
    enum class Mode : std::uint8_t { off, force, increments, samples, watched };

    /// Throws BindingError, std::invalid_argument without a block; the Dbc must outlive this.
    StageFeed(const proto::Dbc& dbc, const StageFeedSettings& settings, drivers::Waiter* control);

    /// Acquisition thread. True: the frame is an increment's, and nobody else's.
    bool take(const drivers::ReceivedFrame& frame) noexcept;
    void take(const drivers::Sample& sample) noexcept;  ///< likewise

    /// Control thread: what came before is not given out any more.
    void order(Mode mode) noexcept;
    [[nodiscard]] bool pop(Motion& motion) noexcept;
    [[nodiscard]] TorqueView torque() const noexcept { return torque_.read(); }
    /// The DBC says whether the platform torques.
    [[nodiscard]] bool knows_torque() const noexcept { return torquing_ != nullptr; }

    [[nodiscard]] IncrementCounters counters() const noexcept { return counts_.read(); }

  private:
    struct Layout {
        const proto::Message* message = nullptr;
        std::array<const proto::Signal*, 3> axis{};
        const proto::Signal* counter = nullptr;
    };
    [[nodiscard]] static Layout bind(const proto::Dbc& dbc, const char* key,
                                     const std::string& message, const char* unit);
    void pair(const Layout& layout, const canfd_frame& frame, drivers::Time arrived) noexcept;
    void begin(std::uint32_t order) noexcept;
    void take_velocity(const drivers::ReceivedFrame& received) noexcept;

    StageFeedSettings settings_;
    drivers::Waiter* control_;
    Layout gyro_, accelerometer_;
    std::array<drivers::BoundSignal, 2> velocity_;
    const proto::Message* status_ = nullptr;
    const proto::Signal* torquing_ = nullptr;
    const proto::Signal* torque_echo_ = nullptr;

    std::atomic<std::uint32_t> order_{0};  ///< generation << kModeBits | mode
    Ring<Motion> ring_{kCapacity};
    Snapshot<TorqueView> torque_;
    Snapshot<IncrementCounters> counts_;

    // Acquisition thread.
    std::uint32_t taken_order_ = 0;
    Motion block_;
    std::uint32_t in_block_ = 0, good_in_block_ = 0;
    std::array<double, 2> base_velocity_{};
    std::array<drivers::Time, 2> base_velocity_at_{-1, -1};  ///< -1: none has come
    std::array<double, 3> angle_{};
    bool angle_known_ = false;
    std::array<double, 3> turn_{};
    std::uint8_t turn_counter_ = 0;
    bool turn_waits_ = false;
    bool first_ = true;
    drivers::Time base_ = 0, last_arrival_ = 0;
    std::int64_t count_ = 0;
    std::uint8_t last_counter_ = 0;
    IncrementCounters shown_;
};

}  // namespace vibrig::rt
