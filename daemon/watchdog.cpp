#include "daemon/watchdog.hpp"

#include <systemd/sd-daemon.h>
#include <time.h>

#include <cstdint>

namespace vibrig {

ServiceManager::ServiceManager() {
    std::uint64_t usec = 0;
    if (::sd_watchdog_enabled(0, &usec) > 0) period_s_ = static_cast<double>(usec) / 2e6;
}

void ServiceManager::ready(const std::string& status) const {
    ::sd_notify(0, ("READY=1\nSTATUS=" + status).c_str());
}

void ServiceManager::status(const std::string& status) const {
    ::sd_notify(0, ("STATUS=" + status).c_str());
}

void ServiceManager::reloading() const {
    timespec now{};
    ::clock_gettime(CLOCK_MONOTONIC, &now);
    const auto usec = std::int64_t{now.tv_sec} * 1'000'000 + now.tv_nsec / 1000;
    ::sd_notify(0, ("RELOADING=1\nMONOTONIC_USEC=" + std::to_string(usec)).c_str());
}

void ServiceManager::stopping() const { ::sd_notify(0, "STOPPING=1\nSTATUS=stopping"); }

void ServiceManager::alive() const { ::sd_notify(0, "WATCHDOG=1"); }

}  // namespace vibrig
