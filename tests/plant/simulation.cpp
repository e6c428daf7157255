#include "tests/plant/simulation.hpp"

#include <poll.h>
#include <sys/timerfd.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <ctime>

namespace vibrig::plant {
namespace {

std::int64_t monotonic_ns() {
    timespec now{};
    clock_gettime(CLOCK_MONOTONIC, &now);
    return std::int64_t{1'000'000'000} * now.tv_sec + now.tv_nsec;
}

}  // namespace

Simulation::Simulation(SharedRig& shared, Bus& bus, const proto::Dbc& dbc,
                       const SimulationSettings& settings, int stop_descriptor,
                       int command_descriptor, std::function<bool()> on_commands)
    : shared_(shared),
      bus_(bus),
      frames_(dbc),
      settings_(settings),
      stop_(stop_descriptor),
      command_(command_descriptor),
      on_commands_(std::move(on_commands)),
      timer_(timerfd_create(CLOCK_MONOTONIC, TFD_CLOEXEC | TFD_NONBLOCK)) {
    if (timer_ < 0) throw PlantError(std::string("timerfd_create: ") + std::strerror(errno));
}

Simulation::~Simulation() { close(timer_); }

void Simulation::run() {
    std::int64_t start = monotonic_ns(), from_tick = 0;
    double speed = settings_.lockstep ? settings_.speed.value_or(0) : 1;
    // In lockstep nothing happens before somebody is there to see it.
    while (settings_.lockstep && !bus_.somebody_there()) {
        if (wait(std::nullopt) == Wake::stop) return;
    }
    for (std::int64_t tick = 0;; ++tick) {
        if (const double asked = asked_speed(speed); asked != speed) {
            speed = asked;
            start = monotonic_ns();
            from_tick = tick;
        }
        const auto rig_us = static_cast<double>((tick - from_tick) * shared_.rig.tick_us());
        if (speed > 0 && !wait_until(start + std::llround(1e3 * rig_us / speed))) return;
        if (settings_.duration_s &&
            1e-6 * static_cast<double>(tick * shared_.rig.tick_us()) > *settings_.duration_s)
            return;
        if (!wait_while_held()) return;
        if (tick > 0) {
            const std::scoped_lock lock(shared_.mutex);
            shared_.rig.advance();
        }
        make_tick();
        send_tick();
        ++counters_.ticks;
        if (settings_.lockstep && !wait_for_acknowledgement()) return;
    }
}

/// By whoever works the rig while it runs.
double Simulation::asked_speed(double now) {
    const std::scoped_lock lock(shared_.mutex);
    return settings_.lockstep ? shared_.speed.value_or(now) : now;
}

void Simulation::make_tick() {
    const std::scoped_lock lock(shared_.mutex);
    const double now = shared_.now_s();
    shared_.apply_faults();
    Sample sample;
    sample.readings = shared_.rig.readings();
    shared_.faults.spoil(sample, now);
    std::vector<can_frame> data;
    frames_.encode(shared_.rig, sample, shared_.faults, command_echo_, torque_echo_, data);
    shared_.faults.spoil(data, now);
    time_us_ = shared_.rig.time_us();
    counters_.frames += data.size();
    tick_frames_.clear();
    if (settings_.lockstep) tick_frames_.push_back(frames_.rig_time(time_us_, false));
    tick_frames_.insert(tick_frames_.end(), data.begin(), data.end());
    if (settings_.lockstep) tick_frames_.push_back(frames_.rig_time(time_us_, true));
}

void Simulation::send_tick() { bus_.send(tick_frames_, settings_.lockstep); }

bool Simulation::wait_while_held() {
    const auto held = [this] {
        const std::scoped_lock lock(shared_.mutex);
        return shared_.hold_at_s && shared_.now_s() >= *shared_.hold_at_s;
    };
    while (held()) {
        if (wait(std::nullopt) == Wake::stop) return false;
    }
    return true;
}

bool Simulation::wait_for_acknowledgement() {
    std::int64_t resend_at = monotonic_ns() + settings_.resend_ns;
    while (acknowledged_us_ != time_us_) {
        const Wake wake = wait(bus_.somebody_there() ? std::optional(resend_at) : std::nullopt);
        if (wake == Wake::stop) return false;
        if (bus_.only_newcomers()) {
            send_tick();
        } else if (wake == Wake::deadline) {
            bus_.send(std::span(tick_frames_).last(1), true);
        } else {
            continue;
        }
        ++counters_.resent;
        resend_at = monotonic_ns() + settings_.resend_ns;
    }
    return true;
}

bool Simulation::wait_until(std::int64_t deadline_ns) {
    for (;;) {
        const Wake wake = wait(deadline_ns);
        if (wake == Wake::stop) return false;
        // Where there is always more to be read its time is over all the same.
        if (wake == Wake::deadline || monotonic_ns() >= deadline_ns) return true;
    }
}

/// At an absolute time: a timeout from now would come later by what it takes from here to the
/// kernel, and by its slack for timeouts. None: never.
void Simulation::arm(std::optional<std::int64_t> at_ns) {
    constexpr std::int64_t kSecond = 1'000'000'000;
    itimerspec timer{};
    if (at_ns) {
        timer.it_value = {static_cast<time_t>(*at_ns / kSecond),
                          static_cast<long>(*at_ns % kSecond)};
    }
    timerfd_settime(timer_, TFD_TIMER_ABSTIME, &timer, nullptr);
    armed_ns_ = at_ns;
}

Simulation::Wake Simulation::wait(std::optional<std::int64_t> deadline_ns) {
    // One that comes too early is put off then: in lockstep most ticks are over long before.
    if (deadline_ns && (!armed_ns_ || *armed_ns_ > *deadline_ns)) arm(deadline_ns);
    std::array<pollfd, 4> descriptors{{{bus_.descriptor(), POLLIN, 0},
                                       {stop_, POLLIN, 0},
                                       {command_, POLLIN, 0},
                                       {timer_, POLLIN, 0}}};
    const int ready = poll(descriptors.data(), descriptors.size(), -1);
    if (ready < 0) return Wake::event;
    const bool expired = descriptors[3].revents != 0;
    if (expired && (!deadline_ns || monotonic_ns() < *deadline_ns)) {
        arm(deadline_ns);
    } else if (expired && ready == 1) {
        armed_ns_.reset();
        return Wake::deadline;
    }
    if (descriptors[1].revents != 0) return Wake::stop;
    if (descriptors[0].revents != 0) {
        bus_.receive([this](const canfd_frame& frame) { handle(frame); });
    }
    if (descriptors[2].revents != 0 && !on_commands_())
        command_ = -1;  // poll ignores it from now on
    return Wake::event;
}

void Simulation::handle(const canfd_frame& frame) {
    if (const auto time = frames_.acknowledged_us(frame)) {
        acknowledged_us_ = time;
        return;
    }
    if (const auto command = frames_.gimbal_command(frame)) {
        const std::scoped_lock lock(shared_.mutex);
        ++counters_.commands;
        command_echo_ = command->counter;
        if (command->mode != GimbalMode::free_drift) {
            shared_.rig.slew_to(command->encoder_deg, command->mode);
        } else {
            shared_.rig.release();
        }
        return;
    }
    if (const auto torque = frames_.torque_command(frame)) {
        const std::scoped_lock lock(shared_.mutex);
        ++counters_.commands;
        torque_echo_ = torque->counter;
        shared_.rig.torque(torque->deg_per_h);
    }
}

}  // namespace vibrig::plant
