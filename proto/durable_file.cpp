#include "proto/durable_file.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <memory>
#include <stdexcept>
#include <utility>

namespace vibrig::proto {

namespace fs = std::filesystem;

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

std::vector<std::string>& inputs() {
    static std::vector<std::string> paths;
    return paths;
}

/// HDF5 or SQLite: nothing that a command writes as its output.
bool is_record(const fs::path& path) {
    std::array<char, 16> head{};
    std::ifstream(path, std::ios::binary).read(head.data(), head.size());
    const std::string_view begin(head.data(), head.size());
    return begin.starts_with("\x89HDF\r\n\x1a\n") || begin.starts_with("SQLite format 3");
}

/// What the daemon, or an archive, keeps beside a campaign's HDF5 files.
bool is_of_campaign(const std::string& name) {
    return name.ends_with(".h5") || name == "dwells.csv" || name == "archive.json" ||
           (name.starts_with("raw-") && (name.ends_with(".log") || name.ends_with(".log.zst")));
}

bool holds_campaign(const fs::path& folder) {
    std::error_code error;
    for (const auto& entry : fs::directory_iterator(folder, error)) {
        const std::string name = entry.path().filename().string();
        if (name.starts_with("campaign") && name.ends_with(".h5") && entry.is_regular_file(error))
            return true;
    }
    return false;
}

/// Written as it is. A descriptor's name leads to the file that it has open, which others hold.
bool is_device(const std::string& path) {
    return path.starts_with("/proc/") ||
           (path.starts_with("/dev/") && !path.starts_with("/dev/shm/"));
}

/// Where links lead; empty: to what is written as it is.
std::string end_of_links(const std::string& path) {
    std::error_code error;
    fs::path at = path;
    for (int step = 0; step < 40; ++step) {
        if (is_device(fs::absolute(at, error).lexically_normal().string())) return {};
        const auto what = fs::symlink_status(at, error).type();
        if (what == fs::file_type::not_found || what == fs::file_type::regular) return at.string();
        if (what != fs::file_type::symlink) return {};
        at = at.parent_path() / fs::read_symlink(at, error);
    }
    cannot(path, "followed", ELOOP);
}

}  // namespace

void name_inputs(std::vector<std::string> paths) { inputs() = std::move(paths); }

void check_output(const std::string& path) {
    std::error_code error;
    const fs::path target = fs::weakly_canonical(path, error);
    if (error) return;
    const auto what = fs::status(target, error).type();
    if (what != fs::file_type::regular && what != fs::file_type::not_found) return;
    // A new one of such a name would be taken for the recording's just as well.
    const std::string name = target.filename().string();
    const bool of_recording = name.find(".sqlite3") != std::string::npos ||
                              (is_of_campaign(name) && holds_campaign(target.parent_path()));
    if (what == fs::file_type::not_found && of_recording)
        throw std::runtime_error(path +
                                 ": found the name of a recording's file, expected another to "
                                 "write");
    if (what == fs::file_type::not_found) return;
    if (of_recording || is_record(target))
        throw std::runtime_error(path + ": found a file of a recording, expected another to write");
    const auto same = [&](const std::string& input) {
        return fs::equivalent(target, input, error) && !error;
    };
    if (std::ranges::any_of(inputs(), same))
        throw std::runtime_error(path +
                                 ": found a file that the command reads, expected another to "
                                 "write");
}

void refuse_same(const std::vector<std::string>& outputs) {
    std::vector<fs::path> seen;
    for (const std::string& path : outputs) {
        std::error_code error;
        fs::path target = fs::weakly_canonical(fs::absolute(path), error);
        if (error || path.empty() || path == "-" || is_device(target.string())) continue;
        if (std::ranges::find(seen, target) != seen.end())
            throw std::runtime_error(path + ": found it twice to be written, expected two files");
        seen.push_back(std::move(target));
    }
}

OutputFile::OutputFile(const std::string& path) : path_(path), target_(end_of_links(path)) {
    check_output(path);
    place_ = target_.empty() ? path : target_ + ".unfinished";
    if (target_.empty()) return;
    check_output(place_);
    // A folder of one's own would let it be replaced.
    if (::access(target_.c_str(), F_OK) == 0 && ::access(target_.c_str(), W_OK) != 0)
        cannot(path_, "written", errno);
    ::unlink(place_.c_str());
    const int file =
        ::open(place_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0666);
    const int why = errno;
    if (file >= 0) {
        ::close(file);
    } else if (::access(target_.c_str(), W_OK) == 0) {  // a file of one's own in another's folder
        place_ = std::exchange(target_, {});
    } else {
        cannot(path_, "written", why);
    }
}

OutputFile::~OutputFile() {
    if (!target_.empty()) ::unlink(place_.c_str());
}

void OutputFile::finish() {
    if (target_.empty()) return;
    const int file = ::open(place_.c_str(), O_RDONLY | O_CLOEXEC);
    if (file < 0) cannot(path_, "written", errno);
    int why = ::fsync(file) == 0 ? 0 : errno;
    struct stat old {};
    // Who may write to another's file need not be allowed to give one away.
    if (::stat(target_.c_str(), &old) == 0) static_cast<void>(take_after(file, old));
    ::close(file);
    if (why == 0 && ::rename(place_.c_str(), target_.c_str()) != 0) why = errno;
    if (why != 0) cannot(path_, "written", why);
    target_.clear();
}

void write_output(const std::string& path, std::string_view text) {
    OutputFile out(path);
    const auto close = [](std::FILE* file) { std::fclose(file); };
    std::unique_ptr<std::FILE, decltype(close)> file(std::fopen(out.place().c_str(), "wb"), close);
    if (!file || std::fwrite(text.data(), 1, text.size(), file.get()) != text.size())
        cannot(path, "written", errno);
    if (std::fclose(file.release()) != 0) cannot(path, "written", errno);
    out.finish();
}

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
