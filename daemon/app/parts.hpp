#pragma once

#include <boost/asio/io_context.hpp>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "daemon/app/campaign_dwells.hpp"
#include "daemon/app/campaign_log.hpp"
#include "daemon/app/campaign_rig.hpp"
#include "daemon/app/events.hpp"
#include "daemon/app/fitness.hpp"
#include "daemon/archive/outbox.hpp"
#include "daemon/campaign/campaign.hpp"
#include "daemon/configuration/configuration.hpp"
#include "daemon/interlock/interlock.hpp"
#include "daemon/journal/journal.hpp"
#include "daemon/log/log_queue.hpp"
#include "daemon/record/pre_trip.hpp"
#include "daemon/record/recorder.hpp"
#include "daemon/rt/acquisition.hpp"
#include "daemon/rt/estimator_stage.hpp"
#include "daemon/rt/real_clock.hpp"
#include "daemon/rt/real_time.hpp"
#include "daemon/rt/rig_clock.hpp"
#include "daemon/rt/stirred_waiter.hpp"
#include "daemon/watch/guard_link.hpp"

namespace vibrig {

/// A fixed-size event from a thread that may not format; the control thread turns it into words.
struct RtEvent {
    Severity severity = Severity::info;
    std::array<char, 16> source{};
    std::array<char, 128> text{};
    std::uint32_t dropped_before = 0;
    std::uint64_t published_to = 0;  ///< the ring's own
};

/// What the daemon is made of, in the order in which it is made; what stands further down uses what
/// stands above. Nothing is opened and no thread runs before Daemon::start().
struct Parts {
    /// Throws ConfigurationError, BindingError, CanError, ShakerError, std::system_error.
    Parts(configuration::Loaded given, const log::LogQueue* log_queue);

    /// False where the simulated rig owns the time: it waits, and nothing is late.
    [[nodiscard]] bool in_real_time() const noexcept { return rig_clock == nullptr; }
    /// The bus, by way of the recorder if there is one.
    [[nodiscard]] drivers::CanPort& sending_port() noexcept;
    /// Where recordings go; empty: nowhere.
    [[nodiscard]] const std::string& recordings() const noexcept;
    /// Which configuration is in force, by the SHA-256 that its recordings and --check give, too.
    [[nodiscard]] std::string in_force() const;

    configuration::Loaded loaded;
    const configuration::Configuration& configuration;
    const log::LogQueue* const log_queue;  ///< where its words go, to be watched; null: nobody asks
    const rt::MemoryLock memory_lock;      ///< before any thread
    std::unique_ptr<rt::RigClock> rig_clock;
    std::unique_ptr<rt::RealClock> real_clock;
    drivers::Clock& clock;
    Events events;
    proto::Dbc dbc;

    // The bus, the shaker, and who watches them.
    boost::asio::io_context io{1};
    std::unique_ptr<drivers::CanPort> port;
    std::unique_ptr<drivers::Shaker> shaker;
    std::unique_ptr<rt::StirredWaiter> control_waiter;
    std::unique_ptr<drivers::Waiter> estimator_waiter;
    rt::Interlock interlock;
    rt::Ring<RtEvent> port_events{64};    ///< acquisition to control
    rt::Ring<RtEvent> shaker_events{64};  ///< shaker to control

    // Samples go from the acquisition to the estimator and into the files.
    rt::Ring<drivers::Sample> estimator_ring{4096};
    dwells::DwellBook book;
    rt::EstimatorStage estimator_stage;
    std::unique_ptr<journal::Journal> journal;  ///< start() makes it; null: none is kept
    std::unique_ptr<archive::Outbox> outbox;    ///< likewise; null: no archive
    std::unique_ptr<drivers::Waiter> recorder_waiter;
    std::unique_ptr<record::Recorder> recorder;  ///< null: nothing is recorded
    std::unique_ptr<record::SentTap> sent_tap;
    std::unique_ptr<record::PreTrip> pre_trip;  ///< null: results are kept nowhere
    rt::StageFeed stage_feed;
    rt::RestMonitor rest;
    rt::Acquisition acquisition;
    Fitness fitness;

    // The campaign, and what it acts on.
    drivers::Gimbal gimbal;
    std::unique_ptr<drivers::Torquer> torquer;  ///< null: no torquers
    CampaignRig rig;
    CampaignDwells dwells;
    CampaignLog campaign_log;
    campaign::Campaign campaign;

    drivers::Time started = 0;
    /// What the threads that a sample passes were given; they come while start() is under way.
    mutable std::mutex setups_mutex;
    rt::ThreadSetup acquisition_setup, estimator_setup;
};

/// What the recorder is given of a campaign that begins.
[[nodiscard]] record::Head recording_head(Parts& parts, const std::string& by,
                                          std::size_t dwells_before);
/// Around the measurement, as it is now; what is commanded, g at the table and Hz. Any thread.
[[nodiscard]] record::ConditionRow conditions(const Parts& parts, double command_g,
                                              double command_hz);

}  // namespace vibrig
