#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <csignal>
#include <ctime>
#include <iostream>
#include <optional>

#include "daemon/serve/render.hpp"
#include "daemon/tool/colour.hpp"
#include "daemon/tool/live/remote.hpp"

namespace vibrig::tool {
namespace {

using Steady = std::chrono::steady_clock;
constexpr double kGiveUp_s =
    60;  ///< with --until-finished: a daemon gone for longer does not come back

double seconds_since(Steady::time_point start) {
    return std::chrono::duration<double>(Steady::now() - start).count();
}

/// Sleeps between two queries; signals wake it at once and never elsewhere.
class Pace {
  public:
    Pace() {
        sigemptyset(&signals_);
        for (const int signal : {SIGINT, SIGTERM, SIGHUP, SIGWINCH}) sigaddset(&signals_, signal);
        sigprocmask(SIG_BLOCK, &signals_, &before_);
    }
    ~Pace() { sigprocmask(SIG_SETMASK, &before_, nullptr); }
    Pace(const Pace&) = delete;
    Pace& operator=(const Pace&) = delete;

    /// False when the user wants to end.
    [[nodiscard]] bool sleep(double seconds) {
        timespec time{};
        time.tv_sec = static_cast<time_t>(seconds);
        time.tv_nsec = static_cast<long>((seconds - std::floor(seconds)) * 1e9);
        const int signal = sigtimedwait(&signals_, nullptr, &time);
        return signal < 0 || signal == SIGWINCH;
    }

  private:
    sigset_t signals_{}, before_{};
};

/// Redraws in place on a terminal.
class Screen {
  public:
    Screen() { std::cout << "\x1b[?25l" << std::flush; }
    ~Screen() { std::cout << "\x1b[?25h" << std::flush; }
    Screen(const Screen&) = delete;
    Screen& operator=(const Screen&) = delete;

    [[nodiscard]] static int width() { return size().ws_col > 0 ? size().ws_col : 80; }

    void draw(const serve::Lines& lines, bool loud) {
        const std::size_t rows = size().ws_row > 1 ? size().ws_row - 1u : 1000u;
        const std::size_t shown = std::min(lines.size(), rows);
        std::string out;
        // A window made lower has lost the upper lines: no further up than it is high.
        const std::size_t up = std::min(drawn_, rows);
        if (up > 0) out += "\x1b[" + std::to_string(up) + 'A';
        out += '\r';
        for (std::size_t i = 0; i < shown; ++i) {
            const bool stress = i == 0;
            if (stress) out += loud ? (colour::wanted() ? "\x1b[7;1;31m" : "\x1b[7;1m") : "\x1b[1m";
            out += lines[i];
            if (stress) out += "\x1b[0m";
            out += "\x1b[K\n";
        }
        out += "\x1b[J";
        std::cout << out << std::flush;
        drawn_ = shown;
    }

  private:
    static winsize size() {
        winsize found{};
        if (ioctl(STDOUT_FILENO, TIOCGWINSZ, &found) != 0) return {};
        return found;
    }
    std::size_t drawn_ = 0;
};

bool is_bad_end(v1::Campaign::State state) {
    return state == v1::Campaign::aborted || state == v1::Campaign::tripped;
}

bool is_under_way(v1::Campaign::State state) {
    return (state >= v1::Campaign::waiting && state <= v1::Campaign::paused) ||
           state == v1::Campaign::zeroing || state == v1::Campaign::levelling;
}

class Watch {
  public:
    explicit Watch(const WatchOptions& options) : options_(options), client_(options.at) {
        if (!options.json && isatty(STDOUT_FILENO) != 0) screen_.emplace();
    }

    int run() {
        // Nobody there at the beginning is an error; nobody there later may come back.
        v1::Status status = query();
        while (true) {
            if (const auto code = look(status)) return *code;
            do {
                if (!pace_.sleep(options_.interval_s)) return options_.until_finished ? kNo : 0;
                const auto next = ask();
                if (next) status = *next;
                if (!next && options_.until_finished && seconds_since(*gone_since_) > kGiveUp_s) {
                    std::cerr << "vibrig: vibrigd is gone for more than a minute, giving up\n";
                    return kBadInput;
                }
            } while (gone_since_);
        }
    }

  private:
    v1::Status query() {
        const serve::Reply reply = client_.get("/api/v1/status");
        v1::Status status;
        parse_answer(reply, status);
        as_json_ = reply.body;
        return status;
    }
    /// Where what is no status is said.
    [[nodiscard]] std::ostream& aside() const { return options_.json ? std::cerr : std::cout; }

    /// Shows one status; the exit code when it is the last.
    std::optional<int> look(const v1::Status& status) {
        const auto now = Steady::now();
        const bool restarted = last_ && status.uptime_s() < last_->uptime_s();
        serve::Rates rates;
        if (last_) {
            const double wall_s = std::chrono::duration<double>(now - last_at_).count();
            rates = serve::rates_between(*last_, status, wall_s);
        }
        const v1::Campaign::State state = status.campaign().state();
        if (screen_) {
            screen_->draw(serve::render_table(status, rates, Screen::width()), is_bad_end(state));
        } else if (options_.json) {
            std::cout << as_json_ << std::endl;
        } else if (!last_ || restarted || !serve::same_place(*last_, status)) {
            std::cout << serve::render_line(status) << std::endl;
        }
        const bool lost = restarted && is_under_way(last_->campaign().state());
        last_ = status;
        last_at_ = now;
        if (!options_.until_finished) return {};
        if (state == v1::Campaign::finished) return finished(status);
        if (is_bad_end(state)) return kNo;
        if (lost) {
            std::cerr << "vibrig: the daemon has started anew; its campaign is over\n";
            return kNo;
        }
        return {};
    }

    /// The verdict on all dwells comes a moment after the campaign's end; older daemons have
    /// none.
    std::optional<int> finished(const v1::Status& status) {
        constexpr double kPatience_s = 10;
        if (!finished_since_) finished_since_ = Steady::now();
        const v1::Verdict& verdict = status.verdict();
        if (!verdict.complete() && seconds_since(*finished_since_) < kPatience_s) return {};
        if (!verdict.sentence().empty()) std::cerr << "verdict: " << verdict.sentence() << '\n';
        return verdict.level() >= (options_.strict ? 1 : 2) ? kNo : 0;
    }

    std::optional<v1::Status> ask() {
        try {
            v1::Status status = query();
            if (gone_since_ && !screen_) aside() << "vibrigd answers again" << std::endl;
            gone_since_.reset();
            return status;
        } catch (const serve::ClientError& error) {
            const bool first = !gone_since_;
            if (first) gone_since_ = Steady::now();
            const std::string text = "*** NO ANSWER FROM vibrigd for " +
                                     serve::render_duration(seconds_since(*gone_since_)) + ": " +
                                     error.what() + "; trying again ***";
            if (screen_) {
                serve::Lines lines{serve::clipped(text, Screen::width())};
                const auto old = serve::render_table(*last_, {}, Screen::width());
                lines.emplace_back("The last it said:");
                lines.insert(lines.end(), old.begin(), old.end());
                screen_->draw(lines, true);
            } else if (first) {
                aside() << text << std::endl;
            }
            return {};
        }
    }

    const WatchOptions& options_;
    serve::Client client_;
    Pace pace_;
    std::optional<Screen> screen_;
    std::optional<v1::Status> last_;
    std::string as_json_;  ///< the newest one
    Steady::time_point last_at_;
    std::optional<Steady::time_point> gone_since_, finished_since_;
};

}  // namespace

int watch(const WatchOptions& options) { return Watch(options).run(); }

}  // namespace vibrig::tool
