#pragma once

#include <array>
#include <boost/system/error_code.hpp>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <new>

namespace vibrig::drivers {

/// Storage of a port's two pending operations (socket, timer), so that waiting never allocates. It
/// outlives the port while an operation is pending; `generation` tells a late completion that its
/// port has gone on without it.
struct PendingOperations {
    struct Slot {
        alignas(std::max_align_t) std::array<std::byte, 256> bytes;
        bool in_use = false;
    };
    std::array<Slot, 2> slots{};
    std::uint64_t generation = 0;

    [[nodiscard]] void* allocate(std::size_t size) {
        for (Slot& slot : slots) {
            if (!slot.in_use && size <= slot.bytes.size()) {
                slot.in_use = true;
                return slot.bytes.data();
            }
        }
        return ::operator new(
            size);  // a cancelled operation still holds its slot: only while reconnecting
    }

    void release(void* memory) noexcept {
        for (Slot& slot : slots) {
            if (memory == slot.bytes.data()) {
                slot.in_use = false;
                return;
            }
        }
        ::operator delete(memory);
    }
};

template <typename T>
struct PendingAllocator {
    using value_type = T;
    std::shared_ptr<PendingOperations> pending;

    explicit PendingAllocator(std::shared_ptr<PendingOperations> p) noexcept
        : pending(std::move(p)) {}
    template <typename U>
    explicit(false) PendingAllocator(const PendingAllocator<U>& other) noexcept
        : pending(other.pending) {}
    [[nodiscard]] T* allocate(std::size_t n) {
        return static_cast<T*>(pending->allocate(n * sizeof(T)));
    }
    void deallocate(T* memory, std::size_t) noexcept { pending->release(memory); }
    template <typename U>
    bool operator==(const PendingAllocator<U>& other) const noexcept {
        return pending == other.pending;
    }
};

/// What Asio calls when an operation is over: nothing, if it was cancelled or its port stopped
/// meanwhile.
template <typename Function>
struct Completion {
    std::shared_ptr<PendingOperations> pending;
    std::uint64_t generation;
    Function function;

    using allocator_type = PendingAllocator<void>;
    [[nodiscard]] allocator_type get_allocator() const noexcept { return allocator_type(pending); }
    void operator()(const boost::system::error_code& error) {
        if (!error && generation == pending->generation) function();
    }
};

}  // namespace vibrig::drivers
