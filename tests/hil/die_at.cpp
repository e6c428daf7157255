// SIGKILL between two lines: preloaded before an unmodified program, it counts the calls that leave
// it, to a disk or a wire, from the moment on at which the file DIE_AT exists, and lets the program
// die before the one whose number stands there; with a name beside the number only calls of that
// name count, of which "sync" is whatever brings a file to the disk.
#include <dlfcn.h>
#include <fcntl.h>
#include <sys/socket.h>
#include <sys/types.h>
#include <unistd.h>

#include <atomic>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>

namespace {

void count(const char* what, const char* kind = "") {
    static const char* const path = std::getenv("DIE_AT");
    static std::atomic<int> calls{0};
    char text[32] = {}, wanted[16] = {};
    int number = 0;
    const int file = path == nullptr ? -1 : ::open(path, O_RDONLY | O_CLOEXEC);
    if (file < 0) return;
    const ssize_t size = ::read(file, text, sizeof text - 1);
    ::close(file);
    if (size <= 0 || std::sscanf(text, "%d %15s", &number, wanted) < 1) return;
    if (wanted[0] != 0 && std::strcmp(wanted, what) != 0 && std::strcmp(wanted, kind) != 0) return;
    if (++calls != number) return;
    ::dprintf(STDERR_FILENO, "killed before %s\n", what);
    ::kill(::getpid(), SIGKILL);
}

template <typename Function>
Function real(const char* name) {
    return reinterpret_cast<Function>(::dlsym(RTLD_NEXT, name));
}

}  // namespace

extern "C" {

ssize_t write(int file, const void* bytes, size_t size) {
    static const auto next = real<ssize_t (*)(int, const void*, size_t)>("write");
    if (size != sizeof(std::uint64_t)) count("write");  // that much is an eventfd, and stays inside
    return next(file, bytes, size);
}
ssize_t pwrite64(int file, const void* bytes, size_t size, off_t at) {
    static const auto next = real<ssize_t (*)(int, const void*, size_t, off_t)>("pwrite64");
    count("pwrite64");
    return next(file, bytes, size, at);
}
ssize_t send(int file, const void* bytes, size_t size, int flags) {
    static const auto next = real<ssize_t (*)(int, const void*, size_t, int)>("send");
    count("send");
    return next(file, bytes, size, flags);
}
ssize_t sendmsg(int file, const msghdr* message, int flags) {
    static const auto next = real<ssize_t (*)(int, const msghdr*, int)>("sendmsg");
    count("sendmsg");
    return next(file, message, flags);
}
int fsync(int file) {
    static const auto next = real<int (*)(int)>("fsync");
    count("fsync", "sync");
    return next(file);
}
int fdatasync(int file) {
    static const auto next = real<int (*)(int)>("fdatasync");
    count("fdatasync", "sync");
    return next(file);
}
int rename(const char* from, const char* to) {
    static const auto next = real<int (*)(const char*, const char*)>("rename");
    count("rename");
    return next(from, to);
}
}
