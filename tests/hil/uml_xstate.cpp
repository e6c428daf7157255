// Lets the User-Mode Linux kernels of 6.1 run on processors with AMX: run-in-uml preloads it there.
// They hand back the 2696 bytes of extended state that AVX-512 needs, and a host whose processor
// has more refuses with EFAULT all that is not the whole. What is added is AMX in its initial
// state, which no program in the machine can have left.
#include <elf.h>
#include <sys/ptrace.h>
#include <sys/syscall.h>
#include <sys/uio.h>
#include <unistd.h>

#include <cerrno>
#include <cstdarg>
#include <cstdint>
#include <cstring>

namespace {

constexpr std::size_t kPresentComponents =
    512;  // where the XSAVE header begins: its first word says what is in use
constexpr std::uint64_t kKnown = 0x3ff;  // x87 to PKRU: what lies in the 2696 bytes
alignas(64) char whole[1 << 16];         // only the kernel's one thread traces
std::size_t whole_size = 0;

long set_extended_state(long pid, const iovec& given) {
    if (whole_size == 0) {
        iovec all{whole, sizeof whole};
        if (syscall(SYS_ptrace, PTRACE_GETREGSET, pid, NT_X86_XSTATE, &all) != 0) return -1;
        whole_size = all.iov_len;
    }
    std::memset(whole, 0, whole_size);
    std::memcpy(whole, given.iov_base, given.iov_len < whole_size ? given.iov_len : whole_size);
    std::uint64_t present;
    std::memcpy(&present, whole + kPresentComponents, sizeof present);
    present &= kKnown;
    std::memcpy(whole + kPresentComponents, &present, sizeof present);
    iovec all{whole, whole_size};
    return syscall(SYS_ptrace, PTRACE_SETREGSET, pid, NT_X86_XSTATE, &all);
}

}  // namespace

#pragma GCC diagnostic ignored "-Wvarargs"  // the C library's own signature
extern "C" long ptrace(__ptrace_request request, ...) noexcept {
    va_list arguments;
    va_start(arguments, request);
    const long pid = va_arg(arguments, int);
    void* const address = va_arg(arguments, void*);
    void* const data = va_arg(arguments, void*);
    va_end(arguments);
    if (request == PTRACE_SETREGSET && reinterpret_cast<std::uintptr_t>(address) == NT_X86_XSTATE)
        return set_extended_state(pid, *static_cast<const iovec*>(data));
    if (request < PTRACE_PEEKTEXT || request > PTRACE_PEEKUSER)
        return syscall(SYS_ptrace, request, pid, address, data);
    long word = 0;  // these three return what they read
    if (syscall(SYS_ptrace, request, pid, address, &word) != 0) return -1;
    errno = 0;
    return word;
}
