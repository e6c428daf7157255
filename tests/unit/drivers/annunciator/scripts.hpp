#pragma once

#include <signal.h>
#include <sys/stat.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <functional>
#include <sstream>
#include <string>
#include <thread>

#include "tests/unit/support/temporary_folder.hpp"

namespace vibrig::drivers::test {

/// A page command as a user would write it, in a folder of its own.
class Script {
  public:
    explicit Script(const std::string& body, bool executable = true) {
        std::ofstream(path()) << "#!/bin/sh\ncd " << folder_.file(".") << "\n" << body << "\n";
        if (executable) ::chmod(path().c_str(), 0755);
    }
    [[nodiscard]] std::string path() const { return folder_.file("page-me"); }
    [[nodiscard]] std::string text_of(const std::string& name) const {
        std::ifstream file(folder_.file(name));
        std::ostringstream text;
        text << file.rdbuf();
        return text.str();
    }
    /// An empty file beside it.
    void make(const std::string& name) const { std::ofstream(folder_.file(name)); }
    /// The process whose number the script has written into the file.
    [[nodiscard]] pid_t process_of(const std::string& name) const {
        const auto text = text_of(name);
        return text.empty() || text.back() != '\n' ? -1 : std::stoi(text);
    }

  private:
    TemporaryFolder folder_;
};

/// Generous: the machine may be busy.
inline bool eventually(const std::function<bool()>& condition, double seconds = 20) {
    const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
    while (!condition()) {
        if (std::chrono::steady_clock::now() > end) return false;
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    return true;
}

/// Gone, or a zombie that nobody has taken yet.
inline bool dead(pid_t process) {
    if (process <= 0) return false;
    std::ifstream file("/proc/" + std::to_string(process) + "/stat");
    std::string text;
    if (!std::getline(file, text)) return true;
    const auto at = text.rfind(')');
    return at == std::string::npos || text.compare(at + 2, 1, "Z") == 0;
}

}  // namespace vibrig::drivers::test
