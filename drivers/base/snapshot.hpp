#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <thread>
#include <type_traits>

namespace vibrig::rt {

/// The latest value of T, written by one thread, readable by any without stopping the writer (a
/// seqlock).
template <typename T>
requires std::is_trivially_copyable_v<T> && std::is_default_constructible_v<T>
class Snapshot {
  public:
    Snapshot() noexcept { publish(T{}); }

    /// Writer only; never waits.
    void publish(const T& value) noexcept {
        Words words{};
        std::memcpy(words.data(), &value, sizeof(T));
        const std::uint64_t sequence = sequence_.load(std::memory_order_relaxed);
        sequence_.store(sequence + 1, std::memory_order_relaxed);
        // Release stores instead of a fence: whoever sees a new word also sees the odd sequence.
        for (std::size_t i = 0; i < kWords; ++i)
            words_[i].store(words[i], std::memory_order_release);
        sequence_.store(sequence + 2, std::memory_order_release);
    }

    /// Any thread. Tries again while the writer is at work.
    [[nodiscard]] T read() const noexcept {
        T value;
        // A writer that was put aside half-way: no spinning, on one CPU it would never go on.
        while (!try_read(value)) std::this_thread::yield();
        return value;
    }

    /// For a thread that may not wait for the writer, which has less priority: false, and `value`
    /// as it was, while the writer is at work.
    [[nodiscard]] bool try_read(T& value) const noexcept {
        Words words{};
        const std::uint64_t before = sequence_.load(std::memory_order_acquire);
        for (std::size_t i = 0; i < kWords; ++i)
            words[i] = words_[i].load(std::memory_order_acquire);
        if (before % 2 != 0 || sequence_.load(std::memory_order_relaxed) != before) return false;
        std::memcpy(static_cast<void*>(&value), words.data(), sizeof(T));
        return true;
    }

  private:
    static constexpr std::size_t kWords = (sizeof(T) + 7) / 8;
    using Words = std::array<std::uint64_t, kWords>;
    alignas(64) std::atomic<std::uint64_t> sequence_{0};
    std::array<std::atomic<std::uint64_t>, kWords> words_{};
};

}  // namespace vibrig::rt
