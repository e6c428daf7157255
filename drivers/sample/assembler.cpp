#include "drivers/sample/assembler.hpp"

#include <linux/can.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <numbers>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "drivers/sample/frame_plan.hpp"
#include "drivers/sample/regularity.hpp"
#include "drivers/sample/sync_clock.hpp"

namespace vibrig::drivers {
namespace {

constexpr std::uint32_t kMaxOpenSamples = 64;
constexpr int kMaxSamplesPerFrame = 16;
/// Rate error of the device that a silence may add up, 1.
constexpr double kRateTolerance = 0.02;

/// a - b for counters that wrap at 2^bits, within half a turn.
std::int64_t wrapped_difference(std::uint64_t a, std::uint64_t b, unsigned bits) noexcept {
    const unsigned spare = 64 - bits;
    return static_cast<std::int64_t>((a - b) << spare) >> spare;
}

std::uint64_t low_bits(std::uint64_t value, unsigned bits) noexcept {
    return bits >= 64 ? value : value & ((std::uint64_t{1} << bits) - 1);
}

/// deg to rad in [0, 2 pi).
double wrapped_radians(double degrees) noexcept {
    constexpr double kTurn = 2 * std::numbers::pi;
    const double turns = degrees / 360.0;
    const double angle = (turns - std::floor(turns)) * kTurn;
    return angle < kTurn ? angle : 0.0;
}

/// FNV-1a.
std::uint64_t digest(std::span<const std::uint8_t> bytes) noexcept {
    std::uint64_t hash = 14695981039346656037ULL;
    for (const std::uint8_t byte : bytes) hash = (hash ^ byte) * 1099511628211ULL;
    return hash;
}

/// A classic frame is as long as the DBC says; CAN FD has no frames of, say, 61 bytes: the next
/// longer one carries them.
bool has_length(const ReceivedFrame& frame, std::uint8_t size) noexcept {
    if (frame.frame.len == size || !frame.fd || size <= CAN_MAX_DLEN)
        return frame.frame.len == size;
    constexpr std::array<std::uint8_t, 7> kLengths{12, 16, 20, 24, 32, 48, 64};
    return frame.frame.len == *std::ranges::lower_bound(kLengths, size);
}

}  // namespace

struct SampleAssembler::Impl {
    /// One sync count while its frames come in.
    struct OpenSample {
        bool shown = false;  ///< a frame of it has come
        std::int64_t count = 0;
        Time first = 0;                           ///< time of the first frame that came
        std::uint64_t seen = 0;                   ///< bits of the messages that came
        std::array<std::uint64_t, 64> content{};  ///< of each, by its bit
        std::uint64_t frames = 0;
        std::array<double, kChannels> value{};
        std::array<Time, kChannels> time{};
        std::array<bool, kChannels> has_value{};
        std::array<bool, kChannels> in_range{};
        std::array<bool, kChannels> has_validity{};
        std::array<bool, kChannels> valid{};
    };

    /// A sync count that does not follow from the last one: a restart of the device if the next one
    /// confirms it.
    struct Suspect {
        bool pending = false;
        OpenSample sample;
        Time sync_time = 0;
    };

    Impl(const proto::Dbc& dbc, const AssemblerSettings& s, SampleHandler handler)
        : settings(s),
          on_sample(std::move(handler)),
          plan(dbc, s.bindings, static_cast<std::uint32_t>(s.samples_per_frame), s.units_checked),
          clock(s.sample_period),
          parts(static_cast<std::uint32_t>(s.samples_per_frame)),
          // As many frames out of order as with one sample in each, but no more samples than that.
          open(std::min(s.open_samples * parts, kMaxOpenSamples)) {}

    void feed(const ReceivedFrame& frame) noexcept;
    void take_sync(const MessagePlan& message, const ReceivedFrame& frame,
                   std::uint64_t raw) noexcept;
    void take_without_count(const MessagePlan& message, const ReceivedFrame& frame) noexcept;
    void take_low(const MessagePlan& message, const ReceivedFrame& frame) noexcept;
    bool place(std::int64_t count, const MessagePlan& message, const ReceivedFrame& frame) noexcept;
    OpenSample& opened(std::int64_t count, const ReceivedFrame& frame) noexcept;
    bool join(OpenSample& sample, const MessagePlan& message, const ReceivedFrame& frame,
              std::uint32_t part) noexcept;
    void take_status(const MessagePlan& message, const ReceivedFrame& frame) noexcept;
    void take_status(const StatusRow& row, double value, Time time) noexcept;
    void suspect_restart(std::uint64_t raw, unsigned bits, const MessagePlan& message,
                         const ReceivedFrame& frame) noexcept;
    void drop_suspect() noexcept;
    void restart_at_suspect() noexcept;
    void begin_at(std::int64_t count, Time time) noexcept;
    void make_room(std::int64_t count) noexcept;
    void drain(Time now) noexcept;
    void give_out(OpenSample& sample) noexcept;
    void count_joined(bool joined) noexcept { ++(joined ? counters.used : counters.duplicate); }
    [[nodiscard]] bool sync_silent(Time now) const noexcept {
        const bool seldom = sync_period > settings.stale_deadline;
        const Time deadline = std::max(
            settings.stale_deadline, seldom ? std::max(kSecond, 3 * sync_period) : 4 * sync_period);
        return sync_time != 0 && now - sync_time > deadline;
    }
    [[nodiscard]] Quality judge(const OpenSample& sample, std::size_t channel) const noexcept;
    /// The earliest count not yet given out of which a frame has come.
    [[nodiscard]] OpenSample* first_shown() noexcept;
    [[nodiscard]] OpenSample& slot(std::int64_t count) noexcept {
        return open[static_cast<std::uint64_t>(count) % open.size()];
    }
    /// The count that is due at `time` if the device ran on.
    [[nodiscard]] double periods_since_newest(Time time) const noexcept {
        return std::floor(static_cast<double>(time - newest_time) /
                              static_cast<double>(settings.sample_period) +
                          0.5);
    }

    AssemblerSettings settings;
    SampleHandler on_sample;
    FramePlan plan;
    SyncClock clock;
    std::uint32_t parts;  ///< samples in a frame
    std::vector<OpenSample> open;
    Suspect suspect;
    bool begun = false;
    std::int64_t newest = 0;    ///< largest count that has shown
    Time newest_time = 0;       ///< of its first frame
    std::int64_t next_out = 0;  ///< the count to be given out next
    Time last_out = 0;
    bool any_out = false;
    std::array<Time, kChannels> last_good{};
    std::array<bool, kChannels> ever_good{};
    PlatformStatus platform;
    Time loop_time = 0, fault_time = 0;  ///< of its newest frame
    Time position_time = 0, slewing_time = 0, echo_time = 0;
    Regularity of_ready, of_speed;
    Time newest_frame = 0;
    Time sync_time = 0, sync_period = 0;  ///< of its newest frame; about how often they come
    AssemblerCounters counters;
};

void SampleAssembler::Impl::feed(const ReceivedFrame& frame) noexcept {
    ++counters.received;
    newest_frame = frame.time;
    const canid_t id = frame.frame.can_id;
    const bool extended = (id & CAN_EFF_FLAG) != 0;
    const MessagePlan* message =
        (id & (CAN_RTR_FLAG | CAN_ERR_FLAG)) != 0
            ? nullptr
            : plan.find(id & (extended ? CAN_EFF_MASK : CAN_SFF_MASK), extended);
    if (message == nullptr) {
        ++counters.unknown;
        return;
    }
    if (!has_length(frame, message->message->size)) {
        ++counters.wrong_length;
        return;
    }
    // Deadlines go by the stamps first: the result is the same whether the thread woke up in time
    // or not.
    drain(frame.time);
    take_status(*message, frame);
    if (message->bits(std::span<const std::uint8_t>(frame.frame.data, frame.frame.len)) == 0) {
        ++counters.used;
        return;
    }
    if (!plan.has_count()) {
        take_without_count(*message, frame);
    } else if (message->count != nullptr) {
        const std::span<const std::uint8_t> payload(frame.frame.data, frame.frame.len);
        const std::optional<std::int64_t> raw = proto::decode_raw(*message->count, payload);
        if (raw)
            // All below goes by the last sample of a frame, which is as old as the frame.
            take_sync(
                *message, frame,
                low_bits(static_cast<std::uint64_t>(*raw) + parts - 1, message->count->length));
        else
            ++counters.wrong_length;
    } else {
        take_low(*message, frame);
    }
    drain(frame.time);
}

void SampleAssembler::Impl::begin_at(std::int64_t count, Time time) noexcept {
    begun = true;
    newest = count;
    next_out = std::max(std::int64_t{0}, count - (parts - 1));
    newest_time = time;
}

void SampleAssembler::Impl::take_sync(const MessagePlan& message, const ReceivedFrame& frame,
                                      std::uint64_t raw) noexcept {
    const unsigned bits = message.count->length;
    if (const Time since = frame.time - sync_time;
        sync_time != 0 && since >= settings.sample_period / 2)
        sync_period = sync_period == 0 ? since : std::min(since, 2 * sync_period);
    sync_time = std::max(sync_time, frame.time);
    if (!begun) begin_at(static_cast<std::int64_t>(raw), frame.time);
    const double elapsed = periods_since_newest(frame.time);
    const std::int64_t expected = newest + static_cast<std::int64_t>(elapsed);
    const std::int64_t count =
        expected + wrapped_difference(raw, static_cast<std::uint64_t>(expected), bits);
    const auto depth = static_cast<std::int64_t>(open.size());
    const double from_expected = std::abs(static_cast<double>(count - expected));
    const bool follows =
        (count > newest - depth && count <= newest + depth) ||
        from_expected <= std::max(static_cast<double>(depth), kRateTolerance * std::abs(elapsed));
    if (!follows) {
        suspect_restart(raw, bits, message, frame);
        return;
    }
    drop_suspect();
    if (place(count, message, frame) && clock.observe(count, frame.time)) ++counters.resyncs;
}

void SampleAssembler::Impl::suspect_restart(std::uint64_t raw, unsigned bits,
                                            const MessagePlan& message,
                                            const ReceivedFrame& frame) noexcept {
    if (suspect.pending) {
        const std::int64_t ahead =
            wrapped_difference(raw, static_cast<std::uint64_t>(suspect.sample.count), bits);
        if (ahead == 0) {
            ++counters.duplicate;
            return;
        }
        if (ahead > 0 && ahead <= static_cast<std::int64_t>(open.size())) {
            const std::int64_t count = suspect.sample.count + ahead;
            restart_at_suspect();
            if (place(count, message, frame)) clock.observe(count, frame.time);
            return;
        }
        drop_suspect();
    }
    suspect.pending = true;
    suspect.sync_time = frame.time;
    suspect.sample = {};
    suspect.sample.count = static_cast<std::int64_t>(raw);
    // Of several samples in its frame the last one alone is kept until it is confirmed.
    count_joined(join(suspect.sample, message, frame, parts - 1));
}

void SampleAssembler::Impl::drop_suspect() noexcept {
    if (!std::exchange(suspect.pending, false)) return;
    counters.used -= suspect.sample.frames;
    counters.unknown += suspect.sample.frames;
}

void SampleAssembler::Impl::restart_at_suspect() noexcept {
    suspect.pending = false;
    ++counters.resyncs;
    while (OpenSample* sample = first_shown()) {
        counters.gaps += static_cast<std::uint64_t>(sample->count - next_out);
        next_out = sample->count + 1;
        give_out(*sample);
    }
    clock.reset();
    clock.observe(suspect.sample.count, suspect.sync_time);
    begin_at(suspect.sample.count, suspect.sync_time);
    slot(newest) = suspect.sample;
}

void SampleAssembler::Impl::take_low(const MessagePlan& message,
                                     const ReceivedFrame& frame) noexcept {
    std::optional<std::int64_t> low;
    if (message.low != nullptr) {
        low = proto::decode_raw(*message.low,
                                std::span<const std::uint8_t>(frame.frame.data, frame.frame.len));
        if (low) *low += parts - 1;
    }
    if (suspect.pending) {
        const bool of_suspect =
            !low ||
            low_bits(static_cast<std::uint64_t>(*low), message.low->length) ==
                low_bits(static_cast<std::uint64_t>(suspect.sample.count), message.low->length);
        if (of_suspect && frame.time <= suspect.sample.first + settings.join_deadline) {
            count_joined(join(suspect.sample, message, frame, parts - 1));
            return;
        }
    }
    if (!begun) {
        ++counters.late;  // of a sample that began before we listened
        return;
    }
    if (!low) {
        place(newest, message, frame);
        return;
    }
    const std::int64_t expected =
        newest + static_cast<std::int64_t>(periods_since_newest(frame.time));
    const std::int64_t count =
        expected + wrapped_difference(static_cast<std::uint64_t>(*low),
                                      static_cast<std::uint64_t>(expected), message.low->length);
    // A few bits cannot carry the count far: without its Sync a frame opens the next sample or the
    // one that is due, no other.
    if (count <= newest - static_cast<std::int64_t>(open.size()) ||
        count > std::max(newest, expected) + parts) {
        ++counters.late;
        return;
    }
    place(count, message, frame);
}

void SampleAssembler::Impl::take_without_count(const MessagePlan& message,
                                               const ReceivedFrame& frame) noexcept {
    if (!begun) {
        begin_at(0, frame.time);
    } else if (frame.time - newest_time >= settings.sample_period / 2) {
        place(newest + 1, message, frame);
        return;
    }
    place(newest, message, frame);
}

/// True if the frame went into its sample.
bool SampleAssembler::Impl::place(std::int64_t count, const MessagePlan& message,
                                  const ReceivedFrame& frame) noexcept {
    if (count < next_out) {
        ++counters.late;
        return false;
    }
    make_room(count);
    // The frame counts with its last sample; of the others those are left out that are given out.
    for (std::uint32_t part = 0; part + 1 < parts; ++part) {
        const std::int64_t earlier = count - (parts - 1) + part;
        if (earlier < next_out) continue;
        join(opened(earlier, frame), message, frame, part);
    }
    const bool joined = join(opened(count, frame), message, frame, parts - 1);
    count_joined(joined);
    return joined;
}

auto SampleAssembler::Impl::opened(std::int64_t count, const ReceivedFrame& frame) noexcept
    -> OpenSample& {
    if (count > newest) {
        newest = count;
        newest_time = frame.time;
    }
    OpenSample& sample = slot(count);
    if (!sample.shown) {
        sample = {};
        sample.count = count;
    }
    return sample;
}

/// False: it has been there. A sample is shown from its first frame on.
bool SampleAssembler::Impl::join(OpenSample& sample, const MessagePlan& message,
                                 const ReceivedFrame& frame, std::uint32_t part) noexcept {
    if (!sample.shown) {
        sample.shown = true;
        sample.first = frame.time;
    }
    const std::span<const std::uint8_t> payload(frame.frame.data, frame.frame.len);
    const std::uint64_t bits = message.bits(payload);
    if (message.multiplexor == nullptr) {
        std::uint64_t& content = sample.content[static_cast<std::size_t>(std::countr_zero(bits))];
        const std::uint64_t now = digest(payload);
        if ((bits & sample.seen) != 0 && content != now && part + 1 == parts) {
            ++counters.contradicting;
            counters.contradicting_id = frame.frame.can_id & CAN_EFF_MASK;
        }
        if ((bits & sample.seen) == 0) content = now;
    }
    if ((bits & ~sample.seen) == 0) return false;
    ++sample.frames;
    sample.seen |= bits;
    for (const MessagePlan::ChannelSignal& c : message.channels) {
        if (c.part != part || !proto::present(*message.message, *c.signal, payload)) continue;
        const std::optional<double> value = proto::decode(*c.signal, payload);
        if (!value) continue;
        if (c.validity) {
            sample.has_validity[c.channel] = true;
            // A code for an error, or for not available, is none for valid.
            sample.valid[c.channel] = *value != 0 && !proto::out_of_range(*c.signal, *value);
        } else {
            sample.has_value[c.channel] = true;
            sample.in_range[c.channel] =
                std::isfinite(*value) && !proto::out_of_range(*c.signal, *value);
            sample.value[c.channel] = std::isfinite(*value) ? *value : 0;
            sample.time[c.channel] = frame.time;
        }
    }
    return true;
}

void SampleAssembler::Impl::take_status(const MessagePlan& message,
                                        const ReceivedFrame& frame) noexcept {
    const std::span<const std::uint8_t> payload(frame.frame.data, frame.frame.len);
    for (const MessagePlan::StatusSignal& s : message.status) {
        if (!proto::present(*message.message, *s.signal, payload)) continue;
        const std::optional<double> value = proto::decode(*s.signal, payload);
        if (!value) continue;
        const auto flag = s.row->flag;
        if (!proto::out_of_range(*s.signal, *value))
            take_status(*s.row, *value, frame.time);
        else if (flag == &PlatformStatus::ready || flag == &PlatformStatus::gyros_at_speed)
            // The others grow old by it; these have no age, as they may be sent on change alone.
            platform.*flag = false;
    }
    platform.ready = platform.ready && !of_ready.ceased(frame.time);
    platform.gyros_at_speed = platform.gyros_at_speed && !of_speed.ceased(frame.time);
}

void SampleAssembler::Impl::take_status(const StatusRow& row, double value, Time time) noexcept {
    if (row.sensor) {
        platform.sensor_c[*row.sensor] = value;
        platform.sensor_time[*row.sensor] = time;
        return;
    }
    if (row.flag != nullptr) {
        platform.*row.flag = value != 0;
    } else if (row.of_gimbals) {
        platform.gimbal_command_echo = static_cast<std::uint8_t>(std::clamp(value, 0.0, 255.0));
    } else {
        platform.temperature_c = value;
        platform.temperature_time = time;
    }
    if (row.of_gimbals) {
        Time& its = row.flag == &PlatformStatus::in_position ? position_time
                    : row.flag == &PlatformStatus::slewing   ? slewing_time
                                                             : echo_time;
        its = time;
        const auto& names = settings.bindings;
        const auto of = [&](const std::string& name, Time at) { return name.empty() ? time : at; };
        platform.gimbal_time =
            std::min({of(names.in_position, position_time), of(names.slewing, slewing_time),
                      of(names.command_echo, echo_time)});
        return;
    }
    if (row.flag == &PlatformStatus::ready) of_ready.came(time);
    if (row.flag == &PlatformStatus::gyros_at_speed) of_speed.came(time);
    if (row.flag == &PlatformStatus::loop_closed) loop_time = time;
    if (row.flag == &PlatformStatus::fault) fault_time = time;
    // Of two that come one right behind the other the worse one counts.
    platform.loop_was_open = platform.loop_was_open || (loop_time != 0 && !platform.loop_closed);
    platform.had_fault = platform.had_fault || platform.fault;
    // A message that comes does not make those fresh that come in another one.
    const bool loop_bound = !settings.bindings.loop_closed.empty();
    const bool fault_bound = !settings.bindings.fault.empty();
    if (loop_bound && fault_bound)
        platform.time = std::min(loop_time, fault_time);
    else
        platform.time = loop_bound ? loop_time : fault_bound ? fault_time : time;
}

auto SampleAssembler::Impl::first_shown() noexcept -> OpenSample* {
    for (std::int64_t count = next_out; count <= newest; ++count) {
        OpenSample& sample = slot(count);
        if (sample.shown) return &sample;
    }
    return nullptr;
}

void SampleAssembler::Impl::make_room(std::int64_t count) noexcept {
    const std::int64_t needed = count - static_cast<std::int64_t>(open.size()) + 1;
    while (next_out < needed) {
        OpenSample* sample = first_shown();
        const std::int64_t next = sample != nullptr ? std::min(sample->count, needed) : needed;
        counters.gaps += static_cast<std::uint64_t>(next - next_out);
        next_out = next;
        if (sample != nullptr && sample->count == next && next < needed) {
            ++next_out;
            give_out(*sample);
        }
    }
}

void SampleAssembler::Impl::drain(Time now) noexcept {
    while (OpenSample* sample = first_shown()) {
        const bool due = sample->first + settings.join_deadline <= now;
        const bool in_turn = sample->count == next_out;
        const bool complete = (sample->seen & plan.complete()) == plan.complete();
        if (!due && !(in_turn && complete)) return;
        counters.gaps += static_cast<std::uint64_t>(sample->count - next_out);
        next_out = sample->count + 1;
        give_out(*sample);
    }
}

Quality SampleAssembler::Impl::judge(const OpenSample& sample, std::size_t channel) const noexcept {
    if (!plan.bound(channel)) return Quality::unbound;
    if (!sample.has_value[channel] ||
        (plan.has_validity(channel) && !sample.has_validity[channel])) {
        const bool stale =
            !ever_good[channel] || sample.first - last_good[channel] > settings.stale_deadline;
        return stale ? Quality::stale : Quality::missing;
    }
    if (plan.has_validity(channel) && !sample.valid[channel]) return Quality::flagged;
    return sample.in_range[channel] ? Quality::good : Quality::out_of_range;
}

void SampleAssembler::Impl::give_out(OpenSample& open_sample) noexcept {
    open_sample.shown = false;
    Sample sample;
    sample.sequence = static_cast<std::uint32_t>(open_sample.count);
    sample.time = plan.has_count() ? clock.time_of(open_sample.count)
                                   : open_sample.first / kMicrosecond * kMicrosecond;
    if (any_out) sample.time = std::max(sample.time, last_out + kMicrosecond);
    last_out = sample.time;
    any_out = true;

    bool incomplete = false, invalid = false;
    sample.quality.fill(Quality::unbound);
    for (std::size_t c = 0; c < kChannels; ++c) {
        const Quality quality = judge(open_sample, c);
        sample.quality[c] = quality;
        incomplete = incomplete || quality == Quality::missing || quality == Quality::stale;
        invalid = invalid || quality == Quality::flagged || quality == Quality::out_of_range;
        if (quality == Quality::good) {
            ever_good[c] = true;
            last_good[c] = std::max(last_good[c], open_sample.time[c]);
        }
    }
    for (std::size_t i = 0; i < 3; ++i) {
        sample.angle[i] = wrapped_radians(open_sample.value[i]);
        sample.force[i] = open_sample.value[3 + i];
    }
    sample.table_accel = open_sample.value[6];
    ++counters.samples;
    if (incomplete)
        ++counters.incomplete;
    else if (invalid)
        ++counters.invalid;
    if (on_sample) on_sample(sample);
    platform.loop_was_open = platform.had_fault = false;  // judged with this sample
}

SampleAssembler::SampleAssembler(const proto::Dbc& dbc, const AssemblerSettings& settings,
                                 SampleHandler on_sample) {
    const auto require = [](bool good, const char* key, std::int64_t value, const char* expected) {
        if (!good) throw BindingError(key, std::to_string(value), expected);
    };
    require(settings.sample_period > 0, "can.sample_period", settings.sample_period,
            "more than 0 ns");
    require(settings.join_deadline > 0, "can.join_deadline", settings.join_deadline,
            "more than 0 ns");
    require(settings.stale_deadline > 0, "can.stale_deadline", settings.stale_deadline,
            "more than 0 ns");
    require(settings.open_samples >= 1 && settings.open_samples <= kMaxOpenSamples,
            "can.open_samples", settings.open_samples, "1 to 64");
    require(settings.samples_per_frame >= 1 && settings.samples_per_frame <= kMaxSamplesPerFrame,
            "can.samples_per_frame", settings.samples_per_frame, "1 to 16");
    impl_ = std::make_unique<Impl>(dbc, settings, std::move(on_sample));
}

SampleAssembler::~SampleAssembler() = default;

void SampleAssembler::feed(const ReceivedFrame& frame) noexcept { impl_->feed(frame); }

void SampleAssembler::advance(Time now) noexcept { impl_->drain(now); }

Time SampleAssembler::next_deadline() const noexcept {
    const auto* sample = impl_->first_shown();
    return sample != nullptr ? sample->first + impl_->settings.join_deadline : kNever;
}

const PlatformStatus& SampleAssembler::platform() const noexcept { return impl_->platform; }

Time SampleAssembler::last_good(Channel channel) const noexcept {
    const Time at = impl_->last_good[static_cast<std::size_t>(channel)];
    return impl_->sync_silent(impl_->newest_frame) ? std::min(at, impl_->sync_time) : at;
}

bool SampleAssembler::stale(Channel channel, Time now) const noexcept {
    const auto c = static_cast<std::size_t>(channel);
    return !impl_->ever_good[c] || now - impl_->last_good[c] > impl_->settings.stale_deadline ||
           impl_->sync_silent(now);
}

bool SampleAssembler::sync_silent(Time now) const noexcept { return impl_->sync_silent(now); }

const AssemblerCounters& SampleAssembler::counters() const noexcept { return impl_->counters; }

}  // namespace vibrig::drivers
