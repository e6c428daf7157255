#include "drivers/annunciator/page_command.hpp"

#include <fcntl.h>
#include <signal.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <system_error>

#include "drivers/base/process_group.hpp"

namespace vibrig::drivers {

namespace {

[[nodiscard]] std::string words_of(int error) { return std::generic_category().message(error); }

/// The read end of a pipe that holds the text and ends there; -1 with errno if there is none.
[[nodiscard]] int pipe_with(const std::string& text) noexcept {
    std::array<int, 2> ends{};
    if (::pipe2(ends.data(), O_CLOEXEC | O_NONBLOCK) != 0) return -1;
    // An empty pipe takes 4096 bytes at once.
    const ssize_t written = ::write(ends[1], text.data(), text.size());
    ::close(ends[1]);
    if (written != static_cast<ssize_t>(text.size())) {
        ::close(ends[0]);
        errno = EPIPE;
        return -1;
    }
    // A reader must neither block nor get EAGAIN.
    ::fcntl(ends[0], F_SETFL, 0);
    return ends[0];
}

}  // namespace

PageCommand::PageCommand(std::string path, Time limit) : path_(std::move(path)), limit_(limit) {}

PageCommand::~PageCommand() {
    for (const Run& run : runs_) {
        ::kill(-run.leader, SIGKILL);
        ::waitpid(run.leader, nullptr, 0);
    }
}

std::string PageCommand::start(const std::string& text, Time now) {
    const int input = pipe_with(text.substr(0, kLongestText));
    if (input < 0) {
        ++counters_.failed;
        return path_ + ": no pipe: " + words_of(errno);
    }
    Run run{-1, now + limit_};
    const int error = start_process_group({path_}, input, -1, -1, run.leader);
    ::close(input);
    if (error != 0) {
        ++counters_.failed;
        return path_ + ": cannot be started: " + words_of(error);
    }
    ++counters_.started;
    runs_.push_back(run);
    return {};
}

std::optional<std::string> PageCommand::conclude(Run& run, Time now) {
    siginfo_t info{};
    // Looked at, not taken: as long as the leader is not, the group's number is nobody else's.
    const bool over =
        ::waitid(P_PID, static_cast<id_t>(run.leader), &info, WEXITED | WNOHANG | WNOWAIT) == 0 &&
        info.si_pid == run.leader;
    if (!over && now < run.until) return {};
    run.late = run.late || !over;
    ::kill(-run.leader, SIGKILL);
    int status = 0;
    if (::waitpid(run.leader, &status, WNOHANG) == 0) return {};  // it takes a moment to die
    if (run.late) {
        ++counters_.timed_out;
        return path_ + ": killed after " + std::to_string(limit_ / kSecond) + " s";
    }
    if (WIFEXITED(status) && WEXITSTATUS(status) == 0) {
        ++counters_.done;
        return std::string();
    }
    ++counters_.failed;
    return path_ + (WIFEXITED(status) ? ": ended with status " + std::to_string(WEXITSTATUS(status))
                                      : ": ended by signal " + std::to_string(WTERMSIG(status)));
}

std::string PageCommand::trouble() const {
    struct stat found {};
    if (::stat(path_.c_str(), &found) != 0) return path_ + ": " + words_of(errno);
    if (!S_ISREG(found.st_mode)) return path_ + ": is no program";
    if (::access(path_.c_str(), X_OK) != 0) return path_ + ": cannot be run: " + words_of(errno);
    return {};
}

std::string PageCommand::attend(Time now) {
    std::string wrong;
    for (std::size_t i = 0; i < runs_.size();) {
        const auto said = conclude(runs_[i], now);
        if (!said) {
            ++i;
            continue;
        }
        if (!said->empty()) wrong = *said;
        runs_.erase(runs_.begin() + static_cast<std::ptrdiff_t>(i));
    }
    return wrong;
}

}  // namespace vibrig::drivers
