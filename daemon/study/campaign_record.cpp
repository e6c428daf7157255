#include "daemon/study/campaign_record.hpp"

#include <bit>
#include <cstring>
#include <stdexcept>

#include "proto/text.hpp"

namespace vibrig::study {

namespace {

static_assert(std::endian::native == std::endian::little, "records are little-endian");

constexpr char kFailed = 'F', kCampaign = 'C';

struct Numbers {
    std::array<double, estimator::kParameters> error, u_a, u;
    double nees_a, nees, hours, verdict;
};

constexpr std::size_t kLongestReason = 1000;

}  // namespace

std::string failed_record(std::string why) {
    if (why.empty()) why = "no reason given";
    if (!proto::is_utf8(why)) why = proto::utf8_from_latin1(why);
    if (why.size() > kLongestReason) {
        why.resize(kLongestReason);
        while (!proto::is_utf8(why)) why.pop_back();
    }
    return kFailed + why;
}

std::string encode(const CampaignRecord& record) {
    if (!record.failed.empty()) return failed_record(record.failed);
    const Numbers numbers{record.error,
                          record.u_a,
                          record.u,
                          record.nees_a,
                          record.nees,
                          record.hours,
                          static_cast<double>(record.verdict)};
    std::string bytes(1 + sizeof numbers, kCampaign);
    std::memcpy(bytes.data() + 1, &numbers, sizeof numbers);
    return bytes + record.reasons;
}

CampaignRecord decode(std::string_view bytes) {
    if (bytes.size() > 1 && bytes[0] == kFailed) return {.failed = std::string(bytes.substr(1))};
    Numbers numbers;
    if (bytes.size() < 1 + sizeof numbers || bytes[0] != kCampaign)
        throw std::runtime_error("found no record of a campaign, expected one");
    std::memcpy(&numbers, bytes.data() + 1, sizeof numbers);
    return {"",
            numbers.error,
            numbers.u_a,
            numbers.u,
            numbers.nees_a,
            numbers.nees,
            numbers.hours,
            static_cast<std::uint8_t>(numbers.verdict),
            std::string(bytes.substr(1 + sizeof numbers))};
}

}  // namespace vibrig::study
