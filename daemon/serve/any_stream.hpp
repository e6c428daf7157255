#pragma once

#include <sys/types.h>

#include <array>
#include <boost/asio/any_io_executor.hpp>
#include <boost/asio/buffer.hpp>
#include <boost/asio/generic/stream_protocol.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/ssl/context.hpp>
#include <boost/beast/core/role.hpp>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <utility>

namespace vibrig::serve {

/// A Unix or TCP socket, with or without TLS, behind one type: what Beast instantiates for it is
/// compiled once. An asynchronous stream in Asio's sense; one thread.
class AnyStream {
  public:
    using executor_type = boost::asio::any_io_executor;
    using Socket = boost::asio::generic::stream_protocol::socket;
    using Done = std::function<void(boost::system::error_code, std::size_t)>;

    explicit AnyStream(Socket socket);
    /// `tls` has to live as long as the handshake.
    AnyStream(Socket socket, boost::asio::ssl::context& tls);
    AnyStream(AnyStream&&) noexcept;
    AnyStream& operator=(AnyStream&&) noexcept;
    ~AnyStream();

    [[nodiscard]] executor_type get_executor() noexcept;

    template <typename Buffers, typename Handler>
    void async_read_some(const Buffers& buffers, Handler&& handler) {
        boost::asio::mutable_buffer into;
        const auto end = boost::asio::buffer_sequence_end(buffers);
        for (auto it = boost::asio::buffer_sequence_begin(buffers); it != end && into.size() == 0;
             ++it)
            into = *it;
        read(into, erased(std::forward<Handler>(handler)));
    }
    template <typename Buffers, typename Handler>
    void async_write_some(const Buffers& buffers, Handler&& handler) {
        std::array<boost::asio::const_buffer, kMostBuffers> from;
        std::size_t n = 0;
        const auto end = boost::asio::buffer_sequence_end(buffers);
        for (auto it = boost::asio::buffer_sequence_begin(buffers); it != end && n < from.size();
             ++it) {
            if (const boost::asio::const_buffer buffer = *it; buffer.size() > 0) from[n++] = buffer;
        }
        write(from, erased(std::forward<Handler>(handler)));
    }

    /// TLS only. As a client: the server's certificate must be good for `host`; `expired_too`: it
    /// may have expired.
    void accept_handshake(std::function<void(boost::system::error_code)> done);
    void connect_handshake(const std::string& host,
                           std::function<void(boost::system::error_code)> done,
                           bool expired_too = false);
    [[nodiscard]] bool encrypted() const noexcept;
    /// Subject of the other side's certificate: common name, organisational unit; empty without.
    [[nodiscard]] std::pair<std::string, std::string> peer_subject() const;

    /// Whether a client's certificate that was good would be so by this context, expired or not.
    [[nodiscard]] bool peer_is_good_for(boost::asio::ssl::context& now) const;

    /// When the other side's certificate ends, or the first of its authorities, s UTC; 0 without.
    [[nodiscard]] std::int64_t peer_expiry() const;

    /// Why the other side's certificate was not taken; empty: it was, or none came.
    [[nodiscard]] std::string certificate_problem() const;

    [[nodiscard]] Socket& socket() noexcept;
    /// No more will be sent; the other side reads to the end.
    void finish() noexcept;
    /// What waits ends with an error.
    void close() noexcept;

  private:
    static constexpr std::size_t kMostBuffers = 16;
    using Buffers = std::array<boost::asio::const_buffer, kMostBuffers>;

    template <typename Handler>
    static Done erased(Handler&& handler) {
        auto kept = std::make_shared<std::decay_t<Handler>>(std::forward<Handler>(handler));
        return [kept = std::move(kept)](boost::system::error_code error, std::size_t bytes) {
            // Moved out first: the operation may start the next one from inside.
            auto once = std::move(*kept);
            once(error, bytes);
        };
    }
    void read(boost::asio::mutable_buffer into, Done done);
    void write(const Buffers& from, Done done);

    struct Impl;
    std::unique_ptr<Impl> impl_;
};

// What Beast's WebSocket asks of a stream, found by its name.
inline void beast_close_socket(AnyStream& stream) { stream.close(); }
inline void teardown(boost::beast::role_type /*role*/, AnyStream& stream,
                     boost::system::error_code& error) {
    stream.finish();
    error = {};
}
template <typename Handler>
void async_teardown(boost::beast::role_type /*role*/, AnyStream& stream, Handler&& handler) {
    stream.finish();
    boost::asio::post(stream.get_executor(), [h = std::forward<Handler>(handler)]() mutable {
        h(boost::system::error_code{});
    });
}

}  // namespace vibrig::serve
