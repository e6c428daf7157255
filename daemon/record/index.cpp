#include "daemon/record/index.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <utility>

#include "daemon/journal/database.hpp"
#include "daemon/record/campaign_file.hpp"
#include "daemon/record/digest.hpp"
#include "daemon/record/raw_log.hpp"
#include "proto/candump.hpp"

namespace vibrig::record {

namespace fs = std::filesystem;
using journal::Database;
using journal::DatabaseError;

namespace {

constexpr std::size_t kMostNamed = 12;

constexpr const char* kTables = R"(
CREATE TABLE IF NOT EXISTS campaign (key TEXT PRIMARY KEY, name TEXT NOT NULL, started_by TEXT NOT NULL,
    started_utc_ns INTEGER NOT NULL, state TEXT NOT NULL);
CREATE TABLE IF NOT EXISTS file (campaign TEXT NOT NULL, name TEXT NOT NULL, part INTEGER NOT NULL,
    closed INTEGER NOT NULL, from_utc_ns INTEGER NOT NULL, to_utc_ns INTEGER NOT NULL, rows INTEGER NOT NULL,
    bytes INTEGER NOT NULL, sha256 TEXT NOT NULL, PRIMARY KEY (campaign, name)))";

std::string base_name(const fs::path& path) {
    return (path.has_filename() ? path : path.parent_path()).filename().string();
}

IndexedFile look_at_part(const std::string& path, Campaign& head) {
    head = read_part_head(path);
    IndexedFile file;
    file.part = head.head.part;
    file.closed = head.state != "running";
    const auto [first, last, rows] = part_span(path);
    file.rows = static_cast<std::int64_t>(rows);
    if (rows > 0) {
        file.from_utc_ns = first + head.head.utc_offset_ns;
        file.to_utc_ns = last + head.head.utc_offset_ns;
    }
    return file;
}

std::int64_t time_of(std::string_view line) {
    try {
        return proto::parse_candump_line(line).time_ns;
    } catch (const proto::CandumpError&) {
        return 0;
    }
}

IndexedFile look_at_raw(const std::string& path) {
    IndexedFile file;
    file.closed = path.ends_with(".zst");
    std::string rest, last;
    read_raw(path, [&](std::string_view piece) {
        rest += piece;
        std::size_t begin = 0;
        for (std::size_t end = rest.find('\n'); end != std::string::npos;
             begin = end + 1, end = rest.find('\n', begin)) {
            if (rest[begin] != '(') continue;
            last.assign(rest, begin, end - begin);
            if (file.rows++ == 0) file.from_utc_ns = time_of(last);
        }
        rest.erase(0, begin);
        return rest.size() < 4096;
    });
    if (file.rows > 0) file.to_utc_ns = time_of(last);
    return file;
}

}  // namespace

std::string Index::path_in(const std::string& folder) { return folder + "/recordings.sqlite3"; }

Index::Index(std::string folder, const Tell& tell) : folder_(std::move(folder)) {
    try {
        open();
        static_cast<void>(campaigns());
    } catch (const DatabaseError& error) {
        if (!error.damaged()) throw;
        database_.reset();
        for (const char* end : {"", "-wal", "-shm"}) fs::remove(path_in(folder_) + end);
        open();
        const std::size_t count = rebuild();
        tell(fmt::format("{}: made anew from the files of {} campaigns", error.what(), count));
    }
}

Index::~Index() = default;

void Index::open() {
    database_ = std::make_unique<Database>(path_in(folder_));
    // It can be made anew: no waiting for the disk.
    database_->execute("PRAGMA synchronous = OFF");
    database_->execute(kTables);
}

void Index::put(const std::string& key, const IndexedFile& file) {
    database_->run("INSERT OR REPLACE INTO file VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)",
                   {std::string_view(key), std::string_view(file.name), std::int64_t{file.part},
                    std::int64_t{file.closed}, file.from_utc_ns, file.to_utc_ns, file.rows,
                    file.bytes, std::string_view(file.sha256)});
}

void Index::note_file(const std::string& path) {
    const std::string folder = folder_of(path);
    const std::string key = base_name(folder);
    IndexedFile file;
    if (path.ends_with(".h5")) {
        Campaign head;
        file = look_at_part(path, head);
        database_->run(
            "INSERT INTO campaign VALUES (?, ?, ?, ?, ?) "
            "ON CONFLICT (key) DO UPDATE SET state = excluded.state",
            {std::string_view(key), std::string_view(head.head.name),
             std::string_view(head.head.started_by), head.head.utc_ns,
             std::string_view(head.state)});
    } else {
        file = look_at_raw(path);
    }
    file.name = base_name(path);
    file.bytes = static_cast<std::int64_t>(fs::file_size(path));
    if (file.closed) file.sha256 = sha256_of_file(path);
    if (file.part == 0 && file.closed)
        database_->run(
            "DELETE FROM file WHERE campaign = ? AND name = ?",
            {std::string_view(key), std::string_view(file.name).substr(
                                        0, file.name.size() - std::string_view(".zst").size())});
    put(key, file);
}

void Index::note(const std::string& campaign_folder) {
    for (const auto& [number, path] : part_files(campaign_folder)) note_file(path);
    for (const auto& path : raw_files(campaign_folder)) note_file(path);
}

std::size_t Index::rebuild() {
    database_->execute("DELETE FROM file");
    database_->execute("DELETE FROM campaign");
    std::size_t count = 0;
    for (const auto& entry : fs::directory_iterator(folder_)) {
        if (!entry.is_directory() || part_files(entry.path().string()).empty()) continue;
        try {
            note(entry.path().string());
            ++count;
        } catch (const DatabaseError&) {
            throw;
        } catch (const std::exception&) {
            // A file that cannot be read is not of the index; reading it says why.
        }
    }
    return count;
}

std::vector<IndexedCampaign> Index::campaigns() const {
    std::vector<IndexedCampaign> all;
    for (const auto& row :
         database_->ask("SELECT key, name, started_by, state, started_utc_ns FROM "
                        "campaign ORDER BY started_utc_ns"))
        all.push_back({row.texts[0], row.texts[1], row.texts[2], row.texts[3], row.numbers[4], {}});
    for (auto& campaign : all) {
        for (const auto& row : database_->ask(
                 "SELECT name, part, closed, from_utc_ns, to_utc_ns, rows, bytes, sha256 "
                 "FROM file WHERE campaign = ? ORDER BY name",
                 {std::string_view(campaign.key)}))
            campaign.files.push_back({row.texts[0], static_cast<int>(row.numbers[1]),
                                      row.numbers[2] != 0, row.numbers[3], row.numbers[4],
                                      row.numbers[5], row.numbers[6], row.texts[7]});
    }
    return all;
}

namespace {

/// As the index has them; where it cannot be opened, by a look at the folders.
std::vector<IndexedCampaign> known_in(const std::string& folder, const Index::Tell& tell) {
    try {
        return Index(folder, tell).campaigns();
    } catch (const std::exception&) {
    }
    std::vector<IndexedCampaign> found;
    std::error_code error;
    for (const auto& entry : fs::directory_iterator(folder, error)) {
        const auto parts = part_files(entry.path().string());
        if (parts.empty()) continue;
        try {
            const Head head = read_part_head(parts.begin()->second).head;
            found.push_back(
                {base_name(entry.path()), head.name, head.started_by, "", head.utc_ns, {}});
        } catch (const std::exception&) {
            continue;
        }
    }
    return found;
}

}  // namespace

std::string find_campaign(const std::string& argument, const std::vector<std::string>& folders,
                          const Index::Tell& tell) {
    std::error_code error;
    if (fs::exists(argument, error) || argument.find('/') != std::string::npos) return argument;
    std::vector<std::string> found;
    std::string known;
    std::size_t count = 0;
    for (const auto& folder : folders) {
        if (!fs::exists(Index::path_in(folder), error)) continue;
        for (const auto& campaign : known_in(folder, tell)) {
            if (campaign.key == argument) return folder + "/" + campaign.key;
            if (campaign.name == argument) found.push_back(folder + "/" + campaign.key);
            if (++count <= kMostNamed) known += " " + campaign.key;
        }
    }
    if (found.size() == 1) return found.front();
    if (!found.empty())
        throw std::runtime_error(
            fmt::format("{}: found {} campaigns of that name, expected one of {}", argument,
                        found.size(), fmt::join(found, " ")));
    throw std::runtime_error(
        argument + ": found neither such a file or folder nor such a campaign in an index" +
        (count == 0 ? fmt::format(" (recordings.sqlite3 in {})", fmt::join(folders, ", "))
                    : ", expected one of" + known + (count > kMostNamed ? " ..." : "")));
}

namespace {

/// What the index beside a campaign's folder has of it; nothing without an index.
std::vector<IndexedFile> indexed_files(const std::string& campaign_folder,
                                       const Index::Tell& tell) {
    std::error_code error;
    const fs::path folder = fs::weakly_canonical(campaign_folder, error);
    const std::string beside = folder.parent_path().string();
    if (error || !fs::exists(Index::path_in(beside), error)) return {};
    try {
        for (auto& campaign : Index(beside, tell).campaigns()) {
            if (campaign.key == base_name(folder)) return std::move(campaign.files);
        }
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
    for (const auto& words : missing_raw(campaign_folder, raw_files(campaign_folder), tell))
        tell(campaign_folder + ": missing " + words);
}

std::vector<std::string> missing_raw(const std::string& campaign_folder,
                                     const std::vector<std::string>& logs,
                                     const Index::Tell& tell) {
    std::map<int, std::string> expected;
    const auto there = raw_files(campaign_folder);
    for (int n = there.empty() ? 0 : raw_number(there.back()); n > 0; --n)
        expected[n] = fmt::format("raw-{:04d}.log", n);
    for (const auto& file : indexed_files(campaign_folder, tell)) {
        if (const int n = raw_number(file.name); n > 0)
            expected[n] = fmt::format("{}, which the index has with {} frames, SHA-256 {}",
                                      file.name, file.rows, file.sha256);
    }
    for (const auto& path : logs) expected.erase(raw_number(path));
    std::vector<std::string> words;
    for (auto& [number, text] : expected) words.push_back(std::move(text));
    return words;
}

}  // namespace vibrig::record
