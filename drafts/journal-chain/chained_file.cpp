#include "daemon/journal/chained_file.hpp"

#include <fmt/format.h>
#include <sys/stat.h>

#include <chrono>
#include <filesystem>
#include <stdexcept>

namespace vibrig::journal {

namespace {

// So much is verified before the start goes on, and no file larger than this as a whole.
constexpr std::int64_t kEntriesAtStart = 1000;
constexpr std::size_t kBytesAtStart = 16 << 20;
constexpr off_t kWholeAtStart = 64 << 20;

constexpr const char* kSchema = R"(
CREATE TABLE IF NOT EXISTS campaign (id INTEGER PRIMARY KEY, name TEXT NOT NULL,
    started_by TEXT NOT NULL, started_utc_ns INTEGER NOT NULL, configuration_hash INTEGER NOT NULL,
    state TEXT NOT NULL, reason TEXT NOT NULL DEFAULT '', ended_utc_ns INTEGER,
    result_json TEXT);
CREATE TABLE IF NOT EXISTS dwell (campaign INTEGER NOT NULL REFERENCES campaign(id),
    run INTEGER NOT NULL, position INTEGER NOT NULL, samples INTEGER NOT NULL,
    used INTEGER NOT NULL, rejected INTEGER NOT NULL, flagged INTEGER NOT NULL,
    reason TEXT NOT NULL, checkpoint BLOB NOT NULL, PRIMARY KEY (campaign, run, position));
CREATE TABLE IF NOT EXISTS event (id INTEGER PRIMARY KEY, utc_ns INTEGER NOT NULL,
    time_ns INTEGER NOT NULL, severity TEXT NOT NULL, source TEXT NOT NULL, text TEXT NOT NULL);
CREATE TABLE IF NOT EXISTS command (id INTEGER PRIMARY KEY, utc_ns INTEGER NOT NULL,
    kind TEXT NOT NULL, person TEXT NOT NULL, argument TEXT NOT NULL, accepted INTEGER NOT NULL,
    answer TEXT NOT NULL);
CREATE TABLE IF NOT EXISTS loop_check (id INTEGER PRIMARY KEY, utc_ns INTEGER NOT NULL,
    person TEXT NOT NULL, out_of_band TEXT NOT NULL);
CREATE TABLE IF NOT EXISTS safety (id INTEGER PRIMARY KEY, utc_ns INTEGER NOT NULL,
    what TEXT NOT NULL, name TEXT NOT NULL, person TEXT NOT NULL, text TEXT NOT NULL,
    two_persons INTEGER NOT NULL);
CREATE TABLE IF NOT EXISTS origin (id INTEGER PRIMARY KEY, utc_ns INTEGER NOT NULL,
    text TEXT NOT NULL);
)";

std::int64_t utc_now() {
    return std::chrono::duration_cast<std::chrono::nanoseconds>(
               std::chrono::system_clock::now().time_since_epoch())
        .count();
}

}  // namespace

ChainedFile::Identity ChainedFile::identity_of(const std::string& path) {
    struct stat found {};
    if (::stat(path.c_str(), &found) != 0) return {};
    return {found.st_dev, found.st_ino, found.st_size};
}

ChainedFile::ChainedFile(std::string path, Pace pace, const Salvage& salvage)
    : path_(std::move(path)), pace_(pace) {
    auto found = open(false);
    if (found.empty()) return;
    try {
        if (database_ && salvage) salvage(*database_);
    } catch (const DatabaseError&) {  // nothing to be had from it
    }
    replace(std::move(found));
}

Database& ChainedFile::database() {
    if (!database_) throw DatabaseError(path_ + ": is not open", 0);
    return *database_;
}

void ChainedFile::replace(std::vector<std::string> found) {
    if (!found.empty()) found_ = std::move(found);
    database_.reset();
    put_aside();
    // What goes wrong now is the disk's fault, and tried again.
    static_cast<void>(open(true));
}

void ChainedFile::put_aside() {
    aside_ = fmt::format("{}.changed.{}", path_, utc_now() / 1'000'000);
    std::error_code none;
    for (const char* part : {"", "-wal", "-shm", kHeadSuffix})
        std::filesystem::rename(path_ + part, aside_ + part, none);
    if (!key_) std::filesystem::rename(path_ + kKeySuffix, aside_ + kKeySuffix, none);
}

std::vector<std::string> ChainedFile::open(bool anew) {
    std::vector<std::string> found;
    const FoundHead beside = anew ? FoundHead{} : read_head(path_ + kHeadSuffix);
    if (!beside.wrong.empty()) found.push_back(beside.wrong);
    const bool had_entries = beside.head && beside.head->link.entry > 0;
    const Identity file = identity_of(path_);
    if (had_entries && file.size <= 0) {
        found.push_back(fmt::format("{}: {}, with {} entries", path_,
                                    file.size < 0 ? "is gone" : "has length zero",
                                    beside.head->link.entry));
        take_key(found);
        return found;
    }
    try {
        database_ = std::make_unique<Database>(path_);
        const auto version = database_->ask("PRAGMA user_version").at(0).numbers.at(0);
        if (version > kVersion) {
            found.push_back(
                fmt::format("{}: found version {}, newer than {}", path_, version, kVersion));
        } else if (version < kVersion && had_entries) {
            found.push_back(fmt::format("{}: found version {}, expected {} as its signed head says",
                                        path_, version, kVersion));
        } else if (file.size <= kWholeAtStart) {
            for (const Row& row : database_->ask("PRAGMA integrity_check(1)")) {
                if (row.texts.at(0) != "ok")
                    found.push_back(path_ + ": damaged: " + row.texts.at(0));
            }
        }
        take_key(found);
        if (!found.empty()) return found;
        if (version < kVersion) {
            make(version, anew ? fmt::format("the chain goes on from {}, put aside: {}", aside_,
                                             found_.empty() ? "" : found_.front())
                               : std::string());
        } else {
            chain_ = Chain(Chain::newest(*database_));
            check_start(beside, found);
        }
        note_identity();
    } catch (const DatabaseError& error) {
        if (!error.damaged()) throw;
        found.emplace_back(error.what());
        take_key(found);
    }
    return found;
}

void ChainedFile::take_key(std::vector<std::string>& found) {
    if (key_) return;
    try {
        key_.emplace(path_ + kKeySuffix);
    } catch (const std::runtime_error& error) {
        found.emplace_back(error.what());
    }
}

/// Head and key first: where there are entries, both have been.
void ChainedFile::make(std::int64_t version, const std::string& origin) {
    if (!key_) key_.emplace(path_ + kKeySuffix);
    chain_ = Chain(Link{});
    if (auto why = write_head(path_ + kHeadSuffix, sign_head({}, *key_)); !why.empty())
        throw DatabaseError(why, 0);
    key_->keep();
    database_->execute("BEGIN IMMEDIATE");
    try {
        database_->execute(kSchema);
        Chain::make_table(*database_);
        const std::int64_t rows = chain_.take_over(*database_);
        begins_ = !origin.empty() ? origin
                  : version == 0  ? "the chain begins with the file"
                                  : fmt::format("the chain begins with what version {} had kept "
                                                "without one: {} rows as they were found",
                                                version, rows);
        database_->run("INSERT INTO origin (utc_ns, text) VALUES (?, ?)",
                       {utc_now(), std::string_view(begins_)});
        chain_.append(*database_, "origin", database_->last_id());
        database_->execute(fmt::format("PRAGMA user_version = {}", kVersion).c_str());
        commit();
    } catch (const DatabaseError&) {
        chain_ = Chain(Link{});
        database_.reset();  // which rolls back
        throw;
    }
    if (version == 0 && origin.empty()) begins_.clear();
}

void ChainedFile::check_start(const FoundHead& beside, std::vector<std::string>& found) {
    if (key_->made()) {
        found.push_back(path_ + kKeySuffix + ": the key is gone");
    } else if (!beside.head) {
        found.push_back(path_ + kHeadSuffix + ": the signed head is gone");
    } else if (beside.head->public_key != key_->public_key()) {
        found.push_back(path_ + kHeadSuffix + ": is signed with another key");
    } else if (auto why = Verification::compare(*database_, beside.head->link, "the signed head");
               !why.empty()) {
        found.push_back(path_ + ": " + why);
    }
    Link from;
    if (const std::int64_t first = chain_.last().entry - kEntriesAtStart; first > 0) {
        const auto row = database_->ask("SELECT hash FROM chain WHERE entry = ?", {first});
        if (!row.empty()) from = {first, row.front().texts[0]};
    }
    Verification newest(from);
    newest.step(*database_, kEntriesAtStart + 1, kBytesAtStart);
    for (const std::string& what : newest.found()) found.push_back(path_ + ": " + what);
    if (!found.empty() && key_->made()) key_->keep();
}

void ChainedFile::begin() {
    database().execute("BEGIN IMMEDIATE");
    before_ = chain_.last();
}

void ChainedFile::commit() {
    database().execute("COMMIT");
    static_cast<void>(write_head(path_ + kHeadSuffix, sign_head(chain_.last(), *key_)));
}

void ChainedFile::roll_back() noexcept {
    chain_.rewind(before_);
    try {
        if (database_) database_->execute("ROLLBACK");
    } catch (const DatabaseError&) {  // SQLite has rolled back by itself
    }
}

void ChainedFile::note_identity() {
    file_ = identity_of(path_);
    log_ = identity_of(path_ + "-wal");
    data_version_ = database_->ask("PRAGMA data_version").at(0).numbers.at(0);
    verified_ = false;
    pass_.emplace();
    next_slice_ns_ = 0;
}

std::string ChainedFile::gone() const {
    const auto compare = [](const std::string& path, const Identity& was, const Identity& now) {
        if (was.size < 0) return std::string();
        if (now.size < 0) return path + ": was deleted while the daemon ran";
        if (now.node != was.node || now.device != was.device)
            return path + ": was replaced by another file while the daemon ran";
        return std::string();
    };
    const Identity file = identity_of(path_);
    if (auto why = compare(path_, file_, file); !why.empty()) return why;
    if (file.size < file_.size)
        return fmt::format("{}: was cut from {} to {} bytes while the daemon ran", path_,
                           file_.size, file.size);
    return compare(path_ + "-wal", log_, identity_of(path_ + "-wal"));
}

std::vector<std::string> ChainedFile::look(std::int64_t now_ns) {
    if (!database_) return {};
    if (auto why = gone(); !why.empty()) return {why};
    file_.size = identity_of(path_).size;
    if (log_.size < 0) log_ = identity_of(path_ + "-wal");
    const auto version = database_->ask("PRAGMA data_version").at(0).numbers.at(0);
    if (version != data_version_) {  // another program has written
        data_version_ = version;
        verified_ = false;
        pass_.emplace();
        next_slice_ns_ = 0;
    }
    if (now_ns < next_slice_ns_) return {};
    // By a connection of its own: what this one has in memory proves nothing.
    Database reader(path_, Database::Mode::read);
    std::vector<std::string> found;
    if (auto why = Verification::compare(reader, chain_.last(), "the daemon"); !why.empty())
        found.push_back(std::move(why));
    if (!pass_) pass_.emplace();
    pass_->step(reader, pace_.entries, pace_.bytes);
    found.insert(found.end(), pass_->found().begin(), pass_->found().end());
    for (std::string& what : found) what = path_ + ": " + what;
    if (pass_->done()) {
        verified_ = true;
        pass_.reset();
    }
    if (verified_) next_slice_ns_ = now_ns + pace_.period_ns;
    return found;
}

}  // namespace vibrig::journal
