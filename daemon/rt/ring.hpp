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

/// What a ring hands over: plain data with two fields for the ring, which whoever pushes leaves 0.
template <typename T>
concept RingRecord = std::is_trivially_copyable_v<T> && std::is_standard_layout_v<T> &&
    std::is_same_v<decltype(T::dropped_before), std::uint32_t> &&
    std::is_same_v<decltype(T::published_to), std::uint64_t>;

/// Lock-free ring for one producer and one consumer thread. A full ring drops the newest record,
/// counts it, and the next record that fits carries the count in its `dropped_before`. Neither side
/// waits, locks or allocates.
///
/// The consumer looks for the next record in the slot where it will be, not at an index of the
/// producer's: the line that says "here" brings the record with it, so that a record alone costs
/// one trip between the processors instead of two. The first record of a push says in its
/// `published_to` where the push ends.
template <RingRecord T>
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
        const std::size_t n = std::min(records.size(), room);
        if (n > 0) {
            T& first = slots_[static_cast<std::size_t>(head & mask_)];
            if (n > 1) copy_rest(records.first(n), head);
            copy_but_published(records.front(), first);
            if (unreported_ > 0) {
                first.dropped_before += unreported_;
                unreported_ = 0;
            }
            head_.store(head + n, std::memory_order_relaxed);
            published_to(first).store(head + n, std::memory_order_release);
        }
        if (const std::size_t lost = records.size() - n; lost > 0) lose(lost);
        return n;
    }

    /// Consumer only. Calls f(const T&) in place for up to `at_most` records and frees them with
    /// one store.
    template <typename F>
    std::size_t consume(F&& f, std::size_t at_most = 32) noexcept {
        const std::uint64_t tail = tail_.load(std::memory_order_relaxed);
        std::size_t n = 0;
        while (n < at_most) {
            const std::uint64_t next = tail + n;
            const auto at = static_cast<std::size_t>(next & mask_);
            if (next == known_head_) {
                // What an earlier round left there is at most `next`.
                const std::uint64_t to = published_to(slots_[at]).load(std::memory_order_acquire);
                if (to <= next) break;
                known_head_ = to;
            }
            const std::size_t run = std::min(
                {static_cast<std::size_t>(known_head_ - next), at_most - n, mask_ + 1 - at});
            const T* const slot = &slots_[at];
            for (std::size_t i = 0; i < run; ++i) f(slot[i]);
            n += run;
        }
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
    static std::atomic_ref<std::uint64_t> published_to(T& slot) noexcept {
        using Mark = std::atomic_ref<std::uint64_t>;
        static_assert(Mark::is_always_lock_free && alignof(T) % Mark::required_alignment == 0 &&
                      offsetof(T, published_to) % Mark::required_alignment == 0);
        return std::atomic_ref<std::uint64_t>(slot.published_to);
    }

    /// The consumer may look at the slot's `published_to` meanwhile.
    static void copy_but_published(const T& from, T& to) noexcept {
        constexpr std::size_t begin = offsetof(T, published_to);
        constexpr std::size_t end = begin + sizeof(T::published_to);
        auto* const bytes = reinterpret_cast<std::byte*>(&to);
        const auto* const source = reinterpret_cast<const std::byte*>(&from);
        std::memcpy(bytes, source, begin);
        std::memcpy(bytes + end, source + end, sizeof(T) - end);
    }

    /// All but the first, in two runs: to the last slot and from the first. The consumer looks at
    /// none of them before the first one is published; but in the next round it may, and must not
    /// find what came along from another ring.
    void copy_rest(std::span<const T> records, std::uint64_t head) noexcept {
        const auto at = static_cast<std::size_t>(head & mask_);
        const std::size_t run = std::min(records.size(), mask_ + 1 - at);
        copy(records.data() + 1, run - 1, &slots_[at] + 1);
        if (records.size() > run) copy(records.data() + run, records.size() - run, slots_.get());
        std::uint64_t foreign = 0;
        for (const T& record : records) foreign |= record.published_to;
        if (foreign == 0) return;
        for (std::size_t i = 1; i < records.size(); ++i) slots_[(at + i) & mask_].published_to = 0;
    }

    /// A processor that is made to copy whole lines does not fetch them first, a tenth of a batch's
    /// time; memcpy() does so from some length on alone. What checks memory accesses sees memcpy().
    static void copy(const T* from, std::size_t n, T* to) noexcept {
        std::size_t bytes = n * sizeof(T);
#if defined(__x86_64__) && !defined(VIBRIG_SANITIZED)
        asm volatile("rep movsb" : "+S"(from), "+D"(to), "+c"(bytes) : : "memory");
#else
        std::memcpy(static_cast<void*>(to), from, bytes);
#endif
    }

    /// Out of the way of a push that fits, which is a fifth faster so.
    [[gnu::noinline]] void lose(std::size_t lost) noexcept {
        unreported_ += static_cast<std::uint32_t>(lost);
        dropped_.store(dropped_.load(std::memory_order_relaxed) + lost, std::memory_order_relaxed);
    }

    // Indices grow for ever and are masked on use, so "full" and "empty" differ without a spare
    // slot. Each side has one line: besides its index, a copy of the other's, so that the
    // consumer's line is read only when the copy says full, and the producer's only by counts().
    // What counts the lost, at each try while the ring is full, is on a line of its own.
    // Processors fetch lines in pairs, so that each has both.
    static constexpr std::size_t kPairOfLines = 128;
    alignas(kPairOfLines) std::atomic<std::uint64_t> head_{0};
    std::uint64_t cached_tail_ = 0;
    alignas(kPairOfLines) std::atomic<std::uint64_t> tail_{0};
    std::uint64_t known_head_ = 0;
    alignas(kPairOfLines) std::uint32_t unreported_ = 0;
    std::atomic<std::uint64_t> dropped_{0};
    alignas(kPairOfLines) std::size_t mask_;
    std::unique_ptr<T[]> slots_;
};

}  // namespace vibrig::rt
