#include "drivers/base/event_fd.hpp"

#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <ctime>
#include <system_error>

namespace vibrig::rt {

EventFd::EventFd() : fd_(::eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC)) {
    if (fd_ < 0) throw std::system_error(errno, std::generic_category(), "eventfd");
}

EventFd::~EventFd() { ::close(fd_); }

void EventFd::signal() const noexcept {
    const std::uint64_t one = 1;
    // Fails only when the counter is full, and then the sleeper is awake already.
    [[maybe_unused]] const auto written = ::write(fd_, &one, sizeof one);
}

void EventFd::clear() const noexcept {
    std::uint64_t count = 0;
    [[maybe_unused]] const auto got = ::read(fd_, &count, sizeof count);
}

bool EventFd::wait(long long timeout_ns) const noexcept {
    pollfd waited{fd_, POLLIN, 0};
    timespec timeout{};
    timeout.tv_sec = timeout_ns / 1'000'000'000;
    timeout.tv_nsec = timeout_ns % 1'000'000'000;
    return ::ppoll(&waited, 1, timeout_ns < 0 ? nullptr : &timeout, nullptr) > 0;
}

}  // namespace vibrig::rt
