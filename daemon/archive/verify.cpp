#include "daemon/archive/verify.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <set>

#include "daemon/archive/manifest.hpp"
#include "daemon/archive/vibration.hpp"
#include "daemon/record/campaign_checks.hpp"
#include "daemon/record/campaign_file.hpp"
#include "daemon/record/disk.hpp"

namespace vibrig::archive {

namespace fs = std::filesystem;

namespace {

std::string number_text(double number) {
    return std::isfinite(number) ? fmt::format("{:.15g}", number) : "-";
}

/// As the index keeps it: table and column, with the row where there are several, and the value.
using Cells = std::map<std::string, std::string>;

void add_coefficients(const Entry& of, Cells& to) {
    for (std::size_t i = 0; i < of.coefficients.size(); ++i) {
        if (!of.coefficients[i]) continue;
        const Coefficient& c = *of.coefficients[i];
        for (const auto& [column, value] : {std::pair{"value", c.value},
                                            {"sigma", c.sigma},
                                            {"u_a", c.u_a},
                                            {"u", c.u},
                                            {"expanded", c.expanded}})
            to[fmt::format("coefficient.{} of {}", column, estimator::parameter_names()[i])] =
                number_text(value);
        if (c.at_hz)
            to[fmt::format("coefficient.at_hz of {}", estimator::parameter_names()[i])] =
                number_text(*c.at_hz);
    }
    // Without a coefficient the index keeps none.
    if (to.empty()) return;
    for (std::size_t i = 0; i < of.covariance.size(); ++i)
        to[fmt::format("covariance.lower_triangle, number {}", i + 1)] =
            std::isfinite(of.covariance[i]) ? fmt::format("{:.9g}", of.covariance[i]) : "-";
}

Cells cells_of(const Entry& of) {
    Cells cells;
    add_coefficients(of, cells);
    for (const auto& [column, text] : {std::pair{"campaign.name", &of.name},
                                       {"campaign.started_by", &of.started_by},
                                       {"campaign.state", &of.state},
                                       {"result.unit_type", &of.unit_type},
                                       {"result.unit_serial", &of.unit_serial},
                                       {"result.reason", &of.reason},
                                       {"result.mark", &of.mark},
                                       {"result.version", &of.version},
                                       {"result.compiler", &of.compiler},
                                       {"result.instruction_set", &of.instruction_set},
                                       {"result.configuration_hash", &of.configuration_hash},
                                       {"result.verdict", &of.verdict},
                                       {"result.sentence", &of.sentence}})
        cells[column] = *text;
    for (const auto& [column, number] : {std::pair{"campaign.started_utc_ns", of.started_utc_ns},
                                         {"result.ended_utc_ns", of.ended_utc_ns},
                                         {"result.dwells", of.dwells},
                                         {"result.simulated", of.simulated ? 1 : 0}})
        cells[column] = std::to_string(number);
    cells["result.nis"] = number_text(of.nis);
    for (const auto& [name, value] : of.noise)
        if (std::isfinite(value)) cells["noise.value of " + name] = number_text(value);
    for (const Temperature& t : of.temperatures) {
        cells["temperature.mean_c of " + t.sensor] = number_text(t.mean);
        cells["temperature.low_c of " + t.sensor] = number_text(t.low);
        cells["temperature.high_c of " + t.sensor] = number_text(t.high);
    }
    std::vector<std::string> instruments;
    for (const Instrument& i : of.instruments)
        instruments.push_back(i.name + ", " + i.serial + ", " + i.certificate + ", " + i.due);
    std::ranges::sort(instruments);  // the index keeps no order
    for (std::size_t i = 0; i < instruments.size(); ++i)
        cells[fmt::format("instrument, number {}", i + 1)] = instruments[i];
    return cells;
}

/// What is not noted of one is not of the other.
void forget_vibration(const Coefficients& not_noted, Coefficients& of) {
    for (std::size_t i = 0; i < of.size(); ++i)
        if (of[i] && not_noted[i] && !not_noted[i]->at_hz) of[i]->at_hz.reset();
}

/// The index's rows against what the recording's own files say.
void check_rows(const Entry& indexed, const fs::path& folder, const std::string& index,
                Verified& to) {
    const auto differs = [&](const std::string& column, const std::string& found,
                             const std::string& expected, const fs::path& by) {
        to.findings.push_back({"index differs", indexed.key,
                               fmt::format("{}: {} of {}: found {}, expected {} of {}", index,
                                           column, indexed.key, found, expected, by.string())});
    };
    const Origin origin = origin_in(folder.string());
    // A rig's own index has the files that the recorder notes, of all that is hashed.
    const std::string hash =
        campaign_hash(origin.hash.empty() ? list_files(folder.string()) : indexed.files);
    if (indexed.hash != hash) differs("result.hash", indexed.hash, hash, folder);
    if (!origin.hash.empty() && origin.hash != indexed.hash)
        differs("result.hash", indexed.hash, origin.hash, folder / kManifestName);
    if (!origin.rig.empty() && origin.rig != indexed.rig)
        differs("result.rig", indexed.rig, origin.rig, folder / kManifestName);
    try {
        Entry recorded = read_recorded(folder.string());
        // Of an index that is older than that column: one thing to do, not a difference of each.
        if (!vibration_noted(indexed.coefficients)) {
            to.findings.push_back({"not in the index", indexed.key,
                                   "of which vibration its quadratic coefficients are is not "
                                   "noted: vibrig archive add " +
                                       folder.string()});
            forget_vibration(indexed.coefficients, recorded.coefficients);
        }
        const Cells is = cells_of(recorded), was = cells_of(indexed);
        const auto text_in = [](const Cells& cells, const std::string& column) {
            const auto found = cells.find(column);
            return found == cells.end() ? "nothing" : '"' + record::shown(found->second) + '"';
        };
        std::set<std::string> columns;
        for (const Cells* of : {&is, &was})
            for (const auto& [column, value] : *of) columns.insert(column);
        for (const auto& column : columns)
            if (const auto found = text_in(was, column), expected = text_in(is, column);
                found != expected)
                differs(column, found, expected, folder);
    } catch (const std::exception& error) {
        to.findings.push_back({"damaged", indexed.key, error.what()});
    }
}

/// What went on later is marked so, and nothing else: it counts in no list and no history.
void check_superseded(const std::vector<Entry>& entries, const std::string& index, Verified& to) {
    for (const Entry& one : entries) {
        if (one.hash.empty()) continue;
        const bool went_on = std::ranges::any_of(entries, [&one](const Entry& later) {
            return later.rig == one.rig && later.name == one.name &&
                   later.started_utc_ns == one.started_utc_ns &&
                   later.ended_utc_ns > one.ended_utc_ns;
        });
        if (one.superseded == went_on) continue;
        to.findings.push_back(
            {"index differs", one.key,
             fmt::format("{}: result.superseded of {}: found {:d}, expected {:d}: {}", index,
                         one.key, one.superseded, went_on,
                         went_on ? "a later delivery of the campaign goes on from it"
                                 : "no later delivery of the campaign is in the index")});
    }
}

/// The files as the index has them, and as the manifest beside them has; whether they are so.
bool check_copy(const Entry& entry, std::vector<File> files, const fs::path& folder, bool quick,
                Verified& to) {
    std::error_code error;
    if (!fs::exists(folder, error)) {
        to.findings.push_back(
            {"missing", entry.key,
             folder.string() + ": " + (error ? error.message() : std::string("no such folder"))});
        return false;
    }
    const std::size_t before = to.findings.size();
    to.files += files.size();
    for (File& file : files) {
        to.bytes += file.bytes;
        if (quick) file.sha256.clear();
    }
    if (files.empty())
        to.findings.push_back({"damaged", entry.key, "the index has none of its files"});
    for (auto& words : differences(folder.string(), files))
        to.findings.push_back({"damaged", entry.key, std::move(words)});
    return to.findings.size() == before;
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
        const fs::path folder = fs::path(place.folder) / entry.key;
        const bool whole = check_copy(entry, index.files(entry.key), folder, quick, found);
        if (entry.hash.empty()) {
            found.findings.push_back(
                {"not in the index", entry.key,
                 "its result is not read: vibrig archive add " + place.folder + "/" + entry.key});
        } else if (whole && !quick) {
            if (const auto indexed = index.campaign(entry.key))
                check_rows(*indexed, folder, index.name(), found);
        }
    }
    check_superseded(entries, index.name(), found);
    for (const auto& folder : campaign_folders(place.folder, strange_in(place.folder, found))) {
        const std::string key = fs::path(folder).lexically_relative(place.folder).string();
        if (!keys.contains(key))
            found.findings.push_back({"not in the index", key, unregistered(folder, place, index)});
    }
    if (!recordings.empty()) check_rig(place, recordings, rig, index, entries, found);
    return found;
}

}  // namespace vibrig::archive
