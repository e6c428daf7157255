#include "daemon/rt/real_time.hpp"

#include <malloc.h>
#include <pthread.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/resource.h>

#include <array>
#include <cerrno>
#include <cstring>

namespace vibrig::rt {
namespace {

// Address space that has to be left below the limit of locked memory: stacks of 8 MB and arenas of
// 64 MB count in full, although little of them is ever touched.
constexpr std::size_t kRoom = std::size_t{1} << 30;
/// Blocks as large are mapped and given back whole, bytes.
constexpr int kLargeBlock = 8 * 1024;
constexpr std::size_t kStack = std::size_t{256} * 1024;  // deeper than any real-time thread goes
constexpr std::size_t kPage = 4096;                      // the smallest there is

std::string words_of(const cpu_set_t& cpus) {
    std::string words;
    for (std::size_t first = 0; first < CPU_SETSIZE; ++first) {
        if (!CPU_ISSET(first, &cpus)) continue;
        std::size_t last = first;
        while (last + 1 < CPU_SETSIZE && CPU_ISSET(last + 1, &cpus)) ++last;
        words += (words.empty() ? "" : ",") + std::to_string(first);
        if (last > first) words += '-' + std::to_string(last);
        first = last;
    }
    return words;
}

std::string limit_of(int resource) {
    rlimit limit{};
    if (::getrlimit(static_cast<__rlimit_resource>(resource), &limit) != 0) return "not known";
    return limit.rlim_cur == RLIM_INFINITY ? "infinity" : std::to_string(limit.rlim_cur);
}

[[gnu::noinline]] void touch_stack() noexcept {
    std::array<volatile char, kStack> pages;  // NOLINT: written page by page
    for (std::size_t i = 0; i < pages.size(); i += kPage) pages[i] = 0;
}

MemoryLock not_locked(const char* what) {
    const int error = errno;
    ::munlockall();
    return {false, std::string(what) + ": " + std::strerror(error) + "; the limit is " +
                       limit_of(RLIMIT_MEMLOCK) +
                       " bytes (LimitMEMLOCK=infinity in the service, or CAP_IPC_LOCK)"};
}

}  // namespace

PageFaults page_faults_of_this_thread() noexcept {
    rusage use{};
    if (::getrusage(RUSAGE_THREAD, &use) != 0) return {};
    return {static_cast<std::uint64_t>(use.ru_majflt), static_cast<std::uint64_t>(use.ru_minflt)};
}

int cpu_of_this_thread() noexcept { return ::sched_getcpu(); }

void keep_this_thread_to(int cpu) noexcept {
    if (cpu < 0 || cpu >= CPU_SETSIZE) return;
    cpu_set_t only;
    CPU_ZERO(&only);
    CPU_SET(static_cast<std::size_t>(cpu), &only);
    ::pthread_setaffinity_np(::pthread_self(), sizeof only, &only);
}

bool this_thread_is_fifo() noexcept {
    int policy = SCHED_OTHER;
    sched_param got{};
    return ::pthread_getschedparam(::pthread_self(), &policy, &got) == 0 && policy == SCHED_FIFO;
}

ThreadSetup set_up_this_thread(const ThreadWishes& wishes) {
    const pthread_t self = ::pthread_self();
    ThreadSetup setup;
    ::pthread_setname_np(self, wishes.name);  // for top and the like
    cpu_set_t allowed;
    CPU_ZERO(&allowed);
    if (wishes.cpu >= 0) {
        CPU_SET(static_cast<std::size_t>(wishes.cpu), &allowed);
        if (const int error = ::pthread_setaffinity_np(self, sizeof allowed, &allowed); error != 0)
            setup.missing.push_back("CPU " + std::to_string(wishes.cpu) + ": " +
                                    std::strerror(error));
    }
    if (::pthread_getaffinity_np(self, sizeof allowed, &allowed) == 0)
        setup.cpus = words_of(allowed);
    if (!setup.missing.empty()) setup.missing.back() += "; it runs on " + setup.cpus;
    if (wishes.fifo_priority > 0) {
        const sched_param wanted{.sched_priority = wishes.fifo_priority};
        if (const int error = ::pthread_setschedparam(self, SCHED_FIFO, &wanted); error != 0)
            setup.missing.push_back("SCHED_FIFO " + std::to_string(wishes.fifo_priority) + ": " +
                                    std::strerror(error) + "; the limit is " +
                                    limit_of(RLIMIT_RTPRIO) +
                                    " (LimitRTPRIO in the service, or CAP_SYS_NICE): ordinary "
                                    "scheduling");
    }
    int policy = SCHED_OTHER;
    sched_param got{};
    if (::pthread_getschedparam(self, &policy, &got) == 0 && policy == SCHED_FIFO)
        setup.fifo_priority = got.sched_priority;
    touch_stack();
    setup.faults = page_faults_of_this_thread();
    return setup;
}

MemoryLock lock_memory() {
    // What is there already comes into memory now, programs and libraries too: the path of a trip
    // may be needed for the first time when their disk hangs. What comes later (stacks of 8 MB, a
    // page of each touched) only as it is touched; rings are, since they are made with zeros.
    if (::mlockall(MCL_CURRENT) != 0 || ::mlockall(MCL_CURRENT | MCL_FUTURE | MCL_ONFAULT) != 0)
        return not_locked("mlockall");
    // A limit met later would be a thread that cannot begin in the middle of a campaign.
    void* const room =
        ::mmap(nullptr, kRoom, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
    if (room == MAP_FAILED) return not_locked("1 GB of address space for later");
    ::munmap(room, kRoom);
    // Memory given back interrupts every CPU that runs a thread of ours.
    ::mallopt(M_TRIM_THRESHOLD, -1);
    return {true, {}};
}

void give_large_blocks_back() {
    // What a campaign has large (its filter, half a megabyte at a time; the matrices of a verdict,
    // which grow with the dwells) goes with it: small blocks that outlive it would take a piece of
    // each place it leaves, and each time it would need a new one.
    ::mallopt(M_MMAP_THRESHOLD, kLargeBlock);
    // With a heap for each thread what a verdict or an answer had in small blocks, which grows with
    // the dwells, too, stays with that thread; in one heap the next thread has it. The real-time
    // threads take none.
    ::mallopt(M_ARENA_MAX, 1);
}

void give_free_memory_back() { ::malloc_trim(0); }

}  // namespace vibrig::rt
