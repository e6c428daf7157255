#include "daemon/study/status.hpp"

#include <fcntl.h>
#include <sys/stat.h>

#include <algorithm>
#include <ctime>

namespace vibrig::study {

namespace {

double seconds(const struct statx_timestamp& t) {
    return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

/// Of a part that is being written; nothing if it is an old one.
bool is_running(const std::string& path, double fresh_s, RunningPart& out) {
    struct statx what {};
    if (statx(AT_FDCWD, path.c_str(), 0, STATX_MTIME | STATX_BTIME, &what) != 0) return false;
    timespec now{};
    clock_gettime(CLOCK_REALTIME, &now);
    const double written = seconds(what.stx_mtime);
    // Clocks of two machines, or one that jumped: written later than now is just now.
    out.age_s = std::max(
        0.0, static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec) - written);
    const double span = (what.stx_mask & STATX_BTIME) != 0 ? written - seconds(what.stx_btime) : 0;
    if (span > 1) out.per_s = static_cast<double>(out.records) / span;
    return out.age_s < fresh_s;
}

}  // namespace

StudyStatus status_of(const Folder& folder, double fresh_s) {
    StudyStatus out;
    out.tasks = folder.tasks();
    double per_s = 0;
    for (const PartName& name : parts_in(folder.parts())) {
        ++out.parts;
        if (name.closed) continue;
        const std::string path = folder.parts() + "/" + name.file;
        PartReader reader(path, folder.id, out.tasks);
        for (TaskRecord record; reader.next(record);) {
        }
        RunningPart part{name.file, name.host, name.shard, name.pid, reader.records(), 0, 0};
        if (!is_running(path, fresh_s, part)) continue;
        per_s += part.per_s;
        out.running.push_back(part);
    }
    Merged merged(folder);
    for (TaskRecord record; merged.next(record);) {
        ++out.done;
        if (record.bytes[0] == 'F') ++out.failed;
    }
    out.found = merged.found();
    // The end of what is being written is not torn.
    for (const std::string& line : merged.found().unfinished) {
        if (std::ranges::none_of(out.running, [&](const RunningPart& part) {
                return line.starts_with(part.file + ": torn");
            }))
            out.found.damaged.push_back(line);
    }
    if (per_s > 0) out.left_s = static_cast<double>(out.found.missing_count) / per_s;
    if (out.found.missing_count == 0) out.left_s = 0;
    return out;
}

}  // namespace vibrig::study
