#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <type_traits>

namespace vibrig::rt {

/// The newest value of one writer, for any number of readers. Neither side waits for the other:
/// there are four slots, so a writer that is put aside half-way leaves the newest complete value
/// readable, and a reader only tries again when it was overtaken by three values meanwhile.
template <typename T>
requires std::is_trivially_copyable_v<T> && std::is_default_constructible_v<T>
class Snapshot {
  public:
    Snapshot() noexcept { publish(T{}); }

    /// Writer only.
    void publish(const T& value) noexcept {
        Words words{};
        std::memcpy(words.data(), &value, sizeof(T));
        const std::uint64_t next = published_.load(std::memory_order_relaxed) + 1;
        auto& slot = slots_[next % kSlots];
        for (std::size_t i = 0; i < kWords; ++i) slot[i].store(words[i], std::memory_order_release);
        published_.store(next, std::memory_order_release);
    }

    /// Any thread.
    [[nodiscard]] T read() const noexcept {
        for (;;) {
            const std::uint64_t seen = published_.load(std::memory_order_acquire);
            const auto& slot = slots_[seen % kSlots];
            Words words{};
            // Acquire: reading a word of a later value makes the publication before it visible
            // below.
            for (std::size_t i = 0; i < kWords; ++i)
                words[i] = slot[i].load(std::memory_order_acquire);
            // The writer touches this slot again only once seen + 3 is published.
            if (published_.load(std::memory_order_acquire) - seen < kSlots - 1) {
                T value;
                std::memcpy(static_cast<void*>(&value), words.data(), sizeof(T));
                return value;
            }
        }
    }

  private:
    static constexpr std::size_t kSlots = 4;
    static constexpr std::size_t kWords = (sizeof(T) + 7) / 8;
    using Words = std::array<std::uint64_t, kWords>;
    alignas(64) std::atomic<std::uint64_t> published_{0};
    std::array<std::array<std::atomic<std::uint64_t>, kWords>, kSlots> slots_{};
};

}  // namespace vibrig::rt
