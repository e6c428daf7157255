#include "daemon/results/progress.hpp"

#include <unistd.h>

#include <cmath>
#include <condition_variable>
#include <cstdio>
#include <mutex>
#include <stop_token>
#include <utility>

namespace vibrig::tool {

namespace {

constexpr std::chrono::milliseconds kPatience{500};
constexpr std::chrono::milliseconds kRefresh{100};

}  // namespace

Progress::Progress(std::string what)
    : what_(std::move(what)),
      terminal_(isatty(STDERR_FILENO) == 1),
      next_(Clock::now() + kPatience) {}

Progress::~Progress() {
    if (shown_) {
        std::fputs("\r\033[K", stderr);
    }
}

bool Progress::is_time() {
    if (!terminal_ || Clock::now() < next_) return false;
    next_ = Clock::now() + kRefresh;
    return shown_ = true;
}

void Progress::show(std::size_t done, std::size_t all) {
    if (!is_time()) return;
    const std::size_t percent = all == 0 ? 100 : done * 100 / all;
    std::fprintf(stderr, "\r%s %zu %%\033[K", what_.c_str(), percent);
    std::fflush(stderr);
}

void Progress::show(const std::string& line) {
    if (!is_time()) return;
    std::fprintf(stderr, "\r%s\033[K", line.c_str());
    std::fflush(stderr);
}

Working::Working(std::string what) {
    if (isatty(STDERR_FILENO) != 1) return;
    thread_ = std::jthread([what = std::move(what)](const std::stop_token& over) {
        const auto began = std::chrono::steady_clock::now();
        Progress progress;
        std::mutex mutex;
        std::condition_variable_any changed;
        std::unique_lock lock(mutex);
        while (!changed.wait_for(lock, over, kPatience, [] { return false; }) &&
               !over.stop_requested()) {
            const std::chrono::duration<double> passed = std::chrono::steady_clock::now() - began;
            progress.show(what + ", " + std::to_string(std::lround(passed.count())) + " s");
        }
    });
}

Working::~Working() = default;

}  // namespace vibrig::tool
