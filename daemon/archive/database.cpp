#include "daemon/archive/database.hpp"

#include <soci/soci.h>
#include <soci/sqlite3/soci-sqlite3.h>
#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <filesystem>
#include <mutex>

#include "daemon/archive/entry.hpp"
#include "daemon/archive/schema.hpp"

namespace vibrig::archive {

namespace {

// Longer than a rig's recorder or another delivery takes for a change.
constexpr int kBusy_s = 10;
// A server that does not answer is as good as none; the delivery comes again.
constexpr const char* kServerPatience = "connect_timeout=5&tcp_user_timeout=10000";
constexpr const char* kPlugin = "libsoci_postgresql.so.4.0";

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
    : name_(shown(where)), server_(is_server(where)) {
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
        if (mode == Mode::read)
            throw ArchiveError(
                fmt::format("found an index of version {}, expected {}: whoever may "
                            "write it brings it there by `vibrig archive add`",
                            found, newest_version()));
        migrate();
    });
}

Database::~Database() = default;

void Database::connect(const std::string& where, Mode mode) {
    if (server_) {
        static std::once_flag once;
        std::call_once(once,
                       [] { soci::dynamic_backends::register_backend("postgresql", kPlugin); });
        session_ = std::make_unique<soci::session>(
            "postgresql",
            where + (where.find('?') == std::string::npos ? "?" : "&") + kServerPatience);
        *session_ << "SET client_min_messages = warning";
        *session_ << "SET statement_timeout = '60s'";
        if (mode == Mode::read) *session_ << "SET default_transaction_read_only = on";
        return;
    }
    if (mode == Mode::read && !std::filesystem::exists(where))
        throw ArchiveError("found no such file, expected an index");
    session_ = std::make_unique<soci::session>(
        soci::sqlite3, fmt::format("db=\"{}\" timeout={} synchronous=FULL{}", where, kBusy_s,
                                   mode == Mode::read ? " readonly=true" : ""));
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
        throw ArchiveError(words.starts_with(name_) ? words : name_ + ": " + words);
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
