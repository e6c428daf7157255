#include "daemon/app/result_files.hpp"

#include <spdlog/fmt/chrono.h>
#include <spdlog/fmt/fmt.h>
#include <sys/stat.h>

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
    const auto path = path_of(complete);
    auto unfinished = path;
    unfinished += ".new";
    std::ofstream file(unfinished);
    file << text;
    file.close();
    std::error_code error;
    if (file) std::filesystem::rename(unfinished, path, error);
    if (!file || error)
        event_(Severity::alarm, "cannot write " + path.string());
    else
        event_(Severity::info,
               fmt::format("{} result in {}", complete ? "complete" : "partial", path.string()));
}

}  // namespace vibrig
