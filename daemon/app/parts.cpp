#include "daemon/app/parts.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "daemon/app/campaign_forecast.hpp"
#include "daemon/app/start_checks.hpp"
#include "daemon/order/campaign_order.hpp"
#include "daemon/record/digest.hpp"
#include "daemon/version.hpp"
#include "drivers/sample/signal_binding.hpp"

namespace vibrig {

using configuration::Configuration;
using drivers::Time;

namespace {

constexpr std::size_t kManyEvents = serve::EventLog::kCapacity;

bool rig_owns_time(const Configuration& configuration) {
    return configuration.clock == Configuration::ClockKind::rig;
}

rt::MemoryLock lock_memory(const Configuration& configuration) {
    if (rig_owns_time(configuration)) return {false, "not asked for: the rig owns the time"};
    if (!configuration.lock_memory) return {false, "not asked for: threads.lock_memory is false"};
    return rt::lock_memory();
}

drivers::ShakerSettings shaker_settings(const Configuration& configuration) {
    auto settings = configuration.shaker;
    // Shorter than its watchdog waits.
    if (configuration.record_demanded())
        settings.identify = std::min(settings.response_timeout, settings.watchdog_period);
    if (rig_owns_time(configuration)) {
        // The rig's time stands still meanwhile: a busy machine is slower, not different.
        settings.response_timeout = std::max(settings.response_timeout, 10 * drivers::kSecond);
        settings.stop_ramp_timeout = settings.response_timeout;
        if (settings.identify > 0) settings.identify = settings.response_timeout;
    }
    return settings;
}

rt::AmplitudeWitness::Settings witness_settings(const Configuration& configuration,
                                                const proto::Dbc& dbc) {
    const auto& rig = configuration.estimator;
    const auto& names = configuration.assembler.bindings;
    const auto count = [&dbc](const std::string& name) {
        const auto bound = drivers::bind_signal(dbc, "can.signals", name);
        // A floating-point number has no counts.
        const bool counts = bound && bound.signal->type == proto::ValueType::integer;
        return counts ? std::abs(bound.signal->scale) : 0;
    };
    return {rig.frequency_hz,
            configuration.assembler.sample_period,
            rig.accelerometer_zero_g,
            rig.accelerometer_matrix,
            {count(names.accel_x), count(names.accel_y), count(names.accel_z),
             count(names.table_accel)}};
}

rt::Interlock::Limits interlock_limits(const Configuration& configuration, const proto::Dbc& dbc) {
    return {configuration.campaign.max_acceleration_g,
            configuration.gimbal.status_deadline,
            configuration.interlock,
            witness_settings(configuration, dbc),
            configuration.estimator.transmission,
            configuration.abort_bands,
            !configuration.assembler.bindings.temperature.empty()};
}

std::unique_ptr<record::Recorder> make_recorder(Parts& parts) {
    if (!parts.configuration.record.enabled || parts.recordings().empty()) return nullptr;
    parts.recorder_waiter = parts.clock.make_waiter();
    return std::make_unique<record::Recorder>(parts.configuration.record, parts.recordings(),
                                              parts.clock, *parts.recorder_waiter,
                                              [&parts](Severity severity, const std::string& text) {
                                                  parts.events.log(severity, "recorder", text);
                                                  if (parts.outbox) parts.outbox->look();
                                              });
}

std::unique_ptr<record::PreTrip> make_pre_trip(Parts& parts) {
    if (parts.configuration.results.empty()) return nullptr;
    return std::make_unique<record::PreTrip>(
        (std::filesystem::path(parts.configuration.results) / "trips").string(),
        parts.configuration.assembler.sample_period,
        [&parts] { return parts.events.after(0, kManyEvents); }, parts.events.sink("pre-trip"));
}

/// To whom the acquisition hands what it has received.
rt::Acquisition::Wiring wiring(Parts& parts) {
    rt::Acquisition::Wiring to{parts.estimator_ring, *parts.estimator_waiter, *parts.control_waiter,
                               parts.interlock};
    to.stages = &parts.stage_feed;
    to.rest = &parts.rest;
    if (parts.recorder) {
        to.recorder_frames = &parts.recorder->received();
        to.recorder_samples = &parts.recorder->samples();
    }
    if (parts.pre_trip) to.pre_trip = &parts.pre_trip->samples();
    to.to_estimator = &parts.estimator_stage.hand_over();
    if (parts.in_real_time())
        parts.estimator_stage.time_by(parts.clock, parts.configuration.assembler.sample_period);
    else
        parts.estimator_stage.gather();
    return to;
}

std::unique_ptr<drivers::Torquer> make_torquer(Parts& parts) {
    const auto& campaign = parts.configuration.campaign;
    // Commissioning wants it of every rig that has torquers.
    if (!campaign.levelling && !drivers::Torquer::known(parts.dbc, campaign.level.torquer))
        return nullptr;
    return std::make_unique<drivers::Torquer>(parts.dbc, campaign.level.torquer,
                                              parts.sending_port());
}

/// Levelling and zeroing, where they are asked for, act by way of these.
campaign::Rig& with_stages(CampaignRig& rig, drivers::Torquer* torquer, rt::StageFeed& feed) {
    rig.torquer = torquer;
    rig.feed = &feed;
    return rig;
}

}  // namespace

Parts::Parts(configuration::Loaded given, const log::LogQueue* queue)
    : loaded(put_in_order(std::move(given))),
      configuration(loaded.configuration),
      log_queue(queue),
      memory_lock(lock_memory(configuration)),
      rig_clock(rig_owns_time(configuration) ? std::make_unique<rt::RigClock>() : nullptr),
      real_clock(rig_clock ? nullptr : std::make_unique<rt::RealClock>()),
      clock(rig_clock ? static_cast<drivers::Clock&>(*rig_clock) : *real_clock),
      events(clock),
      dbc(load_dbc(configuration.dbc)),
      port(drivers::make_can_port(io, configuration.can)),
      shaker(drivers::make_shaker(clock, shaker_settings(configuration))),
      control_waiter(std::make_unique<rt::StirredWaiter>(clock.make_waiter())),
      estimator_waiter(clock.make_waiter()),
      interlock(*shaker, *control_waiter, interlock_limits(configuration, dbc)),
      book(configuration.estimator, events.sink("noise")),
      estimator_stage(estimator_ring, *estimator_waiter, *control_waiter, book.identification()),
      recorder(make_recorder(*this)),
      sent_tap(recorder ? std::make_unique<record::SentTap>(*port, clock, recorder->sent())
                        : nullptr),
      pre_trip(make_pre_trip(*this)),
      stage_feed(dbc, campaign::stage_feed_settings(configuration.campaign), control_waiter.get()),
      rest(configuration.campaign.rest, configuration.assembler.sample_period,
           witness_settings(configuration, dbc).count_g),
      acquisition(io, *port, dbc, configuration.assembler, clock, rig_clock.get(), wiring(*this)),
      fitness(configuration, clock, *port, acquisition),
      gimbal(dbc, configuration.gimbal, sending_port()),
      torquer(make_torquer(*this)),
      rig(gimbal, *shaker, acquisition, rest, fitness, interlock, events),
      dwells({loaded, clock, *control_waiter, book, estimator_stage, recorder, journal, outbox,
              fitness, events, rig_clock != nullptr, memory_lock.locked}),
      campaign_log(events, journal),
      campaign(configuration.campaign,
               {with_stages(rig, torquer.get(), stage_feed), dwells, campaign_log}) {
    events.record_in(recorder.get());
}

drivers::CanPort& Parts::sending_port() noexcept {
    return sent_tap ? static_cast<drivers::CanPort&>(*sent_tap) : *port;
}

std::string Parts::in_force() const {
    return fmt::format("in force: SHA-256 {}, {}, vibrigd {}",
                       record::sha256_of_text(configuration::format_effective(loaded)),
                       loaded.path.empty() ? "without a file" : loaded.path, kVersion);
}

const std::string& Parts::recordings() const noexcept {
    return configuration.record.folder.empty() ? configuration.results
                                               : configuration.record.folder;
}

}  // namespace vibrig
