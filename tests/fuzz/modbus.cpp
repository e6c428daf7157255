// What a Modbus server may answer to a read and a write: any bytes, in any pieces. The first four
// bytes of the input say which transaction it answers, so that the rest gets past that.
#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cstdint>
#include <cstdlib>
#include <string>
#include <thread>

#include "drivers/shaker/modbus_link.hpp"

namespace {

/// Answers each request with the next part of the input; closes when there is no more.
class Server {
  public:
    Server() {
        sockaddr_in address{};
        address.sin_family = AF_INET;
        address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
        socklen_t size = sizeof address;
        listener_ = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
        if (::bind(listener_, reinterpret_cast<sockaddr*>(&address), size) != 0 ||
            ::listen(listener_, 8) != 0 ||
            ::getsockname(listener_, reinterpret_cast<sockaddr*>(&address), &size) != 0)
            std::abort();
        port = ntohs(address.sin_port);
        std::thread([this] { serve(); }).detach();
    }
    void answer_with(std::string answer) { answer_ = std::move(answer); }
    int port = 0;

  private:
    void serve() {
        while (true) {
            const int link = ::accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC);
            if (link < 0) continue;
            std::array<std::uint8_t, 512> request{};
            std::string left = answer_;
            while (::recv(link, request.data(), request.size(), 0) > 0 && !left.empty()) {
                std::string part = left.substr(0, left.size() / 2 + 1);
                left.erase(0, part.size());
                if ((part[0] & 7) != 0 && part.size() > 4) {  // of this transaction, this protocol
                    part[0] = static_cast<char>(request[0]);
                    part[1] = static_cast<char>(request[1]);
                    part[2] = part[3] = 0;
                }
                if (::send(link, part.data(), part.size(), MSG_NOSIGNAL) < 0) break;
                if (left.empty())
                    ::shutdown(link, SHUT_WR);  // or the client waits for its deadline
            }
            ::close(link);
        }
    }

    int listener_ = -1;
    std::string answer_;  // set while nobody is connected
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace vibrig;
    static Server* const server = new Server;
    drivers::ShakerSettings settings;
    settings.host = "127.0.0.1";
    settings.port = server->port;
    settings.response_timeout = 20 * drivers::kMillisecond;
    server->answer_with(std::string(reinterpret_cast<const char*>(data), size));
    drivers::ModbusLink link(settings);
    std::string why;
    if (link.connect(why) != drivers::ModbusLink::Connection::open) return 0;
    std::array<std::uint16_t, 8> words{};
    static_cast<void>(link.read(proto::RegisterTable::holding, 0, words));
    if (link.connected()) static_cast<void>(link.write(0, std::span(words).first(2)));
    return 0;
}
