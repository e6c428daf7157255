#pragma once

#include <condition_variable>
#include <cstdint>
#include <functional>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>

namespace vibrig::plan {

/// One long computation at a time in a thread of its own, for somebody who may never wait. What was
/// abandoned still runs to its end, and nobody hears of it; the next one begins after it.
template <typename Result>
class Aside {
  public:
    /// `done`: called in the thread when there is a result to take.
    explicit Aside(std::function<void()> done) : done_(std::move(done)) {}
    Aside(const Aside&) = delete;
    Aside& operator=(const Aside&) = delete;
    /// Waits for the computation that is under way.
    ~Aside() {
        {
            const std::lock_guard lock(mutex_);
            over_ = true;
            waiting_ = nullptr;
        }
        changed_.notify_all();
        if (thread_.joinable()) thread_.join();
    }

    /// Takes the place of whatever was asked before.
    void ask(std::function<Result()> compute) { ask(std::move(compute), false); }
    /// For a caller that may wait; nobody is notified.
    [[nodiscard]] Result compute(std::function<Result()> what) {
        ask(std::move(what), true);
        std::unique_lock lock(mutex_);
        changed_.wait(lock, [this] { return result_.has_value(); });
        asked_ = false;
        return *std::exchange(result_, std::nullopt);
    }
    void abandon() {
        const std::lock_guard lock(mutex_);
        ++generation_;
        asked_ = false;
        result_.reset();
        waiting_ = nullptr;
    }
    /// Asked, and its result not taken yet.
    [[nodiscard]] bool asked() const {
        const std::lock_guard lock(mutex_);
        return asked_;
    }
    [[nodiscard]] std::optional<Result> take() {
        const std::lock_guard lock(mutex_);
        if (result_) asked_ = false;
        return std::exchange(result_, std::nullopt);
    }

  private:
    void ask(std::function<Result()> compute, bool waited_for) {
        const std::lock_guard lock(mutex_);
        ++generation_;
        asked_ = true;
        waited_for_ = waited_for;
        result_.reset();
        waiting_ = std::move(compute);
        if (!thread_.joinable()) thread_ = std::thread([this] { run(); });
        changed_.notify_all();
    }
    void run() {
        std::unique_lock lock(mutex_);
        for (;;) {
            changed_.wait(lock, [this] { return over_ || waiting_; });
            if (over_) return;
            const auto compute = std::exchange(waiting_, nullptr);
            const std::uint64_t mine = generation_;
            lock.unlock();
            auto found = compute();
            lock.lock();
            if (mine != generation_) continue;
            result_ = std::move(found);
            changed_.notify_all();
            if (waited_for_) continue;
            lock.unlock();
            done_();
            lock.lock();
        }
    }

    std::function<void()> done_;
    mutable std::mutex mutex_;  ///< never held while computing
    std::condition_variable changed_;
    std::function<Result()> waiting_;
    std::optional<Result> result_;
    std::uint64_t generation_ = 0;
    bool asked_ = false, waited_for_ = false, over_ = false;
    std::thread thread_;
};

}  // namespace vibrig::plan
