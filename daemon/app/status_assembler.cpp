#include "daemon/app/status_assembler.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "daemon/version.hpp"

namespace vibrig {

using drivers::Time;

namespace {
// The simulated rig's clock stands still with it: its silence is one of wall time.
constexpr Time kSimulatedSilence = 10 * drivers::kSecond;
}  // namespace

void StatusAssembler::serving(const ServerStatus& server) {
    const std::lock_guard lock(mutex_);
    server_ = server;
}

StatusData StatusAssembler::status() const {
    StatusData status = control_.status();
    status.verdict = parts_.dwells.verdict();
    {
        const std::lock_guard lock(mutex_);
        status.server = server_;
    }
    const auto acquired = parts_.acquisition.view();
    const auto estimated = parts_.estimator_stage.view();
    const Time now = parts_.clock.now();
    status.version = kVersion;
    status.clock = parts_.rig_clock ? "rig" : "real";
    status.time = now;
    status.utc_ns = utc_now();
    status.uptime = now - parts_.started;
    status.shaker = parts_.shaker->reading();
    status.shaker_link = parts_.shaker->state();
    status.shaker_counters = parts_.shaker->counters();
    status.stop_pending = parts_.campaign.stopping();
    status.simulated = parts_.configuration.simulated();
    status.can = parts_.port->state();
    // On a real clock of one moment with the assembler: what is under way between them is no loss.
    status.can_counters = parts_.rig_clock ? parts_.port->counters() : acquired.port;
    status.assembler = acquired.assembler;
    const auto ring = parts_.estimator_stage.ring();
    status.estimator_ring = {ring.pushed, ring.popped, ring.dropped};
    status.latency = acquired.latency;
    status.real_time = real_time_status(acquired, estimated);
    status.rig_ticks = acquired.rig_ticks;
    status.increment_frames = acquired.increments;
    status.estimator_in_dwell = estimated.in_dwell;
    status.estimator_idle = estimated.idle;
    status.sample = acquired.sample;
    for (std::size_t c = 0; c < drivers::kChannels; ++c) {
        status.channel_age_s[c] =
            acquired.last_good[c] == 0 ? -1.0 : drivers::to_seconds(now - acquired.last_good[c]);
    }
    status.channel_deadline_s = drivers::to_seconds(parts_.configuration.assembler.stale_deadline);
    status.platform_deadline_s = drivers::to_seconds(parts_.configuration.gimbal.status_deadline);
    status.silent = parts_.rig_clock && acquired.last_frames != 0 &&
                    drivers::steady_now() - acquired.last_frames > kSimulatedSilence;
    status.sample_rate_hz = acquired.rate.hz();
    status.rate_misfit = parts_.fitness.rate_misfit();
    status.clock_misfit = parts_.fitness.clock_misfit();
    status.witness_g = parts_.interlock.seen_g();
    status.platform = acquired.platform;
    const auto& frame = parts_.configuration.estimator;
    status.frame = {frame.up, frame.encoder_sign, frame.encoder_zero_deg,
                    frame.accelerometer_zero_g, frame.accelerometer_matrix};
    status.estimate = estimated.estimate;
    status.interlock = interlock_status(std::move(status.interlock.latches));
    if (parts_.journal) status.journal = parts_.journal->status();
    if (parts_.recorder) status.recorder = parts_.recorder->status();
    if (parts_.outbox) status.archive = parts_.outbox->status();
    if (parts_.log_queue != nullptr) {
        const auto lines = parts_.log_queue->counts();
        status.log = {lines.taken, lines.written, lines.dropped, lines.waiting, lines.blocked};
    }
    outside_.fill(status);
    status.vibration = vibration(status);
    return status;
}

VibrationStatus StatusAssembler::vibration(const StatusData& status) const {
    const auto& rig = parts_.configuration;
    VibrationStatus out;
    if (!rig.spectrum.mixed && !rig.spectrum.mount_stated) return out;
    const drivers::ShakerReading& reading = status.shaker;
    const bool moves = status.command_table_g > 0 || (reading.valid && reading.running);
    out.kind = "rest";
    if (!moves) return out;
    out.commanded_g = status.command_table_g;
    out.platform_g = status.witness_g[0];
    out.table_g = status.witness_g[1];
    const bool random = reading.valid && reading.random && reading.random->random;
    const bool sweeps = reading.valid && reading.sweep && reading.sweep->on;
    out.kind = random ? "random" : sweeps ? "sweep" : "sine";
    if (!random) {
        out.frequency_hz = sweeps          ? reading.sweep->actual_hz
                           : reading.valid ? reading.frequency_hz
                                           : status.command_frequency_hz;
        if (sweeps) {
            out.from_hz = reading.sweep->from_hz;
            out.to_hz = reading.sweep->to_hz;
            out.words = fmt::format("sweep {:g} to {:g} Hz, now {:.2f} Hz", out.from_hz, out.to_hz,
                                    out.frequency_hz);
        }
        if (reading.valid) out.controller_g = reading.measured_g;
        return out;
    }
    const drivers::RandomReading& now = *reading.random;
    out.number = now.profile;
    out.level_db = now.level_db;
    out.controller_g = now.measured_g_rms;
    constexpr std::array<const char*, 4> kWords{"idle", "levelling", "at level", "aborted"};
    out.control = kWords[static_cast<std::size_t>(now.state)];
    // The rules of rt::RandomBands.
    out.low_g = out.commanded_g * std::pow(10, -3.0 / 20);
    out.high_g = out.commanded_g * std::pow(10, 3.0 / 20);
    out.words = fmt::format("random, profile number {} at {:.1f} dB", now.profile, now.level_db);
    const auto profile = std::ranges::find_if(
        rig.profiles, [&now](const auto& one) { return one.number == now.profile; });
    if (profile == rig.profiles.end()) return out;
    out.profile = profile->profile.name;
    out.words = fmt::format("random, profile {} at {:.1f} dB", out.profile, now.level_db);
    out.psd_at = profile->at_table ? "table" : "platform";
    for (const auto& [hz, density] : profile->profile.psd)
        out.psd.emplace_back(hz, density * std::pow(10, now.level_db / 10));
    return out;
}

RealTimeStatus StatusAssembler::real_time_status(const rt::AcquisitionView& acquired,
                                                 const rt::EstimatorView& estimated) const {
    RealTimeStatus status;
    status.memory_locked = parts_.memory_lock.locked;
    if (!parts_.memory_lock.locked) status.missing.push_back("memory: " + parts_.memory_lock.cause);
    if (const auto bound = acquired.lateness.bound; bound != drivers::kNever)
        status.deadline_ms = 1e3 * drivers::to_seconds(bound);
    const auto add = [&status](const char* name, const rt::ThreadSetup& setup,
                               const rt::Lateness& lateness, const rt::PageFaults& faults) {
        for (const auto& what : setup.missing) status.missing.push_back(name + (": " + what));
        const auto since = [](std::uint64_t now, std::uint64_t then) {
            return now > then ? now - then : 0;
        };
        status.threads.push_back({name, setup.fifo_priority, setup.cpus,
                                  since(faults.major, setup.faults.major),
                                  since(faults.minor, setup.faults.minor), lateness.misses,
                                  1e3 * drivers::to_seconds(lateness.longest)});
    };
    const std::lock_guard lock(parts_.setups_mutex);  // its strings come while start() is under way
    add("acquisition", parts_.acquisition_setup, acquired.lateness, acquired.faults);
    add("estimator", parts_.estimator_setup, estimated.lateness, estimated.faults);
    return status;
}

InterlockStatus StatusAssembler::interlock_status(std::vector<Latch> latches) const {
    InterlockStatus status;
    status.latches = std::move(latches);
    status.tripped = parts_.interlock.name_of(parts_.interlock.latched());
    for (const Latch& latch : status.latches) {
        if (status.tripped.empty() && latch.name != journal::kJournalLatch)
            status.tripped = latch.name;
    }
    for (std::size_t i = 0; i < parts_.interlock.rows(); ++i) {
        const auto row = parts_.interlock.row(i);
        const auto& condition = rt::condition_of(row.rule->condition);
        status.rows.push_back({row.rule->name, condition.name,
                               row.rule->reaction == rt::Reaction::abort ? "abort" : "alarm",
                               condition.unit, row.rule->limit, row.rule->dwell_s,
                               condition.has_limit(), row.rule->latched, row.raised, row.value,
                               row.present, condition.below});
    }
    const auto reactions = parts_.interlock.reactions();
    status.reaction_bounds_ms.assign(rt::ReactionHistogram::kBounds_ms.begin(),
                                     rt::ReactionHistogram::kBounds_ms.end());
    status.reaction_counts.assign(reactions.count.begin(), reactions.count.end());
    status.reaction_largest_ms = reactions.largest_ms;
    status.reaction_sum_ms = reactions.sum_ms;
    return status;
}

}  // namespace vibrig
