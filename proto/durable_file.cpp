#include "proto/durable_file.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <stdexcept>

namespace vibrig::proto {

namespace {

[[noreturn]] void cannot(const std::string& path, const char* what, int why) {
    throw std::runtime_error(path + ": cannot be " + what + ": " + std::strerror(why));
}

/// errno of what has failed; 0: nothing has.
int write_all(int file, std::string_view text) {
    while (!text.empty()) {
        const auto wrote = ::write(file, text.data(), text.size());
        if (wrote < 0 && errno == EINTR) continue;
        if (wrote <= 0) return wrote < 0 ? errno : ENOSPC;
        text.remove_prefix(static_cast<std::size_t>(wrote));
    }
    return ::fsync(file) == 0 ? 0 : errno;
}

/// As the old one; errno.
int take_after(int file, const struct stat& old) {
    struct stat fresh {};
    if (::fstat(file, &fresh) != 0) return errno;
    if ((fresh.st_uid != old.st_uid || fresh.st_gid != old.st_gid) &&
        ::fchown(file, old.st_uid, old.st_gid) != 0)
        return errno;
    return ::fchmod(file, old.st_mode & 07777U) == 0 ? 0 : errno;
}

}  // namespace

void write_durably(const std::string& path, std::string_view text, unsigned mode) {
    std::error_code error;
    std::string target = path;
    if (std::filesystem::is_symlink(path, error)) {
        target = std::filesystem::weakly_canonical(path, error).string();
        if (error) cannot(path, "followed", error.value());
    }
    struct stat old {};
    const bool is_new = ::stat(target.c_str(), &old) != 0;
    const std::string fresh = target + ".new";
    ::unlink(fresh.c_str());
    const int file =
        ::open(fresh.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC | O_NOFOLLOW, mode);
    if (file < 0) cannot(fresh, "written", errno);
    const char* what = "given the owner and mode of the old one";
    int why = is_new ? 0 : take_after(file, old);
    if (why == 0) {
        what = "written";
        why = write_all(file, text);
    }
    if (::close(file) != 0 && why == 0) why = errno;
    if (why == 0 && ::rename(fresh.c_str(), target.c_str()) != 0) why = errno;
    if (why != 0) {
        ::unlink(fresh.c_str());
        cannot(fresh, what, why);
    }
    sync_folder_of(target);
}

void sync_folder_of(const std::string& path) {
    const std::string folder = std::filesystem::absolute(path).parent_path().string();
    const int file = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (file < 0) cannot(folder, "opened", errno);
    const int why = ::fsync(file) == 0 ? 0 : errno;
    ::close(file);
    if (why != 0) cannot(folder, "brought to the disk", why);
}

}  // namespace vibrig::proto
