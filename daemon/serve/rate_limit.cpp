#include "daemon/serve/rate_limit.hpp"

#include <algorithm>

namespace vibrig::serve {

double TokenBucket::left_at(Instant now) const noexcept {
    return std::min(burst_, left_ + per_s_ * std::chrono::duration<double>(now - last_).count());
}

bool TokenBucket::take(Instant now) {
    left_ = left_at(now);
    last_ = now;
    if (left_ < 1) {
        ++missed_;
        return false;
    }
    left_ -= 1;
    return true;
}

bool TokenBucket::full(Instant now) const noexcept { return left_at(now) >= burst_; }

TokenBucket& TokenBuckets::of(const std::string& identity, TokenBucket::Instant now) {
    if (const auto found = own_.find(identity); found != own_.end()) return found->second;
    if (own_.size() >= kMost)
        std::erase_if(own_, [&](const auto& entry) { return entry.second.full(now); });
    return own_.size() < kMost ? own_.emplace(identity, fresh_).first->second : shared_;
}

}  // namespace vibrig::serve
