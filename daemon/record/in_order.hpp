#pragma once

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

/// What is made of a source, one after the other, but ahead in threads of its own: `take` is called
/// by one of them at a time, `make` of what it gave by all at the same time. As many are kept as
/// there are threads, and one more, so that memory does not grow with their number.
template <typename Raw, typename T = Raw>
class InOrder {
  public:
    using Take = std::function<std::optional<Raw>()>;  ///< nothing: it was the last one before
    using Make = std::function<T(Raw)>;

    InOrder(Take take, Make make, unsigned threads)
        : take_(std::move(take)), make_(std::move(make)), most_(threads + 1) {
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

    /// The next one; nothing: there is none. What was thrown for it is thrown here.
    [[nodiscard]] std::optional<T> next() {
        std::unique_lock lock(mutex_);
        changed_.wait(lock, [&] { return made_.contains(given_); });
        Made& made = made_.at(given_);
        if (made.why) std::rethrow_exception(made.why);
        if (!made.value) return std::nullopt;
        std::optional<T> value = std::move(made.value);
        made_.erase(given_++);
        changed_.notify_all();
        return value;
    }

  private:
    struct Made {
        std::optional<T> value;
        std::exception_ptr why = nullptr;
    };

    /// False: it was the last.
    bool one() {
        std::unique_lock turn(turn_);
        std::size_t number = 0;
        {
            std::unique_lock lock(mutex_);
            changed_.wait(lock, [&] { return over_ || taken_ < given_ + most_; });
            if (over_) return false;
            number = taken_++;
        }
        Made made;
        try {
            if (std::optional<Raw> raw = take_()) {
                turn.unlock();
                made.value = make_(std::move(*raw));
            }
        } catch (...) {
            made.why = std::current_exception();
        }
        const bool more = made.value.has_value();
        const std::scoped_lock lock(mutex_);
        over_ = over_ || !more;
        made_.emplace(number, std::move(made));
        changed_.notify_all();
        return more;
    }
    void work() {
        while (one()) {
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

    const Take take_;
    const Make make_;
    const std::size_t most_;
    std::mutex turn_;  ///< of those that take
    std::mutex mutex_;
    std::condition_variable changed_;
    std::map<std::size_t, Made> made_;
    std::size_t taken_ = 0, given_ = 0;
    bool over_ = false;  ///< no more are begun
    std::vector<std::thread> threads_;
};

}  // namespace vibrig::record
