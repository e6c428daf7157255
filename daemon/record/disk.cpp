#include "daemon/record/disk.hpp"

#include <spdlog/fmt/fmt.h>
#include <sys/statvfs.h>

namespace vibrig::record {

std::string lack_of_room(const std::string& folder, double keep_free_mb) {
    struct statvfs room {};
    if (::statvfs(folder.c_str(), &room) != 0) return {};
    const double free_mb =
        static_cast<double>(room.f_bavail) * static_cast<double>(room.f_frsize) / 1e6;
    if (free_mb >= keep_free_mb) return {};
    return fmt::format("{}: {:.0f} MB free, expected {} at least", folder, free_mb, keep_free_mb);
}

}  // namespace vibrig::record
