#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "daemon/domain/campaign_state.hpp"
#include "daemon/domain/positions.hpp"
#include "daemon/domain/services.hpp"
#include "daemon/noise/noise_status.hpp"
#include "daemon/rt/frame_latency.hpp"
#include "daemon/status/campaign_status.hpp"
#include "daemon/status/vibration_status.hpp"
#include "drivers/annunciator/annunciator.hpp"
#include "drivers/can/can_port.hpp"
#include "drivers/sample/assembler.hpp"
#include "drivers/sample/sample.hpp"
#include "drivers/shaker/shaker.hpp"
#include "estimator/identification/identification.hpp"

namespace vibrig {

/// Quality of a channel as it stands now: that of the newest sample while there is one within its
/// deadline.
enum class ChannelState : std::uint8_t {
    good,
    missing,
    flagged,
    out_of_range,
    unbound,
    silent,  ///< no value for longer than its deadline
    never,   ///< no good value since the start, and nothing else to say of it
};
[[nodiscard]] const char* name_of(ChannelState state) noexcept;

/// The whole status at one instant. Filled by the daemon, read by the server; strings only here,
/// not in real-time threads.
struct StatusData {
    std::string version;
    std::string campaign_name;
    std::string clock;       ///< "real" or "rig"
    drivers::Time time = 0;  ///< of the daemon's clock, ns
    std::int64_t utc_ns = 0;
    drivers::Time uptime = 0;

    CampaignState state = CampaignState::idle;
    std::string reason;  ///< why it is aborted, tripped, waiting; else empty
    std::string armed_by;
    std::string armed_for;     ///< unit, plan, highest level, duration
    double arming_left_s = 0;  ///< until the arming expires; 0: not armed, or started
    std::string started_by;    ///< the campaign in progress, or the last one
    std::string resume_offer;  ///< what can be resumed after a restart; empty: nothing
    int run = 0, runs = 0, position = 0, positions = 0;  ///< from 1; 0: none
    std::array<double, 3> position_deg{};
    double progress = 0;     ///< 0 to 1
    double remaining_s = 0;  ///< estimate

    double command_table_g = 0;
    double command_frequency_hz = 0;
    drivers::ShakerReading shaker;
    drivers::LinkState shaker_link = drivers::LinkState::absent;
    drivers::ShakerCounters shaker_counters;
    InterlockStatus interlock;
    JournalStatus journal;
    RecorderStatus recorder;
    ArchiveStatus archive;
    RealTimeStatus real_time;
    MqttStatus mqtt;
    LogStatus log;
    ServerStatus server;
    GuardStatus guard;
    drivers::AnnunciatorStatus annunciator;
    bool stop_pending = false;  ///< a stop is ordered and rest not measured since
    RestStatus rest;

    drivers::PortState can = drivers::PortState::absent;
    drivers::CanPortCounters can_counters;
    drivers::AssemblerCounters assembler;
    std::uint64_t rig_ticks = 0;         ///< delivered frames that were the simulated rig's time
    std::uint64_t increment_frames = 0;  ///< delivered frames that were increments
    RingCounters estimator_ring;
    rt::FrameLatency latency;                                  ///< of the acquisition, real clock
    std::uint64_t estimator_in_dwell = 0, estimator_idle = 0;  ///< popped = in a dwell + idle
    drivers::Sample sample;                                    ///< the newest
    std::array<double, drivers::kChannels> channel_age_s{};    ///< negative: never good
    double channel_deadline_s = 0.1, platform_deadline_s = 0.5;
    bool silent = false;        ///< nothing has come for seconds, whatever clock the rig has
    double sample_rate_hz = 0;  ///< measured; 0: not yet
    std::string rate_misfit;    ///< why it is not the configured one
    std::string clock_misfit;   ///< why rig and daemon have no time in common
    drivers::PlatformStatus platform;
    /// The accelerometers against the command: platform and table, g peak at the table;
    /// negative: not known.
    std::array<double, 2> witness_g{-1, -1};
    VibrationStatus vibration;

    [[nodiscard]] ChannelState channel(std::size_t c) const noexcept;
    /// good, silent or never.
    [[nodiscard]] ChannelState platform_state() const noexcept;
    FrameStatus frame;

    estimator::Estimate estimate;
    NoiseStatus noise;
    VerdictStatus verdict;
    std::vector<estimator::DwellSummary> dwells;
    LevellingStatus levelling;
    ZeroStatus zeros;
    LoopCheckStatus loop_check;
    RestCheckStatus rest_check;
    ProofStatus proof;
    bool simulated = false;  ///< the rig is a program
};

}  // namespace vibrig
