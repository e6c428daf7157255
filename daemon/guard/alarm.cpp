#include "daemon/guard/alarm.hpp"

#include <fcntl.h>
#include <modbus/modbus.h>
#include <poll.h>
#include <pthread.h>
#include <signal.h>
#include <spawn.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <ctime>
#include <nlohmann/json.hpp>
#include <system_error>
#include <utility>

namespace vibrig::guard {

namespace {

using drivers::kSecond;
using drivers::Time;

// A horn that is quiet now may be gone when it is needed, so it is asked all the time.
constexpr Time kBeat = kSecond / 2;
constexpr Time kRetryHorn = kSecond;
// Between write and read-back another master may have had its turn.
constexpr int kReadsToBelieve = 2;
constexpr auto kLookAtPager = std::chrono::milliseconds(50);
constexpr std::size_t kMostWaiting = 16;
constexpr std::size_t kLongestText = 600;

std::string words_of(int error) { return std::generic_category().message(error); }

std::string message(Tune kind, const std::string& text) {
    const std::time_t now = std::time(nullptr);
    tm fields{};
    ::gmtime_r(&now, &fields);
    std::array<char, 32> utc{};
    std::strftime(utc.data(), utc.size(), "%Y-%m-%dT%H:%M:%SZ", &fields);
    const nlohmann::ordered_json json{{"source", "vibrig-guard"},
                                      {"kind", kind == Tune::disobeyed ? "disobeyed" : "abort"},
                                      {"time", utc.data()},
                                      {"text", text.substr(0, kLongestText)}};
    return json.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

/// A file without a name that holds the text, to be read from its beginning; -1 with errno.
int file_with(const std::string& text) noexcept {
    const int file = ::memfd_create("page", MFD_CLOEXEC);
    if (file < 0) return -1;
    if (::pwrite(file, text.data(), text.size(), 0) == static_cast<ssize_t>(text.size()))
        return file;
    ::close(file);
    errno = EIO;
    return -1;
}

}  // namespace

void say(const char* severity, const std::string& text) {
    pollfd out{STDERR_FILENO, POLLOUT, 0};
    if (::poll(&out, 1, 0) != 1 || (out.revents & POLLOUT) == 0) return;
    const std::string line = std::string(severity) + ": " + text + "\n";
    (void)!::write(STDERR_FILENO, line.data(), line.size());
}

bool sounds(Tune tune, Time since) noexcept {
    return tune == Tune::disobeyed || (tune == Tune::stop && since % (2 * kSecond) < kSecond);
}

Coils::Coils(const AlarmSettings& settings)
    : line_(settings.host, settings.port, settings.unit, settings.wait_ms),
      horn_{"horn", settings.horn_coil},
      lamp_{"lamp", settings.lamp_coil} {}

bool Coils::fail(const char* what, const Coil& coil) {
    const int error = errno;
    const std::string text =
        std::string("cannot ") + what + " the " + coil.name + ": " + modbus_strerror(error);
    // An exception is an answer: the next one's cannot be taken for it.
    if (error < EMBXILFUN || error > EMBXGTAR) line_.lose(text);
    note_ = line_.name() + ": " + text;
    return false;
}

bool Coils::is_on(const Coil& coil, bool& on) {
    std::uint8_t bit = 0;
    if (modbus_read_bits(line_.get(), coil.address, 1, &bit) != 1) return fail("read", coil);
    on = bit != 0;
    return true;
}

bool Coils::set(Coil& coil, bool on) {
    if (coil.address < 0) return true;
    bool now = false;
    if (!is_on(coil, now)) return false;
    // Off is said once, when this side has done: another one may want it on.
    if (now != on && (on || coil.on)) {
        if (modbus_write_bit(line_.get(), coil.address, on ? 1 : 0) != 1)
            return fail("write", coil);
        if (!is_on(coil, now)) return false;
    }
    coil.on = on;
    if (now || !on) return true;
    note_ = line_.name() + ": the " + coil.name + " (coil " + std::to_string(coil.address) +
            ") was switched on and reads back off";
    return false;
}

bool Coils::show(Tune tune, Time now) {
    if (tune != std::exchange(tune_, tune)) begun_ = now;
    if (!line_.connected()) {
        if (now < next_attempt_) return false;
        next_attempt_ = now + kRetryHorn;
        if (!line_.connect()) {
            note_ = line_.note();
            return false;
        }
    }
    note_.clear();
    const bool horn = set(horn_, sounds(tune, now - begun_));
    const bool lamp = line_.connected() && set(lamp_, tune != Tune::none);
    if (line_.connected()) line_.is_well();
    return horn && lamp;
}

Pager::Pager(std::string path, Time limit) : path_(std::move(path)), limit_(limit) {}

Pager::~Pager() {
    if (!busy()) return;
    ::kill(-leader_, SIGKILL);
    ::waitpid(leader_, nullptr, 0);
}

std::string Pager::start(const std::string& text, Time now) {
    const int input = file_with(text);
    if (input < 0) return path_ + ": no file for its text: " + words_of(errno);
    posix_spawn_file_actions_t actions;
    posix_spawnattr_t attributes;
    ::posix_spawn_file_actions_init(&actions);
    ::posix_spawnattr_init(&attributes);
    ::posix_spawn_file_actions_adddup2(&actions, input, STDIN_FILENO);
    for (const int output : {STDOUT_FILENO, STDERR_FILENO})
        ::posix_spawn_file_actions_addopen(&actions, output, "/dev/null", O_WRONLY, 0);
    ::posix_spawn_file_actions_addclosefrom_np(&actions, STDERR_FILENO + 1);
    sigset_t none, all;
    ::sigemptyset(&none);
    ::sigfillset(&all);
    ::posix_spawnattr_setsigmask(&attributes, &none);
    ::posix_spawnattr_setsigdefault(&attributes, &all);
    ::posix_spawnattr_setpgroup(&attributes, 0);
    ::posix_spawnattr_setflags(
        &attributes,
        static_cast<short>(POSIX_SPAWN_SETPGROUP | POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF));
    std::string name = path_;
    std::array<char*, 2> arguments{name.data(), nullptr};
    const int error =
        ::posix_spawn(&leader_, path_.c_str(), &actions, &attributes, arguments.data(), environ);
    ::posix_spawn_file_actions_destroy(&actions);
    ::posix_spawnattr_destroy(&attributes);
    ::close(input);
    until_ = now + limit_;
    if (error == 0) return {};
    leader_ = -1;
    return path_ + ": cannot be started: " + words_of(error);
}

std::string Pager::attend(Time now) {
    if (!busy()) return {};
    siginfo_t info{};
    // Looked at, not taken: as long as the leader is not, the group's number is nobody else's.
    const bool over =
        ::waitid(P_PID, static_cast<id_t>(leader_), &info, WEXITED | WNOHANG | WNOWAIT) == 0 &&
        info.si_pid == leader_;
    if (!over && now < until_) return {};
    late_ = late_ || !over;
    ::kill(-leader_, SIGKILL);
    int status = 0;
    if (::waitpid(leader_, &status, WNOHANG) == 0) return {};  // it takes a moment to die
    leader_ = -1;
    if (std::exchange(late_, false))
        return path_ + ": killed after " + std::to_string(limit_ / kSecond) + " s";
    if (WIFEXITED(status) && WEXITSTATUS(status) == 0) return {};
    return path_ + (WIFEXITED(status) ? ": ended with status " + std::to_string(WEXITSTATUS(status))
                                      : ": ended by signal " + std::to_string(WTERMSIG(status)));
}

Alarm::Alarm(const AlarmSettings& settings) {
    if (!settings.host.empty()) coils_ = std::make_unique<Coils>(settings);
    if (!settings.command.empty()) {
        stop_pager_ = std::make_unique<Pager>(settings.command, settings.command_limit);
        disobeyed_pager_ = std::make_unique<Pager>(settings.command, settings.command_limit);
        // As this user, and before it is needed.
        if (::access(settings.command.c_str(), X_OK) != 0)
            say("warning", settings.command + ": cannot be run: " + words_of(errno));
    }
    if (coils_) {
        horn_thread_ = std::thread([this] { run_horn(); });
        ::pthread_setname_np(horn_thread_.native_handle(), "horn");
    }
    if (!stop_pager_) return;
    try {
        pager_thread_ = std::thread([this] { run_pager(); });
    } catch (const std::system_error&) {
        end();  // nobody else does: the horn's runs, and this is not made
        throw;
    }
    ::pthread_setname_np(pager_thread_.native_handle(), "pager");
}

Alarm::~Alarm() { end(); }

void Alarm::end() noexcept {
    {
        const std::lock_guard lock(mutex_);
        quit_ = true;
    }
    changed_.notify_all();
    for (std::thread* const thread : {&pager_thread_, &horn_thread_})
        if (thread->joinable()) thread->join();
}

void Alarm::show(Tune tune) {
    {
        const std::lock_guard lock(mutex_);
        if (std::exchange(tune_, tune) == tune) return;
    }
    changed_.notify_all();
}

void Alarm::page(Tune kind, const std::string& text) {
    if (!stop_pager_) return;
    {
        const std::lock_guard lock(mutex_);
        if (waiting_.size() == kMostWaiting) waiting_.pop_front();
        waiting_.emplace_back(kind, message(kind, text));
    }
    changed_.notify_all();
}

bool Alarm::confirms() const {
    const std::lock_guard lock(mutex_);
    return confirms_;
}

void Alarm::sound(Time now) {
    bad_reads_ = coils_->show(shown_, now) ? 0 : std::min(bad_reads_ + 1, kReadsToBelieve);
    const bool confirms = bad_reads_ < kReadsToBelieve;
    bool changed = false;
    {
        const std::lock_guard lock(mutex_);
        changed = std::exchange(confirms_, confirms) != confirms;
    }
    if (changed)
        say(confirms ? "info" : "warning", confirms
                                               ? "horn and lamp confirm again"
                                               : "horn or lamp do not confirm: " + coils_->note());
}

Pager* Alarm::pager(Tune kind) noexcept {
    return (kind == Tune::disobeyed ? disobeyed_pager_ : stop_pager_).get();
}

bool Alarm::paging() noexcept { return stop_pager_->busy() || disobeyed_pager_->busy(); }

void Alarm::attend(Tune kind, Time now) {
    Pager& one = *pager(kind);
    if (const auto wrong = one.attend(now); !wrong.empty()) say("warning", wrong);
    if (one.busy()) return;
    std::string text;
    {
        const std::lock_guard lock(mutex_);
        const auto next = std::ranges::find(waiting_, kind, &std::pair<Tune, std::string>::first);
        if (next == waiting_.end()) return;
        text = std::move(next->second);
        waiting_.erase(next);
    }
    if (const auto wrong = one.start(text, now); !wrong.empty()) say("warning", wrong);
}

void Alarm::run_horn() {
    std::unique_lock lock(mutex_);
    while (!quit_) {
        shown_ = tune_;
        lock.unlock();
        sound(drivers::steady_now());
        lock.lock();
        changed_.wait_for(lock, std::chrono::nanoseconds(kBeat),
                          [&] { return quit_ || shown_ != tune_; });
    }
    lock.unlock();
    // Nobody would end it; only a table that obeys no stop is left sounding.
    if (shown_ != Tune::disobeyed) (void)coils_->show(Tune::none, drivers::steady_now());
}

void Alarm::run_pager() {
    std::unique_lock lock(mutex_);
    while (!quit_) {
        lock.unlock();
        attend(Tune::stop, drivers::steady_now());
        attend(Tune::disobeyed, drivers::steady_now());
        lock.lock();
        const auto woken = [&] {
            return quit_ || std::ranges::any_of(waiting_, [&](const auto& one) {
                       return !pager(one.first)->busy();
                   });
        };
        if (paging())
            changed_.wait_for(lock, kLookAtPager, woken);
        else
            changed_.wait(lock, woken);
    }
}

}  // namespace vibrig::guard
