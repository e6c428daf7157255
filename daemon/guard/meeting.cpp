#include "daemon/guard/meeting.hpp"

#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstddef>
#include <cstring>
#include <stdexcept>

namespace vibrig::guard {

namespace {

struct UnixAddress {
    sockaddr_un un{};
    socklen_t length = 0;
    [[nodiscard]] const sockaddr* get() const {
        return reinterpret_cast<const sockaddr*>(&un);  // NOLINT: as the call wants it
    }
};

UnixAddress address_of(const std::string& path) {
    UnixAddress address;
    address.un.sun_family = AF_UNIX;
    path.copy(address.un.sun_path, sizeof(address.un.sun_path) - 1);
    const bool abstract = path.front() == '@';
    if (abstract) address.un.sun_path[0] = '\0';
    address.length =
        static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + path.size() + (abstract ? 0 : 1));
    return address;
}

/// Left behind by a guard that was killed: nobody answers there.
bool is_left_behind(const std::string& path, const UnixAddress& address) {
    struct stat status {};
    if (path.front() == '@' || ::lstat(path.c_str(), &status) != 0 || !S_ISSOCK(status.st_mode))
        return false;
    const int probe = ::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    const bool refused =
        ::connect(probe, address.get(), address.length) != 0 && errno == ECONNREFUSED;
    ::close(probe);
    return refused;
}

}  // namespace

Meeting::Meeting(const std::string& path) : path_(path) {
    const auto address = address_of(path);
    if (is_left_behind(path, address)) ::unlink(path.c_str());
    listener_ = ::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    // The daemon's group may knock, nobody else.
    const mode_t mask = ::umask(0117);
    const bool bound = listener_ >= 0 && ::bind(listener_, address.get(), address.length) == 0;
    const int error = errno;
    ::umask(mask);
    if (bound && ::listen(listener_, 4) == 0) return;
    if (listener_ >= 0) ::close(listener_);
    throw std::runtime_error("guard.socket: found \"" + path + "\" (" + std::strerror(error) +
                             "), expected a place that no other guard uses, in a folder where a "
                             "socket can be made");
}

Meeting::~Meeting() {
    hang_up();
    ::close(listener_);
    if (path_.front() != '@') ::unlink(path_.c_str());
}

void Meeting::hang_up() noexcept {
    if (daemon_ >= 0) ::close(daemon_);
    daemon_ = -1;
}

bool Meeting::attend(drivers::Time now) {
    int knocks = -1;
    while ((knocks = ::accept4(listener_, nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC)) >= 0) {
        hang_up();
        daemon_ = knocks;
    }
    bool said = false;
    // As many as may wait; a flood is left to the next time.
    for (int i = 0; i < 64 && daemon_ >= 0; ++i) {
        std::array<std::uint8_t, proto::kDaemonWordBytes + 1> bytes{};
        const ssize_t size = ::recv(daemon_, bytes.data(), bytes.size(), 0);
        if (size < 0 && (errno == EAGAIN || errno == EINTR)) break;
        if (size <= 0) {
            hang_up();
            break;
        }
        const auto word = proto::decode_daemon_word({bytes.data(), static_cast<std::size_t>(size)});
        if (!word) {
            ++refused_;
            continue;
        }
        word_ = word;
        heard_ = now;
        said = true;
    }
    return said;
}

void Meeting::tell(const proto::GuardWord& word) noexcept {
    if (daemon_ < 0) return;
    const auto bytes = proto::encode(word);
    // A daemon that does not read will be silent itself.
    (void)!::send(daemon_, bytes.data(), bytes.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
}

}  // namespace vibrig::guard
