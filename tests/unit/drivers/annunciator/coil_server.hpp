#pragma once

#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

extern char** environ;

namespace vibrig::drivers::test {

[[nodiscard]] inline bool have_pymodbus() {
    return std::system("/usr/bin/python3 -c 'import pymodbus.server.async_io' 2>/dev/null") ==
           0;  // NOLINT
}

/// coil_server.py as a child: what it was asked to write, as it understood it.
class CoilServer {
  public:
    explicit CoilServer(const char* kind) {
        int to[2], from[2];
        if (::pipe2(to, O_CLOEXEC) != 0 || ::pipe2(from, O_CLOEXEC) != 0) return;
        posix_spawn_file_actions_t actions;
        ::posix_spawn_file_actions_init(&actions);
        ::posix_spawn_file_actions_adddup2(&actions, to[0], 0);
        ::posix_spawn_file_actions_adddup2(&actions, from[1], 1);
        std::string python = "/usr/bin/python3", script = VIBRIG_COIL_SERVER, argument = kind;
        char* arguments[] = {python.data(), script.data(), argument.data(), nullptr};
        if (::posix_spawn(&pid_, python.c_str(), &actions, nullptr, arguments, environ) != 0)
            pid_ = -1;
        ::posix_spawn_file_actions_destroy(&actions);
        ::close(to[0]);
        ::close(from[1]);
        input_ = to[1];
        output_ = ::fdopen(from[0], "r");
        port_ = std::atoi(line().c_str());
        reader_ = std::thread([this] {
            for (std::string text = line(); !text.empty(); text = line()) {
                const std::lock_guard lock(mutex_);
                lines_.push_back(text);
            }
        });
    }
    ~CoilServer() {
        end();
        if (output_ != nullptr) std::fclose(output_);
    }
    CoilServer(const CoilServer&) = delete;
    CoilServer& operator=(const CoilServer&) = delete;

    [[nodiscard]] int port() const { return port_; }
    [[nodiscard]] std::vector<std::string> lines() const {
        const std::lock_guard lock(mutex_);
        return lines_;
    }
    [[nodiscard]] std::size_t count(const std::string& text) const {
        std::size_t n = 0;
        for (const auto& line : lines()) n += line == text ? 1U : 0U;
        return n;
    }
    void end() {
        if (pid_ > 0) {
            ::kill(pid_, SIGKILL);
            ::waitpid(pid_, nullptr, 0);
            ::close(input_);
        }
        pid_ = -1;
        if (reader_.joinable()) reader_.join();
    }

  private:
    std::string line() {
        char text[256];
        if (std::fgets(text, sizeof text, output_) == nullptr) return {};
        std::string read = text;
        while (!read.empty() && read.back() == '\n') read.pop_back();
        return read;
    }

    pid_t pid_ = -1;
    int input_ = -1, port_ = 0;
    std::FILE* output_ = nullptr;
    mutable std::mutex mutex_;
    std::vector<std::string> lines_;
    std::thread reader_;
};

}  // namespace vibrig::drivers::test
