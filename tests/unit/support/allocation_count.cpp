// Without a sanitizer every form of operator new is replaced: all must fit together,
// because std::stable_sort takes the non-throwing ones. It stands in a translation unit of its own
// so that no caller is compiled against these definitions.
#include "tests/unit/support/allocation_count.hpp"

#include <atomic>
#include <cstddef>
#include <cstdlib>
#include <new>
#ifdef VIBRIG_SANITIZED
#include <sanitizer/allocator_interface.h>
#endif

namespace {

thread_local std::uint64_t count = 0;
thread_local bool watched = false;
std::atomic<std::uint64_t> watched_count{0};

void note() noexcept {
    ++count;
    if (watched) watched_count.fetch_add(1, std::memory_order_relaxed);
}

}  // namespace

namespace vibrig::test {
std::uint64_t allocations() noexcept { return count; }
void watch_this_thread() noexcept { watched = true; }
std::uint64_t watched_allocations() noexcept {
    return watched_count.load(std::memory_order_relaxed);
}
}  // namespace vibrig::test

#ifdef VIBRIG_SANITIZED
// The sanitizer has its own malloc and operators, and tells of each.
namespace {
[[maybe_unused]] const int kInstalled = __sanitizer_install_malloc_and_free_hooks(
    [](const volatile void*, std::size_t) { note(); }, [](const volatile void*) {});
}  // namespace
#else
namespace {
void* counted(std::size_t size, std::size_t alignment) noexcept {
    note();
    const std::size_t rounded = (size + alignment - 1) / alignment * alignment;
    return std::aligned_alloc(alignment, rounded == 0 ? alignment : rounded);
}

void* counted_or_throw(std::size_t size, std::size_t alignment) {
    if (void* memory = counted(size, alignment)) return memory;
    throw std::bad_alloc();
}

constexpr std::size_t kDefault = alignof(std::max_align_t);
std::size_t bytes(std::align_val_t a) noexcept { return static_cast<std::size_t>(a); }

}  // namespace

void* operator new(std::size_t n) { return counted_or_throw(n, kDefault); }
void* operator new[](std::size_t n) { return counted_or_throw(n, kDefault); }
void* operator new(std::size_t n, std::align_val_t a) { return counted_or_throw(n, bytes(a)); }
void* operator new[](std::size_t n, std::align_val_t a) { return counted_or_throw(n, bytes(a)); }
void* operator new(std::size_t n, const std::nothrow_t&) noexcept { return counted(n, kDefault); }
void* operator new[](std::size_t n, const std::nothrow_t&) noexcept { return counted(n, kDefault); }
void operator delete(void* p) noexcept { std::free(p); }
void operator delete[](void* p) noexcept { std::free(p); }
void operator delete(void* p, std::size_t) noexcept { std::free(p); }
void operator delete[](void* p, std::size_t) noexcept { std::free(p); }
void operator delete(void* p, const std::nothrow_t&) noexcept { std::free(p); }
void operator delete[](void* p, const std::nothrow_t&) noexcept { std::free(p); }
void operator delete(void* p, std::align_val_t) noexcept { std::free(p); }
void operator delete[](void* p, std::align_val_t) noexcept { std::free(p); }
void operator delete(void* p, std::size_t, std::align_val_t) noexcept { std::free(p); }
void operator delete[](void* p, std::size_t, std::align_val_t) noexcept { std::free(p); }

extern "C" {
void* __libc_malloc(std::size_t size);  // glibc's own entry
void* malloc(std::size_t size) noexcept {
    note();
    return __libc_malloc(size);
}
}
#endif
