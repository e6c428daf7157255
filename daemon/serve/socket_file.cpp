#include "daemon/serve/socket_file.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <system_error>
#include <utility>

namespace vibrig::serve {
namespace {

constexpr mode_t kMode = 0660;
constexpr int kBacklog = 4096;  // or what the system allows: a crowd must not keep a stop out

std::string text_of(int error) { return std::generic_category().message(error); }

[[noreturn]] void fail(const std::string& path, const std::string& what, int error) {
    throw ServeError("server.socket: " + path + ": " + what + ": " + text_of(error));
}

class Descriptor {
  public:
    explicit Descriptor(int fd) : fd_(fd) {}
    ~Descriptor() {
        if (fd_ >= 0) ::close(fd_);
    }
    Descriptor(const Descriptor&) = delete;
    Descriptor& operator=(const Descriptor&) = delete;
    [[nodiscard]] int get() const { return fd_; }
    [[nodiscard]] int release() { return std::exchange(fd_, -1); }

  private:
    int fd_;
};

sockaddr_un address_of(const std::string& path) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    if (path.empty() || path.size() >= sizeof address.sun_path) {
        throw ServeError("server.socket: found '" + path + "' (" + std::to_string(path.size()) +
                         " bytes), expected 1 to " + std::to_string(sizeof address.sun_path - 1));
    }
    std::memcpy(address.sun_path, path.data(), path.size());
    return address;
}

const sockaddr* generic(const sockaddr_un& address) {
    return reinterpret_cast<const sockaddr*>(&address);
}

int open_socket(const std::string& path) {
    const int fd = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (fd < 0) fail(path, "cannot make a socket", errno);
    return fd;
}

/// Removes what a dead daemon left; throws when somebody answers or the file is something else.
void clear_stale(const std::string& path, const sockaddr_un& address) {
    struct stat found {};
    if (::lstat(path.c_str(), &found) != 0) {
        if (errno == ENOENT) return;
        fail(path, "cannot look at it", errno);
    }
    if (!S_ISSOCK(found.st_mode)) {
        throw ServeError("server.socket: " + path +
                         ": is no socket, expected a free name or the socket of a dead daemon");
    }
    const Descriptor probe(open_socket(path));
    // EAGAIN: somebody listens, with a full queue.
    if (::connect(probe.get(), generic(address), sizeof address) == 0 || errno == EAGAIN) {
        throw ServeError("another vibrigd answers at " + path);
    }
    if (errno != ECONNREFUSED) fail(path, "cannot tell whether another vibrigd answers", errno);
    if (::unlink(path.c_str()) != 0) fail(path, "cannot remove the socket of a dead daemon", errno);
}

}  // namespace

SocketFile::SocketFile(const std::string& path) : path_(path) {
    const sockaddr_un address = address_of(path);
    std::string folder = std::filesystem::path(path).parent_path();
    if (folder.empty()) folder = ".";
    const Descriptor lock(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
    if (lock.get() < 0) fail(path, "cannot open its folder", errno);
    // Two daemons that start together must not take over each other's file between look and bind.
    if (::flock(lock.get(), LOCK_EX) != 0) fail(path, "cannot lock its folder", errno);
    clear_stale(path, address);

    Descriptor listener(open_socket(path));
    if (::bind(listener.get(), generic(address), sizeof address) != 0) {
        fail(path, "cannot bind", errno);
    }
    struct stat made {};
    // Nobody can connect before listen(), so the mode is right from the first moment that counts.
    if (::chmod(path.c_str(), kMode) != 0 || ::lstat(path.c_str(), &made) != 0 ||
        ::listen(listener.get(), kBacklog) != 0) {
        const int error = errno;
        ::unlink(path.c_str());
        fail(path, "cannot listen", error);
    }
    device_ = made.st_dev;
    inode_ = made.st_ino;
    descriptor_ = listener.release();
}

SocketFile::SocketFile(SocketFile&& other) noexcept
    : path_(std::exchange(other.path_, {})),
      descriptor_(other.release()),
      device_(other.device_),
      inode_(other.inode_) {}

SocketFile::~SocketFile() {
    if (descriptor_ >= 0) ::close(descriptor_);
    if (path_.empty()) return;
    struct stat found {};
    // Somebody may have removed the file and put another daemon's there: only our own is ours to
    // remove.
    if (::lstat(path_.c_str(), &found) == 0 && found.st_dev == device_ && found.st_ino == inode_) {
        ::unlink(path_.c_str());
    }
}

std::string SocketFile::problem() const {
    struct stat found {};
    if (::lstat(path_.c_str(), &found) != 0)
        return errno == ENOENT || errno == ENOTDIR ? "was removed"
                                                   : "cannot be looked at: " + text_of(errno);
    if (found.st_dev != device_ || found.st_ino != inode_) return "was replaced";
    const Descriptor probe(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
    if (probe.get() < 0) return {};  // no descriptor left: that says nothing about the door
    const sockaddr_un address = address_of(path_);
    // EAGAIN: somebody listens, with a full queue.
    if (::connect(probe.get(), generic(address), sizeof address) == 0 || errno == EAGAIN) return {};
    return "takes no connection: " + text_of(errno);
}

void SocketFile::make_room(const std::string& path) {
    std::error_code ignored;
    if (const auto folder = std::filesystem::path(path).parent_path(); !folder.empty())
        std::filesystem::create_directories(folder, ignored);
    struct stat found {};
    if (::lstat(path.c_str(), &found) == 0 && !S_ISSOCK(found.st_mode))
        ::rename(path.c_str(), (path + ".found").c_str());
}

int SocketFile::release() noexcept { return std::exchange(descriptor_, -1); }

}  // namespace vibrig::serve
