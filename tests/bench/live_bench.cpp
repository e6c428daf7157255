#include <benchmark/benchmark.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <functional>
#include <thread>

#include "tests/bench/bare_receiver.hpp"
#include "tests/bench/rig_bus.hpp"

// Processor time of the daemon while 1000 samples a second come in, eight frames each: what it
// takes beyond the filter and the recorder, which work in campaigns only. Beside it that of a
// program which only takes the same frames and wakes a second thread for each sample: what the
// kernel and the machine ask of anybody. On a Unix socket, and on vcan0 where there is one.
// tests/bench/report adds and compares.

namespace vibrig::bench {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;
constexpr int kRate = 1000;  // samples/s
constexpr auto kBefore = std::chrono::seconds(1);
constexpr auto kFor = std::chrono::seconds(3);

double processor_s(pid_t pid) {
    clockid_t clock{};
    timespec t{};
    insist(::clock_getcpuclockid(pid, &clock) == 0 && ::clock_gettime(clock, &t) == 0, "cpu clock");
    return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

/// A process of its own, which does not outlive this one.
pid_t start(const std::function<void()>& child) {
    const pid_t parent = ::getpid();
    const pid_t pid = ::fork();
    insist(pid >= 0, "fork");
    if (pid != 0) return pid;
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (::getppid() == parent) child();
    ::_exit(127);
}

/// Seconds of processor time of that process for one sample.
double per_sample(RigBus& bus, pid_t pid) {
    bus.accept();
    std::uint32_t count = 0;
    auto next = Clock::now();
    const auto stream = [&](std::chrono::seconds length) {
        for (const auto end = Clock::now() + length; Clock::now() < end;) {
            const auto frames = RigBus::eight(count++);
            std::this_thread::sleep_until(next += std::chrono::microseconds(1'000'000 / kRate));
            for (const auto& frame : frames) bus.send(frame);
        }
    };
    stream(kBefore);
    const double before = processor_s(pid);
    const std::uint32_t first = count;
    stream(kFor);
    const double took = processor_s(pid) - before;
    insist(::waitpid(pid, nullptr, WNOHANG) == 0, "it has ended");
    ::kill(pid, SIGKILL);
    ::waitpid(pid, nullptr, 0);
    return took / (count - first);
}

void daemon(benchmark::State& state, const std::function<RigBus()>& make_bus) {
    const fs::path folder =
        fs::temp_directory_path() / ("vibrig-live-" + std::to_string(::getpid()));
    for (auto _ : state) {
        fs::create_directories(folder / "results");
        RigBus bus = make_bus();
        const std::string can = bus.interface.empty()
                                    ? "port = \"seqpacket\"\npath = \"" + bus.path
                                    : "port = \"socketcan\"\ninterface = \"" + bus.interface;
        std::ofstream(folder / "vibrigd.toml")
            << "[campaign]\nname = \"live\"\nresults = \"results\"\nidentify = \"what-it-can\"\n"
            << "[can]\n"
            << can << "\"\nsample_rate_hz = " << kRate << ".0\n[server]\nsocket = \""
            << (folder / "vibrigd.sock").string()
            << "\"\n[log]\nfile = \"log\"\n[shaker]\nport = 1\n[commission]\nsimulated = true\n";
        const auto program = fs::read_symlink("/proc/self/exe").parent_path() / "vibrigd";
        const std::string configuration = folder / "vibrigd.toml";
        state.SetIterationTime(per_sample(bus, start([&] {
                                              ::execl(program.c_str(), "vibrigd", "--config",
                                                      configuration.c_str(), nullptr);
                                          })));
        fs::remove_all(folder);
    }
}

void bare(benchmark::State& state, const std::function<RigBus()>& make_bus) {
    for (auto _ : state) {
        RigBus bus = make_bus();
        state.SetIterationTime(per_sample(bus, start([&bus] { receive_only(bus); })));
    }
}

void add(const std::string& bus, const std::function<RigBus()>& make_bus) {
    for (const auto& [name, what] : {std::pair{"daemon", &daemon}, std::pair{"bare", &bare}})
        benchmark::RegisterBenchmark((name + ("_sample" + bus)).c_str(), *what, make_bus)
            ->UseManualTime()
            ->Iterations(1);
}

}  // namespace
}  // namespace vibrig::bench

int main(int argc, char** argv) {
    using vibrig::bench::RigBus;
    vibrig::bench::add("",
                       [] { return RigBus("vibrig-live-bench-" + std::to_string(::getpid())); });
    if (::if_nametoindex("vcan0") != 0)
        vibrig::bench::add("_vcan", [] { return RigBus(RigBus::Interface{"vcan0"}); });
    benchmark::Initialize(&argc, argv);
    if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
    benchmark::RunSpecifiedBenchmarks();
    return 0;
}
