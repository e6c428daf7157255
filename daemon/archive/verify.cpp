#include "daemon/archive/verify.hpp"

#include <filesystem>
#include <set>

#include "daemon/archive/manifest.hpp"
#include "daemon/record/campaign_file.hpp"
#include "daemon/record/disk.hpp"

namespace vibrig::archive {

namespace fs = std::filesystem;

namespace {

/// The files as the index has them, and as the manifest beside them has.
void check_copy(const Entry& entry, std::vector<File> files, const fs::path& folder, bool quick,
                Verified& to) {
    std::error_code error;
    if (!fs::exists(folder, error)) {
        to.findings.push_back(
            {"missing", entry.key,
             folder.string() + ": " + (error ? error.message() : std::string("no such folder"))});
        return;
    }
    to.files += files.size();
    for (File& file : files) {
        to.bytes += file.bytes;
        if (quick) file.sha256.clear();
    }
    if (files.empty())
        to.findings.push_back({"damaged", entry.key, "the index has none of its files"});
    for (auto& words : differences(folder.string(), files))
        to.findings.push_back({"damaged", entry.key, std::move(words)});
}

/// What is named, and passed by.
Strange strange_in(const fs::path& folder, Verified& to) {
    return [folder, &to](const std::string& path, const std::string& why) {
        to.findings.push_back({"does not belong there",
                               fs::path(path).lexically_relative(folder).string(),
                               path + ": cannot be looked at: " + why});
    };
}

/// A campaign's folder that the index does not have: what it is, and what to do.
std::string unregistered(const std::string& folder, const Place& place, Index& index) {
    const auto known = index.key_of(origin_in(folder).hash);
    std::error_code none;
    if (known && fs::exists(fs::path(place.folder) / *known, none))
        return folder + ": is in the archive's folder and the same campaign as " + *known +
               ", which the index has: this one may be removed";
    return folder + ": is in the archive's folder and not in its index: vibrig archive add " +
           folder;
}

void check_rig(const Place& place, const std::string& recordings, const std::string& rig,
               Index& index, const std::vector<Entry>& entries, Verified& to) {
    std::set<std::string> hashes;
    for (const auto& folder : campaign_folders(recordings, strange_in(recordings, to))) {
        const std::string name = fs::path(folder).filename().string();
        const auto parts = record::part_files(folder);
        if (record::WriterLock::held(parts.rbegin()->second)) continue;  // the one in progress
        try {
            const std::string hash = campaign_hash(list_files(folder));
            hashes.insert(hash);
            if (!index.key_of(hash))
                to.findings.push_back({"missing", name,
                                       folder + ": is on the rig and not in the archive " +
                                           place.folder + ", or different there"});
        } catch (const std::exception& error) {
            to.findings.push_back({"damaged", name, error.what()});
        }
    }
    for (const Entry& entry : entries)
        if (entry.rig == rig && !entry.superseded && !hashes.contains(entry.hash))
            to.findings.push_back({"not on the rig", entry.key,
                                   entry.key + ": is in the archive and not on the rig, or "
                                               "different there"});
}

}  // namespace

Verified verify(const Place& place, const std::string& recordings, const std::string& rig,
                bool quick, const Progress& progress) {
    if (!fs::is_directory(place.folder))
        throw ArchiveError(place.folder + ": found no such folder, expected the archive's");
    Index index(place.index, Database::Mode::read);
    Filter all;
    all.superseded = true;
    const auto entries = index.campaigns(all);
    Verified found;
    std::set<std::string> keys;
    for (const Entry& entry : entries) {
        if (progress) progress(found.campaigns, entries.size());
        ++found.campaigns;
        keys.insert(entry.key);
        check_copy(entry, index.files(entry.key), fs::path(place.folder) / entry.key, quick, found);
        if (entry.hash.empty())
            found.findings.push_back(
                {"not in the index", entry.key,
                 "its result is not read: vibrig archive add " + place.folder + "/" + entry.key});
    }
    for (const auto& folder : campaign_folders(place.folder, strange_in(place.folder, found))) {
        const std::string key = fs::path(folder).lexically_relative(place.folder).string();
        if (!keys.contains(key))
            found.findings.push_back({"not in the index", key, unregistered(folder, place, index)});
    }
    if (!recordings.empty()) check_rig(place, recordings, rig, index, entries, found);
    return found;
}

}  // namespace vibrig::archive
