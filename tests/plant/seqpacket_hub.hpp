#pragma once

#include <vector>

#include "tests/plant/bus.hpp"

namespace vibrig::plant {

/// A bus over Unix SOCK_SEQPACKET: every packet is one struct can_frame or canfd_frame; what one
/// client sends goes to all others, never back to itself.
class SeqpacketHub final : public Bus {
  public:
    explicit SeqpacketHub(const std::string& path);
    ~SeqpacketHub() override;
    SeqpacketHub(const SeqpacketHub&) = delete;
    SeqpacketHub& operator=(const SeqpacketHub&) = delete;

    [[nodiscard]] int descriptor() const noexcept override { return epoll_; }
    void receive(const Handler& on_frame) override;
    void send(std::span<const can_frame> frames, bool wait) override;
    [[nodiscard]] bool only_newcomers() const noexcept override {
        return !clients_.empty() && served_.empty();
    }
    [[nodiscard]] std::uint64_t connections() const noexcept { return connections_; }
    [[nodiscard]] bool somebody_there() const noexcept override { return !clients_.empty(); }
    [[nodiscard]] std::uint64_t dropped() const noexcept override { return dropped_; }

  private:
    void accept_clients();
    void drop_client(int fd);
    /// False when the client has gone.
    bool read_client(int fd, const Handler& on_frame);
    void send_to(int fd, std::span<const can_frame> frames, bool wait);

    std::string path_;
    int listener_ = -1;
    int epoll_ = -1;
    std::vector<int> clients_;
    std::vector<int> served_;  ///< clients of the last send() that are still there
    std::uint64_t connections_ = 0;
    std::uint64_t dropped_ = 0;
};

}  // namespace vibrig::plant
