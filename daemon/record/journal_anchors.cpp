#include "daemon/record/journal_anchors.hpp"

#include <algorithm>
#include <exception>
#include <filesystem>

#include "daemon/record/campaign_file.hpp"

namespace vibrig::record {

namespace {

namespace fs = std::filesystem;

constexpr std::size_t kCampaigns = 3;

struct Found {
    fs::file_time_type written;
    std::string path;
};

/// The last part of each campaign in a folder, the newest first.
std::vector<Found> last_parts(const std::string& folder) {
    std::vector<Found> parts;
    std::error_code error;
    for (const auto& entry : fs::directory_iterator(folder, error)) {
        if (!entry.is_directory(error)) continue;
        const auto files = part_files(entry.path().string());
        if (files.empty()) continue;
        const std::string& path = files.rbegin()->second;
        parts.push_back({fs::last_write_time(path, error), path});
    }
    std::ranges::sort(parts, std::greater{}, &Found::written);
    return parts;
}

}  // namespace

std::vector<journal::Anchor> journal_anchors(const std::string& folder) {
    std::vector<journal::Anchor> anchors;
    auto parts = last_parts(folder);
    if (parts.size() > kCampaigns) parts.resize(kCampaigns);
    for (const Found& part : parts) {
        try {
            const auto campaign = read_part_head(part.path);
            if (auto head = journal::parse_head(campaign.head.journal_head))
                anchors.push_back({part.path, std::move(*head)});
        } catch (const std::exception&) {
            continue;  // others have to say so
        }
    }
    return anchors;
}

}  // namespace vibrig::record
