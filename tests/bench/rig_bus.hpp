#pragma once

#include <linux/can/raw.h>
#include <net/if.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <sys/un.h>
#include <unistd.h>

#include <cmath>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <utility>
#include <vector>

#include "tests/unit/drivers/rig_frames.hpp"

namespace vibrig::bench {

inline void insist(bool good, const char* what) {
    if (!good) {
        std::perror(what);
        std::abort();
    }
}

/// The rig's end of a bus, a Unix socket or a CAN interface: a platform at rest in its gimbals on a
/// table that vibrates. Nobody is waited for longer than kPatienceS.
class RigBus {
  public:
    static constexpr int kPatienceS = 30;

    explicit RigBus(const std::string& abstract_name) : path("@" + abstract_name) {
        listener_ = ::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0);
        sockaddr_un address{};
        address.sun_family = AF_UNIX;
        abstract_name.copy(&address.sun_path[1], sizeof address.sun_path - 1);
        const auto length =
            static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + 1 + abstract_name.size());
        insist(::bind(listener_, reinterpret_cast<const sockaddr*>(&address), length) == 0, "bind");
        insist(::listen(listener_, 1) == 0, "listen");
    }
    struct Interface {
        std::string name;
    };
    explicit RigBus(const Interface& can) : interface(can.name) {
        bus_ = ::socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC, CAN_RAW);
        sockaddr_can address{};
        address.can_family = AF_CAN;
        address.can_ifindex = static_cast<int>(::if_nametoindex(can.name.c_str()));
        insist(::bind(bus_, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0,
               can.name.c_str());
    }
    ~RigBus() {
        ::close(bus_);
        if (listener_ >= 0) ::close(listener_);
    }
    RigBus(const RigBus&) = delete;
    RigBus& operator=(const RigBus&) = delete;

    /// On an interface nobody has to come.
    void accept() {
        if (listener_ < 0) return;
        pollfd comes{listener_, POLLIN, 0};
        insist(::poll(&comes, 1, 1000 * kPatienceS) == 1, "nobody connects to the bus");
        bus_ = ::accept(listener_, nullptr, nullptr);
        insist(bus_ >= 0, "accept");
        const timeval patience{kPatienceS, 0};
        ::setsockopt(bus_, SOL_SOCKET, SO_SNDTIMEO, &patience, sizeof patience);
    }
    void send(const drivers::ReceivedFrame& frame) const {
        insist(::send(bus_, &frame.frame, CAN_MTU, MSG_NOSIGNAL) == static_cast<ssize_t>(CAN_MTU),
               "send");
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

    /// The same and what a platform says of itself, eight in all, in the order of their
    /// identifiers.
    [[nodiscard]] static std::vector<drivers::ReceivedFrame> eight(std::uint32_t count) {
        const auto& dbc = test::rig_dbc();
        auto all = frames(count);
        std::swap(all[4], all[5]);
        all.push_back(
            test::frame_of(dbc, "PlatformStatus", 0,
                           {{"Ready", 1}, {"LoopClosed", 1}, {"GyrosAtSpeed", 1}, {"Fault", 0}}));
        all.push_back(
            test::frame_of(dbc, "PlatformTemperatures", 0, {{"Sensor", 0}, {"Case", 20}}));
        return all;
    }

    const std::string path;       ///< of the socket; empty: an interface
    const std::string interface;  ///< empty: a socket

  private:
    int listener_ = -1;
    int bus_ = -1;
};

}  // namespace vibrig::bench
