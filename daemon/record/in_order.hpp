#pragma once

#include <algorithm>
#include <condition_variable>
#include <cstddef>
#include <exception>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

namespace vibrig::record {

/// What `make(0)`, `make(1)` ... give, one after the other, but made ahead in threads of its own:
/// by one thread in this order, by several at the same time. As many are kept as there are threads,
/// and one more, so that memory does not grow with their number.
template <typename T>
class InOrder {
  public:
    /// Nothing: it was the last one before.
    using Make = std::function<std::optional<T>(std::size_t)>;

    InOrder(Make make, unsigned threads) : make_(std::move(make)), most_(threads + 1) {
        try {
            while (threads_.size() < threads) threads_.emplace_back([this] { work(); });
        } catch (...) {
            end();
            throw;
        }
    }
    ~InOrder() { end(); }
    InOrder(const InOrder&) = delete;
    InOrder& operator=(const InOrder&) = delete;

    /// The next one; nothing: there is none. What `make` threw is thrown in its place.
    [[nodiscard]] std::optional<T> next() {
        std::unique_lock lock(mutex_);
        changed_.wait(lock, [&] { return made_.contains(taken_); });
        Made made = std::move(made_.at(taken_));
        if (!made.value) {  // that it is over stays
            if (made.why) std::rethrow_exception(made.why);
            return std::nullopt;
        }
        made_.erase(taken_++);
        changed_.notify_all();
        return std::move(made.value);
    }

  private:
    struct Made {
        std::optional<T> value;
        std::exception_ptr why = nullptr;
    };

    void work() {
        std::unique_lock lock(mutex_);
        for (;;) {
            changed_.wait(lock, [&] { return over_ || begun_ < taken_ + most_; });
            if (over_) return;
            const std::size_t number = begun_++;
            lock.unlock();
            Made made;
            try {
                made.value = make_(number);
            } catch (...) {
                made.why = std::current_exception();
            }
            lock.lock();
            over_ = over_ || !made.value;
            made_.insert_or_assign(number, std::move(made));
            changed_.notify_all();
        }
    }
    void end() {
        {
            const std::scoped_lock lock(mutex_);
            over_ = true;
        }
        changed_.notify_all();
        for (std::thread& thread : threads_) thread.join();
    }

    const Make make_;
    const std::size_t most_;
    std::mutex mutex_;
    std::condition_variable changed_;
    std::map<std::size_t, Made> made_;
    std::size_t begun_ = 0, taken_ = 0;
    bool over_ = false;  ///< no more are begun
    std::vector<std::thread> threads_;
};

}  // namespace vibrig::record
