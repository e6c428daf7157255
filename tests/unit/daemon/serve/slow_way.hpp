#pragma once

#include <poll.h>

#include <array>
#include <atomic>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/write.hpp>
#include <string>
#include <thread>

namespace vibrig::serve {

/// Hands on what comes and goes, but what a client says after its greeting when it is let.
class SlowWay {
  public:
    explicit SlowWay(const std::string& to) : to_(to) {
        acceptor_.non_blocking(true);
        thread_ = std::thread([this] { run(); });
    }
    ~SlowWay() {
        over_ = true;
        thread_.join();
    }
    SlowWay(const SlowWay&) = delete;
    SlowWay& operator=(const SlowWay&) = delete;
    [[nodiscard]] std::string address() const {
        return "127.0.0.1:" + std::to_string(acceptor_.local_endpoint().port());
    }
    void wait_until_held() const {
        for (int i = 0; i < 1000 && !held_; ++i)
            std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    void let() { let_ = true; }

  private:
    using Tcp = boost::asio::ip::tcp;
    static bool readable(int descriptor) {
        pollfd one{descriptor, POLLIN, 0};
        return ::poll(&one, 1, 5) > 0;
    }
    static bool hand_on(Tcp::socket& from, Tcp::socket& to) {
        std::array<char, 65536> bytes{};
        boost::system::error_code error;
        const std::size_t n = from.read_some(boost::asio::buffer(bytes), error);
        if (!error) boost::asio::write(to, boost::asio::buffer(bytes.data(), n), error);
        return !error;
    }
    void run() {
        Tcp::socket client(io_), server(io_);
        boost::system::error_code error = boost::asio::error::would_block;
        while (!over_ && error) {
            if (readable(acceptor_.native_handle())) acceptor_.accept(client, error);
        }
        if (over_) return;
        const auto colon = to_.find(':');
        server.connect({boost::asio::ip::make_address(to_.substr(0, colon)),
                        static_cast<std::uint16_t>(std::stoi(to_.substr(colon + 1)))});
        bool open = hand_on(client, server);
        while (open && !over_) {
            if (readable(server.native_handle())) open = hand_on(server, client);
            if (!open || !readable(client.native_handle())) continue;
            held_ = true;
            if (let_) open = hand_on(client, server);
        }
    }

    std::string to_;
    boost::asio::io_context io_;
    Tcp::acceptor acceptor_{io_, {boost::asio::ip::make_address("127.0.0.1"), 0}};
    std::atomic<bool> over_ = false, held_ = false, let_ = false;
    std::thread thread_;
};

}  // namespace vibrig::serve
