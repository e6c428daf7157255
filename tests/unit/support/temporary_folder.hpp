#pragma once

#include <cstdlib>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <system_error>
#include <utility>

namespace vibrig {

/// The path of a new folder, which goes with all that is in it when this does.
class TemporaryFolder : public std::filesystem::path {
  public:
    TemporaryFolder() : path(made()) {}
    ~TemporaryFolder() {
        std::error_code ignored;
        std::filesystem::remove_all(*this, ignored);
    }
    TemporaryFolder(const TemporaryFolder&) = delete;
    TemporaryFolder& operator=(const TemporaryFolder&) = delete;

    [[nodiscard]] std::string file(const std::string& name) const { return *this / name; }

  private:
    static std::string made() {
        std::string name = std::filesystem::temp_directory_path() / "vibrig-XXXXXX";
        if (::mkdtemp(name.data()) == nullptr)
            throw std::runtime_error("cannot make the folder " + name);
        return name;
    }
};

}  // namespace vibrig
