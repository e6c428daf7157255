#include "daemon/dwells/player.hpp"

#include <stdexcept>

namespace vibrig::dwells {

Player::Player(const estimator::Settings& settings, DwellBook::Noise noise)
    : book_(settings, nullptr, noise), stage_(ring_, awake_, awake_, book_.identification()) {}

void Player::order(const rt::DwellOrder& order) {
    if (!book_.order(stage_, order)) throw std::runtime_error("the estimator takes no order");
    stage_.work();
}

void Player::push(std::span<const drivers::Sample> samples) {
    if (samples.empty()) return;
    now_ = samples.back().time;
    if (ring_.push_n(samples) != samples.size())
        throw std::runtime_error("the estimator's ring is full");
    stage_.work();
}

}  // namespace vibrig::dwells
