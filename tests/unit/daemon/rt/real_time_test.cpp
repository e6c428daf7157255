#include "daemon/rt/real_time.hpp"

#include <gmock/gmock.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstring>
#include <fstream>
#include <functional>
#include <thread>

#include "daemon/rt/estimator_stage.hpp"
#include "daemon/rt/real_clock.hpp"

namespace vibrig::rt {
namespace {

using drivers::kMillisecond;
using drivers::kSecond;
using testing::HasSubstr;

/// In a thread of its own, which is gone afterwards.
ThreadSetup set_up(
    const ThreadWishes& wishes, const std::function<void()>& then = [] {}) {
    ThreadSetup setup;
    std::thread([&] {
        setup = set_up_this_thread(wishes);
        then();
    }).join();
    return setup;
}

int last_cpu_of_this_process() {
    cpu_set_t cpus;
    EXPECT_EQ(::sched_getaffinity(0, sizeof cpus, &cpus), 0);
    int last = CPU_SETSIZE - 1;
    while (last > 0 && !CPU_ISSET(static_cast<std::size_t>(last), &cpus)) --last;
    return last;
}

TEST(RealTime, KeepsAThreadToItsCpu) {
    const int cpu = last_cpu_of_this_process();
    int ran_on = -1;
    const auto setup = set_up({"one", 0, cpu}, [&] { ran_on = ::sched_getcpu(); });
    EXPECT_EQ(setup.cpus, std::to_string(cpu));
    EXPECT_TRUE(setup.missing.empty());
    EXPECT_EQ(ran_on, cpu);
}

TEST(RealTime, TellsOfACpuThatIsNotThereAndRunsOnTheOthers) {
    const auto any = set_up({"any"});
    const auto setup = set_up({"none", 0, 1023});
    ASSERT_EQ(setup.missing.size(), 1U);
    EXPECT_EQ(setup.missing[0], "CPU 1023: Invalid argument; it runs on " + any.cpus);
    EXPECT_EQ(setup.cpus, any.cpus);
    EXPECT_FALSE(any.cpus.empty());
}

TEST(RealTime, HasTheRealTimePriorityOrTellsTheLimit) {
    const auto setup = set_up({"first", 3});
    if (setup.fifo_priority == 3) {
        EXPECT_TRUE(setup.missing.empty());
    } else {
        EXPECT_EQ(setup.fifo_priority, 0);
        ASSERT_EQ(setup.missing.size(), 1U);
        EXPECT_THAT(setup.missing[0], HasSubstr("SCHED_FIFO 3: "));
        EXPECT_THAT(setup.missing[0], HasSubstr("the limit is "));
    }
}

/// True if `body` is, in a process of its own: what is locked stays locked.
bool in_a_process(const std::function<bool()>& body) {
    const pid_t child = ::fork();
    if (child == 0) ::_exit(body() ? 0 : 1);
    int status = -1;
    EXPECT_EQ(::waitpid(child, &status, 0), child);
    return status == 0;
}

TEST(RealTime, TellsWhyAPriorityCouldNotBeHad) {
    // GIVEN a process that may have none
    EXPECT_TRUE(in_a_process([] {
        const rlimit none{0, 0};
        const bool bare = ::setrlimit(RLIMIT_RTPRIO, &none) == 0 &&
                          (::geteuid() != 0 || ::setresuid(65534, 65534, 65534) == 0);
        const auto setup = set_up_this_thread({"first", 3});
        return bare && setup.fifo_priority == 0 && setup.missing.size() == 1 &&
               setup.missing[0].find("SCHED_FIFO 3: Operation not permitted; the limit is 0 ") == 0;
    }));
}

// Sanitizers answer for mlockall, and touch memory of their own.
#ifndef VIBRIG_SANITIZED
std::uint64_t locked_kb() {
    std::ifstream status("/proc/self/status");
    for (std::string word; status >> word;)
        if (word == "VmLck:") break;
    std::uint64_t kb = 0;
    status >> kb;
    return kb;
}

TEST(RealTime, LocksTheMemoryOrTellsTheLimit) {
    EXPECT_TRUE(in_a_process([] {
        const auto lock = lock_memory();
        return lock.locked == lock.cause.empty() && lock.locked == (locked_kb() > 0);
    }));
}

TEST(RealTime, LocksNothingWhereTheLimitWouldBeMetNowOrLater) {
    // GIVEN a process without a capability that may lock little, or all it has now and not what is
    // to come (where it may be given so much)
    for (const rlim_t bytes : {rlim_t{65536}, rlim_t{900} << 20}) {
        EXPECT_TRUE(in_a_process([bytes] {
            rlimit limit{};
            bool right = ::getrlimit(RLIMIT_MEMLOCK, &limit) == 0;
            limit.rlim_cur = std::min(bytes, limit.rlim_max);
            right = right && ::setrlimit(RLIMIT_MEMLOCK, &limit) == 0 &&
                    (::geteuid() != 0 || ::setresuid(65534, 65534, 65534) == 0);
            // WHEN it is to lock its memory, THEN it tells the limit, and has address space as
            // before
            const auto lock = lock_memory();
            void* const room = ::mmap(nullptr, std::size_t{2} << 30, PROT_NONE,
                                      MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
            const std::string stated = "; the limit is " + std::to_string(limit.rlim_cur);
            return right && !lock.locked && lock.cause.find(stated) != std::string::npos &&
                   locked_kb() == 0 && room != MAP_FAILED;
        })) << bytes;
    }
}
TEST(RealTime, CountsPageFaultsOfTheThreadAlone) {
    constexpr std::size_t kPages = 64;
    const auto touch = [] {
        const std::size_t size = kPages * static_cast<std::size_t>(::sysconf(_SC_PAGESIZE));
        void* const memory =
            ::mmap(nullptr, size, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
        ASSERT_NE(memory, MAP_FAILED);
        ::madvise(memory, size, MADV_NOHUGEPAGE);
        std::memset(memory, 1, size);
        ::munmap(memory, size);
    };
    PageFaults after;
    const auto setup = set_up({"faults"}, [&] {
        touch();
        after = page_faults_of_this_thread();
    });
    EXPECT_GE(after.minor - setup.faults.minor, kPages);
    // what is touched by another thread is that one's
    const auto other = set_up({"other"}, [&] {
        std::thread(touch).join();
        after = page_faults_of_this_thread();
    });
    EXPECT_LT(after.minor - other.faults.minor, kPages);
}

TEST(RealTime, TheStackIsThereOnceAThreadIsSetUp) {
    PageFaults after;
    const auto setup = set_up({"deep"}, [&] {
        const std::function<int(int)> deeper = [&deeper](int left) {
            volatile char page[4096];
            page[0] = static_cast<char>(left);
            return page[0] + (left > 0 ? deeper(left - 1) : 0);
        };
        EXPECT_NE(deeper(40), 1);  // well within what was touched
        after = page_faults_of_this_thread();
    });
    EXPECT_LT(after.minor - setup.faults.minor, 20U);
}

#endif

TEST(Lateness, CountsWhatIsLaterThanItsBoundAndKeepsTheLongest) {
    Lateness lateness;
    lateness.add(kSecond);
    EXPECT_EQ(lateness.misses, 0U) << "without a bound nothing is late";
    lateness = {25 * kMillisecond};
    for (const drivers::Time taken : {kMillisecond, 25 * kMillisecond, 26 * kMillisecond})
        lateness.add(taken);
    EXPECT_EQ(lateness.misses, 1U);
    EXPECT_EQ(lateness.longest, 26 * kMillisecond);
}

TEST(HandOver, KeepsTheOldestUntilItIsTaken) {
    HandOver hand;
    EXPECT_EQ(hand.taken(), 0);
    hand.given(5);
    hand.given(7);
    EXPECT_EQ(hand.taken(), 5);
    EXPECT_EQ(hand.taken(), 0);
    hand.given(9);
    EXPECT_EQ(hand.taken(), 9);
}

/// Time stands where the test puts it.
struct StandingClock final : drivers::Clock {
    drivers::Time time = kSecond;
    [[nodiscard]] drivers::Time now() const noexcept override { return time; }
    std::unique_ptr<drivers::Waiter> make_waiter() override { return RealClock().make_waiter(); }
};

TEST(EstimatorStage, CountsSamplesItIsDoneWithTooLate) {
    // GIVEN a stage that may take 25 ms, and a sample handed over before it begins
    for (const drivers::Time late : {24 * kMillisecond, 26 * kMillisecond}) {
        StandingClock clock;
        const auto self = clock.make_waiter(), control = clock.make_waiter();
        Ring<drivers::Sample> ring(16);
        estimator::Identification identification{estimator::Settings{}};
        EstimatorStage stage(ring, *self, *control, identification);
        stage.time_by(clock, 25 * kMillisecond);
        HandOver& hand = stage.hand_over();
        drivers::Sample sample;
        sample.time = clock.time;
        ASSERT_TRUE(ring.try_push(sample));
        hand.given(clock.time);
        // WHEN it comes to it so much later
        clock.time += late;
        std::thread thread([&] { stage.run(); });
        self->notify();
        while (stage.view().taken == 0) std::this_thread::yield();
        stage.stop();
        thread.join();
        // THEN only what is later than the bound is a miss
        EXPECT_EQ(stage.view().lateness.misses, late > 25 * kMillisecond ? 1U : 0U);
        EXPECT_EQ(stage.view().lateness.longest, late);
    }
}

TEST(EstimatorStage, WhatGathersWantsToBeToldOfTheDwellsEndAndOfDisplays) {
    // GIVEN a stage that gathers, ordered a dwell from 1 s to 1.35 s
    StandingClock clock;
    const auto self = clock.make_waiter(), control = clock.make_waiter();
    Ring<drivers::Sample> ring(64);
    estimator::Identification identification{estimator::Settings{}};
    EstimatorStage stage(ring, *self, *control, identification);
    const HandOver& hand = stage.hand_over();
    EXPECT_TRUE(hand.wants(0)) << "who does not gather is told of each";
    stage.gather();
    DwellOrder order;
    order.from = kSecond;
    order.to = kSecond + 350 * kMillisecond;
    ASSERT_TRUE(stage.order(order));
    drivers::Sample sample;
    for (sample.time = kSecond; sample.time <= order.from + 200 * kMillisecond;
         sample.time += 25 * kMillisecond)
        ASSERT_TRUE(ring.try_push(sample));
    stage.work();
    // THEN what lies before both may wait
    EXPECT_EQ(stage.view().in_dwell, 9U);
    EXPECT_FALSE(hand.wants(order.to - 1));
    EXPECT_TRUE(hand.wants(order.to));
    // WHEN the dwell is given up, THEN what had come and was not told of is in it, and afterwards
    // the next display is what it waits for
    sample.time = order.from + 225 * kMillisecond;
    ASSERT_TRUE(ring.try_push(sample));
    DwellOrder cancel;
    cancel.cancel = true;
    ASSERT_TRUE(stage.order(cancel));
    stage.work();
    DwellDone done;
    ASSERT_TRUE(stage.take_done(done));
    EXPECT_EQ(done.summary.samples, 10U);
    EXPECT_FALSE(hand.wants(order.to));
    EXPECT_TRUE(hand.wants(sample.time + 200 * kMillisecond));
}

/// CPUs a thread may run on.
cpu_set_t cpus_of(pthread_t thread) {
    cpu_set_t set;
    CPU_ZERO(&set);
    EXPECT_EQ(::pthread_getaffinity_np(thread, sizeof set, &set), 0);
    return set;
}

TEST(EstimatorStage, WorksWhereItIsGivenSamples) {
    // GIVEN a stage that stays by the giver, and as many CPUs as this machine lends us
    const cpu_set_t all = cpus_of(::pthread_self());
    StandingClock clock;
    const auto self = clock.make_waiter(), control = clock.make_waiter();
    Ring<drivers::Sample> ring(16);
    estimator::Identification identification{estimator::Settings{}};
    EstimatorStage stage(ring, *self, *control, identification);
    stage.time_by(clock, kSecond);
    HandOver& hand = stage.hand_over();
    stage.stay_by_giver();
    std::thread thread([&] { stage.run(); });
    const cpu_set_t at_first = cpus_of(thread.native_handle());
    EXPECT_TRUE(CPU_EQUAL(&all, &at_first));
    // WHEN samples come from one CPU after the other
    for (int cpu = 0; cpu < CPU_SETSIZE; ++cpu) {
        if (!CPU_ISSET(static_cast<std::size_t>(cpu), &all)) continue;
        hand.given(clock.time, cpu);
        self->notify();
        // THEN it comes along
        const auto there = [&] {
            const cpu_set_t set = cpus_of(thread.native_handle());
            return CPU_COUNT(&set) == 1 && CPU_ISSET(static_cast<std::size_t>(cpu), &set);
        };
        while (!there()) std::this_thread::yield();
    }
    stage.stop();
    thread.join();
}

}  // namespace
}  // namespace vibrig::rt
