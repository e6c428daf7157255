#include "daemon/record/index.hpp"

#include <spdlog/fmt/fmt.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <iterator>
#include <map>
#include <tuple>
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

// Together, or an index that was begun would be somebody else's.
constexpr const char* kTables = R"(
BEGIN;
CREATE TABLE IF NOT EXISTS campaign (key TEXT PRIMARY KEY, name TEXT NOT NULL, started_by TEXT NOT NULL,
    started_utc_ns INTEGER NOT NULL, state TEXT NOT NULL);
CREATE TABLE IF NOT EXISTS file (campaign TEXT NOT NULL, name TEXT NOT NULL, part INTEGER NOT NULL,
    closed INTEGER NOT NULL, from_utc_ns INTEGER NOT NULL, to_utc_ns INTEGER NOT NULL, rows INTEGER NOT NULL,
    bytes INTEGER NOT NULL, sha256 TEXT NOT NULL, PRIMARY KEY (campaign, name));
CREATE INDEX IF NOT EXISTS campaign_by_name ON campaign (name);
CREATE INDEX IF NOT EXISTS campaign_by_begin ON campaign (started_utc_ns);
COMMIT)";

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

/// SQLite writes beside it, too.
bool may_write(const std::string& folder) {
    return ::access((folder + "/").c_str(), W_OK) == 0 &&
           ::access(Index::path_in(folder).c_str(), W_OK) == 0;
}

}  // namespace

std::string Index::path_in(const std::string& folder) { return folder + "/recordings.sqlite3"; }

Index::Index(std::string folder, const Tell& tell, Use use)
    : folder_(std::move(folder)), tell_(tell), only_read_(use == Use::ask && !may_write(folder_)) {
    std::error_code none;
    const bool empty = fs::file_size(path_in(folder_), none) == 0;  // nor an error
    or_make_anew([this] { open(); });
    static_cast<void>(ask("SELECT name FROM file LIMIT 1"));
    if (!empty) return;  // not taken away first: somebody may just be making it
    tell_(path_in(folder_) +
          fmt::format(": is empty: made anew from the files of {} campaigns", rebuild()));
}

bool Index::or_make_anew(const std::function<void()>& act) {
    try {
        act();
        return true;
    } catch (const DatabaseError& error) {
        if (!error.damaged() || only_read_) throw;
        make_anew(error.what());
        return false;
    }
}

void Index::make_anew(const std::string& why) {
    database_.reset();
    for (const char* end : {"", "-wal", "-shm"}) fs::remove(path_in(folder_) + end);
    open();
    const std::size_t count = rebuild();
    tell_(fmt::format("{}: made anew from the files of {} campaigns", why, count));
}

std::vector<journal::Row> Index::ask(const char* sql, const std::vector<std::string>& texts) {
    const std::vector<journal::Value> values(texts.begin(), texts.end());
    std::vector<journal::Row> rows;
    const auto look = [&] { rows = database_->ask(sql, values); };
    if (!or_make_anew(look)) look();
    return rows;
}

Index::~Index() = default;

void Index::open() {
    journal::refuse_foreign(path_in(folder_), {"file", "index_version"});
    using Mode = Database::Mode;
    database_ = std::make_unique<Database>(path_in(folder_), only_read_ ? Mode::read : Mode::write);
    if (only_read_) return;
    database_->execute("PRAGMA synchronous = OFF");  // it can be made anew: no waiting
    database_->execute(kTables);
}

void Index::put(const std::string& key, const IndexedFile& file) {
    database_->run("INSERT OR REPLACE INTO file VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)",
                   {key, file.name, file.part, file.closed, file.from_utc_ns, file.to_utc_ns,
                    file.rows, file.bytes, file.sha256});
}

void Index::look(const std::string& path) {
    const std::string folder = folder_of(path);
    const std::string key = base_name(folder);
    IndexedFile file;
    if (path.ends_with(".h5")) {
        Campaign head;
        file = look_at_part(path, head);
        database_->run(
            "INSERT INTO campaign VALUES (?, ?, ?, ?, ?) "
            "ON CONFLICT (key) DO UPDATE SET state = excluded.state",
            {key, head.head.name, head.head.started_by, head.head.utc_ns, head.state});
    } else {
        file = look_at_raw(path);
    }
    file.name = base_name(path);
    file.bytes = static_cast<std::int64_t>(fs::file_size(path));
    if (file.closed) file.sha256 = sha256_of_file(path);
    if (file.part == 0 && file.closed)
        database_->run("DELETE FROM file WHERE campaign = ? AND name = ?",
                       {key, std::string_view(file.name).substr(
                                 0, file.name.size() - std::string_view(".zst").size())});
    put(key, file);
}

void Index::note_file(const std::string& path) {
    or_make_anew([&] { look(path); });  // with this file
}

void Index::look_at_folder(const std::string& campaign_folder) {
    for (const auto& [number, path] : part_files(campaign_folder)) look(path);
    for (const auto& path : raw_files(campaign_folder)) look(path);
}

void Index::note(const std::string& campaign_folder) {
    or_make_anew([&] { look_at_folder(campaign_folder); });
}

std::size_t Index::rebuild() {
    database_->execute("DELETE FROM file");
    database_->execute("DELETE FROM campaign");
    std::size_t count = 0;
    for (const auto& entry : fs::directory_iterator(folder_)) {
        if (!entry.is_directory() || part_files(entry.path().string()).empty()) continue;
        try {
            look_at_folder(entry.path().string());
            ++count;
        } catch (const DatabaseError&) {
            throw;
        } catch (const std::exception&) {
            // A file that cannot be read is not of the index; reading it says why.
        }
    }
    return count;
}

namespace {

IndexedFile file_of(const journal::Row& row) {
    return {row.texts[1],        static_cast<int>(row.numbers[2]),
            row.numbers[3] != 0, row.numbers[4],
            row.numbers[5],      row.numbers[6],
            row.numbers[7],      row.texts[8]};
}

}  // namespace

std::vector<IndexedCampaign> Index::campaigns() {
    std::vector<IndexedCampaign> all;
    std::map<std::string, std::size_t> at;
    for (const auto& row : ask("SELECT key, name, started_by, state, started_utc_ns FROM "
                               "campaign ORDER BY started_utc_ns")) {
        at.emplace(row.texts[0], all.size());
        all.push_back({row.texts[0], row.texts[1], row.texts[2], row.texts[3], row.numbers[4], {}});
    }
    for (const auto& row : ask("SELECT * FROM file ORDER BY campaign, name")) {
        if (const auto of = at.find(row.texts[0]); of != at.end())
            all[of->second].files.push_back(file_of(row));
    }
    return all;
}

Index::Named Index::look_up(const std::string& key_or_name) {
    Named found;
    found.is_key = !ask("SELECT key FROM campaign WHERE key = ?", {key_or_name}).empty();
    for (const auto& row :
         ask("SELECT key FROM campaign WHERE name = ? ORDER BY started_utc_ns", {key_or_name}))
        found.keys.push_back(row.texts[0]);
    return found;
}

std::vector<IndexedFile> Index::files_of(const std::string& key) {
    std::vector<IndexedFile> files;
    for (const auto& row : ask("SELECT * FROM file WHERE campaign = ? ORDER BY name", {key}))
        files.push_back(file_of(row));
    return files;
}

std::pair<std::vector<std::string>, std::size_t> Index::some_keys(std::size_t most) {
    std::vector<std::string> keys;
    const std::string some =
        fmt::format("SELECT key FROM campaign ORDER BY started_utc_ns LIMIT {}", most);
    for (const auto& row : ask(some.c_str())) keys.push_back(row.texts[0]);
    const auto count = ask("SELECT count(*) FROM campaign").at(0).numbers.at(0);
    return {keys, static_cast<std::size_t>(count)};
}

namespace {

/// What a folder of campaigns has of a name.
struct Known {
    Index::Named named;
    std::vector<std::string> keys;  ///< some, if none is meant
    std::size_t count = 0;
};

/// Of a folder whose index cannot be opened, by a look at its folders.
Known seen_in(const std::string& folder, const std::string& argument) {
    Known known;
    std::error_code error;
    for (const auto& entry : fs::directory_iterator(folder, error)) {
        const auto parts = part_files(entry.path().string());
        if (parts.empty()) continue;
        try {
            const std::string key = base_name(entry.path());
            const std::string name = read_part_head(parts.begin()->second).head.name;
            known.named.is_key = known.named.is_key || key == argument;
            if (name == argument) known.named.keys.push_back(key);
            if (++known.count <= kMostNamed) known.keys.push_back(key);
        } catch (const std::exception&) {
            continue;
        }
    }
    return known;
}

Known known_in(const std::string& folder, const std::string& argument, const Index::Tell& tell) {
    try {
        Index index(folder, tell, Index::Use::ask);
        Known known{index.look_up(argument), {}, 0};
        if (!known.named.is_key && known.named.keys.empty())
            std::tie(known.keys, known.count) = index.some_keys(kMostNamed);
        return known;
    } catch (const std::exception&) {
        return seen_in(folder, argument);
    }
}

}  // namespace

std::string find_campaign(const std::string& argument, const std::vector<std::string>& folders,
                          const Index::Tell& tell) {
    std::error_code error;
    if (fs::exists(argument, error) || argument.find('/') != std::string::npos) return argument;
    std::vector<std::string> found;
    std::string known;
    std::size_t count = 0, named = 0;
    for (const auto& folder : folders) {
        if (!fs::exists(Index::path_in(folder), error)) continue;
        const Known here = known_in(folder, argument, tell);
        if (here.named.is_key) return folder + "/" + argument;
        for (const auto& key : here.named.keys) found.push_back(folder + "/" + key);
        for (const auto& key : here.keys) {
            if (named++ < kMostNamed) known += " " + key;
        }
        count += here.count;
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

/// It begins another life of the daemon, before which UTC may have been set back.
bool begins_anew(const std::string& path) {
    RawReader reader(path);
    std::string begin;
    for (std::string_view piece; begin.size() < kStartLine.size() && reader.next(piece);)
        begin += piece;
    return begin.starts_with(kStartLine);
}

}  // namespace

std::string misplaced_raw(const std::string& campaign_folder) {
    // As for whoever reads the frames: a second for time stamps that are not quite in order.
    constexpr std::int64_t kSecond_ns = 1'000'000'000;
    std::int64_t last = 0;
    for (const auto& path : raw_files(campaign_folder)) {
        const IndexedFile log = look_at_raw(path);
        if (log.rows == 0) continue;
        if (begins_anew(path)) last = 0;
        if (log.from_utc_ns + kSecond_ns < last)
            return fmt::format(
                "{}: found a time {:.2f} s before the end of the log before it, expected logs in "
                "their order: it is of another campaign, or a copy",
                path, static_cast<double>(last - log.from_utc_ns) * 1e-9);
        last = std::max(last, log.to_utc_ns);
    }
    return {};
}

}  // namespace vibrig::record
