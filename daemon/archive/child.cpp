#include "daemon/archive/child.hpp"

#include <fcntl.h>
#include <poll.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstring>
#include <thread>

#include "drivers/base/process_group.hpp"

namespace vibrig::archive {

namespace {

using Clock = std::chrono::steady_clock;
constexpr int kLook_ms = 200;
constexpr std::size_t kMostOutput = 4 << 20;

/// A pipe whose ends close themselves.
struct Pipe {
    std::array<int, 2> end{-1, -1};
    Pipe() {
        if (::pipe2(end.data(), O_CLOEXEC) != 0) end = {-1, -1};
    }
    ~Pipe() {
        close(0);
        close(1);
    }
    Pipe(const Pipe&) = delete;
    Pipe& operator=(const Pipe&) = delete;
    void close(std::size_t which) {
        if (end[which] >= 0) ::close(end[which]);
        end[which] = -1;
    }
};

/// False: the end of it.
bool take(int from, std::string& to) {
    std::array<char, 4096> piece{};
    const auto n = ::read(from, piece.data(), piece.size());
    if (n > 0 && to.size() < kMostOutput) to.append(piece.data(), static_cast<std::size_t>(n));
    return n > 0 || (n < 0 && (errno == EINTR || errno == EAGAIN));
}

std::string last_line(std::string text) {
    while (!text.empty() && text.back() == '\n') text.pop_back();
    const auto at = text.rfind('\n');
    return at == std::string::npos ? text : text.substr(at + 1);
}

/// Reads both until they end; false: the time was up.
bool listen(Pipe& out, Pipe& error, Run& run, Clock::time_point until,
            const std::atomic<bool>& stop) {
    while (out.end[0] >= 0 || error.end[0] >= 0) {
        if (stop.load() || Clock::now() > until) return false;
        std::array<pollfd, 2> ends{{{out.end[0], POLLIN, 0}, {error.end[0], POLLIN, 0}}};
        if (::poll(ends.data(), ends.size(), kLook_ms) <= 0) continue;
        if (ends[0].revents != 0 && !take(out.end[0], run.out)) out.close(0);
        if (ends[1].revents != 0 && !take(error.end[0], run.error)) error.close(0);
    }
    return true;
}

}  // namespace

Run run_child(const std::vector<std::string>& arguments, double limit_s,
              const std::atomic<bool>& stop) {
    Run run;
    Pipe out, error;
    pid_t leader = -1;
    const auto until = Clock::now() + std::chrono::duration_cast<Clock::duration>(
                                          std::chrono::duration<double>(limit_s));
    if (out.end[0] < 0 || error.end[0] < 0) {
        run.error = std::string("no pipe: ") + std::strerror(errno);
        return run;
    }
    if (const int why =
            drivers::start_process_group(arguments, -1, out.end[1], error.end[1], leader);
        why != 0) {
        run.error = arguments[0] + ": cannot be started: " + std::strerror(why);
        return run;
    }
    out.close(1);
    error.close(1);
    bool ended = listen(out, error, run, until, stop);
    if (!ended) ::kill(-leader, SIGKILL);
    // Killed on a file system that does not answer it may stay.
    for (int look = 0; look < 20; ++look) {
        int status = 0;
        const pid_t found = ::waitpid(leader, &status, WNOHANG);
        if (found == leader || (found < 0 && errno != EINTR)) {
            if (ended && WIFEXITED(status)) run.status = WEXITSTATUS(status);
            ended = ended && WIFEXITED(status);
            break;
        }
        std::this_thread::sleep_for(std::chrono::milliseconds(50));
    }
    run.error = last_line(run.error);
    if (!ended && run.error.empty())
        run.error = stop.load() ? "ended with the daemon" : "no answer, or killed";
    return run;
}

}  // namespace vibrig::archive
