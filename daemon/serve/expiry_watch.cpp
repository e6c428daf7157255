#include "daemon/serve/expiry_watch.hpp"

#include <fmt/chrono.h>

#include <ctime>

namespace vibrig::serve {
namespace {

constexpr std::int64_t kDay_s = 86'400;  // s

int stage_of(std::int64_t left) {
    return left <= 0 ? 3 : left <= 7 * kDay_s ? 2 : left <= 30 * kDay_s ? 1 : 0;
}

}  // namespace

std::string date_of(std::int64_t utc_s) {
    return fmt::format("{:%Y-%m-%d}", fmt::gmtime(std::time_t{utc_s}));
}

std::string ExpiryWatch::check(const std::string& whose, std::int64_t expires, std::int64_t now) {
    if (reported_.size() >= kMostKnown && reported_.find(whose) == reported_.end())
        reported_.clear();
    auto& [known, reported] = reported_[whose];
    if (known != expires) reported = 0;  // a renewed one
    known = expires;
    const int stage = stage_of(expires - now);
    if (stage <= reported) return {};
    reported = stage;
    const std::string date = date_of(expires);
    if (stage == 3) return whose + " has expired on " + date + ": renew it with `vibrig pki init`";
    const std::int64_t days = (expires - now) / kDay_s;
    return whose + " expires in " +
           (days < 1 ? "less than a day" : std::to_string(days) + (days == 1 ? " day" : " days")) +
           ", on " + date + ": renew it with `vibrig pki init`";
}

}  // namespace vibrig::serve
