// What the threads that a sample passes are given of real time, and what they have had of it.
#include <pthread.h>

#include <future>

#include "daemon/app/daemon.hpp"

namespace vibrig {

bool Daemon::in_real_time() const noexcept {
    return configuration_.clock == configuration::Configuration::ClockKind::real;
}

rt::MemoryLock Daemon::lock_memory() const {
    rt::give_large_blocks_back();
    if (!in_real_time()) return {false, "not asked for: the rig owns the time"};
    if (!configuration_.lock_memory) return {false, "not asked for: threads.lock_memory is false"};
    return rt::lock_memory();
}

void Daemon::start_threads() {
    const auto begin = [this](std::thread& thread, rt::ThreadSetup& setup, rt::ThreadWishes wishes,
                              auto body) {
        // The rig waits for us where it owns the time: a thread that comes first is only woken for
        // every frame instead of every sample.
        if (!in_real_time()) wishes = {wishes.name};
        std::promise<rt::ThreadSetup> promise;
        auto ready = promise.get_future();
        thread = std::thread([wishes, body, done = std::move(promise)]() mutable {
            done.set_value(rt::set_up_this_thread(wishes));
            body();
        });
        auto done = ready.get();
        for (const auto& what : done.missing) log(Severity::warning, wishes.name, what);
        const std::lock_guard lock(mutex_);
        setup = std::move(done);
    };
    if (in_real_time() && configuration_.lock_memory && !memory_lock_.locked)
        log(Severity::warning, "memory", "not locked: " + memory_lock_.cause);
    control_thread_ = std::thread([this] {
        ::pthread_setname_np(::pthread_self(), "control");
        control_loop();
    });
    begin(estimator_thread_, estimator_setup_,
          {"estimator", configuration_.estimator_priority, configuration_.estimator_cpu},
          [this] { estimator_stage_.run(); });
    begin(acquisition_thread_, acquisition_setup_,
          {"acquisition", configuration_.acquisition_priority, configuration_.acquisition_cpu},
          [this] { io_.run(); });
}

RealTimeStatus Daemon::real_time_status(const rt::AcquisitionView& acquired,
                                        const rt::EstimatorView& estimated) const {
    RealTimeStatus status;
    status.memory_locked = memory_lock_.locked;
    if (!memory_lock_.locked) status.missing.push_back("memory: " + memory_lock_.cause);
    if (const auto bound = acquired.lateness.bound; bound != drivers::kNever)
        status.deadline_ms = 1e3 * drivers::to_seconds(bound);
    const auto add = [&status](const char* name, const rt::ThreadSetup& setup,
                               const rt::Lateness& lateness, const rt::PageFaults& faults) {
        for (const auto& what : setup.missing) status.missing.push_back(name + (": " + what));
        const auto since = [](std::uint64_t now, std::uint64_t then) {
            return now > then ? now - then : 0;
        };
        status.threads.push_back({name, setup.fifo_priority, setup.cpus,
                                  since(faults.major, setup.faults.major),
                                  since(faults.minor, setup.faults.minor), lateness.misses,
                                  1e3 * drivers::to_seconds(lateness.longest)});
    };
    const std::lock_guard lock(mutex_);  // its strings come while start() is under way
    add("acquisition", acquisition_setup_, acquired.lateness, acquired.faults);
    add("estimator", estimator_setup_, estimated.lateness, estimated.faults);
    return status;
}

}  // namespace vibrig
