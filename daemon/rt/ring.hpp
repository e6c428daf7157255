#pragma once

#include <algorithm>
#include <atomic>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <type_traits>

namespace vibrig::rt {

struct RingCounts {
    std::uint64_t pushed = 0, popped = 0, dropped = 0;
};

/// Lock-free ring for one producer and one consumer thread. A full ring drops the newest record,
/// counts it, and the next record that fits carries the count in its `dropped_before`. Neither side
/// waits, locks or allocates.
template <typename T>
requires std::is_trivially_copyable_v<T> && requires(T t) { t.dropped_before = 1U; }
class Ring {
  public:
    /// Throws std::invalid_argument unless capacity is a power of two.
    explicit Ring(std::size_t capacity) : mask_(capacity - 1) {
        if (!std::has_single_bit(capacity)) {
            throw std::invalid_argument("ring capacity: must be a power of two, got " +
                                        std::to_string(capacity));
        }
        slots_ = std::make_unique<T[]>(capacity);
    }

    /// Producer only. False: dropped and counted.
    bool try_push(const T& record) noexcept { return push_n({&record, 1}) == 1; }

    /// Producer only. Publishes all that fit with one store; returns how many. The rest is dropped
    /// and counted.
    std::size_t push_n(std::span<const T> records) noexcept {
        const std::uint64_t head = head_.load(std::memory_order_relaxed);
        const std::uint64_t capacity = mask_ + 1;
        if (head + records.size() - cached_tail_ > capacity) {
            cached_tail_ = tail_.load(std::memory_order_acquire);
        }
        const auto room = static_cast<std::size_t>(capacity - (head - cached_tail_));
        const std::size_t n = records.size() < room ? records.size() : room;
        if (n > 0) {
            // In two runs, to the last slot and from the first: an index masked for each record
            // costs a batch a quarter of its time.
            const auto at = static_cast<std::size_t>(head & mask_);
            const std::size_t first = std::min(n, mask_ + 1 - at);
            copy(records.data(), first, &slots_[at]);
            if (n > first) copy(records.data() + first, n - first, slots_.get());
            if (unreported_ > 0) {
                slots_[at].dropped_before += unreported_;
                unreported_ = 0;
            }
            head_.store(head + n, std::memory_order_release);
        }
        if (const std::size_t lost = records.size() - n; lost > 0) lose(lost);
        return n;
    }

    /// Consumer only. Calls f(const T&) in place for up to `at_most` records and frees them with
    /// one store.
    template <typename F>
    std::size_t consume(F&& f, std::size_t at_most = 32) noexcept {
        const std::uint64_t tail = tail_.load(std::memory_order_relaxed);
        if (cached_head_ - tail < at_most) cached_head_ = head_.load(std::memory_order_acquire);
        const auto waiting = static_cast<std::size_t>(cached_head_ - tail);
        const std::size_t n = waiting < at_most ? waiting : at_most;
        const auto at = static_cast<std::size_t>(tail & mask_);
        const std::size_t first = std::min(n, mask_ + 1 - at);
        for (std::size_t i = 0; i < first; ++i) f(static_cast<const T&>(slots_[at + i]));
        for (std::size_t i = 0; i < n - first; ++i) f(static_cast<const T&>(slots_[i]));
        if (n > 0) tail_.store(tail + n, std::memory_order_release);
        return n;
    }

    /// Any thread. offered = pushed + dropped, pushed = popped + waiting.
    [[nodiscard]] RingCounts counts() const noexcept {
        // The consumer's index first: read the other way round, popped could exceed pushed.
        const std::uint64_t popped = tail_.load(std::memory_order_acquire);
        return {head_.load(std::memory_order_acquire), popped,
                dropped_.load(std::memory_order_relaxed)};
    }

  private:
    /// memcpy() and no loop: a processor that copies whole lines does not fetch them first, a fifth
    /// of a batch's time.
    static void copy(const T* from, std::size_t n, T* to) noexcept {
        std::memcpy(static_cast<void*>(to), from, n * sizeof(T));
    }

    /// Out of the way of a push that fits, which is a fifth faster so.
    [[gnu::noinline]] void lose(std::size_t lost) noexcept {
        unreported_ += static_cast<std::uint32_t>(lost);
        dropped_.store(dropped_.load(std::memory_order_relaxed) + lost, std::memory_order_relaxed);
    }

    // Indices grow for ever and are masked on use, so "full" and "empty" differ without a spare
    // slot. Each side has one line, which the other side looks at: besides its index, a copy of the
    // other's index, so that the other's line is read only when the copy says full or empty. A push
    // writes nothing there but the index, since each write takes the line away from the side that
    // looks: what counts the lost, at each try while the ring is full, is on a line of its own.
    // Processors fetch lines in pairs, so that each has both.
    static constexpr std::size_t kPairOfLines = 128;
    alignas(kPairOfLines) std::atomic<std::uint64_t> head_{0};
    std::uint64_t cached_tail_ = 0;
    alignas(kPairOfLines) std::atomic<std::uint64_t> tail_{0};
    std::uint64_t cached_head_ = 0;
    alignas(kPairOfLines) std::uint32_t unreported_ = 0;
    std::atomic<std::uint64_t> dropped_{0};
    alignas(kPairOfLines) std::size_t mask_;
    std::unique_ptr<T[]> slots_;
};

}  // namespace vibrig::rt
