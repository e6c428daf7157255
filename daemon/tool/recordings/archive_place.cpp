#include "daemon/tool/recordings/archive_place.hpp"

#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <iostream>

#include "daemon/configuration/configuration.hpp"
#include "daemon/report/paperwork.hpp"
#include "daemon/results/progress.hpp"
#include "daemon/tool/commands.hpp"
#include "proto/text.hpp"

namespace vibrig::tool {

namespace fs = std::filesystem;

namespace {

std::string environment(const char* name) {
    const char* const value = std::getenv(name);
    return value == nullptr ? "" : value;
}

/// Where recordings.sqlite3 is, as for CAMPAIGN elsewhere; empty: nowhere.
std::string folder_here() {
    std::error_code error;
    for (const std::string& folder :
         {std::string("."), environment("VIBRIG_RECORDINGS"), std::string("/var/lib/vibrig")})
        if (!folder.empty() && fs::exists(archive::index_in(folder), error)) return folder;
    return "";
}

/// As it goes into a folder's name, JSON and an index; empty: it is fine.
std::string rig_name_rule(const std::string& rig) {
    constexpr std::size_t kLongest = 64;
    const bool good =
        rig.size() <= kLongest && proto::is_utf8(rig) &&
        std::ranges::none_of(rig, [](unsigned char c) { return c < 0x20 || c == 0x7f; });
    return good ? "" : "1 to 64 bytes of UTF-8 without control characters";
}

}  // namespace

void add_archive_options(CLI::App& command, ArchiveOptions& options) {
    command.add_option("--archive", options.archive,
                       "the archive's folder, or its index on a server, postgresql://... (default: "
                       "$VIBRIG_ARCHIVE, else recordings.sqlite3 here, in $VIBRIG_RECORDINGS or in "
                       "/var/lib/vibrig)");
    command.add_option("--index", options.index,
                       "its index, postgresql://... (default: $VIBRIG_ARCHIVE_INDEX, else "
                       "recordings.sqlite3 in the folder)");
    command.add_option("--config", options.config, "vibrigd's configuration, which has [archive]");
}

void add_at_hz(CLI::App& command, std::optional<double>& at_hz) {
    add_number(command, "--at-hz", at_hz,
               "quadratic coefficients of campaigns at this frequency, 0: static ones (default: of "
               "the same vibration as the newest's), Hz",
               0, 1e5);
}

Whereabouts whereabouts_of(const ArchiveOptions& options) {
    Whereabouts found;
    std::string folder = options.archive, index = options.index;
    found.rig = options.rig;
    if (!options.config.empty()) {
        const auto c = configuration::load(options.config, false).configuration;
        if (folder.empty() && c.archive.folder.empty())
            throw std::runtime_error(options.config +
                                     ": archive.folder: found nothing, expected "
                                     "the archive's folder");
        if (folder.empty()) folder = c.archive.folder;
        if (index.empty()) index = c.archive.index;
        if (found.rig.empty()) found.rig = c.archive.rig;
        found.recordings = c.record.folder.empty() ? c.results : c.record.folder;
    }
    if (folder.empty() && index.empty()) {
        folder = environment("VIBRIG_ARCHIVE");
        index = environment("VIBRIG_ARCHIVE_INDEX");
    }
    if (archive::is_server(folder)) {
        index = folder;
        folder.clear();
    }
    found.named = !folder.empty() || !index.empty();
    if (folder.empty() && index.empty()) folder = folder_here();
    if (!index.empty() && !archive::is_server(index))
        throw std::runtime_error("--index: found '" + proto::printable(index) +
                                 "', expected postgresql://...");
    if (index.empty() && !folder.empty()) index = archive::index_in(folder);
    if (found.rig.empty()) found.rig = archive::host_name();
    if (const auto expected = rig_name_rule(found.rig); !expected.empty())
        throw std::runtime_error(
            (!options.rig.empty() ? "--rig" : options.config + ": archive.rig") + ": found '" +
            proto::printable(found.rig) + "', expected " + expected);
    found.place = {folder, index};
    return found;
}

std::unique_ptr<archive::Index> open_index(const ArchiveOptions& options) {
    const Whereabouts at = whereabouts_of(options);
    if (at.place.index.empty())
        throw std::runtime_error(
            "found no recordings.sqlite3 here, in $VIBRIG_RECORDINGS or in /var/lib/vibrig, "
            "expected --archive FOLDER");
    using Mode = archive::Database::Mode;
    const std::string& where = at.place.index;
    if (archive::is_server(where)) return std::make_unique<archive::Index>(where, Mode::read);
    // Beside campaigns an empty file is none of a new index: reading says what to do.
    std::error_code none;
    const bool cut =
        fs::file_size(where, none) == 0 &&
        !archive::campaign_folders(at.place.folder, [](const auto&, const auto&) {}).empty();
    const bool writes = archive::may_write(where) && !cut;
    auto index = std::make_unique<archive::Index>(where, writes ? Mode::write : Mode::read);
    // Whoever may not note the results reads them for this once.
    if (!writes && !index->without_result().empty())
        index = std::make_unique<archive::Index>(where, Mode::copy);
    Progress progress("reading results");
    archive::read_results(
        *index, at.place.folder, at.rig,
        [](const std::string& words) { std::cerr << words << '\n'; },
        [&](std::size_t done, std::size_t all) { progress.show(done, all); });
    return index;
}

std::int64_t utc_of(const std::string& option, const std::string& text) {
    int year = 0, month = 0, day = 0, hour = 0, minute = 0, second = 0, end = 0;
    const auto whole = [&] { return static_cast<std::size_t>(end) == text.size() && end > 0; };
    bool good =
        std::sscanf(text.c_str(), "%4d-%2d-%2d%n", &year, &month, &day, &end) == 3 && whole();
    if (!good)
        good = std::sscanf(text.c_str(), "%4d-%2d-%2d%*1[T ]%2d:%2d:%2dZ%n", &year, &month, &day,
                           &hour, &minute, &second, &end) == 6 &&
               whole();
    const std::chrono::year_month_day date{std::chrono::year(year),
                                           std::chrono::month(static_cast<unsigned>(month)),
                                           std::chrono::day(static_cast<unsigned>(day))};
    if (!good || !date.ok() || hour > 23 || minute > 59 || second > 60)
        throw std::runtime_error(option + ": found '" + proto::printable(text) +
                                 "', expected a date as 2026-03-01 or 2026-03-01T08:00:00Z");
    const auto days = std::chrono::sys_days(date).time_since_epoch();
    return (std::chrono::duration_cast<std::chrono::seconds>(days).count() + 3600 * hour +
            60 * minute + second) *
           1'000'000'000;
}

std::string minute_text(std::int64_t utc_ns) { return report::utc_text(utc_ns).substr(0, 16); }
}  // namespace vibrig::tool
