#include "daemon/tool/recordings/campaign_argument.hpp"

#include <cstdlib>
#include <iostream>
#include <vector>

#include "daemon/record/index.hpp"

namespace vibrig::tool {

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
    for (const auto& [number, file] : record::part_files(record::folder_of(path))) {
        if (record::is_part_file(path, number))
            record::compare_with_index(record::folder_of(path), tell_on_error);
    }
    return record::read_campaign(path);
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
