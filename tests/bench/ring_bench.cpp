#include <benchmark/benchmark.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <boost/lockfree/spsc_queue.hpp>
#include <chrono>
#include <cstdint>
#include <thread>
#include <vector>

#include "daemon/rt/ring.hpp"

// The ring between two threads against boost::lockfree::spsc_queue in one run on one machine:
// median latency of single records, and cost of a record in batches of 32. tests/bench/report
// compares the ratios with the goals.

namespace vibrig::bench {
namespace {

using Clock = std::chrono::steady_clock;

struct alignas(64) Record {
    std::uint64_t number = 0;
    std::array<double, 5> value{};
    std::uint32_t dropped_before = 0;
    std::uint64_t published_to = 0;  ///< the ring's own
};
static_assert(sizeof(Record) == 64, "one cache line per record");

constexpr std::size_t kCapacity = 1024;
constexpr std::size_t kBatch = 32;
constexpr std::size_t kRecords = 1 << 16;
constexpr std::size_t kLooks = 1 << 8;
/// Round trips for each look: a clock that goes in steps of 10 ns tells 110 ns from 115 by no
/// median.
constexpr int kRoundTrips = 16;

struct OwnRing {
    rt::Ring<Record> ring{kCapacity};
    bool push(const Record& record) { return ring.try_push(record); }
    /// How many of the batch went in.
    std::size_t push(const Record* records, std::size_t n) { return ring.push_n({records, n}); }
    /// All that waits, as the other one's.
    template <class F>
    std::size_t consume(F f) {
        return ring.consume(f, kCapacity);
    }
};

struct BoostRing {
    boost::lockfree::spsc_queue<Record, boost::lockfree::capacity<kCapacity>> ring;
    bool push(const Record& record) { return ring.push(record); }
    std::size_t push(const Record* records, std::size_t n) { return ring.push(records, n); }
    template <class F>
    std::size_t consume(F f) {
        return ring.consume_all(f);
    }
};

void pause() {
#if defined(__x86_64__)
    __builtin_ia32_pause();
#elif defined(__aarch64__)
    asm volatile("yield");
#endif
}

/// Spins first: with a core for each side nobody waits longer than a cache line takes. Pauses,
/// since a reader that looks ahead without end has each of its looks thrown away when the line
/// changes: the faster its loop, the later the record, by 10 to 20 percent of a trip.
struct Patience {
    int spins = 0;
    void wait() {
        pause();
        if (++spins % 4096 == 0) std::this_thread::yield();
    }
};

/// Median of the half of a round trip, one record each way, a few together.
template <class Ring>
void latency(benchmark::State& state) {
    Ring there, back;
    std::atomic<bool> stop{false};
    std::jthread echo([&] {
        Patience patience;
        while (!stop.load(std::memory_order_relaxed)) {
            if (there.consume([&](const Record& r) { back.push(r); }) == 0) patience.wait();
        }
    });
    std::vector<double> seconds(kLooks);
    Record record;
    for (auto _ : state) {
        for (double& s : seconds) {
            const auto begin = Clock::now();
            for (int trip = 0; trip < kRoundTrips; ++trip) {
                ++record.number;
                there.push(record);
                Patience patience;
                std::uint64_t got = 0;
                while (got != record.number) {
                    if (back.consume([&](const Record& r) { got = r.number; }) == 0)
                        patience.wait();
                }
            }
            s = std::chrono::duration<double>(Clock::now() - begin).count() / (2 * kRoundTrips);
        }
        const auto middle = seconds.begin() + kLooks / 2;
        std::nth_element(seconds.begin(), middle, seconds.end());
        state.SetIterationTime(*middle);
    }
    stop = true;
}

/// Time of one record when both sides work in batches.
template <class Ring>
void throughput(benchmark::State& state) {
    std::array<Record, kBatch> batch{};
    for (auto _ : state) {
        Ring ring;
        std::uint64_t sum = 0;
        std::atomic<bool> ready{false};
        std::jthread consumer([&] {
            ready = true;
            std::size_t left = kRecords;
            Patience patience;
            while (left > 0) {
                const std::size_t n = ring.consume([&](const Record& r) { sum += r.number; });
                left -= n;
                if (n == 0) patience.wait();
            }
        });
        while (!ready) std::this_thread::yield();
        Patience patience;
        const auto begin = Clock::now();
        for (std::size_t sent = 0; sent < kRecords;) {
            const std::size_t n = ring.push(batch.data(), std::min(kBatch, kRecords - sent));
            sent += n;
            if (n == 0) patience.wait();
        }
        consumer.join();
        state.SetIterationTime(std::chrono::duration<double>(Clock::now() - begin).count() /
                               static_cast<double>(kRecords));
        benchmark::DoNotOptimize(sum);
    }
}

BENCHMARK(latency<OwnRing>)->Name("ring_latency")->UseManualTime()->Iterations(20);
BENCHMARK(latency<BoostRing>)->Name("boost_latency")->UseManualTime()->Iterations(20);
BENCHMARK(throughput<OwnRing>)->Name("ring_batch")->UseManualTime()->Iterations(20);
BENCHMARK(throughput<BoostRing>)->Name("boost_batch")->UseManualTime()->Iterations(20);

}  // namespace
}  // namespace vibrig::bench

BENCHMARK_MAIN();
