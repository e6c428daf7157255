#include "drivers/can/can_port_base.hpp"

#include <fcntl.h>
#include <linux/can/error.h>
#include <linux/sock_diag.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <utility>

#include "drivers/can/can_pending_operations.hpp"

namespace vibrig::drivers {
namespace {

using std::chrono::milliseconds;
constexpr milliseconds kBackoffMin{100};
constexpr milliseconds kBackoffMax{1000};
constexpr milliseconds kLinkWatch{500};
/// Full batches taken before other work of the io_context gets its turn.
constexpr int kBatchesPerWake = 8;
/// Batches taken from a socket that has failed: what it had queued is still good.
constexpr int kBatchesToEmpty = 4096;

bool hung_up(int fd) noexcept {
    pollfd p{fd, POLLIN | POLLRDHUP, 0};
    return ::poll(&p, 1, 0) > 0 && (p.revents & (POLLRDHUP | POLLHUP | POLLERR)) != 0;
}

/// One frame from the bytes of a packet; false: no such frame exists.
bool to_frame(const ReceiveBatch::Packet& packet, bool accept_fd, ReceivedFrame& out) noexcept {
    const std::size_t size = packet.bytes.size();
    const bool classic = size == CAN_MTU;
    if ((packet.flags & MSG_TRUNC) != 0 || (!classic && !(accept_fd && size == CANFD_MTU)))
        return false;
    out = {};
    std::memcpy(&out.frame, packet.bytes.data(), size);
    out.fd = !classic;
    if (classic) {
        out.frame.flags = out.frame.__res0 = out.frame.__res1 =
            0;  // can_frame has padding and the raw DLC there
        return out.frame.len <= CAN_MAX_DLEN;
    }
    out.frame.flags = static_cast<__u8>(out.frame.flags | CANFD_FDF);
    return out.frame.len <= CANFD_MAX_DLEN;
}

}  // namespace

template <typename Function>
auto CanPortBase::completion(Function function) {
    return Completion<Function>{pending_, pending_->generation, std::move(function)};
}

CanPortBase::CanPortBase(boost::asio::io_context& io, CanPortSettings settings, std::string place)
    : settings_(std::move(settings)),
      place_(std::move(place)),
      pending_(std::make_shared<PendingOperations>()),
      socket_(io),
      timer_(io),
      backoff_(kBackoffMin) {
    refusing_fd_ = ::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    send_fd_ = ::fcntl(refusing_fd_, F_DUPFD_CLOEXEC, 0);
    if (send_fd_ < 0) {
        const std::string reason = ::strerrordesc_np(errno);
        if (refusing_fd_ >= 0) ::close(refusing_fd_);
        throw CanError(place_ + ": no file descriptor for the port: " + reason);
    }
}

CanPortBase::~CanPortBase() {
    CanPortBase::stop();
    ::close(send_fd_);
    ::close(refusing_fd_);
}

void CanPortBase::start(FrameHandler on_frames, StateHandler on_state, ErrorHandler on_error) {
    stop();
    on_frames_ = std::move(on_frames);
    on_state_ = std::move(on_state);
    on_error_ = std::move(on_error);
    announced_ = stopped_ = false;
    backoff_ = kBackoffMin;
    const Refusal refusal = open();
    if (refusal.beyond_waiting) {
        throw CanError(
            place_ + ": " + refusal.text +
            (refusal.error != 0 ? std::string(": ") + ::strerrordesc_np(refusal.error) : ""));
    }
    if (refusal.text[0] != '\0') {
        enter(refusal.state, refusal.error, refusal.text);
        retry_later();
    }
}

void CanPortBase::stop() noexcept {
    stopped_ = true;
    ++pending_->generation;
    try {
        timer_.cancel();
    } catch (const boost::system::system_error&) {
    }
    close();
    state_.store(PortState::absent);
}

CanPortBase::Refusal CanPortBase::open() {
    const Opened opened = open_socket();
    if (opened.fd < 0) return opened.refusal;
    socket_.assign(opened.fd);
    ::dup3(opened.fd, send_fd_, O_CLOEXEC);
    overflows_ = 0;
    int got = 0;
    socklen_t size = sizeof got;
    ::getsockopt(opened.fd, SOL_SOCKET, SO_RCVBUF, &got, &size);
    // The kernel reports twice what is usable. A Unix socket is bounded by its sender's buffer
    // instead.
    if (settings_.kind == CanPortSettings::Kind::socketcan && got / 2 < settings_.receive_buffer) {
        std::array<char, 128> text{};
        std::snprintf(text.data(), text.size(),
                      "running, but the receive buffer is %d of %d bytes (net.core.rmem_max)",
                      got / 2, settings_.receive_buffer);
        enter(PortState::running, 0, text.data());
    } else {
        enter(PortState::running, 0, "running");
    }
    if (stopped_) return {};
    wait_readable();
    if (settings_.kind == CanPortSettings::Kind::socketcan) watch_link();
    return {};
}

int CanPortBase::link_error(int) const noexcept { return 0; }

void CanPortBase::set_common_options(int fd) const noexcept {
    const int on = 1;
    ::setsockopt(fd, SOL_SOCKET, SO_TIMESTAMPNS, &on, sizeof on);
    // Beyond net.core.rmem_max only with CAP_NET_ADMIN.
    const int bytes = settings_.receive_buffer;
    if (::setsockopt(fd, SOL_SOCKET, SO_RCVBUFFORCE, &bytes, sizeof bytes) != 0) {
        ::setsockopt(fd, SOL_SOCKET, SO_RCVBUF, &bytes, sizeof bytes);
    }
}

void CanPortBase::close() noexcept {
    if (!socket_.is_open()) return;
    count_last_overflows();
    publish();
    ::dup3(refusing_fd_, send_fd_, O_CLOEXEC);
    // Not close(): Asio leaves the removal from its epoll set to the kernel then, and a send()
    // under way in another thread would delay that.
    ::close(socket_.release());
}

void CanPortBase::wait_readable() {
    socket_.async_wait(Descriptor::wait_read, completion([this] { on_readable(); }));
}

void CanPortBase::retry_later() {
    if (stopped_) return;
    timer_.expires_after(backoff_);
    backoff_ = std::min(backoff_ * 2, kBackoffMax);
    timer_.async_wait(completion([this] {
        const Refusal refusal = open();
        if (refusal.text[0] == '\0') return;
        enter(refusal.state, refusal.error, refusal.text);
        retry_later();
    }));
}

/// The kernel tells a socket only once that its interface went down, and a send() in another thread
/// may be the one to hear it.
void CanPortBase::watch_link() {
    timer_.expires_after(kLinkWatch);
    timer_.async_wait(completion([this] {
        if (const int error = link_error(socket_.native_handle())) return lost(error);
        watch_link();
    }));
}

void CanPortBase::on_readable() {
    const std::uint64_t generation = pending_->generation;
    const int fd = socket_.native_handle();
    int error = 0;
    for (int batch = 0; batch < (error == 0 ? kBatchesPerWake : kBatchesToEmpty); ++batch) {
        const int count = batch_.receive(fd);
        if (count <= 0) {
            const int reason = count == 0 ? EAGAIN : errno;
            const bool empty = reason == EAGAIN || reason == EWOULDBLOCK;
            if (reason == EINTR) continue;
            if (empty || error == reason) break;
            // An error is reported before the frames that were queued ahead of it.
            error = reason;
            continue;
        }
        const std::size_t trailing_empty = take(static_cast<std::size_t>(count));
        if (pending_->generation != generation) return;  // a handler stopped the port
        if (trailing_empty > 0) {
            if (hung_up(fd)) return lost(0);
            counted_.received += trailing_empty;
            counted_.malformed += trailing_empty;
            publish();
        }
        if (error == 0 && static_cast<std::size_t>(count) < ReceiveBatch::kCapacity) break;
    }
    if (error != 0) return lost(error);
    wait_readable();
}

std::size_t CanPortBase::take(std::size_t count) {
    const ClockPair clocks = ClockPair::now();
    std::size_t trailing_empty = 0;
    while (trailing_empty < count && batch_.packet(count - 1 - trailing_empty).bytes.empty())
        ++trailing_empty;

    std::size_t frames = 0;
    std::size_t errors = 0;
    bool heard = false;  ///< a frame, after the last that said bus off: nobody is cut off then
    for (std::size_t i = 0; i + trailing_empty < count; ++i) {
        const ReceiveBatch::Packet packet = batch_.packet(i);
        if (packet.overflows) count_overflows(*packet.overflows);
        ++counted_.received;
        ReceivedFrame& received = frames_[frames];
        if (!to_frame(packet, settings_.fd, received)) {
            ++counted_.malformed;
            continue;
        }
        const Time time = clocks.to_monotonic(packet.stamp.value_or(clocks.realtime));
        received.time = last_time_ = std::max(time, last_time_);
        received.own = (packet.flags & MSG_CONFIRM) != 0;
        if (received.own) {
            ++counted_.own;
        } else if ((received.frame.can_id & CAN_ERR_FLAG) != 0) {
            ++counted_.error_frames;
            if ((received.frame.can_id & CAN_ERR_BUSOFF) != 0) heard = false;
            errors_[errors++] = received;
        } else {
            ++counted_.delivered;
            heard = true;
            ++frames;
        }
    }
    publish();
    if (count > trailing_empty) backoff_ = kBackoffMin;

    const std::uint64_t generation = pending_->generation;
    for (std::size_t i = 0; i < errors && pending_->generation == generation; ++i) {
        watch_controller(errors_[i].frame);
        if (on_error_) on_error_(errors_[i]);
    }
    if (frames > 0 && pending_->generation == generation) {
        if (heard && controller_.load() == ControllerState::bus_off)
            controller_.store(ControllerState::active);
        if (heard && state() == PortState::degraded) enter(PortState::running, 0, "running again");
        if (on_frames_) on_frames_(std::span(frames_).first(frames));
    }
    return trailing_empty;
}

void CanPortBase::count_overflows(std::uint32_t overflows) noexcept {
    counted_.kernel_dropped += overflows - overflows_;  // modulo 2^32, as the kernel counts
    overflows_ = overflows;
}

/// The control message comes only with the next frame; what was lost after the last one is asked
/// for.
void CanPortBase::count_last_overflows() noexcept {
    std::array<std::uint32_t, SK_MEMINFO_VARS> memory{};
    socklen_t size = sizeof memory;
    if (::getsockopt(socket_.native_handle(), SOL_SOCKET, SO_MEMINFO, memory.data(), &size) == 0 &&
        size > SK_MEMINFO_DROPS * sizeof(std::uint32_t)) {
        count_overflows(memory[SK_MEMINFO_DROPS]);
    }
}

void CanPortBase::watch_controller(const canfd_frame& error_frame) {
    if ((error_frame.can_id & CAN_ERR_BUSOFF) != 0) {
        controller_.store(ControllerState::bus_off);
    } else if ((error_frame.can_id & CAN_ERR_RESTARTED) != 0) {
        controller_.store(ControllerState::active);
    } else if ((error_frame.can_id & CAN_ERR_CRTL) != 0) {
        const unsigned says = error_frame.data[1];
        constexpr unsigned kPassive = CAN_ERR_CRTL_RX_PASSIVE | CAN_ERR_CRTL_TX_PASSIVE;
        constexpr unsigned kWarning = CAN_ERR_CRTL_RX_WARNING | CAN_ERR_CRTL_TX_WARNING;
        if ((says & (kPassive | kWarning | CAN_ERR_CRTL_ACTIVE)) != 0) {
            controller_.store((says & kPassive) != 0   ? ControllerState::passive
                              : (says & kWarning) != 0 ? ControllerState::warning
                                                       : ControllerState::active);
        }
    }
    if ((error_frame.can_id & CAN_ERR_BUSOFF) != 0) {
        enter(PortState::degraded, 0, "bus off");
    } else if ((error_frame.can_id & CAN_ERR_RESTARTED) != 0 && state() == PortState::degraded) {
        enter(PortState::running, 0, "controller restarted");
    }
}

void CanPortBase::lost(int error) {
    controller_.store(ControllerState::active);  // it is set up anew
    ++pending_->generation;  // neither the socket's nor the watch's completion counts any more
    close();
    if (error == ENODEV) {
        enter(PortState::absent, error, "gone, waiting");
    } else if (error == ENETDOWN) {
        enter(PortState::connecting, error, "down, waiting");
    } else {
        enter(PortState::connecting, error, "connection lost, waiting");
    }
    retry_later();
}

void CanPortBase::enter(PortState state, int error, const char* text) {
    if (announced_ && state_.load(std::memory_order_relaxed) == state) return;
    announced_ = true;
    state_.store(state);
    ++counted_.transitions;
    publish();
    if (!on_state_) return;
    std::array<char, 320> line{};
    const char* name = error != 0 ? ::strerrorname_np(error) : nullptr;
    if (name != nullptr) {
        std::snprintf(line.data(), line.size(), "%s: %s (%s)", place_.c_str(), text, name);
    } else {
        std::snprintf(line.data(), line.size(), "%s: %s", place_.c_str(), text);
    }
    on_state_(state, line.data());
}

bool CanPortBase::send(const canfd_frame& frame, bool fd) noexcept {
    bool sent = false;
    if (fd) {
        if (settings_.fd && frame.len <= CANFD_MAX_DLEN) {
            sent = ::send(send_fd_, &frame, CANFD_MTU, MSG_DONTWAIT | MSG_NOSIGNAL) == CANFD_MTU;
        }
    } else if (frame.len <= CAN_MAX_DLEN) {
        can_frame classic{};
        classic.can_id = frame.can_id;
        classic.len = frame.len;
        std::memcpy(classic.data, frame.data, frame.len);
        sent = ::send(send_fd_, &classic, CAN_MTU, MSG_DONTWAIT | MSG_NOSIGNAL) == CAN_MTU;
    }
    (sent ? sent_ : send_failed_).fetch_add(1, std::memory_order_relaxed);
    return sent;
}

CanPortCounters CanPortBase::counters() const noexcept {
    CanPortCounters c = published_.read();
    c.sent = sent_.load(std::memory_order_relaxed);
    c.send_failed = send_failed_.load(std::memory_order_relaxed);
    c.controller = controller_.load(std::memory_order_relaxed);
    return c;
}

PortState CanPortBase::state() const noexcept { return state_.load(); }

}  // namespace vibrig::drivers
