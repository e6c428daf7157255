#include "daemon/rt/acquisition.hpp"

#include <unistd.h>

#include <algorithm>
#include <boost/asio/post.hpp>
#include <cerrno>
#include <chrono>
#include <system_error>

namespace vibrig::rt {

using drivers::Time;

namespace {
// Silence is looked for this often on the real clock; stale deadlines are longer.
constexpr Time kTimerPeriod = 50 * drivers::kMillisecond;
// Of what is shown while no sample is complete. When frames end in the midst of one, the timer
// shows the last of them.
constexpr Time kShowPeriod = drivers::kMillisecond;
constexpr std::uint64_t kGathered = 1024;  // samples that a stage which wants none may be left
constexpr Time kFaultPeriod = 200 * drivers::kMillisecond;  // a system call each time
}  // namespace

Acquisition::Acquisition(boost::asio::io_context& io, drivers::CanPort& port, const proto::Dbc& dbc,
                         const drivers::AssemblerSettings& settings, drivers::Clock& clock,
                         RigClock* rig, Wiring wiring)
    : io_(io),
      port_(port),
      clock_(clock),
      rig_(rig),
      to_(wiring),
      assembler_(dbc, settings, [this](const drivers::Sample& s) { on_sample(s); }),
      rest_(io),
      timer_(io) {
    // Where the rig owns the time it waits, and nothing is late.
    if (rig_ == nullptr) shown_.lateness.bound = settings.sample_period;
    if (rig_ != nullptr) {
        rig_link_.emplace(port_);
        const int rest = ::dup(rig_->rest().fd());
        if (rest < 0) throw std::system_error(errno, std::generic_category(), "dup");
        rest_.assign(rest);
    }
}

void Acquisition::start(Event on_port_state) {
    port_.start([this](std::span<const drivers::ReceivedFrame> frames) { on_frames(frames); },
                std::move(on_port_state), [](const drivers::ReceivedFrame&) {});
    if (rig_ != nullptr) {
        wait_for_rest();
    } else {
        arm_timer();
    }
}

void Acquisition::stop() {
    boost::asio::post(io_, [this] {
        port_.stop();
        timer_.cancel();
        rest_.close();
        io_.stop();
    });
}

void Acquisition::on_frames(std::span<const drivers::ReceivedFrame> frames) noexcept {
    shown_.in_hand = frames.size();
    shown_.last_frames = drivers::steady_now();
    to_.interlock.arrived(shown_.last_frames);
    for (const auto& frame : frames) {
        --shown_.in_hand;
        if (!rig_link_) {
            shown_.foreign_time += frame.frame.can_id == RigTimeLink::kTimeId ? 1 : 0;
            record(frame, frame.time);
            feed(frame);
        } else if (rig_link_->is_time(frame.frame)) {
            ++shown_.rig_ticks;
            const auto tick = rig_link_->decode(frame.frame);
            record(frame, tick ? tick->time : rig_->now());
            if (tick) on_tick(*tick);
        } else {
            drivers::ReceivedFrame stamped = frame;
            stamped.time = rig_->now();
            record(frame, stamped.time);
            feed(stamped);
        }
    }
    if (rig_link_) return;
    oldest_ = frames.empty() ? 0 : frames.front().time;
    // Between two samples nobody acts on more than the platform's state.
    if (assembler_.counters().samples != shown_.assembler.samples || platform_changed() ||
        oldest_ - shown_.beat >= kShowPeriod) {
        hand_on();
    } else {
        count_latency(clock_.now());
    }
}

void Acquisition::record(const drivers::ReceivedFrame& frame, Time time) noexcept {
    if (to_.recorder_frames != nullptr)
        to_.recorder_frames->try_push({frame.frame, time, frame.fd, false, 0});
}

void Acquisition::feed(const drivers::ReceivedFrame& frame) noexcept {
    if (to_.stages != nullptr && to_.stages->take(frame)) {
        ++shown_.increments;
    } else {
        assembler_.feed(frame);
    }
}

void Acquisition::on_tick(const RigTimeLink::Tick& tick) noexcept {
    rig_->set(tick.time);
    if (!tick.end) return;
    on_time(tick.time);
    unacknowledged_ = tick;
    rig_->fire();
    acknowledge_if_at_rest();
}

void Acquisition::on_time(Time now) noexcept {
    assembler_.advance(now);
    to_.interlock.check_ages(assembler_, now);
    hand_on();
}

void Acquisition::on_sample(const drivers::Sample& sample) noexcept {
    if (to_.rest != nullptr) to_.rest->add(sample);
    to_.interlock.check(sample, assembler_.platform());
    doubt_witness();
    if (to_.stages != nullptr) to_.stages->take(sample);
    // Without its count a sample's time is not measured, nor is the rate.
    if (assembler_.sync_silent(sample.time))
        shown_.rate = {};
    else
        shown_.rate.add(sample);
    batch_[batched_++] = sample;
    if (batched_ == batch_.size()) push_batch();
}

/// A trip that an accelerometer has shown leaves two to be believed, the table and it: that it is
/// still afterwards proves nothing. The same holds for each that contradicted the command then.
void Acquisition::doubt_witness() noexcept {
    const Tripped trip = to_.interlock.latched();
    if (trip == doubted_) return;
    doubted_ = trip;
    if (to_.rest == nullptr || !trip) return;
    const auto [platform, table] = to_.interlock.contradicts();
    if (trip.channel < drivers::kChannels)
        to_.rest->doubt(static_cast<drivers::Channel>(trip.channel));
    if (platform) to_.rest->doubt(drivers::Channel::accel_x);
    if (table) to_.rest->doubt(drivers::Channel::table_accel);
}

void Acquisition::push_batch() noexcept {
    if (batched_ == 0) return;
    // First the recorder's: when a dwell is reported done its samples are there.
    if (to_.recorder_samples != nullptr) to_.recorder_samples->push_n({batch_.data(), batched_});
    to_.estimator_ring.push_n({batch_.data(), batched_});
    tell_estimator(batch_[batched_ - 1].time);
    if (to_.pre_trip != nullptr) to_.pre_trip->push_n({batch_.data(), batched_});
    shown_.samples_offered += batched_;
    shown_.sample = batch_[batched_ - 1];
    batched_ = 0;
}

void Acquisition::tell_estimator(Time newest) noexcept {
    if (to_.to_estimator != nullptr) {
        if (!to_.to_estimator->wants(newest)) {
            const auto ring = to_.estimator_ring.counts();
            if (ring.pushed - ring.popped < kGathered) return;
        }
        to_.to_estimator->given(clock_.now(), cpu_of_this_thread());
    }
    to_.estimator.notify();
}

bool Acquisition::platform_changed() const noexcept {
    const auto& platform = assembler_.platform();
    const auto& was = shown_.platform;
    return platform.ready != was.ready || platform.loop_closed != was.loop_closed ||
           platform.gyros_at_speed != was.gyros_at_speed || platform.fault != was.fault ||
           platform.in_position != was.in_position || platform.slewing != was.slewing ||
           platform.gimbal_command_echo != was.gimbal_command_echo;
}

void Acquisition::count_latency(Time now) noexcept {
    if (oldest_ != 0) {
        shown_.latency.add(now - oldest_);
        shown_.lateness.add(now - oldest_);
    }
    oldest_ = 0;
}

void Acquisition::hand_on() noexcept {
    push_batch();
    const bool changed = platform_changed();
    shown_.platform = assembler_.platform();
    shown_.assembler = assembler_.counters();
    shown_.port = port_.counters();
    for (std::size_t c = 0; c < drivers::kChannels; ++c) {
        shown_.last_good[c] = assembler_.last_good(static_cast<drivers::Channel>(c));
    }
    shown_.beat = clock_.now();
    count_latency(shown_.beat);
    count_faults(shown_.beat);
    view_.publish(shown_);
    if (changed) to_.control.notify();
}

void Acquisition::count_faults(Time now) noexcept {
    if (now - faults_at_ < kFaultPeriod) return;
    faults_at_ = now;
    shown_.faults = page_faults_of_this_thread();
}

void Acquisition::arm_timer() {
    const Time now = clock_.now();
    const Time deadline = std::clamp(assembler_.next_deadline(), now, now + kTimerPeriod);
    timer_.expires_at(std::chrono::steady_clock::time_point(std::chrono::nanoseconds(deadline)));
    timer_.async_wait([this, deadline](const boost::system::error_code& error) {
        if (error) return;
        to_.interlock.arrived(drivers::steady_now());
        const Time woken = clock_.now();
        shown_.lateness.add(woken - deadline);
        on_time(woken);
        arm_timer();
    });
}

void Acquisition::wait_for_rest() {
    rest_.async_wait(boost::asio::posix::stream_descriptor::wait_read,
                     [this](const boost::system::error_code& error) {
                         if (error) return;
                         rig_->rest().clear();
                         acknowledge_if_at_rest();
                         wait_for_rest();
                     });
}

void Acquisition::acknowledge_if_at_rest() noexcept {
    if (!unacknowledged_ || !rig_->at_rest()) return;
    const auto sent = rig_link_->acknowledge(*unacknowledged_);
    if (!sent) return;
    if (to_.recorder_frames != nullptr)
        to_.recorder_frames->try_push({*sent, unacknowledged_->time, false, true, 0});
    unacknowledged_.reset();
}

}  // namespace vibrig::rt
