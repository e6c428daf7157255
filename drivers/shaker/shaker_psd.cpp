// What the controller measured of a random vibration: read at rest, a part at a time.
#include <algorithm>
#include <span>
#include <utility>

#include "drivers/shaker/modbus_shaker.hpp"

namespace vibrig::drivers {
namespace {

// Two floats each; 125 words are what one request may read, and no pair is torn.
constexpr std::size_t kWordsOfPair = 4, kMostWords = 124;

}  // namespace

std::uint64_t ModbusShaker::read_psd() noexcept {
    const auto& random = settings_.registers.random;
    if (!random || !random->psd_block) return 0;
    const std::uint64_t request = ++psd_asked_;
    wake();
    return request;
}

ShakerPsd ModbusShaker::psd() const {
    const std::lock_guard lock(psd_mutex_);
    return psd_;
}

/// As the identity: nothing shakes, and nothing waits to.
bool ModbusShaker::psd_due() noexcept {
    const std::uint64_t asked = psd_asked_.load();
    if (asked != psd_request_) {
        psd_request_ = asked;
        psd_attempts_left_ = settings_.registers.random->psd_block->attempts;
        psd_words_.clear();
    }
    return psd_attempts_left_ > 0 && polled_ && !commanded_ && !orders_.waiting() &&
           latest_.read().at_rest();
}

/// A late reply would be taken for the next one: a device that does not answer costs its link.
void ModbusShaker::read_psd_part() {
    const proto::PsdBlock& block = *settings_.registers.random->psd_block;
    const std::size_t all = kWordsOfPair * static_cast<std::size_t>(block.pairs);
    const std::size_t begin = psd_words_.size();
    std::vector<std::uint16_t> part(std::min(kMostWords, all - begin));
    const auto address = static_cast<std::uint16_t>(block.first.address + begin);
    link_.respond_within(std::min(settings_.response_timeout, settings_.watchdog_period / 2));
    const Reply reply = transact([&] { return link_.read(block.first.table, address, part); });
    link_.respond_within(settings_.response_timeout);
    if (reply.kind == ReplyKind::overtaken || outranked()) return;  // a stop: read after it
    if (reply.ok()) {
        psd_words_.insert(psd_words_.end(), part.begin(), part.end());
        if (psd_words_.size() == all) answer_psd({});
        return;
    }
    psd_words_.clear();
    if (!link_.connected()) {
        closed_by_us_ = true;
        next_attempt_ = clock_.now();
    }
    if (--psd_attempts_left_ == 0)
        answer_psd("reading " + std::to_string(part.size()) + " registers from " +
                   std::to_string(address) + ": " + reply.text() + ", tried " +
                   std::to_string(block.attempts) + (block.attempts == 1 ? " time" : " times"));
}

void ModbusShaker::answer_psd(std::string why_not) {
    const proto::PsdBlock& block = *settings_.registers.random->psd_block;
    proto::Register hz = block.first;
    hz.scale = 1;
    ShakerPsd answer{psd_request_, {}, std::move(why_not)};
    const std::span<const std::uint16_t> words = psd_words_;
    for (std::size_t at = 0; at < words.size(); at += kWordsOfPair)
        answer.pairs.push_back({proto::decode(hz, words.subspan(at, 2)),
                                proto::decode(block.first, words.subspan(at + 2, 2))});
    psd_attempts_left_ = 0;
    psd_words_.clear();
    {
        const std::lock_guard lock(psd_mutex_);
        psd_ = std::move(answer);
    }
    if (on_reading_) on_reading_();
}

}  // namespace vibrig::drivers
