#include "daemon/app/watchdog.hpp"

#include <sys/socket.h>
#include <sys/un.h>
#include <systemd/sd-daemon.h>
#include <time.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>

namespace vibrig {
namespace {

/// As sd_notify(3), but it never waits: a service manager that hangs must not hold the thread that
/// takes the signals. What it has no room for is said again soon.
void notify(const std::string& text) {
    const char* const path = std::getenv("NOTIFY_SOCKET");
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    if (path == nullptr || (*path != '/' && *path != '@')) return;
    const std::size_t length = std::strlen(path);
    if (length >= sizeof address.sun_path) return;
    std::memcpy(address.sun_path, path, length);
    if (*path == '@') address.sun_path[0] = '\0';
    static const int descriptor = ::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    ::sendto(descriptor, text.data(), text.size(), MSG_NOSIGNAL,
             reinterpret_cast<const sockaddr*>(&address),
             static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + length));
}

}  // namespace

ServiceManager::ServiceManager() {
    std::uint64_t usec = 0;
    if (::sd_watchdog_enabled(0, &usec) > 0) period_s_ = static_cast<double>(usec) / 2e6;
}

void ServiceManager::ready(const std::string& status) const { notify("READY=1\nSTATUS=" + status); }

void ServiceManager::status(const std::string& status) const { notify("STATUS=" + status); }

void ServiceManager::reloading() const {
    timespec now{};
    ::clock_gettime(CLOCK_MONOTONIC, &now);
    const auto usec = std::int64_t{now.tv_sec} * 1'000'000 + now.tv_nsec / 1000;
    notify("RELOADING=1\nMONOTONIC_USEC=" + std::to_string(usec));
}

void ServiceManager::stopping(double longest_s) const {
    notify("STOPPING=1\nSTATUS=stopping\nEXTEND_TIMEOUT_USEC=" +
           std::to_string(std::llround(1e6 * longest_s)));
}

void ServiceManager::alive() const { notify("WATCHDOG=1"); }

}  // namespace vibrig
