#pragma once

#include <array>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace vibrig::study {

/// SHA-256 of study.json: what belongs to one study and to no other.
using StudyId = std::array<unsigned char, 32>;
[[nodiscard]] StudyId id_of(std::string_view hexadecimal);

/// A range of tasks that one process works on, [begin, end). Shards count from 0.
struct Shard {
    std::uint64_t number = 0, of = 1;

    [[nodiscard]] std::uint64_t begin(std::uint64_t tasks) const { return tasks * number / of; }
    [[nodiscard]] std::uint64_t end(std::uint64_t tasks) const { return tasks * (number + 1) / of; }
};

struct TaskRecord {
    std::uint64_t index = 0;
    std::string bytes;
};

/// A file of records, "17of64-HOST-PID-0.part"; ".part.tmp" while its process writes it, or after
/// that was killed.
struct PartName {
    std::string file;  ///< without the folder
    Shard shard;
    std::string host;
    long pid = 0;
    bool closed = true;

    /// True for an open one whose process was one of this machine and is no more.
    [[nodiscard]] bool abandoned() const;
};
/// Parts in `folder`, by name. `others`: what is there and is none.
[[nodiscard]] std::vector<PartName> parts_in(const std::string& folder,
                                             std::vector<std::string>* others = nullptr);

/// Appends records in the order of their index to a file that no other process has. Throws
/// StudyError.
class PartWriter {
  public:
    PartWriter(std::string folder, const StudyId& id, Shard shard);
    ~PartWriter();
    PartWriter(const PartWriter&) = delete;
    PartWriter& operator=(const PartWriter&) = delete;

    /// On the disk when it returns.
    void append(const std::vector<TaskRecord>& records);
    /// It gets its final name. Nothing was appended: there is no file.
    void close();
    [[nodiscard]] const std::string& path() const { return path_; }  ///< empty: none yet

  private:
    void open();
    void write(std::string_view bytes);
    [[noreturn]] void fail(const char* what);

    std::string folder_;
    StudyId id_;
    Shard shard_;
    std::string path_;
    int file_ = -1;
};

/// Record by record; what is damaged ends it. A part that got its final name since is the same.
class PartReader {
  public:
    enum class End : unsigned char { none, whole, torn, damaged, foreign, unreadable };

    PartReader(const std::string& path, const StudyId& id, std::uint64_t tasks);

    /// False at the end; why() says what kind of end it is.
    bool next(TaskRecord& record);
    [[nodiscard]] End end() const { return end_; }
    /// For people: "torn after 12 records, at byte 9312"; empty: whole.
    [[nodiscard]] const std::string& why() const { return why_; }
    [[nodiscard]] std::uint64_t records() const { return records_; }

  private:
    struct Close {
        void operator()(std::FILE* file) const { std::fclose(file); }
    };
    bool finish(End end, const std::string& why);
    void read_head(const StudyId& id);

    std::unique_ptr<std::FILE, Close> file_;
    std::uint64_t tasks_, records_ = 0, at_ = 0;
    std::optional<std::uint64_t> last_;
    End end_ = End::none;
    std::string why_;
};

/// Which tasks of a shard are done, from the parts that may hold them.
struct Done {
    std::vector<bool> tasks;  ///< from the shard's first on
    std::uint64_t count = 0, failed = 0;
    std::vector<std::string> damaged;  ///< one line each
};
[[nodiscard]] Done done_in(const std::string& folder, const StudyId& id, std::uint64_t tasks,
                           Shard shard);

}  // namespace vibrig::study
