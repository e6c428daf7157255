#include "daemon/dwells/player.hpp"

#include <stdexcept>

namespace vibrig::dwells {

Player::Player(const estimator::Settings& settings)
    : identification_(settings),
      stage_(ring_, awake_, awake_, identification_),
      noise_(settings, nullptr) {}

void Player::order(const rt::DwellOrder& order) {
    if (!stage_.order(order)) throw std::runtime_error("the estimator takes no order");
    stage_.work();
}

void Player::push(std::span<const drivers::Sample> samples) {
    if (samples.empty()) return;
    now_ = samples.back().time;
    if (ring_.push_n(samples) != samples.size())
        throw std::runtime_error("the estimator's ring is full");
    stage_.work();
}

bool Player::take_done(rt::DwellDone& done, bool decide) {
    if (!stage_.take_done(done)) return false;
    rt::BlockRecord block;
    while (stage_.take_block(block)) noise_.add(block);
    if (decide) noise_.conclude(done.summary, identification_);
    return true;
}

}  // namespace vibrig::dwells
