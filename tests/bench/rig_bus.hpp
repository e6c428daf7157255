#pragma once

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cmath>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "tests/unit/drivers/rig_frames.hpp"

namespace vibrig::bench {

inline void insist(bool good, const char* what) {
    if (!good) {
        std::perror(what);
        std::abort();
    }
}

/// The rig's end of a bus over a Unix socket: a platform at rest in its gimbals on a table that
/// vibrates.
class RigBus {
  public:
    explicit RigBus(const std::string& abstract_name) : path("@" + abstract_name) {
        sockaddr_un address{};
        address.sun_family = AF_UNIX;
        abstract_name.copy(&address.sun_path[1], sizeof address.sun_path - 1);
        const auto length =
            static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + 1 + abstract_name.size());
        insist(::bind(listener_, reinterpret_cast<const sockaddr*>(&address), length) == 0, "bind");
        insist(::listen(listener_, 1) == 0, "listen");
    }
    ~RigBus() {
        ::close(bus_);
        ::close(listener_);
    }
    RigBus(const RigBus&) = delete;
    RigBus& operator=(const RigBus&) = delete;

    void accept() {
        bus_ = ::accept(listener_, nullptr, nullptr);
        insist(bus_ >= 0, "accept");
    }
    void send(const drivers::ReceivedFrame& frame) const {
        insist(::send(bus_, &frame.frame, CAN_MTU, 0) == static_cast<ssize_t>(CAN_MTU), "send");
    }

    /// The frames of one sync count; the last one completes the sample.
    [[nodiscard]] static std::vector<drivers::ReceivedFrame> frames(std::uint32_t count) {
        const auto& dbc = test::rig_dbc();
        const double low = count % 256;
        const double f = 6 * std::sin(0.37 * count);
        return {
            test::frame_of(dbc, "Sync", 0, {{"SyncCount", count}}),
            test::frame_of(dbc, "Resolvers", 0,
                           {{"Outer", 0.01},
                            {"Inner", 0.02},
                            {"OuterValid", 1},
                            {"InnerValid", 1},
                            {"SyncLow", low}}),
            test::frame_of(dbc, "ResolverAzimuth", 0,
                           {{"Azimuth", 0.03}, {"AzimuthValid", 1}, {"SyncLow", low}}),
            test::frame_of(
                dbc, "AccelerometersXY", 0,
                {{"X", 0}, {"Y", 1 + f}, {"XValid", 1}, {"YValid", 1}, {"SyncLow", low}}),
            test::frame_of(dbc, "TableAccelerometer", 0, {{"Axial", f}, {"SyncLow", low}}),
            test::frame_of(dbc, "AccelerometerZ", 0, {{"Z", 0}, {"ZValid", 1}, {"SyncLow", low}})};
    }

    const std::string path;

  private:
    int listener_ = ::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0);
    int bus_ = -1;
};

}  // namespace vibrig::bench
