#include "daemon/app/result_files.hpp"

#include <spdlog/fmt/chrono.h>
#include <spdlog/fmt/fmt.h>
#include <sys/stat.h>

#include <cerrno>
#include <ctime>
#include <fstream>
#include <system_error>
#include <utility>

namespace vibrig {

ResultFiles::ResultFiles(std::string folder, EventSink event)
    : folder_(std::move(folder)), event_(std::move(event)) {}

std::filesystem::path ResultFiles::path_of(bool complete) const {
    return folder_ / (complete ? "result.json" : "result-partial.json");
}

void ResultFiles::begin() {
    if (folder_.empty()) return;
    waiting_.reset();
    for (const bool complete : {true, false}) put_aside(path_of(complete));
}

void ResultFiles::put_aside(const std::filesystem::path& path) {
    struct stat found {};
    std::tm utc{};
    if (::stat(path.c_str(), &found) != 0 || ::gmtime_r(&found.st_mtim.tv_sec, &utc) == nullptr)
        return;
    const std::string dated = fmt::format("{}-{:%Y%m%dT%H%M%SZ}", path.stem().string(), utc);
    std::error_code error;
    auto to = folder_ / (dated + ".json");
    for (int i = 2; std::filesystem::exists(to, error); ++i)
        to = folder_ / fmt::format("{}-{}.json", dated, i);
    std::filesystem::rename(path, to, error);
    if (error)
        event_(Severity::alarm, fmt::format("{} is of an earlier campaign and cannot be moved: {}",
                                            path.string(), error.message()));
}

void ResultFiles::write(const std::string& text, bool complete) {
    if (folder_.empty()) return;
    waiting_.reset();
    const auto path = path_of(complete).string();
    if (const auto why = put(text, complete); !why.empty()) {
        waiting_ = {text, complete, Steady::now()};
        event_(Severity::alarm,
               fmt::format("cannot write {}: {}; tried again until the next campaign begins", path,
                           why));
        return;
    }
    event_(Severity::info, fmt::format("{} result in {}", complete ? "complete" : "partial", path));
}

void ResultFiles::try_again(Steady::time_point now) {
    constexpr auto kRetry = std::chrono::seconds(1);
    if (!waiting_ || now - waiting_->tried < kRetry) return;
    waiting_->tried = now;
    if (!put(waiting_->text, waiting_->complete).empty()) return;
    event_(Severity::info,
           fmt::format("{} result in {} at last", waiting_->complete ? "complete" : "partial",
                       path_of(waiting_->complete).string()));
    waiting_.reset();
}

/// Why it could not be done; empty: it is done.
std::string ResultFiles::put(const std::string& text, bool complete) const {
    const auto path = path_of(complete);
    auto unfinished = path;
    unfinished += ".new";
    std::ofstream file(unfinished);
    file << text;
    file.close();
    std::error_code error;
    if (!file) error.assign(errno != 0 ? errno : EIO, std::generic_category());
    if (!error) std::filesystem::rename(unfinished, path, error);
    std::error_code ignored;
    if (error) std::filesystem::remove(unfinished, ignored);
    return error ? error.message() : "";
}

}  // namespace vibrig
