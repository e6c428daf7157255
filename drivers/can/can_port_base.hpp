#pragma once

#include <array>
#include <atomic>
#include <boost/asio/basic_waitable_timer.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/posix/basic_stream_descriptor.hpp>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>

#include "drivers/base/snapshot.hpp"
#include "drivers/can/can_port.hpp"
#include "drivers/can/receive_batch.hpp"

namespace vibrig::drivers {

struct PendingOperations;

/// What both kinds of port share: the receive loop, counters, states and recovery. A kind says how
/// to open its socket.
class CanPortBase : public CanPort {
  public:
    CanPortBase(boost::asio::io_context& io, CanPortSettings settings, std::string place);
    ~CanPortBase() override;
    CanPortBase(const CanPortBase&) = delete;
    CanPortBase& operator=(const CanPortBase&) = delete;

    void start(FrameHandler on_frames, StateHandler on_state, ErrorHandler on_error) final;
    void stop() noexcept final;
    [[nodiscard]] bool send(const canfd_frame& frame, bool fd) noexcept final;
    [[nodiscard]] CanPortCounters counters() const noexcept final;
    [[nodiscard]] PortState state() const noexcept final;

  protected:
    /// Why a socket could not be had.
    struct Refusal {
        PortState state = PortState::absent;
        int error = 0;                ///< errno; 0: none
        const char* text = "";        ///< what was found
        bool beyond_waiting = false;  ///< start() throws
    };
    struct Opened {
        int fd = -1;  ///< non-blocking, ready to receive
        Refusal refusal;
    };
    [[nodiscard]] virtual Opened open_socket() noexcept = 0;
    /// Why the link under an open socket cannot carry frames, as errno; 0: it can, or the socket
    /// itself would tell.
    [[nodiscard]] virtual int link_error(int fd) const noexcept;
    /// Options both kinds want: time stamps, receive buffer.
    void set_common_options(int fd) const noexcept;

    [[nodiscard]] const CanPortSettings& settings() const noexcept { return settings_; }

  private:
    using Executor = boost::asio::io_context::executor_type;
    using Descriptor = boost::asio::posix::basic_stream_descriptor<Executor>;
    using Timer = boost::asio::basic_waitable_timer<
        std::chrono::steady_clock, boost::asio::wait_traits<std::chrono::steady_clock>, Executor>;
    template <typename Function>
    auto completion(Function function);

    [[nodiscard]] Refusal open();
    void close() noexcept;
    void wait_readable();
    void retry_later();
    void watch_link();
    void on_readable();
    /// Hands the frames of one batch on. Returns how many packets at its end were empty: the caller
    /// knows whether these are packets at all or the end of the connection.
    std::size_t take(std::size_t count);
    void count_overflows(std::uint32_t overflows) noexcept;
    void count_last_overflows() noexcept;
    void watch_controller(const canfd_frame& error_frame);
    void lost(int error);
    void enter(PortState state, int error, const char* text);
    void publish() noexcept { published_.publish(counted_); }

    const CanPortSettings settings_;
    const std::string place_;
    std::shared_ptr<PendingOperations> pending_;
    Descriptor socket_;
    Timer timer_;  ///< to the next attempt, or while running to the next look at the link
    std::chrono::milliseconds backoff_;
    FrameHandler on_frames_;
    StateHandler on_state_;
    ErrorHandler on_error_;
    /// One descriptor number for the port's whole life, so that send() in another thread never
    /// meets a closed or reused one. It is the running socket, or while there is none an
    /// unconnected one that refuses.
    int send_fd_ = -1;
    int refusing_fd_ = -1;
    bool announced_ = false;       ///< the present state has been reported
    bool stopped_ = true;          ///< possibly by a handler
    std::uint32_t overflows_ = 0;  ///< of this socket so far
    Time last_time_ = 0;
    ReceiveBatch batch_;
    std::array<ReceivedFrame, ReceiveBatch::kCapacity> frames_{};
    std::array<ReceivedFrame, ReceiveBatch::kCapacity> errors_{};

    // The receive side counts in `counted_` and publishes after each batch, so that a reader in
    // another thread gets counters that belong together.
    CanPortCounters counted_;
    rt::Snapshot<CanPortCounters> published_;
    std::atomic<std::uint64_t> sent_{0};
    std::atomic<std::uint64_t> send_failed_{0};
    std::atomic<ControllerState> controller_{ControllerState::active};
    std::atomic<PortState> state_{PortState::absent};
};

/// The kinds; both throw CanError for settings that cannot be.
[[nodiscard]] std::unique_ptr<CanPort> make_socketcan_port(boost::asio::io_context& io,
                                                           const CanPortSettings& settings);
[[nodiscard]] std::unique_ptr<CanPort> make_seqpacket_port(boost::asio::io_context& io,
                                                           const CanPortSettings& settings);

}  // namespace vibrig::drivers
