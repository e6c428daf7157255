#pragma once

namespace vibrig::rt {

/// An eventfd that closes itself.
class EventFd {
  public:
    /// Throws std::system_error when no descriptor can be had.
    EventFd();
    ~EventFd();
    EventFd(const EventFd&) = delete;
    EventFd& operator=(const EventFd&) = delete;

    void signal() const noexcept;  ///< any thread
    void clear() const noexcept;   ///< does not block
    /// Sleeps until signalled; negative timeout: for ever. True if signalled.
    bool wait(long long timeout_ns) const noexcept;
    [[nodiscard]] int fd() const noexcept { return fd_; }

  private:
    int fd_;
};

}  // namespace vibrig::rt
