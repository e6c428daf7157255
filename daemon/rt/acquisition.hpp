#pragma once

#include <array>
#include <boost/asio/io_context.hpp>
#include <boost/asio/posix/stream_descriptor.hpp>
#include <boost/asio/steady_timer.hpp>
#include <functional>
#include <optional>

#include "daemon/interlock/interlock.hpp"
#include "daemon/interlock/rest_monitor.hpp"
#include "daemon/rt/frame_latency.hpp"
#include "daemon/rt/frame_record.hpp"
#include "daemon/rt/rate_meter.hpp"
#include "daemon/rt/real_time.hpp"
#include "daemon/rt/rig_clock.hpp"
#include "daemon/rt/rig_time_link.hpp"
#include "daemon/rt/ring.hpp"
#include "daemon/rt/stage_feed.hpp"
#include "drivers/base/snapshot.hpp"
#include "drivers/can/can_port.hpp"
#include "drivers/sample/assembler.hpp"

namespace vibrig::rt {

/// What the acquisition thread shows of itself; latest wins.
struct AcquisitionView {
    drivers::Sample sample;  ///< the newest
    drivers::PlatformStatus platform;
    drivers::AssemblerCounters assembler;
    drivers::CanPortCounters port;  ///< of the same moment as the assembler's
    std::uint64_t rig_ticks = 0;    ///< delivered frames that were the rig's time
    std::uint64_t increments = 0;   ///< delivered frames that were increments
    std::uint64_t in_hand = 0;      ///< delivered frames of the batch at work, not looked at yet
    std::uint64_t samples_offered = 0;  ///< to the ring: pushed + dropped
    std::array<drivers::Time, drivers::kChannels> last_good{};
    FrameLatency latency;  ///< on the real clock
    /// On the real clock: of frames, as latency; of wake-ups for silence, after their moment.
    Lateness lateness;
    PageFaults faults;
    RateMeter rate;
    std::uint64_t foreign_time = 0;  ///< frames of a simulated rig's time that is not ours
    drivers::Time last_frames = 0;   ///< wall time; 0: none yet
    drivers::Time beat = 0;          ///< when the thread last handled frames
};

/// First stage: frames in, interlock, samples out to the rings. Everything here runs in the thread
/// of the io_context; after start() it neither allocates, locks, logs nor formats.
class Acquisition {
  public:
    struct Wiring {
        Ring<drivers::Sample>& estimator_ring;
        drivers::Waiter& estimator;
        drivers::Waiter& control;
        Interlock& interlock;
        StageFeed* stages = nullptr;
        // To the recorder, which looks into them by itself; null: none.
        Ring<FrameRecord>* recorder_frames = nullptr;
        Ring<drivers::Sample>* recorder_samples = nullptr;
        Ring<drivers::Sample>* pre_trip = nullptr;  ///< what led to a trip; null: nobody keeps it
        HandOver* to_estimator = nullptr;           ///< null: it is told of each sample
        RestMonitor* rest = nullptr;                ///< null: nobody asks
    };
    using Event = std::function<void(drivers::PortState, const char* text)>;

    /// `rig` is the clock itself when the simulated rig owns the time, else null. Throws
    /// drivers::BindingError.
    Acquisition(boost::asio::io_context& io, drivers::CanPort& port, const proto::Dbc& dbc,
                const drivers::AssemblerSettings& settings, drivers::Clock& clock, RigClock* rig,
                Wiring wiring);

    void start(Event on_port_state);
    /// From any thread: closes the port and lets io_context::run() end.
    void stop();
    [[nodiscard]] AcquisitionView view() const noexcept { return view_.read(); }

  private:
    void on_frames(std::span<const drivers::ReceivedFrame> frames) noexcept;
    void on_sample(const drivers::Sample& sample) noexcept;
    void doubt_witness() noexcept;
    void record(const drivers::ReceivedFrame& frame, drivers::Time time) noexcept;
    void on_tick(const RigTimeLink::Tick& tick) noexcept;
    void feed(const drivers::ReceivedFrame& frame) noexcept;
    void push_batch() noexcept;
    void tell_estimator(drivers::Time newest) noexcept;
    void hand_on() noexcept;
    [[nodiscard]] bool platform_changed() const noexcept;
    void count_latency(drivers::Time now) noexcept;
    void count_faults(drivers::Time now) noexcept;
    void on_time(drivers::Time now) noexcept;
    void arm_timer();
    void wait_for_rest();
    void acknowledge_if_at_rest() noexcept;

    boost::asio::io_context& io_;
    drivers::CanPort& port_;
    drivers::Clock& clock_;
    RigClock* rig_;
    Wiring to_;
    drivers::SampleAssembler assembler_;
    std::optional<RigTimeLink> rig_link_;
    std::optional<RigTimeLink::Tick> unacknowledged_;
    boost::asio::posix::stream_descriptor rest_;
    boost::asio::steady_timer timer_;
    Tripped doubted_;  ///< trip whose witness is doubted already
    std::array<drivers::Sample, 32> batch_{};
    std::size_t batched_ = 0;
    drivers::Time oldest_ = 0;     ///< stamp of the batch at work; 0: none, or the rig's time
    drivers::Time faults_at_ = 0;  ///< when they were last looked at
    Snapshot<AcquisitionView> view_;
    AcquisitionView shown_;
};

}  // namespace vibrig::rt
