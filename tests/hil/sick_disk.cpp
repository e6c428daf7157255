// A disk that falls ill on command, for an unmodified program: preloaded, it stands before the
// calls that write.
//   SICK_FOLDER   what lies below it is on that disk
//   SICK_CONTROL  one byte: '-' healthy, 'e' every write fails with EIO, 's' fsync takes
//   SICK_SECONDS, and SICK_BEGAN appears when the first does, 't' it takes 1 MB/s of all writers
//   together, as a disk does that nothing caches
#include <dlfcn.h>
#include <fcntl.h>
#include <sys/types.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <mutex>

namespace {

char state() {
    static const char* const path = std::getenv("SICK_CONTROL");
    char byte = '-';
    const int file = path == nullptr ? -1 : ::open(path, O_RDONLY | O_CLOEXEC);
    if (file < 0 || ::read(file, &byte, 1) != 1) byte = '-';
    if (file >= 0) ::close(file);
    return byte;
}

bool on_the_disk(int file) {
    static const char* const folder = std::getenv("SICK_FOLDER");
    char link[64], path[4096];
    std::snprintf(link, sizeof link, "/proc/self/fd/%d", file);
    const ssize_t size = ::readlink(link, path, sizeof path - 1);
    if (folder == nullptr || size <= 0) return false;
    path[size] = '\0';
    return std::strncmp(path, folder, std::strlen(folder)) == 0;
}

bool fails(int file) {
    if (!on_the_disk(file) || state() != 'e') return false;
    errno = EIO;
    return true;
}

void wait(int file) {
    const char* const seconds = std::getenv("SICK_SECONDS");
    if (seconds == nullptr || !on_the_disk(file) || state() != 's') return;
    if (const char* const began = std::getenv("SICK_BEGAN"))
        ::close(::open(began, O_WRONLY | O_CREAT | O_CLOEXEC, 0644));
    ::sleep(static_cast<unsigned>(std::atoi(seconds)));
}

/// One after the other, as long as so many bytes take.
void take_time(int file, size_t size) {
    static std::mutex disk;
    if (!on_the_disk(file) || state() != 't') return;
    const std::lock_guard one(disk);
    ::usleep(static_cast<useconds_t>(size));  // 1 MB/s: 1 us a byte
}

template <typename Function>
Function real(const char* name) {
    return reinterpret_cast<Function>(::dlsym(RTLD_NEXT, name));
}

}  // namespace

extern "C" {

ssize_t write(int file, const void* bytes, size_t size) {
    static const auto next = real<ssize_t (*)(int, const void*, size_t)>("write");
    take_time(file, size);
    return fails(file) ? -1 : next(file, bytes, size);
}
ssize_t pwrite(int file, const void* bytes, size_t size, off_t at) {
    static const auto next = real<ssize_t (*)(int, const void*, size_t, off_t)>("pwrite");
    take_time(file, size);
    return fails(file) ? -1 : next(file, bytes, size, at);
}
ssize_t pwrite64(int file, const void* bytes, size_t size, off_t at) {
    static const auto next = real<ssize_t (*)(int, const void*, size_t, off_t)>("pwrite64");
    take_time(file, size);
    return fails(file) ? -1 : next(file, bytes, size, at);
}
int fsync(int file) {
    static const auto next = real<int (*)(int)>("fsync");
    wait(file);
    return fails(file) ? -1 : next(file);
}
int fdatasync(int file) {
    static const auto next = real<int (*)(int)>("fdatasync");
    wait(file);
    return fails(file) ? -1 : next(file);
}
}
