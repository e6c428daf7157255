#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <vector>

struct _mat_t;
struct matvar_t;

namespace vibrig::tool {

/// A MATLAB file (version 5, compressed), variable by variable. All throw std::runtime_error that
/// names the file.
class MatFile {
  public:
    /// Overwrites a file of that name; refuses what is no file, such as a device.
    explicit MatFile(std::string path);

    /// `rows` of `width` numbers, row by row.
    void add(const std::string& name, const std::vector<double>& values, std::size_t width = 1);
    void add(const std::string& name, std::string text);
    /// Closes the file and reads it back: its library does not tell of a full disk.
    void finish();

  private:
    struct Close {
        void operator()(_mat_t* file) const noexcept;
    };
    struct Added {
        std::string name;
        std::size_t hash;  ///< of its data
    };

    void write(const std::string& name, matvar_t* variable);

    std::string path_;
    std::unique_ptr<_mat_t, Close> file_;
    std::vector<Added> added_;
};

}  // namespace vibrig::tool
