#include <benchmark/benchmark.h>
#include <sys/socket.h>
#include <sys/uio.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <boost/asio/io_context.hpp>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <memory>
#include <string>

#include "drivers/can/can_port.hpp"

// Taking frames with their time stamps from a socket: the port (readiness by Asio, batches of 32,
// drops and kinds counted, frames handed on) against a bare loop of recvmmsg, the same frames
// queued on the same kind of socket. tests/bench/report compares.

namespace vibrig::bench {
namespace {

constexpr int kQueued = 128;  // four batches; a Unix socket of default size holds them
constexpr int kRounds = 200;

double cpu_s() {
    timespec t{};
    ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

void insist(bool good, const char* what) {
    if (!good) {
        std::perror(what);
        std::abort();
    }
}

void queue_frames(int fd) {
    can_frame frame{};
    frame.can_id = 0x101;
    frame.len = 8;
    for (int i = 0; i < kQueued; ++i) {
        frame.data[0] = static_cast<std::uint8_t>(i);
        insist(::send(fd, &frame, sizeof frame, MSG_DONTWAIT) == sizeof frame, "send");
    }
}

/// A frame without its time is of no use, to nobody.
std::int64_t stamp_of(const msghdr& header) {
    for (const cmsghdr* c = CMSG_FIRSTHDR(&header); c != nullptr;
         c = CMSG_NXTHDR(const_cast<msghdr*>(&header), const_cast<cmsghdr*>(c))) {
        if (c->cmsg_level != SOL_SOCKET || c->cmsg_type != SCM_TIMESTAMPNS) continue;
        timespec t{};
        std::memcpy(&t, CMSG_DATA(c), sizeof t);
        return t.tv_sec * 1'000'000'000 + t.tv_nsec;
    }
    return 0;
}

void bare(benchmark::State& state) {
    std::array<int, 2> ends{};
    insist(::socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_NONBLOCK, 0, ends.data()) == 0,
           "socketpair");
    // As the port asks for; otherwise the kernel has less to do.
    constexpr int kOn = 1;
    ::setsockopt(ends[1], SOL_SOCKET, SO_TIMESTAMPNS, &kOn, sizeof kOn);
    std::array<canfd_frame, 32> frames{};
    std::array<std::array<std::byte, 128>, 32> control{};
    std::array<iovec, 32> vectors{};
    std::array<mmsghdr, 32> headers{};
    std::uint64_t sum = 0;
    std::int64_t stamps = 0;
    for (auto _ : state) {
        double used = 0;
        for (int round = 0; round < kRounds; ++round) {
            queue_frames(ends[0]);
            const double begin = cpu_s();
            for (int taken = 0; taken < kQueued;) {
                for (std::size_t i = 0; i < 32; ++i) {
                    vectors[i] = {&frames[i], sizeof frames[i]};
                    headers[i].msg_hdr = {};
                    headers[i].msg_hdr.msg_iov = &vectors[i];
                    headers[i].msg_hdr.msg_iovlen = 1;
                    headers[i].msg_hdr.msg_control = control[i].data();
                    headers[i].msg_hdr.msg_controllen = control[i].size();
                }
                const int n = ::recvmmsg(ends[1], headers.data(), 32, MSG_DONTWAIT, nullptr);
                insist(n > 0, "recvmmsg");
                for (std::size_t i = 0; i < static_cast<std::size_t>(n); ++i) {
                    sum += frames[i].data[0];
                    stamps += stamp_of(headers[i].msg_hdr);
                }
                taken += n;
            }
            used += cpu_s() - begin;
        }
        state.SetIterationTime(used / (kRounds * kQueued));
    }
    benchmark::DoNotOptimize(sum);
    benchmark::DoNotOptimize(stamps);
    ::close(ends[0]);
    ::close(ends[1]);
}

void port(benchmark::State& state) {
    const std::string name = "@vibrig-bench-" + std::to_string(::getpid());
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    name.copy(&address.sun_path[1], sizeof address.sun_path - 1, 1);
    const int listener = ::socket(AF_UNIX, SOCK_SEQPACKET, 0);
    const auto length = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + name.size());
    insist(::bind(listener, reinterpret_cast<const sockaddr*>(&address), length) == 0, "bind");
    insist(::listen(listener, 1) == 0, "listen");
    boost::asio::io_context io{1};
    drivers::CanPortSettings settings;
    settings.kind = drivers::CanPortSettings::Kind::seqpacket;
    settings.path = name;
    const auto made = drivers::make_can_port(io, settings);
    int taken = 0;
    std::uint64_t sum = 0;
    made->start(
        [&](std::span<const drivers::ReceivedFrame> frames) {
            for (const auto& frame : frames) sum += frame.frame.data[0];
            taken += static_cast<int>(frames.size());
        },
        [](drivers::PortState, const char*) {}, {});
    const int sender = ::accept(listener, nullptr, nullptr);
    insist(sender >= 0, "accept");
    for (auto _ : state) {
        double used = 0;
        for (int round = 0; round < kRounds; ++round) {
            queue_frames(sender);
            taken = 0;
            const double begin = cpu_s();
            while (taken < kQueued) io.run_one();
            used += cpu_s() - begin;
        }
        state.SetIterationTime(used / (kRounds * kQueued));
    }
    benchmark::DoNotOptimize(sum);
    made->stop();
    ::close(sender);
    ::close(listener);
}

BENCHMARK(port)->Name("receive_port")->UseManualTime()->Iterations(5);
BENCHMARK(bare)->Name("receive_bare")->UseManualTime()->Iterations(5);

}  // namespace
}  // namespace vibrig::bench

BENCHMARK_MAIN();
