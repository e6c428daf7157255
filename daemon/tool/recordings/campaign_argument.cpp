#include "daemon/tool/recordings/campaign_argument.hpp"

#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <vector>

#include "daemon/record/index.hpp"

namespace vibrig::tool {

namespace fs = std::filesystem;

namespace {
void tell_on_error(const std::string& words) { std::cerr << words << '\n'; }
}  // namespace

std::string named_campaign(const std::string& argument) {
    std::vector<std::string> folders{"."};
    if (const char* more = std::getenv("VIBRIG_RECORDINGS"); more != nullptr && *more != '\0')
        folders.emplace_back(more);
    folders.emplace_back("/var/lib/vibrig");
    return record::find_campaign(argument, folders, tell_on_error);
}

record::Campaign read_named_campaign(const std::string& argument) {
    const std::string path = record::campaign_path(named_campaign(argument));
    // A file of another name, put aside by somebody, is none of the index.
    const auto parts = record::part_files(record::folder_of(path));
    for (const auto& [number, file] : parts) {
        if (file == path) record::compare_with_index(record::folder_of(path), tell_on_error);
    }
    return record::read_campaign(path);
}

void keep_recordings(const std::string& output) {
    std::error_code error;
    const fs::path path = fs::weakly_canonical(output, error);
    if (error || !fs::is_regular_file(path, error)) return;
    const std::string name = path.filename().string();
    const bool beside = !record::part_files(path.parent_path().string()).empty();
    if (record::is_hdf5(path.string()) || name == "recordings.sqlite3" ||
        (beside && (record::raw_number(name) > 0 || name == "dwells.csv" || name.ends_with(".h5"))))
        throw std::runtime_error(output +
                                 ": found a file of a recording, expected another to write");
}

bool tell_missing_raw(const std::string& folder) {
    const auto missing = record::missing_raw(folder, tell_on_error);
    for (const auto& words : missing) std::cerr << folder << ": missing " << words << '\n';
    return missing.empty();
}

bool tell_left_out(const std::string& folder, const std::vector<std::string>& logs) {
    const auto names = record::left_out(folder, logs);
    if (names.empty()) return true;
    std::cerr << folder << ": not read: " << names.front();
    if (names.size() > 1) std::cerr << " to " << names.back();
    std::cerr << ", " << names.size() << " of its " << record::raw_files(folder).size()
              << " segments: this is part of the campaign; expected " << folder
              << ", or all of them\n";
    return false;
}

}  // namespace vibrig::tool
