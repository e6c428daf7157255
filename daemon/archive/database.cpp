#include "daemon/archive/database.hpp"

#include <soci/soci.h>
#include <soci/sqlite3/soci-sqlite3.h>
#include <spdlog/fmt/fmt.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <utility>

#include "daemon/archive/entry.hpp"
#include "daemon/archive/schema.hpp"

namespace vibrig::archive {

namespace fs = std::filesystem;

namespace {

// Longer than a rig's recorder or another delivery takes for a change.
constexpr int kBusy_s = 10;
// A server that does not answer is as good as none; the delivery comes again.
constexpr const char* kServerPatience = "connect_timeout=5&tcp_user_timeout=10000";
constexpr const char* kPlugin = "libsoci_postgresql.so.4.0";
constexpr int kCopyLooks = 5;

/// SQLite's own handle of a session.
sqlite_api::sqlite3*& handle_in(soci::session& session) {
    return static_cast<soci::sqlite3_session_backend*>(session.get_backend())->conn_;
}

std::unique_ptr<soci::session> empty_session() {
    return std::make_unique<soci::session>(soci::sqlite3, "db=:memory:");
}

/// A session that may only read. `alone`: nobody writes the file, and what SQLite would want beside
/// it is not looked for. SOCI itself opens no such file.
std::unique_ptr<soci::session> reading_session(const std::string& path, bool alone) {
    // With an authority, or "//lab" would be one.
    std::string uri = path.starts_with('/') ? "file://" : "file:";
    for (const char c : path)
        uri += c == '%' || c == '?' || c == '#' ? fmt::format("%{:02x}", c) : std::string(1, c);
    if (alone) uri += "?immutable=1";
    auto session = empty_session();
    sqlite_api::sqlite3* opened = nullptr;
    const int result = sqlite_api::sqlite3_open_v2(uri.c_str(), &opened,
                                                   SQLITE_OPEN_READONLY | SQLITE_OPEN_URI, nullptr);
    sqlite_api::sqlite3_close(std::exchange(handle_in(*session), opened));
    if (result != SQLITE_OK) throw ArchiveError(sqlite_api::sqlite3_errmsg(opened));
    sqlite_api::sqlite3_busy_timeout(opened, 1000 * kBusy_s);
    return session;
}

/// A recorder's file, by its head: changes go to a log beside it first.
bool has_log(const std::string& path) {
    std::array<char, 20> head{};
    std::ifstream(path, std::ios::binary).read(head.data(), head.size());
    return head[18] == 2;
}

/// What tells that somebody wrote the file.
auto state_of(const std::string& path) {
    std::error_code none;
    return std::pair{fs::last_write_time(path, none), fs::file_size(path, none)};
}

}  // namespace

bool is_server(const std::string& where) {
    return where.starts_with("postgresql://") || where.starts_with("postgres://");
}

std::string shown(const std::string& where) {
    if (!is_server(where)) return where;
    const std::size_t begin = where.find("//") + 2, at = where.find('@', begin);
    const std::size_t colon = where.find(':', begin);
    if (at == std::string::npos || colon > at) return where;
    return where.substr(0, colon) + ":..." + where.substr(at);
}

Database::Database(const std::string& where, Mode mode)
    : name_(shown(where)), server_(is_server(where)), mode_(mode) {
    guarded([&] {
        connect(where, mode);
        const int found = version();
        if (found > newest_version())
            throw ArchiveError(
                fmt::format("found an index of version {}, expected {} at most: it "
                            "was written by a newer vibrig",
                            found, newest_version()));
        if (found == newest_version()) return;
        if (found == 0 && !server_) refuse_foreign();
        if (mode == Mode::read && server_)
            throw ArchiveError(
                fmt::format("found an index of version {}, expected {}: whoever may "
                            "write it brings it there by `vibrig archive add`",
                            found, newest_version()));
        // As a recorder left it: whoever may only read it need not wait for somebody who may not.
        if (mode == Mode::read) copy_into_memory();
        migrate();
    });
}

Database::~Database() = default;

void Database::connect_server(const std::string& where, Mode mode) {
    static std::once_flag once;
    std::call_once(once, [] { soci::dynamic_backends::register_backend("postgresql", kPlugin); });
    session_ = std::make_unique<soci::session>(
        "postgresql", where + (where.find('?') == std::string::npos ? "?" : "&") + kServerPatience);
    *session_ << "SET client_min_messages = warning";
    *session_ << "SET statement_timeout = '60s'";
    if (mode == Mode::read) *session_ << "SET default_transaction_read_only = on";
}

void Database::connect(const std::string& where, Mode mode) {
    if (server_) {
        connect_server(where, mode);
    } else if (mode == Mode::write) {
        connect_file(where);
    } else {
        read_file(where, mode);
    }
}

void Database::connect_file(const std::string& where) {
    session_ = std::make_unique<soci::session>(soci::sqlite3,
                                               fmt::format("db=\"{}\" timeout={}", where, kBusy_s));
    // Only now: SOCI would ask for it before it is patient.
    *session_ << "PRAGMA synchronous = FULL";
}

void Database::read_file(const std::string& where, Mode mode) {
    std::error_code error;
    const auto size = fs::file_size(where, error);
    if (error == std::errc::no_such_file_or_directory)
        throw ArchiveError("found no such file, expected an index");
    if (error) throw ArchiveError("cannot be looked at: " + error.message());
    if (size == 0) throw ArchiveError("found an empty file, expected an index; " + remedy());
    // Of a writer that was killed: whoever may, takes back what it began.
    if (fs::exists(where + "-journal", error) && may_write(where)) {
        connect_file(where);
        static_cast<void>(version());
    }
    for (int look = 0; look < kCopyLooks && has_log(where); ++look) {
        // A log is there while a recorder has the file, and after one that was killed.
        if (fs::exists(where + "-wal", error)) break;
        // Without it SQLite wants to make one, in a folder that is somebody else's. It reads
        // without, a file that does not change: so all of it now, before a recorder begins.
        const auto before = state_of(where);
        session_ = reading_session(where, true);
        copy_into_memory();
        if (state_of(where) == before && !fs::exists(where + "-wal", error)) return;
    }
    session_ = reading_session(where, false);
    if (mode == Mode::copy) copy_into_memory();
}

void Database::copy_into_memory() {
    auto copy = empty_session();
    auto* const from = handle_in(*session_);
    auto* const to = handle_in(*copy);
    auto* const backup = sqlite_api::sqlite3_backup_init(to, "main", from, "main");
    if (backup == nullptr) throw ArchiveError(sqlite_api::sqlite3_errmsg(to));
    static_cast<void>(sqlite_api::sqlite3_backup_step(backup, -1));
    if (sqlite_api::sqlite3_backup_finish(backup) != SQLITE_OK)
        throw ArchiveError(sqlite_api::sqlite3_errmsg(to));
    session_ = std::move(copy);
}

int Database::version() {
    int there = 0;
    if (server_) {
        *session_ << "SELECT count(*) FROM information_schema.tables WHERE table_name = "
                     "'index_version' AND table_schema = current_schema()",
            soci::into(there);
    } else {
        *session_ << "SELECT count(*) FROM sqlite_master WHERE name = 'index_version'",
            soci::into(there);
    }
    if (there == 0) return 0;
    int number = 0;
    soci::indicator known = soci::i_null;
    *session_ << "SELECT max(number) FROM index_version", soci::into(number, known);
    return known == soci::i_ok ? number : 0;
}

void Database::refuse_foreign() {
    int tables = 0, ours = 0;
    *session_ << "SELECT count(*), count(CASE WHEN name IN ('file', 'index_version') THEN 1 END) "
                 "FROM sqlite_master "
                 "WHERE type = 'table'",
        soci::into(tables), soci::into(ours);
    if (tables > 0 && ours == 0)
        throw ArchiveError(
            "found a database that is no index, expected one of recordings: it is somebody else's "
            "and was not changed");
}

void Database::migrate() {
    Change change(*session_);
    // Of those who come at once the first does it.
    if (server_) *session_ << "SELECT pg_advisory_xact_lock(7462147)";
    const int from = version();
    if (from == 0)
        *session_ << "CREATE TABLE IF NOT EXISTS index_version (number INTEGER PRIMARY KEY)";
    for (int to = from + 1; to <= newest_version(); ++to) {
        for (const auto& statement : migrations()[static_cast<std::size_t>(to) - 1])
            *session_ << statement;
        *session_ << "INSERT INTO index_version VALUES (:number)", soci::use(to);
    }
    change.commit();
}

bool may_write(const std::string& path) {
    const std::string folder = fs::path(path).parent_path().string();
    return ::access(path.c_str(), W_OK) == 0 &&
           ::access(folder.empty() ? "." : folder.c_str(), W_OK) == 0;
}

std::string Database::folder() const {
    const std::string folder = fs::path(name_).parent_path().string();
    return folder.empty() ? "." : folder;
}

std::string Database::remedy() const {
    return fmt::format("move it away, then `vibrig archive add {0} --archive {0}` makes it anew",
                       folder());
}

std::string Database::explained(std::string words) const {
    // What SOCI says before SQLite's own words.
    if (words.starts_with("sqlite3_statement_backend::"))
        if (const auto at = words.find(": "); at != std::string::npos) words.erase(0, at + 2);
    const auto says = [&](const char* text) { return words.find(text) != std::string::npos; };
    const char* const damage = says("file is not a database")
                                   ? "it does not begin as an SQLite file does"
                               : says("malformed") ? "a part of it is missing or was overwritten"
                                                   : nullptr;
    if (damage != nullptr)
        return fmt::format("is damaged: {} (SQLite: {}); {}", damage, words, remedy());
    std::error_code none;
    for (const char* end : {"-journal", "-wal"})
        if ((says("readonly database") || says("unable to open")) &&
            fs::exists(name_ + end, none) && ::access(name_.c_str(), R_OK) == 0)
            return fmt::format(
                "found {}{} beside it, of a program that was killed (SQLite: {}): whoever may "
                "write there mends it by `vibrig list --archive {}`",
                fs::path(name_).filename().string(), end, words, folder());
    return words;
}

void Database::rethrow() const {
    try {
        throw;
    } catch (const std::exception& error) {
        std::string words = error.what();
        while (!words.empty() && (words.back() == '\n' || words.back() == '.')) words.pop_back();
        // libpq's words come on several lines.
        std::ranges::replace(words, '\n', ' ');
        std::erase(words, '\t');
        if (words.find(kPlugin) != std::string::npos)
            words += "; the package libsoci-postgresql4.0 brings it";
        // SOCI adds the statement, which says nothing to whoever reads it.
        if (const auto at = words.find(" while "); at != std::string::npos) words.resize(at);
        if (words.starts_with(name_)) throw ArchiveError(words);
        throw ArchiveError(name_ + ": " + (server_ ? words : explained(words)));
    }
}

Change::Change(soci::session& sql) : sql_(sql) {
    // SQLite: whoever begins to write only later may find that another was faster.
    sql_ << (sql_.get_backend_name() == "sqlite3" ? "BEGIN IMMEDIATE" : "BEGIN");
}

Change::~Change() {
    if (!open_) return;
    try {
        sql_ << "ROLLBACK";
    } catch (const std::exception&) {  // the connection is gone, and the change with it
    }
}

void Change::commit() {
    sql_ << "COMMIT";
    open_ = false;
}

}  // namespace vibrig::archive
