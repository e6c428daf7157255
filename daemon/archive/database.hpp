#pragma once

#include <cstdint>
#include <memory>
#include <string>

namespace soci {
class session;
}

namespace vibrig::archive {

/// An index' database: a SQLite file, or a PostgreSQL server by "postgresql://...". One thread.
class Database {
  public:
    /// read: of a file nothing but the right to read it is needed, and none is made beside it.
    /// copy: of a file, in memory: what is written goes with it.
    enum class Mode : std::uint8_t { write, read, copy };
    /// Brings it to the newest version when it is to be written; to be read, a copy of it. Throws
    /// ArchiveError that names it without a password.
    Database(const std::string& where, Mode mode);
    ~Database();
    Database(const Database&) = delete;
    Database& operator=(const Database&) = delete;

    [[nodiscard]] soci::session& sql() noexcept { return *session_; }
    [[nodiscard]] const std::string& name() const noexcept { return name_; }
    [[nodiscard]] bool writes() const noexcept { return mode_ != Mode::read; }
    /// 0: a file with no tables, or one that has them without a number.
    [[nodiscard]] int version();

    /// What SOCI throws, as an ArchiveError that names the database.
    template <typename Work>
    auto guarded(Work&& work) -> decltype(work()) {
        try {
            return work();
        } catch (...) {
            rethrow();
        }
    }

  private:
    [[noreturn]] void rethrow() const;
    void connect(const std::string& where, Mode mode);
    void connect_server(const std::string& where, Mode mode);
    void connect_file(const std::string& where);
    void read_file(const std::string& where, Mode mode);
    void copy_into_memory();
    void migrate();
    /// A file that has tables and not an index's.
    void refuse_foreign();
    [[nodiscard]] std::string folder() const;
    /// In words, what makes a file anew.
    [[nodiscard]] std::string remedy() const;
    /// SQLite's words of a file, with what they mean and what helps.
    [[nodiscard]] std::string explained(std::string words) const;

    std::string name_;
    bool server_;
    Mode mode_;
    std::unique_ptr<soci::session> session_;
};

/// All of it or nothing; one writer at a time. Rolled back unless commit() was called.
class Change {
  public:
    explicit Change(soci::session& sql);
    ~Change();
    Change(const Change&) = delete;
    Change& operator=(const Change&) = delete;
    void commit();

  private:
    soci::session& sql_;
    bool open_ = true;
};

[[nodiscard]] bool is_server(const std::string& where);
/// An index in a file: SQLite writes beside it, too.
[[nodiscard]] bool may_write(const std::string& path);
/// As it may be shown: without a password.
[[nodiscard]] std::string shown(const std::string& where);

}  // namespace vibrig::archive
