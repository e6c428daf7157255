#include "daemon/archive/manifest.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "daemon/record/campaign_file.hpp"
#include "daemon/record/digest.hpp"

namespace vibrig::archive {

namespace fs = std::filesystem;

namespace {

bool of_the_recording(const std::string& name) {
    return record::raw_number(name) > 0 || name == "dwells.csv" ||
           (name.starts_with("campaign") && name.ends_with(".h5"));
}

/// Else JSON does not take it.
bool is_utf8(const nlohmann::ordered_json& text) {
    try {
        static_cast<void>(text.dump());
        return true;
    } catch (const nlohmann::json::exception&) {
        return false;
    }
}

std::string shown_name(const nlohmann::json& name) {
    return name.dump(-1, ' ', true, nlohmann::json::error_handler_t::replace);
}

}  // namespace

std::vector<File> list_files(const std::string& folder) {
    std::vector<File> files;
    for (const auto& entry : fs::directory_iterator(folder)) {
        const std::string name = entry.path().filename().string();
        std::error_code error;  // of a link that leads round in a circle: it is no file
        if (!entry.is_regular_file(error) || name == kManifestName || name.ends_with(".new"))
            continue;
        files.push_back({name, static_cast<std::int64_t>(entry.file_size()),
                         record::sha256_of_file(entry.path().string())});
    }
    std::ranges::sort(files, {}, &File::name);
    return files;
}

std::string campaign_hash(const std::vector<File>& files) {
    std::string text;
    for (const File& file : files)
        if (of_the_recording(file.name)) text += file.sha256 + "  " + file.name + "\n";
    return record::sha256_of_text(text);
}

std::string manifest_json(const Entry& entry, const std::string& source) {
    nlohmann::ordered_json files = nlohmann::ordered_json::array();
    for (const File& file : entry.files)
        files.push_back({{"name", file.name}, {"bytes", file.bytes}, {"sha256", file.sha256}});
    const nlohmann::ordered_json manifest{
        {"hash", entry.hash}, {"rig", entry.rig}, {"key", entry.key}, {"files", std::move(files)}};
    if (is_utf8(manifest)) return manifest.dump(2) + "\n";
    for (const File& file : entry.files)
        if (!is_utf8(file.name))
            throw ArchiveError(source + ": found a file " + shown_name(file.name) +
                               ", expected a name in UTF-8");
    throw ArchiveError(source + ": found the campaign " + shown_name(entry.key) + " of the rig " +
                       shown_name(entry.rig) + ", expected names in UTF-8");
}

Origin origin_in(const std::string& folder) {
    std::ifstream file(fs::path(folder) / kManifestName);
    const auto root = nlohmann::json::parse(file, nullptr, false);
    try {
        if (root.is_object()) return {root.value("rig", ""), root.value("hash", "")};
    } catch (const nlohmann::json::exception&) {  // somebody else's
    }
    return {};
}

std::vector<std::string> differences(const std::string& folder, const std::vector<File>& expected) {
    std::vector<std::string> wrong;
    for (const File& file : expected) {
        const fs::path path = fs::path(folder) / file.name;
        std::error_code error;
        const auto bytes = static_cast<std::int64_t>(fs::file_size(path, error));
        if (error) {
            wrong.push_back(fmt::format("{}: missing", path.string()));
        } else if (bytes != file.bytes) {
            wrong.push_back(fmt::format("{}: {}, found {} bytes, expected {}", path.string(),
                                        bytes < file.bytes ? "short" : "long", bytes, file.bytes));
        } else if (const auto found = record::sha256_of_file(path.string());
                   !file.sha256.empty() && found != file.sha256) {
            wrong.push_back(fmt::format("{}: different, found SHA-256 {}, expected {}",
                                        path.string(), found, file.sha256));
        }
    }
    return wrong;
}

}  // namespace vibrig::archive
