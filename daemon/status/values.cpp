#include "daemon/status/values.hpp"

#include <array>

namespace vibrig {
namespace {

using S = StatusData;

constexpr double kGravity = 9.80665;  // m/s^2 of 1 g

StatusScalar scalar(bool value) { return value; }
StatusScalar scalar(double value) {
    return std::isfinite(value) ? StatusScalar(value) : StatusScalar();
}
StatusScalar scalar(std::string value) { return value; }
StatusScalar scalar(const char* value) { return std::string(value); }
StatusScalar scalar(std::integral auto value) {
    return static_cast<std::uint64_t>(std::cmp_less(value, 0) ? 0 : value);
}
template <typename Value>
StatusScalar scalar(const std::optional<Value>& value) {
    return value ? scalar(*value) : StatusScalar();
}

template <typename Value>
struct Known {
    using type = Value;
};
template <typename Value>
struct Known<std::optional<Value>> {
    using type = Value;
};

template <typename Value>
constexpr std::size_t kind_of() {
    using Plain = typename Known<std::remove_cvref_t<Value>>::type;
    return std::is_same_v<Plain, bool>       ? 1
           : std::is_integral_v<Plain>       ? 2
           : std::is_floating_point_v<Plain> ? 3
                                             : 4;
}

/// `Of` gives the value; it is a lambda that holds nothing.
template <typename Of>
constexpr StatusValue row(const char* field, const char* unit, Of /*of*/) {
    return {field, unit, kind_of<decltype(Of{}(std::declval<const S&>()))>(),
            [](const S& s) { return scalar(Of{}(s)); }};
}

template <typename Value>
std::optional<Value> only(bool known, Value value) {
    return known ? std::optional<Value>(value) : std::nullopt;
}

std::uint64_t raised(const S& s) {
    std::uint64_t count = 0;
    for (const auto& one : s.interlock.rows) count += one.raised ? 1 : 0;
    return count;
}

/// Of a campaign: before its first sample what the filter has is no measurement.
bool filters(const S& s) { return s.estimate.samples > 0; }
bool platform_good(const S& s) { return s.platform_state() == ChannelState::good; }
/// They have a message of their own, which may be silent alone.
bool gimbals_good(const S& s) {
    return s.platform.gimbal_time != 0 && !s.silent &&
           drivers::to_seconds(s.time - s.platform.gimbal_time) <= s.platform_deadline_s;
}

// clang-format off
const auto kValues = std::to_array<StatusValue>({
    row("version", "", [](auto& s) { return s.version; }).mqtt("Properties/Version")
        .shown("daemon", "vibrigd {}"),
    row("clock", "", [](auto& s) { return s.clock; }).mqtt("Properties/Clock")
        .shown("daemon", "clock {}"),
    row("simulated", "", [](auto& s) { return s.simulated; }).mqtt("Properties/SIMULATED")
        .gauge("vibrig_simulated", "1: the rig is a program."),
    row("time_s", "s", [](auto& s) { return drivers::to_seconds(s.time); }),
    row("uptime_s", "s", [](auto& s) { return drivers::to_seconds(s.uptime); }).mqtt("Uptime")
        .gauge("vibrig_uptime_seconds", "Since the start, by the daemon's clock.")
        .shown("daemon", "up {}").as_duration(),
    row("clock_misfit", "", [](auto& s) { return s.clock_misfit; })
        .shown("clock", "MISFIT: {}").off_page(),
    row("", "", [](auto& s) { return !s.clock_misfit.empty(); })
        .gauge("vibrig_clock_misfit", "1 where rig and daemon have no time in common."),

    row("campaign.name", "", [](auto& s) { return s.campaign_name; }).mqtt("Campaign/Name")
        .shown("campaign", "{}").off_page(),
    row("", "", [](auto& s) { return name_of(s.state); }).mqtt("Campaign/State"),
    row("campaign.reason", "", [](auto& s) { return s.reason; }).mqtt("Campaign/Reason"),
    row("campaign.armed_by", "", [](auto& s) { return s.armed_by; }).mqtt("Campaign/Armed by")
        .shown("campaign", "armed by {}", "not armed").off_page(),
    row("campaign.armed_for", "", [](auto& s) { return s.armed_for; })
        .shown("armed for", "{}").off_page(),
    row("campaign.arming_left_s", "s",
        [](auto& s) { return only(s.arming_left_s > 0, s.arming_left_s); })
        .shown("expires", "in {}", "").with_decimals(0).off_page(),
    row("campaign.started_by", "", [](auto& s) { return s.started_by; }),
    row("campaign.resume_offer", "", [](auto& s) { return s.resume_offer; }),
    row("campaign.run", "", [](auto& s) { return s.run; }).mqtt("Campaign/Run")
        .gauge("vibrig_campaign_run", "Present run, from 1; 0: none."),
    row("campaign.runs", "", [](auto& s) { return s.runs; }).mqtt("Campaign/Runs"),
    row("campaign.position", "", [](auto& s) { return s.position; }).mqtt("Campaign/Position")
        .gauge("vibrig_campaign_position", "Present position, from 1; 0: none."),
    row("campaign.positions", "", [](auto& s) { return s.positions; }).mqtt("Campaign/Positions"),
    row("campaign.progress", "%", [](auto& s) { return s.progress; }).mqtt("Campaign/Progress", 100)
        .gauge("vibrig_campaign_progress_ratio", "Part of the campaign that is done."),
    row("campaign.remaining_s", "s", [](auto& s) { return s.remaining_s; })
        .mqtt("Campaign/Remaining")
        .gauge("vibrig_campaign_remaining_seconds", "Estimate."),
    row("", "", [](auto& s) { return s.dwells.size(); }).mqtt("Campaign/Dwells"),

    row("", "", [](auto& s) { return s.shaker_link == drivers::LinkState::running; })
        .mqtt("Shaker/Link up")
        .gauge("vibrig_shaker_link_up", "1 while the shaker's controller answers."),
    row("campaign.command_table_g", "g", [](auto& s) { return s.command_table_g; })
        .mqtt("Shaker/Command")
        .gauge("vibrig_shaker_command_meters_per_second_squared",
               "Commanded peak acceleration of the table.", kGravity)
        .shown("table", "{} commanded").with_decimals(4).off_page(),
    row("campaign.command_frequency_hz", "Hz", [](auto& s) { return s.command_frequency_hz; }),
    row("shaker.reading_time_s", "s",
        [](auto& s) { return only(s.shaker.valid, drivers::to_seconds(s.shaker.time)); }),
    row("shaker.amplitude_g", "g",
        [](auto& s) { return only(s.shaker.valid, s.shaker.amplitude_g); }),
    row("shaker.measured_g", "g", [](auto& s) { return only(s.shaker.valid, s.shaker.measured_g); })
        .mqtt("Shaker/Measured")
        .gauge("vibrig_shaker_measured_meters_per_second_squared",
               "Measured peak acceleration of the table.", kGravity)
        .shown("table", "{} measured").with_decimals(4).off_page(),
    row("shaker.frequency_hz", "Hz",
        [](auto& s) { return only(s.shaker.valid, s.shaker.frequency_hz); })
        .mqtt("Shaker/Frequency")
        .gauge("vibrig_shaker_frequency_hertz", "Set-point as read back.")
        .shown("table", "{}").with_decimals(3).off_page(),
    row("shaker.running", "", [](auto& s) { return only(s.shaker.valid, s.shaker.running); })
        .mqtt("Shaker/Running")
        .gauge("vibrig_shaker_running", "1 while the run register is set."),
    row("shaker.state", "", [](auto& s) { return only(s.shaker.valid, s.shaker.state); }),
    row("shaker.fault", "", [](auto& s) { return only(s.shaker.valid, s.shaker.fault); }),
    row("", "", [](auto& s) { return only(s.shaker.valid, s.shaker.fault != 0); })
        .gauge("vibrig_shaker_fault", "1 while the controller reports a fault."),
    row("shaker.emergency_stop_open", "",
        [](auto& s) { return only(s.shaker.valid, s.shaker.emergency_stop_open); })
        .mqtt("Shaker/Emergency stop open").gauge("vibrig_emergency_stop_open",
               "1 while the emergency-stop chain is open.")
        .shown("shaker", "EMERGENCY STOP OPEN").off_page(),
    row("shaker.requests", "", [](auto& s) { return s.shaker_counters.requests; }),
    row("shaker.replies", "", [](auto& s) { return s.shaker_counters.replies; }),
    row("shaker.timeouts", "", [](auto& s) { return s.shaker_counters.timeouts; })
        .shown("shaker", "{} timeouts"),
    row("shaker.exceptions", "", [](auto& s) { return s.shaker_counters.exceptions; }),
    row("shaker.wrong_replies", "", [](auto& s) { return s.shaker_counters.wrong_replies; }),
    row("shaker.lost", "", [](auto& s) { return s.shaker_counters.lost; }),
    row("shaker.set_points_discarded", "",
        [](auto& s) { return s.shaker_counters.set_points_discarded; }),
    row("shaker.reconnects", "", [](auto& s) { return s.shaker_counters.reconnects; })
        .counter("vibrig_shaker_reconnects_total", "Connections made anew."),
    row("shaker.feeds", "", [](auto& s) { return s.shaker_counters.feeds; })
        .counter("vibrig_shaker_watchdog_feeds_total", "Feeds of the shaker's watchdog."),
    row("shaker.stops_written", "", [](auto& s) { return s.shaker_counters.stops_written; })
        .counter("vibrig_shaker_stops_total", "Stops written."),
    row("shaker.read_back_mismatches", "",
        [](auto& s) { return s.shaker_counters.read_back_mismatches; })
        .counter("vibrig_shaker_read_back_mismatches_total",
               "Set-points that read back otherwise."),
    row("shaker.watchdog_timeout_s", "s", [](auto& s) {
        return only(s.shaker.valid && s.shaker.watchdog != drivers::WatchdogTimeout::unread,
                    s.shaker.watchdog_timeout_s); }),
    row("shaker.stop_pending", "", [](auto& s) { return s.stop_pending; })
        .mqtt("Shaker/Stop pending")
        .gauge("vibrig_shaker_stop_pending", "1: a stop is ordered and rest not measured since."),
    row("", "", [](auto& s) { return s.rest.disobeyed; })
        .gauge("vibrig_shaker_stop_disobeyed",
               "1: a stop was not obeyed in its time: the emergency stop is to be pressed."),
    row("shaker.rest", "", [](auto& s) { return s.rest.state; }),
    row("shaker.not_at_rest", "", [](auto& s) { return s.rest.what; }),
    row("shaker.platform_rms_g", "g", [](auto& s) { return s.rest.witnesses.platform.rms(); }),
    row("shaker.table_rms_g", "g", [](auto& s) { return s.rest.witnesses.table.rms(); }),
    row("shaker.platform_witness_g", "g",
        [](auto& s) { return only(s.witness_g[0] >= 0, s.witness_g[0]); }),
    row("shaker.table_witness_g", "g",
        [](auto& s) { return only(s.witness_g[1] >= 0, s.witness_g[1]); }),

    row("vibration.kind", "", [](auto& s) { return s.vibration.kind; })
        .shown("excitation", "{}", "").off_page(),
    row("vibration.frequency_hz", "Hz",
        [](auto& s) { return only(s.vibration.frequency_hz > 0, s.vibration.frequency_hz); })
        .shown("excitation", "{}", "").with_decimals(2).off_page(),
    row("vibration.profile", "", [](auto& s) { return s.vibration.profile; })
        .shown("excitation", "profile {}", "").off_page(),
    row("vibration.number", "", [](auto& s) { return only(s.vibration.number > 0, s.vibration.number); }),
    row("vibration.level_db", "dB",
        [](auto& s) { return only(s.vibration.number > 0, s.vibration.level_db); })
        .shown("excitation", "{}", "").with_decimals(1).off_page(),
    row("vibration.control", "", [](auto& s) { return s.vibration.control; })
        .shown("excitation", "{}", "").off_page(),
    row("vibration.commanded_g", "g", [](auto& s) { return s.vibration.commanded_g; }),
    row("vibration.controller_g", "g",
        [](auto& s) { return only(s.vibration.controller_g >= 0, s.vibration.controller_g); }),
    row("vibration.table_g", "g",
        [](auto& s) { return only(s.vibration.table_g >= 0, s.vibration.table_g); }),
    row("vibration.platform_g", "g",
        [](auto& s) { return only(s.vibration.platform_g >= 0, s.vibration.platform_g); }),
    row("vibration.low_g", "g", [](auto& s) { return only(s.vibration.low_g >= 0, s.vibration.low_g); }),
    row("vibration.high_g", "g",
        [](auto& s) { return only(s.vibration.high_g >= 0, s.vibration.high_g); }),
    row("vibration.psd_at", "", [](auto& s) { return s.vibration.psd_at; }),
    row("vibration.from_hz", "Hz",
        [](auto& s) { return only(s.vibration.from_hz > 0, s.vibration.from_hz); }),
    row("vibration.to_hz", "Hz",
        [](auto& s) { return only(s.vibration.to_hz > 0, s.vibration.to_hz); }),
    row("vibration.words", "", [](auto& s) { return s.vibration.words; })
        .shown("vibration", "{}", ""),

    row("interlock.tripped", "", [](auto& s) { return s.interlock.tripped; })
        .mqtt("Interlock/Tripped"),
    row("", "", [](auto& s) { return !s.interlock.tripped.empty(); })
        .gauge("vibrig_interlock_tripped",
               "1: the shaker was stopped; latched until acknowledged."),
    row("", "", [](auto& s) { return raised(s); }).mqtt("Interlock/Raised"),

    row("", "", [](auto& s) { return s.can == drivers::PortState::running; }).mqtt("CAN/Link up")
        .gauge("vibrig_can_link_up", "1 while the CAN port runs."),
    row("can.received", "", [](auto& s) { return s.can_counters.received; }).mqtt("CAN/Received")
        .counter("vibrig_can_received_frames_total", "Frames read from the CAN port.")
        .shown("CAN", "{} frames"),
    row("can.delivered", "", [](auto& s) { return s.can_counters.delivered; }),
    row("can.own", "", [](auto& s) { return s.can_counters.own; }),
    row("can.error_frames", "", [](auto& s) { return s.can_counters.error_frames; })
        .shown("CAN", "{} errors"),
    row("can.malformed", "", [](auto& s) { return s.can_counters.malformed; }),
    row("can.kernel_dropped", "", [](auto& s) { return s.can_counters.kernel_dropped; })
        .mqtt("CAN/Dropped")
        .shown("dropped", "kernel {}").alarms(),
    row("can.sent", "", [](auto& s) { return s.can_counters.sent; })
        .counter("vibrig_can_sent_frames_total", "Frames sent."),
    row("can.send_failed", "", [](auto& s) { return s.can_counters.send_failed; })
        .counter("vibrig_can_send_failures_total", "Frames that could not be sent."),
    row("can.transitions", "", [](auto& s) { return s.can_counters.transitions; }),
    row("can.controller", "", [](auto& s) { return drivers::name_of(s.can_counters.controller); }),

    row("assembler.received", "", [](auto& s) { return s.assembler.received; }),
    row("assembler.used", "", [](auto& s) { return s.assembler.used; }),
    row("assembler.unknown", "", [](auto& s) { return s.assembler.unknown; })
        .shown("dropped", "unknown {}"),
    row("assembler.duplicate", "", [](auto& s) { return s.assembler.duplicate; })
        .shown("dropped", "duplicate {}"),
    row("assembler.late", "", [](auto& s) { return s.assembler.late; })
        .shown("dropped", "late {}"),
    row("assembler.wrong_length", "", [](auto& s) { return s.assembler.wrong_length; }),
    row("assembler.samples", "", [](auto& s) { return s.assembler.samples; }).mqtt("Samples/Taken")
        .counter("vibrig_samples_total", "Samples put together.")
        .shown("samples", "{} taken"),
    row("assembler.incomplete", "", [](auto& s) { return s.assembler.incomplete; })
        .mqtt("Samples/Incomplete")
        .counter("vibrig_samples_incomplete_total", "Samples with a missing channel.")
        .shown("dropped", "incomplete {}"),
    row("assembler.gaps", "", [](auto& s) { return s.assembler.gaps; }).mqtt("Samples/Gaps")
        .counter("vibrig_sample_gaps_total", "Sync counts that never showed.")
        .shown("dropped", "gaps {}").alarms(),
    row("assembler.resyncs", "", [](auto& s) { return s.assembler.resyncs; }),
    row("assembler.rig_ticks", "", [](auto& s) { return s.rig_ticks; }),
    row("assembler.increments", "", [](auto& s) { return s.increment_frames; }),
    row("estimator_ring.pushed", "", [](auto& s) { return s.estimator_ring.pushed; }),
    row("estimator_ring.popped", "", [](auto& s) { return s.estimator_ring.popped; }),
    row("estimator_ring.dropped", "", [](auto& s) { return s.estimator_ring.dropped; })
        .mqtt("Samples/Dropped")
        .shown("dropped", "ring {}").alarms(),
    row("estimator_ring.in_dwell", "", [](auto& s) { return s.estimator_in_dwell; }),
    row("estimator_ring.idle", "", [](auto& s) { return s.estimator_idle; }),
    row("sample.time_s", "s", [](auto& s) { return drivers::to_seconds(s.sample.time); }),
    row("sample.sequence", "", [](auto& s) { return s.sample.sequence; }),
    row("sample.dropped_before", "", [](auto& s) { return s.sample.dropped_before; }),
    row("sample.rate_hz", "Hz",
        [](auto& s) { return only(s.sample_rate_hz > 0, s.sample_rate_hz); })
        .gauge("vibrig_sample_rate_hertz", "Measured over ten seconds at most.")
        .shown("samples", "{}").with_decimals(1),
    row("real_time.memory_locked", "", [](auto& s) { return s.real_time.memory_locked; })
        .gauge("vibrig_memory_locked", "1 while the daemon's memory is locked."),
    row("real_time.deadline_ms", "ms", [](auto& s) { return s.real_time.deadline_ms; }),

    row("", "", [](auto& s) { return !platform_good(s); })
        .gauge("vibrig_platform_silent", "1 while it has sent nothing within its deadline."),
    row("platform.quality", "", [](auto& s) { return name_of(s.platform_state()); }),
    row("platform.time_s", "s",
        [](auto& s) { return only(s.platform.time != 0, drivers::to_seconds(s.platform.time)); }),
    row("platform.ready", "", [](auto& s) { return only(platform_good(s), s.platform.ready); })
        .mqtt("Platform/Ready")
        .gauge("vibrig_platform_ready", "1 while the platform reports it.")
        .shown("platform", "ready", "NOT READY").off_page(),
    row("platform.loop_closed", "",
        [](auto& s) { return only(platform_good(s), s.platform.loop_closed); })
        .gauge("vibrig_platform_loop_closed", "1 while its loop is closed.")
        .shown("platform", "", "loop open").off_page(),
    row("platform.gyros_at_speed", "",
        [](auto& s) { return only(platform_good(s), s.platform.gyros_at_speed); })
        .shown("platform", "", "gyros not at speed").off_page(),
    row("platform.fault", "", [](auto& s) { return only(platform_good(s), s.platform.fault); })
        .gauge("vibrig_platform_fault", "1 while it reports a fault.")
        .shown("platform", "FAULT").off_page(),
    row("platform.temperature_c", "degC",
        [](auto& s) { return only(platform_good(s), s.platform.temperature_c); })
        .mqtt("Platform/Temperature")
        .gauge("vibrig_platform_temperature_celsius", "As the platform reports.")
        .shown("platform", "{}", "").with_decimals(2).off_page(),
    row("platform.gimbal_time_s", "s", [](auto& s) {
        return only(s.platform.gimbal_time != 0, drivers::to_seconds(s.platform.gimbal_time)); }),
    row("platform.in_position", "",
        [](auto& s) { return only(gimbals_good(s), s.platform.in_position); })
        .shown("platform", "in position").off_page(),
    row("platform.slewing", "",
        [](auto& s) { return only(gimbals_good(s), s.platform.slewing); })
        .shown("platform", "slewing").off_page(),
    row("platform.gimbal_command_echo", "", [](auto& s) {
        return only(gimbals_good(s), s.platform.gimbal_command_echo); }),

    row("journal.path", "", [](auto& s) { return s.journal.path; }),
    row("journal.running", "", [](auto& s) { return s.journal.running; }),
    row("", "", [](auto& s) { return s.journal.path.empty() || s.journal.running; })
        .mqtt("Journal/Writes")
        .gauge("vibrig_journal_up", "1 while the journal writes, or none is kept."),
    row("journal.note", "", [](auto& s) { return s.journal.note; }),
    row("journal.taken", "", [](auto& s) { return s.journal.taken; }),
    row("journal.written", "", [](auto& s) { return s.journal.written; }),
    row("journal.dropped", "", [](auto& s) { return s.journal.dropped; }),
    row("journal.public_key", "", [](auto& s) { return s.journal.public_key; }),
    row("journal.head", "", [](auto& s) { return s.journal.head; }),
    row("journal.proof_head", "", [](auto& s) { return s.journal.proof_head; }),
    row("journal.entries", "", [](auto& s) { return s.journal.entries; }),
    row("journal.verified", "", [](auto& s) { return s.journal.verified; }),
    row("journal.verified_part", "", [](auto& s) { return s.journal.verified_part; }),
    row("journal.not_watched", "", [](auto& s) { return s.journal.not_watched; }),
    row("recorder.folder", "", [](auto& s) { return s.recorder.folder; }),
    row("recorder.file", "", [](auto& s) { return s.recorder.file; }),
    row("recorder.recording", "", [](auto& s) { return s.recorder.recording; }),
    row("recorder.good", "", [](auto& s) { return s.recorder.good; }),
    row("", "", [](auto& s) { return !s.recorder.recording || s.recorder.good; })
        .mqtt("Recorder/Writes"),
    row("recorder.note", "", [](auto& s) { return s.recorder.note; }),
    row("recorder.samples", "", [](auto& s) { return s.recorder.samples; }),
    row("recorder.samples_lost", "", [](auto& s) { return s.recorder.samples_lost; }),
    row("recorder.frames", "", [](auto& s) { return s.recorder.frames; }),
    row("recorder.frames_lost", "", [](auto& s) { return s.recorder.frames_lost; }),
    row("recorder.raw_bytes", "", [](auto& s) { return s.recorder.raw_bytes; }),
    row("recorder.segments", "", [](auto& s) { return s.recorder.segments; }),
    row("recorder.gaps", "", [](auto& s) { return s.recorder.gaps; }),
    row("recorder.samples_dropped", "", [](auto& s) { return s.recorder.samples_dropped; }),
    row("recorder.frames_dropped", "", [](auto& s) { return s.recorder.frames_dropped; }),
    row("recorder.entries_dropped", "", [](auto& s) { return s.recorder.entries_dropped; }),

    row("estimate.amplitude_g", "g", [](auto& s) { return only(filters(s), s.estimate.amplitude_g); })
        .shown("vibration", "newest dwell {}").with_decimals(4),
    row("estimate.frequency_hz", "Hz", [](auto& s) { return only(filters(s), s.estimate.frequency_hz); })
        .shown("vibration", "{}").with_decimals(3).unless("vibration.words"),
    row("estimate.kappa", "", [](auto& s) { return only(filters(s), s.estimate.kappa); }),
    row("estimate.samples", "", [](auto& s) { return s.estimate.samples; })
        .shown("filter", "{} samples").off_page(),
    row("estimate.used", "", [](auto& s) { return s.estimate.used; })
        .shown("filter", "{} used").off_page(),
    row("estimate.rejected", "", [](auto& s) { return s.estimate.rejected; })
        .shown("filter", "{} rejected").off_page(),
    row("estimate.nis_per_dof", "", [](auto& s) { return only(filters(s), s.estimate.nis_per_dof); })
        .mqtt("Filter/NIS per degree of freedom")
        .gauge("vibrig_filter_nis_ratio", "Normalised innovation squared per degree of freedom.")
        .shown("filter", "NIS {}").with_decimals(3).off_page(),
    row("estimate.dwells", "", [](auto& s) { return s.estimate.dwells; })
        .shown("filter", "{} dwells").off_page(),
    row("noise.angle_in_force_arcsec", "arcsec",
        [](auto& s) { return s.noise.angle_in_force_arcsec; }),
    row("noise.block_s", "s", [](auto& s) { return only(s.noise.dwells > 0, s.noise.block_s); }),
    row("noise.dwells", "", [](auto& s) { return s.noise.dwells; })
        .gauge("vibrig_noise_dwells", "Dwells the noise is known from.")
        .shown("noise", "in {} dwells").off_page(),
    row("noise.dwells_left_out", "", [](auto& s) { return s.noise.dwells_left_out; }),
    row("noise.alarms_total", "", [](auto& s) { return s.noise.alarms_total; })
        .counter("vibrig_noise_alarms_total",
               "Dwells whose noise was not that of the earlier ones.")
        .shown("noise", "{} alarms").off_page(),
    row("", "", [](auto& s) { return only(s.verdict.dwells > 0, s.verdict.level); })
        .gauge("vibrig_verdict_level", "Of the campaign so far: 0 valid, 1 doubtful, 2 not valid."),
    row("", "", [](auto& s) { return only(s.verdict.dwells > 0, s.verdict.dwells); })
        .gauge("vibrig_verdict_dwells", "Dwells that the verdict rests on."),
    row("", "", [](auto& s) { return only(s.verdict.dwells > 0, s.verdict.widening); })
        .gauge("vibrig_uncertainty_widening_ratio",
               "Uncertainty of a coefficient over that of noise alone, median."),
    row("verdict.level", "", [](auto& s) { return s.verdict.level; }),
    row("verdict.word", "", [](auto& s) { return s.verdict.word; }),
    row("verdict.sentence", "", [](auto& s) { return s.verdict.sentence; })
        .shown("verdict", "{}").off_page(),
    row("verdict.dwells", "", [](auto& s) { return s.verdict.dwells; }),
    row("verdict.widening", "", [](auto& s) { return s.verdict.widening; }),
    row("verdict.complete", "", [](auto& s) { return s.verdict.complete; }),

    row("log.taken", "", [](auto& s) { return s.log.taken; }),
    row("log.written", "", [](auto& s) { return s.log.written; }),
    row("log.dropped", "", [](auto& s) { return s.log.dropped; }),
    row("log.waiting", "", [](auto& s) { return s.log.waiting; }),
    row("log.blocked", "", [](auto& s) { return s.log.blocked; })
        .gauge("vibrig_log_blocked", "1 while nobody takes the log's lines."),
    row("guard.socket", "", [](auto& s) { return s.guard.socket; }),
    row("guard.heard", "", [](auto& s) { return only(!s.guard.socket.empty(), s.guard.heard); })
        .gauge("vibrig_guard_up", "1 while vibrig-guard is heard."),
    row("", "", [](auto& s) { return only(!s.guard.socket.empty(), !s.guard.text.empty()); })
        .gauge("vibrig_guard_finding", "1 while vibrig-guard has found something."),
    row("guard.note", "", [](auto& s) { return s.guard.note; }),
    row("guard.cause", "", [](auto& s) { return s.guard.cause; }),
    row("guard.text", "", [](auto& s) { return s.guard.text; }),
    row("guard.disobeyed", "", [](auto& s) { return s.guard.disobeyed; }),
    row("guard.sees", "", [](auto& s) { return only(s.guard.heard, s.guard.sees); }),
    row("guard.rest", "", [](auto& s) { return only(s.guard.heard, s.guard.rest); }),
    row("guard.reaches_shaker", "", [](auto& s) { return only(s.guard.heard, s.guard.reaches_shaker); }),
    row("guard.horn_confirms", "", [](auto& s) { return only(s.guard.heard, s.guard.horn_confirms); }),
    row("guard.table_g", "g", [](auto& s) { return only(s.guard.heard, s.guard.table_g); }),
    row("guard.version", "", [](auto& s) { return s.guard.version; }),
    row("annunciator.horn", "", [](auto& s) { return s.annunciator.horn; }),
    row("annunciator.confirms", "", [](auto& s) { return s.annunciator.confirms; }),
    row("", "", [](auto& s) { return only(s.annunciator.horn, s.annunciator.confirms); })
        .gauge("vibrig_annunciator_confirms", "1 while horn and lamp read back as commanded."),
    row("annunciator.horn_note", "", [](auto& s) { return s.annunciator.horn_note; }),
    row("annunciator.pattern", "", [](auto& s) { return drivers::name_of(s.annunciator.pattern); }),
    row("annunciator.command", "", [](auto& s) { return s.annunciator.command; }),
    row("annunciator.started", "", [](auto& s) { return s.annunciator.started; }),
    row("annunciator.failed", "", [](auto& s) { return s.annunciator.failed; }),
    row("annunciator.timed_out", "", [](auto& s) { return s.annunciator.timed_out; }),
    row("annunciator.left_out", "", [](auto& s) { return s.annunciator.left_out; }),
    row("annunciator.command_note", "", [](auto& s) { return s.annunciator.command_note; }),
    row("archive.folder", "", [](auto& s) { return s.archive.folder; }),
    row("archive.good", "", [](auto& s) { return only(!s.archive.folder.empty(), s.archive.good); })
        .gauge("vibrig_archive_up", "1 while campaigns can be delivered to the archive."),
    row("archive.note", "", [](auto& s) { return s.archive.note; }),
    row("archive.delivering", "", [](auto& s) { return s.archive.delivering; }),
    row("archive.waiting", "",
        [](auto& s) { return only(!s.archive.folder.empty(), s.archive.waiting); })
        .gauge("vibrig_archive_waiting", "Campaigns that are over and not delivered.")
        .shown("archive", "{} waiting", "").off_page(),
    row("archive.waiting_bytes", "",
        [](auto& s) { return only(!s.archive.folder.empty(), s.archive.waiting_bytes); })
        .gauge("vibrig_archive_waiting_bytes", "Bytes of them."),
    row("archive.delivered", "", [](auto& s) { return s.archive.delivered; })
        .shown("archive", "{} delivered", "").off_page(),
    row("archive.failures", "", [](auto& s) { return s.archive.failures; }),
    row("archive.removed", "", [](auto& s) { return s.archive.removed; }),
    row("archive.refused", "",
        [](auto& s) { return only(!s.archive.folder.empty(), s.archive.refused); })
        .gauge("vibrig_archive_refused", "Campaigns that the archive refused: put aside."),
    row("archive.refused_note", "", [](auto& s) { return s.archive.refused_note; }),
    row("mqtt.broker", "", [](auto& s) { return s.mqtt.broker; }),
    row("mqtt.connected", "", [](auto& s) { return s.mqtt.connected; }),
    row("", "", [](auto& s) { return only(!s.mqtt.broker.empty(), s.mqtt.connected); })
        .gauge("vibrig_mqtt_up", "1 while the broker is connected."),
    row("mqtt.note", "", [](auto& s) { return s.mqtt.note; }),
    row("mqtt.connections", "", [](auto& s) { return s.mqtt.connections; }),
    row("", "", [](auto& s) { return only(!s.mqtt.broker.empty(), s.mqtt.connections); })
        .counter("vibrig_mqtt_connections_total", "Connections to the broker."),
    row("mqtt.births", "", [](auto& s) { return s.mqtt.births; }),
    row("mqtt.messages", "", [](auto& s) { return s.mqtt.messages; }),
    row("mqtt.left_out", "", [](auto& s) { return s.mqtt.left_out; }),
});
// clang-format on

}  // namespace

std::span<const StatusValue> status_values() { return kValues; }

}  // namespace vibrig
