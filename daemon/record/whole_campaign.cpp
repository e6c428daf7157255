#include "daemon/record/whole_campaign.hpp"

#include <spdlog/fmt/fmt.h>

#include <filesystem>
#include <stdexcept>
#include <utility>
#include <vector>

namespace vibrig::record {

namespace {

/// Of missing parts, in one message.
constexpr std::size_t kMostMissing = 5;

std::vector<std::string> names_of(const std::map<int, std::string>& parts) {
    std::vector<std::string> names;
    for (const auto& [part, path] : parts)
        names.push_back(std::filesystem::path(path).filename().string());
    return names;
}

}  // namespace

WholeCampaign::WholeCampaign(std::string folder, std::string campaign,
                             std::map<int, std::string> parts)
    : folder_(std::move(folder)), campaign_(std::move(campaign)), parts_(std::move(parts)) {
    const int last = parts_.rbegin()->first;
    // As many as `part` says, which may be any number in a file that somebody changed.
    const int absent = last - static_cast<int>(parts_.size());
    std::vector<std::string> missing;
    for (int part = 1; part <= last && missing.size() < kMostMissing; ++part)
        if (!parts_.contains(part)) missing.push_back(part_name(part));
    if (absent > static_cast<int>(missing.size()))
        missing.push_back(fmt::format("{} more", absent - static_cast<int>(missing.size())));
    if (!missing.empty())
        throw std::runtime_error(fmt::format(
            "{}: missing {} of campaign {}, expected all {} parts (found {})", folder_,
            fmt::join(missing, ", "), campaign_, last, fmt::join(names_of(parts_), ", ")));
}

void WholeCampaign::check(int number, const Campaign& part) const {
    if (part.head.part == number && part.head.campaign == campaign_) return;
    throw std::runtime_error(fmt::format("{}: found part {} of campaign {}, expected part {} of {}",
                                         part.path, part.head.part, part.head.campaign, number,
                                         campaign_));
}

void WholeCampaign::check_end(const std::string& state) const {
    if (state != kContinued) return;
    const int last = parts_.rbegin()->first;
    throw std::runtime_error(fmt::format(
        "{}: missing {} of campaign {}, in which {} says that the campaign goes on (found {})",
        folder_, part_name(last + 1), campaign_, part_name(last),
        fmt::join(names_of(parts_), ", ")));
}

}  // namespace vibrig::record
