#pragma once

#include <sys/socket.h>

#include <string>

namespace vibrig::serve {

/// A connection of one's own to a TCP door, to learn whether others find it. Never waits: what
/// became of it is asked at the next look. One thread.
class OwnConnection {
  public:
    /// "127.0.0.1:8090", "[::1]:8090", numbers; a door to every address is tried over loopback.
    explicit OwnConnection(const std::string& address);
    ~OwnConnection() { close(); }
    OwnConnection(const OwnConnection&) = delete;
    OwnConnection& operator=(const OwnConnection&) = delete;

    /// Makes another one; that before is given up.
    void begin() noexcept;
    /// Somebody has come through the door from here: true if it is this connection.
    [[nodiscard]] bool is_mine(const sockaddr_storage& from) noexcept;
    /// Why the last one did not come through; empty: it did, or nobody can tell.
    [[nodiscard]] std::string problem() const;
    [[nodiscard]] bool arrived() const noexcept { return arrived_; }

  private:
    void close() noexcept;

    sockaddr_storage door_{};
    socklen_t door_size_ = 0;
    int descriptor_ = -1;
    int error_ = 0;  ///< at once
    bool arrived_ = false;
};

}  // namespace vibrig::serve
