#pragma once

#include <sys/types.h>

#include <stdexcept>
#include <string>

namespace vibrig::serve {

/// A socket that cannot be had; the message names its path and the cause.
class ServeError : public std::runtime_error {
  public:
    using std::runtime_error::runtime_error;
};

/// The file of a listening Unix socket, mode 0660. Takes over the file of a dead daemon, never that
/// of a live one; removes its own at the end.
class SocketFile {
  public:
    /// Throws ServeError.
    explicit SocketFile(const std::string& path);
    ~SocketFile();
    SocketFile(SocketFile&& other) noexcept;
    SocketFile& operator=(SocketFile&&) = delete;
    SocketFile(const SocketFile&) = delete;
    SocketFile& operator=(const SocketFile&) = delete;

    /// Why nobody finds this daemon by that name; empty: a connection of one's own leads here.
    [[nodiscard]] std::string problem() const;
    /// Before one is made anew: the folder if it is gone, and what is no socket out of the way, as
    /// PATH.found.
    static void make_room(const std::string& path);

    /// The listening descriptor; the caller closes it from now on.
    [[nodiscard]] int release() noexcept;

  private:
    std::string path_;
    int descriptor_ = -1;
    dev_t device_ = 0;
    ino_t inode_ = 0;
};

}  // namespace vibrig::serve
