#include "drivers/shaker/modbus_shaker.hpp"

#include <pthread.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace vibrig::drivers {
namespace {

// The first time on a new link that is the stop's alone. A device that was cut off for long has
// tripped already, nothing is gained by feeding it at once; and who comes back to a table that he
// left shaking is to see one command go out. 100 ms, and as much again for the way there.
constexpr Time kStopAlone = 200 * kMillisecond;
// Between two writes of a stop that is not confirmed, and between two attempts to connect for it:
// at most, whatever everything else waits for.
constexpr Time kStopRepeat = 200 * kMillisecond;
// Between two reads of the watchdog's timeout; a second at most, with the request itself.
constexpr Time kTimeoutPeriod = 500 * kMillisecond;

/// A period after `due` if this round was in time; one that came early, or so late that a period
/// was missed, starts anew.
[[nodiscard]] Time following(Time due, Time period, Time now) noexcept {
    return due <= now && now < due + period ? due + period : now + period;
}

[[nodiscard]] bool encodable(const proto::Register& reg, double value) noexcept {
    std::array<std::uint16_t, 2> words{};
    return std::isfinite(value) && value >= 0 &&
           proto::encode(reg, value, std::span(words).first(reg.words()));
}

/// A set-point of random vibration that the registers can hold; none: any.
[[nodiscard]] bool playable(const proto::ShakerRegisters& map,
                            const std::optional<RandomSetPoint>& random) noexcept {
    if (!random) return true;
    std::array<std::uint16_t, 2> words{};
    return map.random && random->profile > 0 &&
           encodable(map.random->profile_number, random->profile) &&
           std::isfinite(random->level_db) &&
           proto::encode(map.random->profile_level_db, random->level_db,
                         std::span(words).first(map.random->profile_level_db.words()));
}

/// The same of a sweep.
[[nodiscard]] bool sweepable(const proto::ShakerRegisters& map,
                             const std::optional<SweepSetPoint>& sweep) noexcept {
    return !sweep ||
           (map.sweep && sweep->from_hz > 0 && sweep->to_hz > 0 && sweep->octaves_per_minute > 0 &&
            encodable(map.sweep->from, sweep->from_hz) && encodable(map.sweep->to, sweep->to_hz) &&
            encodable(map.sweep->rate, sweep->octaves_per_minute));
}

[[nodiscard]] bool nonzero(std::span<const std::uint16_t> words) noexcept {
    return std::any_of(words.begin(), words.end(), [](std::uint16_t word) { return word != 0; });
}

}  // namespace

ModbusShaker::ModbusShaker(Clock& clock, const ShakerSettings& settings)
    : clock_(clock),
      settings_(settings),
      link_(settings),
      image_(settings.registers),
      backoff_(settings.backoff_min) {}

ModbusShaker::~ModbusShaker() { shut_down(); }

void ModbusShaker::start(std::function<bool()> may_feed, StateHandler on_state) {
    may_feed_ = std::move(may_feed);
    on_state_ = std::move(on_state);
    waiter_ =
        clock_.make_waiter();  // busy from here on: a simulated clock waits for the first round
    wakeable_ = waiter_.get();
    thread_ = std::thread([this] { run(); });
    ::pthread_setname_np(thread_.native_handle(), "shaker");
}

bool ModbusShaker::request(const ShakerSetPoint& set_point, std::uint64_t stops) noexcept {
    const proto::ShakerRegisters& map = settings_.registers;
    if (!encodable(map.frequency, set_point.frequency_hz) ||
        !encodable(map.amplitude, set_point.amplitude_g) ||
        !encodable(map.ramp_time, set_point.ramp_s) || !playable(map, set_point.random) ||
        !sweepable(map, set_point.sweep) || (set_point.random && set_point.sweep)) {
        return false;
    }
    // Whatever the caller thinks: the frequency changes at rest only, or it passes the resonance.
    const auto now = reading();
    if (set_point.amplitude_g > 0 && now.valid && (now.running || !now.still()) &&
        !same_kind(set_point, now))
        return false;
    if (read_only_) return false;
    const auto ticket = orders_.ticket();
    if (ticket.stop_pending() || ticket.stops() != stops || state() != LinkState::running)
        return false;
    if (orders_.put(set_point, ticket)) ++counts_.set_points_discarded;
    wake();
    return true;
}

void ModbusShaker::stop_now() noexcept {
    // Either the thread sees the stop before it sends, or this sees the request in flight: both are
    // sequentially consistent. While a stop is pending already, what is in flight is that stop and
    // is not cut off.
    if (orders_.stop() && in_flight_.load()) link_.cut();
    wake();
}

void ModbusShaker::hang_up_until(Time time) noexcept {
    hung_up_until_ = time;
    wake();
}

ShakerReading ModbusShaker::reading() const noexcept {
    ShakerReading reading = latest_.read();
    // One lost reply and the reconnect after it are lived through; the watchdog waits longer still.
    const Time lifetime = std::max(3 * settings_.poll_period, 2 * settings_.watchdog_period);
    if (clock_.now() - reading.time > lifetime) reading.fresh = reading.valid = false;
    return reading;
}

ShakerCounters ModbusShaker::counters() const noexcept {
    ShakerCounters c;
    c.replies = counts_.replies;
    c.timeouts = counts_.timeouts;
    c.exceptions = counts_.exceptions;
    c.reconnects = counts_.reconnects;
    c.set_points_discarded = counts_.set_points_discarded;
    c.feeds = counts_.feeds;
    c.stops_written = counts_.stops_written;
    c.read_back_mismatches = counts_.read_back_mismatches;
    c.wrong_replies = counts_.wrong_replies;
    c.lost = counts_.lost;
    c.set_points_written = counts_.set_points_written;
    c.requests = counts_.requests;  // last: never fewer requests than ways they ended
    return c;
}

void ModbusShaker::wake() noexcept {
    wakers_.fetch_add(1);
    if (Waiter* const waiter = wakeable_.load()) waiter->notify();
    if (wakers_.fetch_sub(1) == 1) wakers_.notify_all();
}

void ModbusShaker::shut_down() noexcept {
    quit_ = true;
    link_.abort();
    wake();
    if (thread_.joinable()) thread_.join();
    wakeable_ = nullptr;
    for (int waking = wakers_.load(); waking != 0; waking = wakers_.load()) wakers_.wait(waking);
    waiter_.reset();
    link_.close();
    state_ = LinkState::absent;
}

void ModbusShaker::run() noexcept {
    while (!quit_.load()) {
        ++beats_;
        work(clock_.now());
    }
}

/// One round: the most urgent thing, or sleep until the next is due.
void ModbusShaker::work(Time now) {
    drop_void_set_point();
    const std::uint64_t ordered = stops();  // first: a stop that comes meanwhile is another one
    const bool stop = stop_pending();
    // Whoever orders it again does not wait for the turn of the last one.
    if (std::exchange(stops_seen_, ordered) != ordered)
        stop_tried_ = connect_tried_for_stop_ = false;
    if (!stop) stop_tried_ = connect_tried_for_stop_ = ramp_tried_ = joint_in_vain_ = false;
    if (stop) hung_up_until_ = 0;
    const Time silent_until = hung_up_until_.load();
    if (!stop && now < silent_until) {
        if (link_.connected()) {
            close_link();
            closed_by_us_ = true;
            set_state(LinkState::connecting, "closed by order");
        }
        next_attempt_ = silent_until;
        return sleep_until(silent_until);
    }
    if (!link_.connected()) {
        if (now >= next_attempt_ || (stop && !connect_tried_for_stop_)) return try_connect(now);
        return sleep_until(next_attempt_);
    }
    if (stop && (!stop_tried_ || now >= next_stop_)) return write_stop(now);
    if (watchdog_due(now)) return serve_watchdog(now);
    if (now >= next_check_ && !timeout_due_) return check_timeout(now);
    // Before the poll, which a slow line may have due all the time; it ends with one of its own.
    if (!stop && orders_.waiting() && now >= stop_alone_until_) return write_set_point();
    if (now >= next_poll_) return poll(now);
    if (!stop && identity_due()) return ask_identity();
    if (!stop && psd_due()) return read_psd_part();
    Time next = std::min(next_poll_, stop ? next_stop_ : next_feed_);
    if (!timeout_due_) next = std::min(next, next_check_);
    sleep_until(next);
}

void ModbusShaker::try_connect(Time now) {
    connect_tried_for_stop_ = stop_pending();
    std::string why;
    const auto result = link_.connect(why);
    now = clock_.now();
    if (result != ModbusLink::Connection::open) {
        next_attempt_ = now + (stop_pending() ? stop_repeat() : backoff_);
        backoff_ = std::min(2 * backoff_, settings_.backoff_max);
        set_state(
            result == ModbusLink::Connection::failed ? LinkState::connecting : LinkState::fault,
            why + "; trying again");
        return;
    }
    link_is_new();
    const bool again = std::exchange(was_connected_, true);
    if (again) ++counts_.reconnects;
    polled_ = poll_refused_ = feed_refused_ = false;
    stop_tried_ = false;
    if (!stop_pending()) joint_refused_ = false;
    timeout_seen_ = WatchdogTimeout::unread;
    timeout_due_ = settings_.registers.watchdog_timeout.access != proto::Access::read;
    // A lost reply must not cost the device a feed that it still waits for.
    const bool starved = again && now - last_feed_ > watchdog_timeout();
    stop_alone_until_ = stop_pending() || starved ? now + kStopAlone : now;
    next_stop_ = next_poll_ = next_check_ = now;
    next_feed_ = stop_alone_until_;
}

/// What waits was meant for the device as it was.
void ModbusShaker::close_link() {
    link_.close();
    orders_.link_lost();
    drop_void_set_point();
    polled_ = false;
}

void ModbusShaker::lose_link(const std::string& why) {
    close_link();
    next_attempt_ = clock_.now() + (stop_pending() ? stop_repeat() : backoff_);
    backoff_ = std::min(2 * backoff_, settings_.backoff_max);
    set_state(LinkState::connecting, why + "; connecting again");
}

/// Something more urgent than the work at hand: the end, or a stop that has not been tried yet.
bool ModbusShaker::outranked() const noexcept {
    return quit_.load() || (stop_pending() && !stop_tried_);
}

Reply ModbusShaker::transact(const std::function<Reply()>& request) {
    in_flight_ = true;
    if (outranked()) {
        in_flight_ = false;
        return {ReplyKind::overtaken, 0};
    }
    ++counts_.requests;
    const Reply reply = request();
    in_flight_ = false;
    switch (reply.kind) {
        case ReplyKind::ok:
            ++counts_.replies;
            return reply;
        case ReplyKind::exception:
            ++counts_.exceptions;
            return reply;
        case ReplyKind::timeout:
            ++counts_.timeouts;
            break;
        case ReplyKind::wrong:
            ++counts_.wrong_replies;
            break;
        case ReplyKind::lost:
            ++counts_.lost;
            break;
        case ReplyKind::overtaken:
            break;
    }
    lose_link(outranked() ? "request cut off by a stop" : reply.text());
    return reply;
}

Reply ModbusShaker::write(const proto::Register& reg, std::span<const std::uint16_t> words) {
    return transact([&] { return link_.write(reg.address, words); });
}

Reply ModbusShaker::read(const proto::Register& reg, std::span<std::uint16_t> words) {
    return transact([&] { return link_.read(reg.table, reg.address, words); });
}

/// The register as last read: a bits register shares its word with bits that are not ours.
ModbusShaker::Words ModbusShaker::present(const proto::Register& reg) noexcept {
    Words words{};
    std::ranges::copy(image_.words_of(reg), words.begin());
    return words;
}

ModbusShaker::Written ModbusShaker::write_and_verify(const char* role, const proto::Register& reg,
                                                     double value) {
    Words words = present(reg);
    const auto raw = std::span(words).first(reg.words());
    if (!proto::encode(reg, value, raw)) return Written::otherwise;
    const Reply reply = write(reg, raw);
    if (reply.ok()) return verify(role, reg, raw);
    if (reply.kind != ReplyKind::exception) return Written::not_written;
    write_failed_ = true;
    settle(std::string(role) + " refused: " + reply.text());
    return Written::otherwise;
}

ModbusShaker::Written ModbusShaker::verify(const char* role, const proto::Register& reg,
                                           std::span<const std::uint16_t> words) {
    Words back{};
    const auto raw = std::span(back).first(words.size());
    const Reply reply = read(reg, raw);
    if (!reply.ok() && reply.kind != ReplyKind::exception) return Written::not_written;
    if (reply.ok()) std::copy(raw.begin(), raw.end(), image_.words_of(reg).begin());
    if (reply.ok() && same_raw(reg, words, raw)) return Written::as_written;
    write_failed_ = true;
    if (reply.ok()) {
        ++counts_.read_back_mismatches;
        settle(std::string(role) + " reads back as " + std::to_string(proto::decode(reg, raw)) +
               ", expected " + std::to_string(proto::decode(reg, words)));
    } else {
        settle(std::string(role) + " cannot be read back: " + reply.text());
    }
    return Written::otherwise;
}

/// Ramp 0 and run 0: down as fast as the controller's own soft stop. In one request where they lie
/// side by side; else the ramp gets one short try, and then run 0 goes out whatever came back.
/// After one request for both that did not end in run 0 read back they go as if they lay apart: a
/// controller may take its ramp when run changes.
Reply ModbusShaker::order_stop(std::span<const std::uint16_t> run) {
    const proto::ShakerRegisters& map = settings_.registers;
    Words ramp_words = present(map.ramp_time);
    const auto ramp = std::span(ramp_words).first(map.ramp_time.words());
    static_cast<void>(proto::encode(map.ramp_time, 0, ramp));  // fits every type
    const bool ramp_first = map.ramp_time.address + ramp.size() == map.run.address;
    const bool run_first = map.run.address + run.size() == map.ramp_time.address;
    if ((ramp_first || run_first) && !joint_refused_ && !joint_in_vain_) {
        joint_in_vain_ = true;  // until the stop is done
        std::array<std::uint16_t, 4> words{};
        const auto second = std::ranges::copy(ramp_first ? ramp : run, words.begin()).out;
        std::ranges::copy(ramp_first ? run : ramp, second);
        const Reply reply = transact([&] {
            return link_.write(ramp_first ? map.ramp_time.address : map.run.address,
                               std::span(words).first(ramp.size() + run.size()));
        });
        if (reply.kind != ReplyKind::exception) return reply;
        // It is there and takes one register at a time.
        joint_refused_ = true;
        joint_in_vain_ = false;
    }
    const Reply reply = try_ramp(ramp);
    return link_.connected() ? write(map.run, run) : reply;
}

/// Once a stop. Without a link after it, run 0 is next on another, where no late reply is.
Reply ModbusShaker::try_ramp(std::span<const std::uint16_t> ramp) {
    if (std::exchange(ramp_tried_, true)) return {};
    link_.respond_within(std::min(settings_.stop_ramp_timeout, settings_.response_timeout));
    const Reply reply = write(settings_.registers.ramp_time, ramp);
    link_.respond_within(settings_.response_timeout);
    if (!link_.connected()) next_attempt_ = clock_.now();
    return reply;
}

void ModbusShaker::write_stop(Time now) {
    stop_tried_ = true;
    commanded_.reset();
    next_stop_ = now + stop_repeat();
    // A stop at rest may make the device forget the fault that it holds. What a process finds at
    // its first connection is read before; once, whatever comes of it.
    if (!std::exchange(looked_, true)) {
        poll(now);
        if (!link_.connected()) return;
    }
    const proto::Register& run = settings_.registers.run;
    Words words = present(run);
    const auto raw = std::span(words).first(run.words());
    static_cast<void>(proto::encode(run, 0, raw));
    const bool alone = joint_in_vain_;
    const Reply reply = order_stop(raw);
    if (reply.kind == ReplyKind::exception) {
        write_failed_ = true;
        settle("stop refused: " + reply.text());
    }
    if (reply.ok()) {
        ++counts_.stops_written;
        if (on_stop_written_) on_stop_written_();
    }
    const bool done =
        reply.ok() && link_.connected() && verify("run", run, raw) == Written::as_written;
    // What one request for both did not do waits for no turn.
    if (!done && joint_in_vain_ && !alone) next_stop_ = next_attempt_ = clock_.now();
    if (!done) return;
    orders_.stop_done();
    drop_void_set_point();
    write_failed_ = false;
    // Whoever changed the watchdog's timeout: after a stop it is what we set.
    timeout_due_ = settings_.registers.watchdog_timeout.access != proto::Access::read;
    next_poll_ = clock_.now();
    next_feed_ = std::max(next_poll_, stop_alone_until_);
    settle("stopped");
}

/// A stop does not back off.
Time ModbusShaker::stop_repeat() const noexcept {
    return std::min(settings_.backoff_min, kStopRepeat);
}

void ModbusShaker::drop_void_set_point() noexcept {
    if (orders_.waiting() && orders_.drop_void()) ++counts_.set_points_discarded;
}

void ModbusShaker::write_set_point() {
    const auto set_point = orders_.take();
    if (!set_point) return;
    commanded_.reset();
    if (!write_steps(*set_point)) {
        if (outranked() || !link_.connected()) ++counts_.set_points_discarded;
    } else {
        ++counts_.set_points_written;
        if (set_point->amplitude_g > 0 || set_point->run_at_zero) commanded_ = set_point;
    }
    if (link_.connected() && !outranked())
        poll(clock_.now());  // a reading newer than the set-point, then not busy
    orders_.finished();
}

bool ModbusShaker::write_steps(const ShakerSetPoint& set_point) {
    const proto::ShakerRegisters& map = settings_.registers;
    Words words{};
    const auto encoded = [&](const proto::Register& reg, double value) {
        words = present(reg);
        const auto raw = std::span(words).first(reg.words());
        static_cast<void>(proto::encode(reg, value, raw));
        return raw;
    };
    const bool running = image_.value_of(map.run) != 0;
    const bool excite =
        set_point.run_at_zero || nonzero(encoded(map.amplitude, set_point.amplitude_g));
    std::vector<Step> steps;
    // On the way to zero the frequency does not matter: nothing may keep the shaker from coming
    // down.
    if (excite && !running && (map.random || map.sweep) && !choose(set_point)) return false;
    const auto frequency = encoded(map.frequency, set_point.frequency_hz);
    if (!set_point.random && !set_point.sweep && (excite || (!running && nonzero(frequency))) &&
        !same_raw(map.frequency, frequency, image_.words_of(map.frequency))) {
        // Frequency changes only at zero amplitude; at rest the register may still hold the last
        // one.
        if (!running && nonzero(image_.words_of(map.amplitude)))
            steps.push_back({"amplitude", map.amplitude, 0});
        steps.push_back({"frequency", map.frequency, set_point.frequency_hz});
    }
    steps.push_back({"ramp time", map.ramp_time, set_point.ramp_s});
    steps.push_back({"amplitude", map.amplitude, set_point.amplitude_g});
    // A device that is thought to run and does not has tripped: it gets no command, and the
    // read-back differs.
    if (!excite || !running) steps.push_back({"run", map.run, excite ? 1.0 : 0.0});
    if (!write_each(steps)) return false;
    if (excite && running)
        return verify("run", map.run, encoded(map.run, 1)) == Written::as_written;
    return true;
}

bool ModbusShaker::write_each(std::span<const Step> steps) {
    for (const Step& step : steps) {
        if (watchdog_due(clock_.now())) serve_watchdog(clock_.now());
        if (!link_.connected()) return false;
        if (write_and_verify(step.role, step.reg, step.value) != Written::as_written) return false;
    }
    return true;
}

bool ModbusShaker::watchdog_due(Time now) const noexcept {
    return now >= next_feed_ && !stop_pending();
}

void ModbusShaker::serve_watchdog(Time now) {
    next_feed_ = following(next_feed_, settings_.watchdog_period, now);
    if (read_only_) return;
    if (timeout_due_) write_timeout();
    if (timeout_due_ || !link_.connected()) return;
    const proto::ShakerRegisters& map = settings_.registers;
    Words words{};
    if (!may_feed_ || !may_feed_()) return;
    feed_ = static_cast<std::uint16_t>((feed_ + 1) & 0x7fff);
    const auto raw = std::span(words).first(map.watchdog->words());
    if (!proto::encode(*map.watchdog, feed_ * map.watchdog->scale, raw)) return;
    const Reply reply = write(*map.watchdog, raw);
    feed_refused_ = reply.kind == ReplyKind::exception;
    if (reply.ok()) {
        ++counts_.feeds;
        last_feed_ = now;
    }
    if (link_.connected()) settle("watchdog feed " + reply.text());
}

void ModbusShaker::write_timeout() {
    const proto::Register& reg = settings_.registers.watchdog_timeout;
    Words words{};
    const auto raw = std::span(words).first(reg.words());
    static_cast<void>(proto::encode(reg, to_seconds(watchdog_timeout()), raw));
    const Reply reply = write(reg, raw);
    feed_refused_ = reply.kind == ReplyKind::exception;
    if (feed_refused_) settle("watchdog timeout refused: " + reply.text());
    if (!reply.ok()) return;
    timeout_due_ = false;
    next_check_ = clock_.now();
}

void ModbusShaker::check_timeout(Time now) {
    next_check_ = now + kTimeoutPeriod;
    const proto::Register& reg = settings_.registers.watchdog_timeout;
    Words words{}, written{};
    const auto raw = std::span(words).first(reg.words());
    const auto ours = std::span(written).first(reg.words());
    const Reply reply = read(reg, raw);
    if (!reply.ok() && reply.kind != ReplyKind::exception) return;
    static_cast<void>(proto::encode(reg, to_seconds(watchdog_timeout()), ours));
    timeout_read_s_ = reply.ok() ? proto::decode(reg, raw) : 0;
    // What was written may have been rounded to nothing, which switches many watchdogs off.
    const bool good = timeout_read_s_ > 0 &&
                      timeout_read_s_ <= to_seconds(kLongestWatchdogTimeout) &&
                      (reg.access == proto::Access::read || same_raw(reg, ours, raw));
    const auto seen = good ? WatchdogTimeout::kept : WatchdogTimeout::changed;
    if (std::exchange(timeout_seen_, seen) != seen) next_poll_ = now;  // to be reported at once
    settle(good ? "read back"
           : reply.ok()
               ? "watchdog timeout reads back as " + std::to_string(timeout_read_s_) +
                     " s, expected " + std::to_string(to_seconds(watchdog_timeout())) + " s"
               : "watchdog timeout cannot be read back: " + reply.text());
}

void ModbusShaker::poll(Time now) {
    next_poll_ = following(next_poll_, settings_.poll_period, now);
    for (RegisterRange& range : image_.ranges()) {
        const Reply reply =
            transact([&] { return link_.read(range.table, range.address, range.words); });
        if (reply.ok()) continue;
        if (reply.kind != ReplyKind::exception) return;
        poll_refused_ = true;
        return settle("reading " + std::to_string(range.words.size()) + " registers from " +
                      std::to_string(range.address) + ": " + reply.text());
    }
    polled_ = looked_ = true;
    poll_refused_ = false;
    backoff_ = settings_.backoff_min;
    ShakerReading reading = image_.reading(now);
    reading.watchdog = timeout_seen_;
    reading.watchdog_timeout_s = timeout_read_s_;
    const auto changed = changed_by_others(reading);
    if (!changed.empty()) {
        ++counts_.read_back_mismatches;
        write_failed_ = true;
        commanded_.reset();  // reported once
    }
    if (on_judging_) on_judging_(reading);
    latest_.publish(reading);
    settle(changed.empty() ? "read back" : changed);
    if (on_reading_) on_reading_();
}

std::string ModbusShaker::differs(const char* role, const proto::Register& reg, double commanded) {
    Words words = present(reg);
    const auto ours = std::span(words).first(reg.words());
    static_cast<void>(proto::encode(reg, commanded, ours));
    const auto read = image_.words_of(reg);
    return same_raw(reg, ours, read)
               ? std::string()
               : std::string(role) + " was changed by another: reads back as " +
                     std::to_string(proto::decode(reg, read)) + ", commanded " +
                     std::to_string(proto::decode(reg, ours));
}

void ModbusShaker::settle(const std::string& why) {
    if (poll_refused_ || feed_refused_ || write_failed_ ||
        timeout_seen_ == WatchdogTimeout::changed)
        return set_state(LinkState::degraded, why);
    if (polled_) set_state(LinkState::running, why);
}

void ModbusShaker::set_state(LinkState state, const std::string& text) {
    if (quit_.load() || state_.exchange(state) == state || !on_state_) return;
    on_state_(state, ("shaker " + link_.name() + ": " + text).c_str());
}

}  // namespace vibrig::drivers
