#pragma once

#include <poll.h>
#include <termios.h>
#include <unistd.h>

#include <chrono>
#include <thread>

namespace vibrig::tool {

/// Keys of a terminal come one by one; as before at the end.
class KeyByKey {
  public:
    KeyByKey() {
        if (isatty(STDIN_FILENO) == 0 || tcgetattr(STDIN_FILENO, &before_) != 0) return;
        termios fresh = before_;
        fresh.c_lflag &= static_cast<tcflag_t>(~(ICANON | ECHO));
        changed_ = tcsetattr(STDIN_FILENO, TCSANOW, &fresh) == 0;
    }
    ~KeyByKey() {
        if (changed_) tcsetattr(STDIN_FILENO, TCSANOW, &before_);
    }
    KeyByKey(const KeyByKey&) = delete;
    KeyByKey& operator=(const KeyByKey&) = delete;
    /// True: a key was pressed within the time.
    [[nodiscard]] bool pressed(std::chrono::milliseconds within) const {
        if (!changed_) {
            std::this_thread::sleep_for(within);
            return false;
        }
        pollfd in{STDIN_FILENO, POLLIN, 0};
        if (poll(&in, 1, static_cast<int>(within.count())) <= 0) return false;
        char key = 0;
        return read(STDIN_FILENO, &key, 1) == 1;
    }

  private:
    termios before_{};
    bool changed_ = false;
};

}  // namespace vibrig::tool
