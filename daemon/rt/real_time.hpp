#pragma once

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "drivers/base/clock.hpp"

namespace vibrig::rt {

/// Page faults of one thread; major ones waited for a disk.
struct PageFaults {
    std::uint64_t major = 0, minor = 0;
};
/// Page faults of the calling thread since it began; one system call.
[[nodiscard]] PageFaults page_faults_of_this_thread() noexcept;

/// Counts what was done later than a bound. One thread.
struct Lateness {
    drivers::Time bound = drivers::kNever;
    std::uint64_t misses = 0;
    drivers::Time longest = 0;  ///< of all, late or not

    void add(drivers::Time taken) noexcept {
        longest = std::max(longest, taken);
        if (taken > bound) ++misses;
    }
};

/// Since when the next stage has had something that it is not done with, and where that was given.
/// One giver, one taker.
class HandOver {
  public:
    /// After the records are in the ring, before the notice; `cpu` the giver runs on, -1: not
    /// known.
    void given(drivers::Time now, int cpu = -1) noexcept {
        cpu_.store(cpu, std::memory_order_relaxed);
        drivers::Time none = 0;
        since_.compare_exchange_strong(none, now);
    }
    /// Before the ring is emptied; 0: nothing new.
    [[nodiscard]] drivers::Time taken() noexcept { return since_.exchange(0); }
    [[nodiscard]] int cpu() const noexcept { return cpu_.load(std::memory_order_relaxed); }

    /// Taker: what is older than `time` may lie in the ring without a notice.
    void want(drivers::Time time) noexcept { wanted_.store(time); }
    /// Giver: whether a record of this time is to be told of.
    [[nodiscard]] bool wants(drivers::Time time) const noexcept { return time >= wanted_.load(); }

  private:
    std::atomic<drivers::Time> since_{0};
    std::atomic<drivers::Time> wanted_{std::numeric_limits<drivers::Time>::min()};  ///< all
    std::atomic<int> cpu_{-1};
};

/// What a thread is to have.
struct ThreadWishes {
    const char* name = "";
    int fifo_priority = 0;  ///< SCHED_FIFO; 0: ordinary scheduling
    int cpu = -1;           ///< it keeps to this one; -1: any
};

/// What it has.
struct ThreadSetup {
    int fifo_priority = 0;             ///< 0: ordinary scheduling
    std::string cpus;                  ///< it may run on, "0-1,3"; empty: not known
    std::vector<std::string> missing;  ///< what could not be had, each with its cause
    PageFaults faults;                 ///< it took so far
};

/// The CPU it is on; -1: not known.
[[nodiscard]] int cpu_of_this_thread() noexcept;
/// From here on the calling thread keeps to this one, if it may; one system call.
void keep_this_thread_to(int cpu) noexcept;
/// SCHED_FIFO, not merely asked for.
[[nodiscard]] bool this_thread_is_fifo() noexcept;

/// Sets up the calling thread and brings its stack into memory. What cannot be had is left as it
/// is and reported.
[[nodiscard]] ThreadSetup set_up_this_thread(const ThreadWishes& wishes);

struct MemoryLock {
    bool locked = false;
    std::string cause;  ///< why it is not
};

/// Locks the memory of the process: all that is there now, and whatever comes once it has been
/// touched. Before other threads begin.
[[nodiscard]] MemoryLock lock_memory();
/// For all memory from here on: a large block is the system's again as soon as it is freed,
/// small ones come from one heap. Before other threads begin, or they have theirs.
void give_large_blocks_back();
/// All that is free and was needed once; where memory is locked it stays.
void give_free_memory_back();

}  // namespace vibrig::rt
