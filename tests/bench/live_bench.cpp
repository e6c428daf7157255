#include <benchmark/benchmark.h>
#include <signal.h>
#include <spawn.h>
#include <sys/resource.h>
#include <sys/wait.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <thread>

#include "tests/bench/rig_bus.hpp"

// Processor time of the daemon while 1000 samples a second come in, six frames each: what it takes
// beyond the filter and the recorder, which work in campaigns only. tests/bench/report adds those.

namespace vibrig::bench {
namespace {

using Clock = std::chrono::steady_clock;
constexpr int kRate = 1000;  // samples/s
constexpr auto kFor = std::chrono::seconds(5);

double processor_s(pid_t pid) {
    clockid_t clock{};
    timespec t{};
    insist(::clock_getcpuclockid(pid, &clock) == 0 && ::clock_gettime(clock, &t) == 0, "cpu clock");
    return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

/// Seconds of processor time for one sample.
void daemon(benchmark::State& state) {
    namespace fs = std::filesystem;
    const fs::path folder =
        fs::temp_directory_path() / ("vibrig-live-" + std::to_string(::getpid()));
    fs::create_directories(folder / "results");
    RigBus bus("vibrig-live-bench-" + std::to_string(::getpid()));
    std::ofstream(folder / "vibrigd.toml")
        << "[campaign]\nname = \"live\"\nresults = \"results\"\nidentify = \"what-it-can\"\n"
        << "[can]\nport = \"seqpacket\"\npath = \"" << bus.path << "\"\nsample_rate_hz = " << kRate
        << ".0\n[server]\nsocket = \"" << (folder / "vibrigd.sock").string()
        << "\"\n[log]\nfile = \"log\"\n[shaker]\nport = 1\n[commission]\nsimulated = true\n";
    const auto program = fs::read_symlink("/proc/self/exe").parent_path() / "vibrigd";
    const std::string configuration = folder / "vibrigd.toml";
    const std::array<const char*, 4> arguments{"vibrigd", "--config", configuration.c_str(),
                                               nullptr};
    pid_t pid = 0;
    insist(::posix_spawn(&pid, program.c_str(), nullptr, nullptr,
                         const_cast<char* const*>(arguments.data()), environ) == 0,
           "vibrigd");
    bus.accept();
    std::uint32_t count = 0;
    auto next = Clock::now();
    const auto stream = [&](std::chrono::seconds length) {
        for (const auto end = Clock::now() + length; Clock::now() < end;) {
            std::this_thread::sleep_until(next += std::chrono::microseconds(1'000'000 / kRate));
            for (const auto& frame : RigBus::frames(count)) bus.send(frame);
            ++count;
        }
    };
    for (auto _ : state) {
        stream(std::chrono::seconds(1));
        const double before = processor_s(pid);
        const std::uint32_t first = count;
        stream(kFor);
        state.SetIterationTime((processor_s(pid) - before) / (count - first));
    }
    ::kill(pid, SIGKILL);
    ::waitpid(pid, nullptr, 0);
    fs::remove_all(folder);
}
BENCHMARK(daemon)->Name("daemon_sample")->UseManualTime()->Iterations(1);

}  // namespace
}  // namespace vibrig::bench

BENCHMARK_MAIN();
