#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace vibrig::record::hdf5 {

/// "file: object: what HDF5 says".
class Error : public std::runtime_error {
  public:
    using std::runtime_error::runtime_error;
};

/// An identifier of the library with the call that gives it back.
class Handle {
  public:
    using Close = int (*)(std::int64_t);
    Handle() = default;
    Handle(std::int64_t id, Close close) noexcept : id_(id), close_(close) {}
    Handle(Handle&& other) noexcept : id_(other.id_), close_(other.close_) { other.id_ = -1; }
    Handle& operator=(Handle&& other) noexcept;
    ~Handle() { reset(); }
    [[nodiscard]] std::int64_t get() const noexcept { return id_; }
    /// False: the library could not write what it still held.
    bool reset() noexcept;

  private:
    std::int64_t id_ = -1;
    Close close_ = nullptr;
};

/// In a column of i64: a row that never reached the disk.
inline constexpr std::int64_t kUnwritten = std::numeric_limits<std::int64_t>::min();

enum class Type : std::uint8_t { f64, i64, u64, i32, u32, u8, text };

/// Values of one array, row by row.
template <typename T>
struct Array {
    std::vector<std::size_t> dimensions;
    std::vector<T> values;
};

/// Names of the numbers in a row of a column that has one for each of something: its attribute
/// `names`.
struct Names {
    std::vector<std::string> now;
    std::vector<std::string> unnamed;  ///< the first of these, where the file does not say
};

/// One file; one thread at a time. Everything throws Error.
class File {
  public:
    enum class Mode : std::uint8_t {
        read,   ///< of one that is being written too
        write,  ///< one that is closed
        mend,   ///< one that its writer left open
    };
    [[nodiscard]] static File create(const std::string& path);
    [[nodiscard]] static File open(const std::string& path, Mode mode);

    /// From now on readers find it at `path` and may read; nothing but rows is added.
    void start_swmr(const std::string& path);
    void flush();
    void close();

    void make_group(const std::string& name);
    /// A link is no part of a recording: throws.
    [[nodiscard]] bool has(const std::string& name) const;
    void set(const std::string& object, const char* attribute, std::string_view text);
    void set(const std::string& object, const char* attribute, std::int64_t number);
    [[nodiscard]] std::string text(const std::string& object, const char* attribute) const;
    [[nodiscard]] std::int64_t number(const std::string& object, const char* attribute) const;

    /// A text of any length as a dataset of its own; an old one is replaced.
    void write_text(const std::string& name, std::string_view text, std::string_view description);
    [[nodiscard]] std::string read_text(const std::string& name) const;
    void write_numbers(const std::string& name, std::span<const double> values,
                       const std::vector<std::size_t>& dimensions, std::string_view unit,
                       std::string_view description);

    [[nodiscard]] Array<double> doubles(const std::string& name) const;
    [[nodiscard]] Array<std::int64_t> integers(const std::string& name) const;
    [[nodiscard]] std::vector<std::string> texts(const std::string& name) const;
    [[nodiscard]] std::vector<std::size_t> dimensions(const std::string& name) const;
    /// The place in `names.now` of each number in a row of such a column. An older file may have
    /// fewer; one with others is refused.
    [[nodiscard]] std::vector<std::size_t> places(const std::string& name,
                                                  const Names& names) const;

    [[nodiscard]] std::int64_t id() const noexcept { return file_.get(); }
    [[nodiscard]] const std::string& path() const noexcept { return path_; }
    [[nodiscard]] Handle open_set(const std::string& name) const;
    [[noreturn]] void fail(const std::string& object) const;

  private:
    /// Of the values that it says it has.
    [[nodiscard]] std::size_t values_in(const Handle& set, const std::string& name) const;
    void attribute(const std::string& object, const char* name, std::int64_t type,
                   const void* value);
    void write_set(const std::string& name, const Handle& space, std::int64_t type,
                   const void* values);
    template <typename T>
    Array<T> read(const std::string& name, std::int64_t type) const;

    std::string path_;
    Handle file_;
};

/// What a column holds.
struct ColumnSpec {
    const char* name;
    Type type;
    std::size_t text_bytes;          ///< of a text
    std::vector<std::size_t> shape;  ///< of one row of numbers; empty: one
    const char* unit;                ///< empty: none
    const char* description;
    bool newer = false;            ///< older files have none
    const Names* names = nullptr;  ///< of the numbers in a row; null: none
};

/// A group of columns that grow together, row by row. Rows are kept until commit(). Of a file that
/// is older than the columns, the ones that it has, as it has them.
class Table {
  public:
    Table(File& file, std::string group, std::vector<ColumnSpec> columns, std::size_t chunk_rows,
          const char* description);
    /// Goes on with the one that is there.
    Table(File& file, std::string group, std::vector<ColumnSpec> columns);

    /// Cells of a row in the order of the columns.
    void put(const void* cell, std::size_t bytes);
    void put(std::string_view text);
    void commit();
    /// Forgets the rows behind the first `rows`, which every column has.
    void keep(std::size_t rows);
    [[nodiscard]] std::size_t waiting() const noexcept { return waiting_; }

  private:
    struct Column {
        std::size_t bytes = 0;  ///< of one row
        std::vector<unsigned char> buffer;
        ColumnSpec spec;
        std::string name;  ///< in the file
        Handle dataset, type;
        std::vector<std::size_t> places;  ///< in a cell, of a row's numbers; empty: as they are
    };
    /// With no dataset yet.
    Column& add(ColumnSpec spec);

    File* file_;
    std::string group_;
    std::vector<Column> columns_;
    std::size_t next_ = 0;  ///< column of the next cell
    std::size_t waiting_ = 0, rows_ = 0;
};

}  // namespace vibrig::record::hdf5
