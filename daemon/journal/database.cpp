#include "daemon/journal/database.hpp"

#include <fmt/format.h>
#include <sqlite3.h>

#include <algorithm>
#include <cstring>
#include <filesystem>

namespace vibrig::journal {

namespace {
constexpr int kBusyTimeout_ms = 2000;  // a person may be reading the file

/// As a URI: nothing in a path may look like a query.
std::string uri_of(const std::string& path) {
    std::string uri = "file:";
    for (const char c : path) {
        if (c == '%' || c == '?' || c == '#') {
            constexpr const char* kDigits = "0123456789abcdef";
            uri += {'%', kDigits[c >> 4], kDigits[c & 0xf]};
        } else {
            uri += c;
        }
    }
    return uri;
}

template <typename Number>
void append_bytes(std::string& bytes, Number number) {
    char raw[sizeof number];
    std::memcpy(raw, &number, sizeof number);
    bytes.append(raw, sizeof number);
}
}  // namespace

bool DatabaseError::damaged() const noexcept {
    const int primary = code_ & 0xff;
    // SQLITE_ERROR: a table or a column is not there.
    return primary == SQLITE_CORRUPT || primary == SQLITE_NOTADB || primary == SQLITE_ERROR;
}

void Database::Close::operator()(sqlite3* database) const noexcept { sqlite3_close_v2(database); }
void Database::Finalize::operator()(sqlite3_stmt* statement) const noexcept {
    sqlite3_finalize(statement);
}

Database::Database(const std::string& path, Mode mode) : path_(path) {
    sqlite3* opened = nullptr;
    std::error_code none;
    // Without a log beside it nobody writes, and what only reads should make none.
    const bool alone = mode == Mode::read && !std::filesystem::exists(path + "-wal", none);
    const std::string uri = uri_of(path) + (alone ? "?immutable=1" : "");
    const int result =
        sqlite3_open_v2(uri.c_str(), &opened,
                        SQLITE_OPEN_URI | SQLITE_OPEN_EXRESCODE |
                            (mode == Mode::read ? SQLITE_OPEN_READONLY
                                                : SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE),
                        nullptr);
    database_.reset(opened);
    if (result != SQLITE_OK) fail("open");
    sqlite3_busy_timeout(opened, kBusyTimeout_ms);
    // What is written is seldom read again, what is read is read once: of 2 MB, the usual, a daemon
    // would fill each byte in its first night, and each look at the whole journal would take them.
    execute("PRAGMA cache_size = -256");
    if (mode == Mode::read) return;
    execute("PRAGMA journal_mode = WAL");
    execute("PRAGMA synchronous = FULL");
    execute("PRAGMA foreign_keys = ON");
}

Database::~Database() = default;

void refuse_foreign(const std::string& path, const std::vector<std::string>& tables) {
    std::error_code none;
    if (!std::filesystem::exists(path, none)) return;
    std::vector<Row> names;
    try {
        names = Database(path, Database::Mode::read)
                    .ask("SELECT name FROM sqlite_master WHERE type = 'table'");
    } catch (const DatabaseError&) {
        return;
    }
    const auto is_ours = [&](const Row& row) {
        return std::ranges::find(tables, row.texts.at(0)) != tables.end();
    };
    if (!names.empty() && std::ranges::none_of(names, is_ours))
        throw DatabaseError(
            fmt::format("{}: found a database without a table {} (its first is {}), expected "
                        "another file: this one is somebody else's and was not changed",
                        path, fmt::join(tables, " or "), names.front().texts.at(0)),
            0);
}

void Database::fail(const char* doing) const {
    const int code = database_ ? sqlite3_extended_errcode(database_.get()) : SQLITE_NOMEM;
    // Whatever was to be done with it: who has to look at the file is helped by its state.
    const int primary = code & 0xff;
    if (primary == SQLITE_CORRUPT || primary == SQLITE_NOTADB)
        throw DatabaseError(
            fmt::format("{}: is damaged: {} (SQLite: {})", path_,
                        primary == SQLITE_NOTADB ? "it does not begin as an SQLite file does"
                                                 : "a part of it is missing or was overwritten",
                        sqlite3_errmsg(database_.get())),
            code);
    throw DatabaseError(path_ + ": cannot " + doing + ": " +
                            (database_ ? sqlite3_errmsg(database_.get()) : "out of memory"),
                        code);
}

void Database::execute(const char* sql) {
    if (sqlite3_exec(database_.get(), sql, nullptr, nullptr, nullptr) != SQLITE_OK) fail("write");
}

Database::Statement Database::prepare(const char* sql, const std::vector<Value>& values) {
    sqlite3_stmt* prepared = nullptr;
    if (sqlite3_prepare_v2(database_.get(), sql, -1, &prepared, nullptr) != SQLITE_OK)
        fail("prepare");
    Statement statement(prepared);
    int index = 0;
    for (const Value& value : values) {
        ++index;
        int result = SQLITE_OK;
        if (const auto* number = std::get_if<std::int64_t>(&value)) {
            result = sqlite3_bind_int64(prepared, index, *number);
        } else if (const auto* text = std::get_if<std::string_view>(&value)) {
            result = sqlite3_bind_text64(prepared, index, text->data(), text->size(),
                                         SQLITE_TRANSIENT, SQLITE_UTF8);
        } else {
            const auto& blob = std::get<Blob>(value).bytes;
            result =
                sqlite3_bind_blob64(prepared, index, blob.data(), blob.size(), SQLITE_TRANSIENT);
        }
        if (result != SQLITE_OK) fail("bind");
    }
    return statement;
}

void Database::run(const char* sql, const std::vector<Value>& values) {
    const Statement statement = prepare(sql, values);
    if (sqlite3_step(statement.get()) != SQLITE_DONE) fail("write");
}

std::vector<Row> Database::ask(const char* sql, const std::vector<Value>& values) {
    const Statement statement = prepare(sql, values);
    std::vector<Row> rows;
    for (;;) {
        const int result = sqlite3_step(statement.get());
        if (result == SQLITE_DONE) return rows;
        if (result != SQLITE_ROW) fail("read");
        Row& row = rows.emplace_back();
        for (int i = 0; i < sqlite3_column_count(statement.get()); ++i) {
            const bool number = sqlite3_column_type(statement.get(), i) == SQLITE_INTEGER;
            row.numbers.push_back(number ? sqlite3_column_int64(statement.get(), i) : 0);
            std::string& text = row.texts.emplace_back();
            if (number) continue;
            if (const void* bytes = sqlite3_column_blob(statement.get(), i)) {
                text.assign(static_cast<const char*>(bytes),
                            static_cast<std::size_t>(sqlite3_column_bytes(statement.get(), i)));
            }
        }
    }
}

std::vector<std::string> Database::damage(int at_most) {
    std::vector<std::string> found;
    for (const Row& row : ask(fmt::format("PRAGMA integrity_check({})", at_most).c_str())) {
        std::string text = row.texts.at(0);
        if (text == "ok") continue;
        // "*** in database main ***" stands in a line of its own before the first.
        if (text.starts_with("***")) text.erase(0, text.find('\n') + 1);
        std::ranges::replace(text, '\n', ';');
        found.push_back("is damaged: " + text);
    }
    return found;
}

std::string Database::row_bytes(const std::string& table, std::int64_t row) {
    const std::string sql = "SELECT * FROM " + table + " WHERE rowid = ?";
    const Statement statement = prepare(sql.c_str(), {row});
    const int result = sqlite3_step(statement.get());
    if (result == SQLITE_DONE) return {};
    if (result != SQLITE_ROW) fail("read");
    std::string bytes;
    for (int i = 0; i < sqlite3_column_count(statement.get()); ++i) {
        const int type = sqlite3_column_type(statement.get(), i);
        bytes += static_cast<char>(type);
        if (type == SQLITE_INTEGER) {
            append_bytes(bytes, std::int64_t{sqlite3_column_int64(statement.get(), i)});
        } else if (type == SQLITE_FLOAT) {
            append_bytes(bytes, sqlite3_column_double(statement.get(), i));
        } else if (type != SQLITE_NULL) {
            const void* const column = sqlite3_column_blob(statement.get(), i);
            const auto size = static_cast<std::size_t>(sqlite3_column_bytes(statement.get(), i));
            append_bytes(bytes, std::uint64_t{size});
            if (size > 0) bytes.append(static_cast<const char*>(column), size);
        }
    }
    return bytes;
}

void Database::end_when(const std::atomic<bool>& stop) {
    constexpr int kSteps = 10'000;  // of SQLite's machine, some 0.1 ms
    sqlite3_progress_handler(
        database_.get(), kSteps,
        [](void* flag) { return static_cast<const std::atomic<bool>*>(flag)->load() ? 1 : 0; },
        const_cast<std::atomic<bool>*>(&stop));
}

Snapshot::~Snapshot() {
    try {
        database_.execute("COMMIT");
    } catch (const DatabaseError&) {  // it has ended by itself
    }
}

std::int64_t Database::last_id() const noexcept {
    return sqlite3_last_insert_rowid(database_.get());
}

}  // namespace vibrig::journal
