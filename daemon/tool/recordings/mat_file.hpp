#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include "proto/durable_file.hpp"

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
    /// Closes the file, reads it back, as its library does not tell of a full disk, and gives it
    /// its name.
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
    proto::OutputFile out_;
    std::unique_ptr<_mat_t, Close> file_;
    std::vector<Added> added_;
};

}  // namespace vibrig::tool
