#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <stdexcept>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

struct sqlite3;
struct sqlite3_stmt;

namespace vibrig::journal {

/// What SQLite says, with its extended code.
class DatabaseError : public std::runtime_error {
  public:
    DatabaseError(const std::string& what, int code) : std::runtime_error(what), code_(code) {}
    /// The file is no database or is damaged.
    [[nodiscard]] bool damaged() const noexcept;

  private:
    int code_;
};

struct Blob {
    std::string_view bytes;
};
using Value = std::variant<std::int64_t, std::string_view, Blob>;

/// A row of a question; texts and blobs as strings.
struct Row {
    std::vector<std::int64_t> numbers;  ///< 0 for a text
    std::vector<std::string> texts;     ///< empty for a number
};

/// One SQLite file: WAL, synchronous FULL. One thread at a time. Everything throws DatabaseError.
class Database {
  public:
    /// read: changes nothing, and makes no files beside it.
    enum class Mode : std::uint8_t { write, read };
    explicit Database(const std::string& path, Mode mode = Mode::write);
    ~Database();
    Database(const Database&) = delete;
    Database& operator=(const Database&) = delete;

    void execute(const char* sql);
    void run(const char* sql, const std::vector<Value>& values);
    [[nodiscard]] std::vector<Row> ask(const char* sql, const std::vector<Value>& values = {});
    /// What SQLite's own check of the whole file finds, each in one line; empty: nothing.
    [[nodiscard]] std::vector<std::string> damage(int at_most);
    [[nodiscard]] std::int64_t last_id() const noexcept;
    /// A row as bytes, with the types of its columns; empty: there is no such row.
    [[nodiscard]] std::string row_bytes(const std::string& table, std::int64_t row);
    /// What takes long ends with a DatabaseError once `stop` is true.
    void end_when(const std::atomic<bool>& stop);

  private:
    struct Close {
        void operator()(sqlite3* database) const noexcept;
    };
    struct Finalize {
        void operator()(sqlite3_stmt* statement) const noexcept;
    };
    using Statement = std::unique_ptr<sqlite3_stmt, Finalize>;
    [[nodiscard]] Statement prepare(const char* sql, const std::vector<Value>& values);
    [[noreturn]] void fail(const char* doing) const;

    std::string path_;
    std::unique_ptr<sqlite3, Close> database_;
};

/// Before a file is opened for writing, which changes it: refuses a database that has tables and
/// none of these, as somebody else's. One that is damaged is for who opens it.
void refuse_foreign(const std::string& path, const std::vector<std::string>& tables);

/// A picture of the file that no writer changes, as long as it lives.
class Snapshot {
  public:
    explicit Snapshot(Database& database) : database_(database) { database_.execute("BEGIN"); }
    ~Snapshot();
    Snapshot(const Snapshot&) = delete;
    Snapshot& operator=(const Snapshot&) = delete;

  private:
    Database& database_;
};

}  // namespace vibrig::journal
