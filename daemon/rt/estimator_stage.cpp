#include "daemon/rt/estimator_stage.hpp"

#include <algorithm>

namespace vibrig::rt {

using drivers::Time;

namespace {
// Displays need no more; the filter itself sees every sample.
constexpr Time kPublishPeriod = 200 * drivers::kMillisecond;
}  // namespace

EstimatorStage::EstimatorStage(Ring<drivers::Sample>& samples, drivers::Waiter& self,
                               drivers::Waiter& control, estimator::Identification& identification)
    : samples_(samples),
      self_(self),
      control_(control),
      identification_(identification),
      feed_(identification, blocks_) {}

void EstimatorStage::run() noexcept {
    while (!stop_.load()) {
        work();
        if (stays_) follow();
        self_.wait_until(drivers::kNever);
    }
    if (feed_.begun()) finish(true);
}

void EstimatorStage::work() noexcept {
    const Time since = handed_over_.taken();
    orders_.consume([this](const DwellOrder& order) { take_order(order); });
    take_samples();
    if (since != 0 && clock_ != nullptr) shown_.lateness.add(clock_->now() - since);
    if (shown_.sample_time - published_at_ >= kPublishPeriod) publish(feed_.begun());
    if (gathers_)
        handed_over_.want(
            std::min(ordered_ ? current_.to : drivers::kNever, published_at_ + kPublishPeriod));
}

void EstimatorStage::take_samples() noexcept {
    while (samples_.consume([this](const drivers::Sample& s) { take_sample(s); }) > 0) {
    }
}

void EstimatorStage::follow() noexcept {
    const int cpu = handed_over_.cpu();
    if (cpu == cpu_) return;
    cpu_ = cpu;
    keep_this_thread_to(cpu);
}

void EstimatorStage::stop() noexcept {
    stop_.store(true);
    self_.notify();
}

void EstimatorStage::time_by(const drivers::Clock& clock, Time bound) noexcept {
    clock_ = &clock;
    shown_.lateness.bound = bound;
}

bool EstimatorStage::order(const DwellOrder& order) noexcept {
    const bool fits = orders_.try_push(order);
    self_.notify();
    return fits;
}

bool EstimatorStage::take_done(DwellDone& done) noexcept {
    return done_.consume([&done](const DwellDone& d) { done = d; }, 1) == 1;
}

bool EstimatorStage::take_block(BlockRecord& block) noexcept {
    return blocks_.consume([&block](const BlockRecord& b) { block = b; }, 1) == 1;
}

void EstimatorStage::take_order(const DwellOrder& order) noexcept {
    // What has come before belongs to the dwell that is given up.
    if (order.cancel) take_samples();
    if (ordered_) finish(true);
    if (order.cancel) return;
    current_ = order;
    ordered_ = true;
}

void EstimatorStage::take_sample(const drivers::Sample& sample) noexcept {
    // First, since it publishes counts: those hold whole samples only.
    if (ordered_ && sample.time >= current_.to) finish(false);
    ++shown_.taken;
    shown_.sample_time = sample.time;
    if (!ordered_ || sample.time < current_.from) {
        ++shown_.idle;
        return;
    }
    ++shown_.in_dwell;
    const bool first = !feed_.begun();
    if (first) feed_.begin(current_.dwell, current_.to - current_.from);
    const auto measurement = measurement_of(sample, current_.from, current_.zero_g);
    feed_.add(measurement);
    if (journal_ != nullptr)
        journal_->try_push({measurement, current_.dwell.run, current_.dwell.position, first, 0});
    shown_.dwell_fraction = static_cast<double>(sample.time - current_.from) /
                            static_cast<double>(current_.to - current_.from);
}

void EstimatorStage::finish(bool cut_short) noexcept {
    shown_.dwell_fraction = 0;
    const bool begun = feed_.begun();
    DwellDone done;
    done.summary = begun ? feed_.end(cut_short) : feed_.none_of(current_.dwell);
    if (begun) publish(true);
    ordered_ = false;
    // From here on the Identification is the control thread's.
    done_.try_push(done);
    control_.notify();
}

/// `ours`: in a dwell; outside the Identification may be in the control thread's hands.
void EstimatorStage::publish(bool ours) noexcept {
    if (ours) identification_.estimate(shown_.estimate);
    published_at_ = shown_.sample_time;
    shown_.faults = page_faults_of_this_thread();
    view_.publish(shown_);
}

}  // namespace vibrig::rt
