// A campaign's files against what the index beside its folder has of them.
#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <filesystem>
#include <iterator>
#include <map>

#include "daemon/record/campaign_file.hpp"
#include "daemon/record/digest.hpp"
#include "daemon/record/index.hpp"
#include "daemon/record/raw_log.hpp"

namespace vibrig::record {

namespace fs = std::filesystem;

namespace {

/// What the index beside a campaign's folder has of it; nothing without an index.
std::vector<IndexedFile> indexed_files(const std::string& campaign_folder,
                                       const Index::Tell& tell) {
    std::error_code error;
    const fs::path folder = fs::weakly_canonical(campaign_folder, error);
    const std::string beside = folder.parent_path().string();
    if (error || !fs::exists(Index::path_in(beside), error)) return {};
    try {
        return Index(beside, tell, Index::Use::ask).files_of(base_name(folder));
    } catch (const std::exception&) {
        // Of somebody else: nothing to compare with.
    }
    return {};
}

}  // namespace

void compare_with_index(const std::string& campaign_folder, const Index::Tell& tell) {
    std::error_code error;
    const fs::path folder = fs::weakly_canonical(campaign_folder, error);
    for (const auto& file : indexed_files(campaign_folder, tell)) {
        const fs::path path = folder / file.name;
        if (!fs::exists(path, error)) {
            if (file.part > 0)
                throw std::runtime_error(fmt::format(
                    "{}: missing {} of campaign {}, which the index has with {} samples",
                    campaign_folder, file.name, base_name(folder), file.rows));
        } else if (file.closed &&
                   static_cast<std::int64_t>(fs::file_size(path, error)) != file.bytes) {
            tell(fmt::format("{}: found {} bytes, {} when it was closed: changed since",
                             path.string(), fs::file_size(path, error), file.bytes));
        }
    }
    for (const auto& words : gone_raw(campaign_folder, tell))
        tell(campaign_folder + ": missing " + words);
}

std::vector<std::string> changed_parts(const std::string& campaign_folder,
                                       const Index::Tell& tell) {
    std::error_code error;
    std::vector<std::string> words;
    for (const auto& file : indexed_files(campaign_folder, tell)) {
        const std::string path = (fs::path(campaign_folder) / file.name).string();
        if (file.part == 0 || !file.closed || file.sha256.empty() || !fs::exists(path, error))
            continue;
        if (const std::string found = sha256_of_file(path); found != file.sha256)
            words.push_back(
                fmt::format("{}: found SHA-256 {}, expected {} as it was closed: "
                            "changed since",
                            path, found, file.sha256));
    }
    return words;
}

std::vector<std::string> gone_raw(const std::string& campaign_folder, const Index::Tell& tell) {
    std::map<int, std::string> expected;
    const auto there = raw_files(campaign_folder);
    for (int n = there.empty() ? 0 : raw_number(there.back()); n > 0; --n)
        expected[n] = fmt::format("raw-{:04d}.log", n);
    for (const auto& file : indexed_files(campaign_folder, tell)) {
        if (const int n = raw_number(file.name); n > 0)
            expected[n] = fmt::format("{}, which the index has with {} frames, SHA-256 {}",
                                      file.name, file.rows, file.sha256);
    }
    for (const auto& path : there) expected.erase(raw_number(path));
    std::vector<std::string> words;
    for (auto& [number, text] : expected) words.push_back(std::move(text));
    return words;
}

std::vector<std::string> cut_raw(const std::string& campaign_folder) {
    std::vector<std::string> words;
    // A compressed one has its name once it is whole, also while the campaign is being written.
    for (const auto& path : raw_files(campaign_folder)) {
        if (path.ends_with(".zst") && is_cut(path))
            words.push_back(fmt::format("the end of {}: the file is cut off", base_name(path)));
    }
    return words;
}

std::vector<std::string> missing_raw(const std::string& campaign_folder, const Index::Tell& tell) {
    auto words = gone_raw(campaign_folder, tell);
    std::ranges::move(cut_raw(campaign_folder), std::back_inserter(words));
    return words;
}

}  // namespace vibrig::record
