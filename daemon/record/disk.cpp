#include "daemon/record/disk.hpp"

#include <fcntl.h>
#include <spdlog/fmt/fmt.h>
#include <sys/statvfs.h>
#include <unistd.h>

namespace vibrig::record {

namespace {

// Of the open file, not of the process: HDF5 opens and closes the same file.
struct flock whole_file() {
    struct flock lock {};
    lock.l_type = F_WRLCK;
    lock.l_whence = SEEK_SET;
    return lock;
}

}  // namespace

WriterLock::WriterLock(const std::string& path) : file_(::open(path.c_str(), O_RDWR | O_CLOEXEC)) {
    auto lock = whole_file();
    if (file_ >= 0) static_cast<void>(::fcntl(file_, F_OFD_SETLK, &lock));
}

WriterLock::~WriterLock() {
    if (file_ >= 0) ::close(file_);
}

bool WriterLock::held(const std::string& path) {
    const int file = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);  // who only asks need not write
    if (file < 0) return false;
    auto lock = whole_file();
    const bool asked = ::fcntl(file, F_OFD_GETLK, &lock) == 0;
    ::close(file);
    return asked && lock.l_type != F_UNLCK;
}

std::string lack_of_room(const std::string& folder, double keep_free_mb) {
    struct statvfs room {};
    if (::statvfs(folder.c_str(), &room) != 0) return {};
    const double free_mb =
        static_cast<double>(room.f_bavail) * static_cast<double>(room.f_frsize) / 1e6;
    if (free_mb >= keep_free_mb) return {};
    return fmt::format("{}: {:.0f} MB free, expected {} at least", folder, free_mb, keep_free_mb);
}

}  // namespace vibrig::record
