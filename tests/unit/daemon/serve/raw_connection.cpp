#include "tests/unit/daemon/serve/raw_connection.hpp"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <stdexcept>

namespace vibrig::serve {

RawConnection::RawConnection(const std::string& path)
    : descriptor_(
          ::socket(path.front() == '/' ? AF_UNIX : AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    path.copy(address.sun_path, sizeof address.sun_path - 1);
    sockaddr_in local{};
    local.sin_family = AF_INET;
    local.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    local.sin_port =
        htons(static_cast<std::uint16_t>(std::atoi(path.c_str() + path.rfind(':') + 1)));
    const bool is_unix = path.front() == '/';
    const int failed =
        is_unix
            ? ::connect(descriptor_, reinterpret_cast<const sockaddr*>(&address), sizeof address)
            : ::connect(descriptor_, reinterpret_cast<const sockaddr*>(&local), sizeof local);
    if (failed != 0) {
        const std::string cause = std::strerror(errno);
        ::close(descriptor_);
        throw std::runtime_error("cannot connect to " + path + ": " + cause);
    }
    const timeval limit{20, 0};
    ::setsockopt(descriptor_, SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof limit);
}

RawConnection::~RawConnection() { ::close(descriptor_); }

void RawConnection::send(std::string_view bytes) const {
    while (!bytes.empty()) {
        const ssize_t sent = ::send(descriptor_, bytes.data(), bytes.size(), MSG_NOSIGNAL);
        if (sent <= 0) return;  // the server may refuse in the middle
        bytes.remove_prefix(static_cast<std::size_t>(sent));
    }
}

void RawConnection::finish_sending() const { ::shutdown(descriptor_, SHUT_WR); }

std::string RawConnection::bytes(std::size_t count) const {
    std::string text(count, '\0');
    const ssize_t got = ::recv(descriptor_, text.data(), count, MSG_WAITALL);
    text.resize(got > 0 ? static_cast<std::size_t>(got) : 0);
    return text;
}

std::string RawConnection::answer() const {
    std::string text;
    char byte = 0;
    while (text.find("\r\n\r\n") == std::string::npos) {
        if (::recv(descriptor_, &byte, 1, 0) != 1) return text;
        text.push_back(byte);
    }
    const std::size_t at = text.find("Content-Length: ");
    std::size_t left =
        at == std::string::npos ? 0 : std::strtoul(text.c_str() + at + 16, nullptr, 10);
    std::array<char, 4096> block{};
    while (left > 0) {
        const ssize_t got = ::recv(descriptor_, block.data(), std::min(left, block.size()), 0);
        if (got <= 0) return text;
        text.append(block.data(), static_cast<std::size_t>(got));
        left -= static_cast<std::size_t>(got);
    }
    return text;
}

std::string RawConnection::until_closed() const {
    std::string text;
    std::array<char, 4096> block{};
    while (true) {
        const ssize_t got = ::recv(descriptor_, block.data(), block.size(), 0);
        if (got > 0) {
            text.append(block.data(), static_cast<std::size_t>(got));
            continue;
        }
        const bool open = got < 0 && (errno == EAGAIN || errno == EWOULDBLOCK);
        return open ? text + "(open)" : text;
    }
}

int status_of(const std::string& answer) {
    return answer.rfind("HTTP/1.1 ", 0) == 0 ? std::atoi(answer.c_str() + 9) : 0;
}

std::string body_of(const std::string& answer) {
    const std::size_t at = answer.find("\r\n\r\n");
    return at == std::string::npos ? "" : answer.substr(at + 4);
}

std::string get(const std::string& path, const std::string& target) {
    const RawConnection connection(path);
    connection.send("GET " + target + " HTTP/1.1\r\nHost: x\r\n\r\n");
    return connection.answer();
}

std::string post(const std::string& path, const std::string& target, const std::string& body) {
    const RawConnection connection(path);
    connection.send("POST " + target +
                    " HTTP/1.1\r\nHost: x\r\nContent-Type: application/json\r\n" +
                    "Content-Length: " + std::to_string(body.size()) + "\r\n\r\n" + body);
    return connection.answer();
}

}  // namespace vibrig::serve
