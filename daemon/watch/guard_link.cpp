#include "daemon/watch/guard_link.hpp"

#include <poll.h>
#include <pthread.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <cstddef>
#include <system_error>

#include "daemon/version.hpp"
#include "proto/safety.hpp"

namespace vibrig::watch {

namespace {

constexpr int kBeatMs = static_cast<int>(safety::kHeartbeat_s * 1e3);

std::int64_t steady_ns() {
    return std::chrono::duration_cast<std::chrono::nanoseconds>(
               std::chrono::steady_clock::now().time_since_epoch())
        .count();
}

bool fresh(std::int64_t heard_ns) {
    return heard_ns != 0 &&
           static_cast<double>(steady_ns() - heard_ns) < safety::kHeartbeatDeadline_s * 1e9;
}

}  // namespace

std::string GuardEyes::lacks(const GuardStatus& guard, std::int64_t now_ns) {
    // How long it was not heard is counted already.
    if (!guard.heard) return "is not heard: " + guard.note;
    if (guard.sees && guard.reaches_shaker) {
        lacking_since_ns_ = -1;
        return {};
    }
    if (lacking_since_ns_ < 0) lacking_since_ns_ = now_ns;
    if (static_cast<double>(now_ns - lacking_since_ns_) <= kPatience_s * 1e9) return {};
    const std::string blind = guard.sees ? "" : "sees no accelerometer";
    const std::string unlinked = guard.reaches_shaker ? "" : "does not reach the shaker";
    return blind + (blind.empty() || unlinked.empty() ? "" : " and ") + unlinked;
}

GuardLink::GuardLink(std::string path, AskWord word)
    : path_(std::move(path)), ask_(std::move(word)), wake_(::eventfd(0, EFD_CLOEXEC)) {
    if (wake_ < 0) throw std::system_error(errno, std::generic_category(), "guard.socket");
}

GuardLink::~GuardLink() {
    stop();
    ::close(wake_);
}

void GuardLink::start() {
    thread_ = std::thread([this] { run(); });
    ::pthread_setname_np(thread_.native_handle(), "guard");
}

void GuardLink::stop() {
    const std::uint64_t one = 1;
    if (thread_.joinable() && ::write(wake_, &one, sizeof one) == sizeof one) thread_.join();
}

void GuardLink::run() {
    for (auto next = steady_ns();;) {
        if (steady_ns() >= next) {
            beat();
            next = steady_ns() + std::int64_t{kBeatMs} * 1'000'000;
        }
        std::array<pollfd, 2> events{{{wake_, POLLIN, 0}, {socket_, POLLIN, 0}}};
        if (::poll(events.data(), events.size(), kBeatMs) < 0) continue;
        if (events[0].revents != 0) break;
        if (socket_ >= 0 && events[1].revents != 0) listen();
    }
    // The last word: nothing is armed any more.
    if (socket_ >= 0) beat();
    hang_up("ended");
}

void GuardLink::beat() {
    if (!reach()) return;
    auto word = ask_();
    word.sequence = ++sequence_;
    {
        const std::lock_guard lock(mutex_);
        word.acknowledged = acknowledged_;
    }
    const auto bytes = proto::encode(word);
    if (::send(socket_, bytes.data(), bytes.size(), MSG_NOSIGNAL | MSG_DONTWAIT) < 0 &&
        errno != EAGAIN)
        hang_up(std::generic_category().message(errno));
}

bool GuardLink::reach() {
    if (socket_ >= 0) return true;
    const int fd = ::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    path_.copy(address.sun_path, sizeof(address.sun_path) - 1);
    const bool abstract = path_.front() == '@';
    if (abstract) address.sun_path[0] = '\0';
    const auto length =
        static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + path_.size() + (abstract ? 0 : 1));
    if (fd < 0 || ::connect(fd, reinterpret_cast<const sockaddr*>(&address), length) != 0) {
        const std::string why = std::generic_category().message(errno);
        if (fd >= 0) ::close(fd);
        hang_up(why);
        return false;
    }
    socket_ = fd;
    return true;
}

void GuardLink::listen() {
    for (;;) {
        std::array<std::uint8_t, proto::kGuardWordBytes + 1> bytes{};
        const ssize_t size = ::recv(socket_, bytes.data(), bytes.size(), 0);
        if (size < 0 && (errno == EAGAIN || errno == EINTR)) return;
        if (size <= 0) return hang_up("it has gone");
        const auto word = proto::decode_guard_word({bytes.data(), static_cast<std::size_t>(size)});
        const std::lock_guard lock(mutex_);
        if (!word) {
            note_ = path_ + ": answers what this version does not know: restart vibrig-guard";
            continue;
        }
        // An answer to what was said in another life of either does not count.
        if (word->sequence == 0 || word->sequence > sequence_) continue;
        word_ = *word;
        heard_ns_ = steady_ns();
        note_.clear();
    }
}

void GuardLink::hang_up(const std::string& why) {
    if (socket_ >= 0) ::close(socket_);
    socket_ = -1;
    const std::lock_guard lock(mutex_);
    note_ = path_ + ": " + why;
}

bool GuardLink::heard() const {
    const std::lock_guard lock(mutex_);
    return fresh(heard_ns_);
}

proto::GuardWord GuardLink::word() const {
    const std::lock_guard lock(mutex_);
    return word_;
}

void GuardLink::acknowledge(std::uint64_t finding) {
    const std::lock_guard lock(mutex_);
    acknowledged_ = finding;
}

proto::GuardCause GuardLink::finding() const {
    const std::lock_guard lock(mutex_);
    return fresh(heard_ns_) && word_.finding != acknowledged_ ? word_.cause
                                                              : proto::GuardCause::none;
}

GuardStatus GuardLink::status() const {
    GuardStatus status;
    status.socket = path_;
    const std::lock_guard lock(mutex_);
    status.heard = fresh(heard_ns_);
    status.note = note_.empty() ? "no word within its deadline" : note_;
    if (!status.heard) return status;  // what it said last it may not say any more
    status.version = word_.version.data();
    status.note = status.version == kVersion ? ""
                                             : "version " + status.version + ", vibrigd is " +
                                                   kVersion + ": restart vibrig-guard";
    status.cause = proto::name_of(word_.cause);
    status.text = word_.cause == proto::GuardCause::none ? "" : proto::text_of(word_.cause);
    status.disobeyed = word_.disobeyed;
    status.sees = word_.sees;
    status.rest = word_.rest;
    status.reaches_shaker = word_.reaches_shaker;
    status.horn_confirms = word_.horn_confirms;
    status.table_g = word_.table_g;
    return status;
}

}  // namespace vibrig::watch
