#include "daemon/rt/stage_feed.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <stdexcept>

#include "drivers/sample/assembler.hpp"
#include "estimator/filter/angles.hpp"

namespace vibrig::rt {

using drivers::Time;

namespace {

constexpr std::uint32_t kModeBits = 3;

bool is(const proto::Message* message, const canfd_frame& frame) noexcept {
    return message != nullptr &&
           frame.can_id == (message->id | (message->extended ? CAN_EFF_FLAG : 0U)) &&
           frame.len == message->size;
}

StageFeed::Mode mode_of(std::uint32_t order) noexcept {
    return static_cast<StageFeed::Mode>(order & ((1U << kModeBits) - 1));
}

}  // namespace

StageFeed::Layout StageFeed::bind(const proto::Dbc& dbc, const char* key,
                                  const std::string& message, const char* unit) {
    Layout layout;
    const auto signal = [&](const char* name) {
        const auto bound = drivers::bind_signal(dbc, key, message + "." + name,
                                                std::string_view(name) == "Counter" ? "" : unit);
        layout.message = bound.message;
        return bound.signal;
    };
    layout.axis = {signal("X"), signal("Y"), signal("Z")};
    layout.counter = signal("Counter");
    return layout;
}

StageFeed::StageFeed(const proto::Dbc& dbc, const StageFeedSettings& settings,
                     drivers::Waiter* control)
    : settings_(settings), control_(control) {
    if (settings_.block == 0)
        throw std::invalid_argument("stage feed: block: found 0 samples, expected 1 at least");
    if (settings_.increments) {
        gyro_ = bind(dbc, "zeroing.gyro_message", settings_.gyro_message, "arcsec");
        accelerometer_ =
            bind(dbc, "zeroing.accelerometer_message", settings_.accelerometer_message, "m/s");
    }
    if (const auto* message = dbc.find(std::string_view(settings_.status_message))) {
        status_ = message;
        torquing_ = message->find("Torquing");
        torque_echo_ = message->find("TorqueEcho");
    }
    constexpr std::array kVelocity{"levelling.velocity_north", "levelling.velocity_east"};
    for (std::size_t i = 0; i < 2; ++i) {
        if (settings_.velocity[i].empty() && !settings_.velocity[1 - i].empty()) {
            throw drivers::BindingError(kVelocity[i], "",
                                        std::string("a signal as for ") + kVelocity[1 - i] +
                                            ", or neither: the base's velocity has two components");
        }
        velocity_[i] = drivers::bind_signal(dbc, kVelocity[i], settings_.velocity[i], "m/s");
    }
    if (velocity_[0] && velocity_[0].signal == velocity_[1].signal)
        throw drivers::BindingError(kVelocity[1], settings_.velocity[1],
                                    "another signal than that of levelling.velocity_north");
}

void StageFeed::take_velocity(const drivers::ReceivedFrame& received) noexcept {
    const std::span<const std::uint8_t> payload(received.frame.data, received.frame.len);
    for (std::size_t i = 0; i < 2; ++i) {
        if (!is(velocity_[i].message, received.frame)) continue;
        const double value = proto::decode(*velocity_[i].signal, payload).value_or(std::nan(""));
        // What the device itself reports as none grows old.
        if (!std::isfinite(value) || proto::out_of_range(*velocity_[i].signal, value)) continue;
        base_velocity_[i] = value;
        base_velocity_at_[i] = received.time;
    }
}

void StageFeed::order(Mode mode) noexcept {
    const std::uint32_t generation = (order_.load() >> kModeBits) + 1;
    order_.store(generation << kModeBits | static_cast<std::uint32_t>(mode));
}

bool StageFeed::pop(Motion& motion) noexcept {
    const std::uint32_t order = order_.load();
    const std::uint32_t generation = order >> kModeBits;
    bool found = false;
    while (!found && ring_.consume([&](const Motion& m) { motion = m; }, 1) == 1) {
        found = motion.generation == generation && mode_of(order) != Mode::off;
    }
    return found;
}

void StageFeed::begin(std::uint32_t order) noexcept {
    taken_order_ = order;
    in_block_ = good_in_block_ = 0;
    block_ = {};
    first_ = true;
    turn_waits_ = false;
}

void StageFeed::take(const drivers::Sample& sample) noexcept {
    if (sample.angles_good()) {
        angle_ = sample.angle;
        angle_known_ = true;
    }
    const std::uint32_t order = order_.load();
    if (order != taken_order_) begin(order);
    if (mode_of(order) == Mode::samples || mode_of(order) == Mode::watched) {
        Motion one;
        one.time = sample.time;
        one.force = sample.force;
        one.angle = angle_;
        one.generation = order >> kModeBits;
        one.good = sample.force_good() && sample.angles_good();
        one.table = sample.table_accel;
        one.table_good = sample.of(drivers::Channel::table_accel) == drivers::Quality::good;
        ring_.try_push(one);
        if (control_ != nullptr && mode_of(order) == Mode::samples) control_->notify();
        return;
    }
    if (mode_of(order) != Mode::force) return;
    if (sample.force_good()) {
        for (std::size_t i = 0; i < 3; ++i) block_.force[i] += sample.force[i];
        ++good_in_block_;
    }
    if (++in_block_ < settings_.block) return;
    block_.good = good_in_block_ > 0 && angle_known_;
    for (double& force : block_.force) force /= good_in_block_ > 0 ? good_in_block_ : 1;
    block_.time = sample.time;
    block_.angle = angle_;
    block_.generation = order >> kModeBits;
    if (velocity_[0]) {
        block_.velocity = base_velocity_;
        const Time oldest = std::min(base_velocity_at_[0], base_velocity_at_[1]);
        block_.velocity_age_s = oldest < 0
                                    ? std::numeric_limits<double>::infinity()
                                    : std::max(0.0, drivers::to_seconds(sample.time - oldest));
    }
    ring_.try_push(block_);
    block_ = {};
    in_block_ = good_in_block_ = 0;
    if (control_ != nullptr) control_->notify();
}

bool StageFeed::take(const drivers::ReceivedFrame& received) noexcept {
    const canfd_frame& frame = received.frame;
    if (velocity_[0]) take_velocity(received);
    if (torquing_ != nullptr && is(status_, frame)) {
        const std::span<const std::uint8_t> payload(frame.data, frame.len);
        TorqueView view;
        view.time = received.time;
        view.torquing = proto::decode_raw(*torquing_, payload).value_or(0) != 0;
        if (torque_echo_ != nullptr) {
            view.echo =
                static_cast<std::uint8_t>(proto::decode_raw(*torque_echo_, payload).value_or(0));
        }
        torque_.publish(view);
        return false;
    }
    const bool gyro = is(gyro_.message, frame);
    if (!gyro && !is(accelerometer_.message, frame)) return false;
    ++shown_.received;
    const std::uint32_t order = order_.load();
    if (order != taken_order_) begin(order);
    if (mode_of(order) == Mode::increments) {
        pair(gyro ? gyro_ : accelerometer_, frame, received.time);
    } else {
        ++shown_.unasked;
    }
    counts_.publish(shown_);
    return true;
}

void StageFeed::pair(const Layout& layout, const canfd_frame& frame, Time arrived) noexcept {
    const std::span<const std::uint8_t> payload(frame.data, frame.len);
    const auto counter =
        static_cast<std::uint8_t>(proto::decode_raw(*layout.counter, payload).value_or(0));
    std::array<double, 3> value{};
    bool good = true;
    for (std::size_t i = 0; i < 3; ++i) {
        value[i] = proto::decode(*layout.axis[i], payload).value_or(std::nan(""));
        good = good && std::isfinite(value[i]) && !proto::out_of_range(*layout.axis[i], value[i]);
    }
    if (layout.message == gyro_.message) {
        shown_.alone += turn_waits_ ? 1 : 0;
        for (std::size_t i = 0; i < 3; ++i) turn_[i] = estimator::kRadPerArcsec * value[i];
        if (!good) turn_[0] = std::nan("");
        turn_counter_ = counter;
        turn_waits_ = true;
        return;
    }
    if (!turn_waits_ || turn_counter_ != counter) {
        ++shown_.alone;
        return;
    }
    turn_waits_ = false;
    ++shown_.pairs;
    if (first_) {
        first_ = false;
        base_ = arrived;
        count_ = 0;
    } else {
        // The counter says how many periods have gone by, the stamps how often it has wrapped.
        const auto step = static_cast<std::uint8_t>(counter - last_counter_);
        const double periods = static_cast<double>(arrived - last_arrival_) /
                               static_cast<double>(settings_.increment_period);
        count_ += step + 256 * std::llround(std::max(0.0, (periods - step) / 256));
    }
    last_counter_ = counter;
    last_arrival_ = arrived;
    Motion motion;
    motion.increment = true;
    motion.time = base_ + count_ * settings_.increment_period;
    motion.force = value;
    motion.turn = turn_;
    motion.angle = angle_;
    motion.good = good && angle_known_ && std::isfinite(turn_[0]);
    motion.generation = taken_order_ >> kModeBits;
    ring_.try_push(motion);
    if (control_ != nullptr) control_->notify();
}

}  // namespace vibrig::rt
