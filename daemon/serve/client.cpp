#include "daemon/serve/client.hpp"

#include <sys/socket.h>
#include <sys/time.h>

#include <boost/asio/connect.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/local/stream_protocol.hpp>
#include <boost/beast/core/buffers_to_string.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/http/parser.hpp>
#include <boost/beast/http/read.hpp>
#include <boost/beast/http/string_body.hpp>
#include <boost/beast/http/write.hpp>
#include <boost/beast/websocket.hpp>
#include <cerrno>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <utility>

#include "daemon/serve/any_stream.hpp"
#include "daemon/serve/socket_file.hpp"
#include "daemon/serve/tls.hpp"

namespace vibrig::serve {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = boost::beast::http;
namespace websocket = boost::beast::websocket;
using Protocol = asio::local::stream_protocol;
using Request = http::request<http::string_body>;
using boost::system::error_code;
using boost::system::system_error;

constexpr unsigned kHttp11 = 11;
constexpr std::uint64_t kLongestAnswer = 64ULL * 1024 * 1024;
constexpr const char* kDefaultPort = "8443";
constexpr auto kSilence = std::chrono::seconds(40);

}  // namespace

struct Client::Impl {
    Impl(Address given, std::chrono::milliseconds limit)
        : address(std::move(given)), timeout(limit) {
        if (address.host.empty()) {
            where = address.socket;
            return;
        }
        // "rig.lab", "rig.lab:8443", "[fe80::1]:8443"
        const std::size_t colon = address.host.rfind(':');
        const bool has_port = colon != std::string::npos && address.host.back() != ']' &&
                              (address.host.find(':') == colon || address.host[colon - 1] == ']');
        port = has_port ? address.host.substr(colon + 1) : kDefaultPort;
        host = has_port ? address.host.substr(0, colon) : address.host;
        if (host.size() > 2 && host.front() == '[' && host.back() == ']')
            host = host.substr(1, host.size() - 2);
        where = host + " port " + port;
        if (address.identity.empty())
            throw ClientError("--host needs --identity FOLDER/NAME, as made by `vibrig pki init`");
        const auto folder = std::filesystem::path(address.identity).parent_path();
        try {
            tls.emplace(mutual_tls(address.identity + ".crt", address.identity + ".key",
                                   (folder / "authority.crt").string(), false));
        } catch (const ServeError& error) {
            throw ClientError(error.what());
        }
    }

    /// Asynchronous underneath: only so does a deadline hold.
    template <typename Start>
    error_code run(Start&& start) {
        bool done = false;
        error_code result;
        start([&](error_code error, std::size_t = 0) {
            done = true;
            result = error;
        });
        io.restart();
        io.run_for(timeout);
        if (done) return result;
        stream->close();
        io.restart();
        io.run();
        return asio::error::timed_out;
    }

    /// A Unix socket whose queue is full takes no connection at once, and Asio would take that for
    /// one under way. The system waits for a place itself, in the order of who came.
    error_code enter(const Protocol::endpoint& endpoint) {
        AnyStream::Socket& socket = stream->socket();
        error_code error;
        socket.open(endpoint.protocol(), error);
        if (error) return error;
        const auto limit = std::chrono::duration_cast<std::chrono::microseconds>(timeout).count();
        constexpr std::int64_t kMicro = 1'000'000;
        const timeval longest{limit / kMicro, limit % kMicro};
        const int descriptor = socket.native_handle();
        ::setsockopt(descriptor, SOL_SOCKET, SO_SNDTIMEO, &longest, sizeof longest);
        int failed = 0;
        do {
            failed =
                ::connect(descriptor, endpoint.data(), static_cast<socklen_t>(endpoint.size()));
        } while (failed != 0 && errno == EINTR);
        return failed == 0 ? error_code() : error_code(errno, asio::error::get_system_category());
    }

    void connect() {
        stream.reset();
        buffer.clear();
        if (tls) return connect_remote();
        Protocol::endpoint endpoint;
        try {
            endpoint = Protocol::endpoint(address.socket);
        } catch (const system_error&) {
            throw ClientError("socket: found '" + address.socket + "', expected at most 107 bytes");
        }
        stream.emplace(AnyStream::Socket(io));
        const error_code error = enter(endpoint);
        if (!error) return;
        stream.reset();
        if (error == asio::error::try_again)
            throw ClientError("cannot connect to " + where + ": its queue is full, nobody took " +
                              "this connection within " + std::to_string(timeout.count()) + " ms");
        if (error == boost::system::errc::no_such_file_or_directory ||
            error == asio::error::connection_refused) {
            throw NotRunning("no vibrigd answers at " + where +
                             " (is it running? --socket PATH or VIBRIG_SOCKET names another one)");
        }
        throw ClientError("cannot connect to " + where + ": " + error.message());
    }

    void connect_remote() {
        error_code error;
        asio::ip::tcp::resolver resolver(io);
        const auto found = resolver.resolve(host, port, error);
        if (error) throw ClientError("cannot find " + host + ": " + error.message());
        for (const auto& entry : found) {
            stream.emplace(AnyStream::Socket(io), *tls);
            const asio::generic::stream_protocol::endpoint endpoint(entry.endpoint());
            error = run([&](auto done) {
                stream->socket().async_connect(endpoint, [done](error_code code) { done(code); });
            });
            if (!error) break;
        }
        if (!error) {
            error = run([&](auto done) {
                stream->connect_handshake(
                    host, [done](error_code code) { done(code); }, address.expired_too);
            });
        }
        if (!error) return;
        stream.reset();
        if (error == asio::error::connection_refused)
            throw NotRunning("no vibrigd answers at " + where);
        throw ClientError("cannot connect to " + where + ": " + error.message());
    }

    error_code exchange(const Request& request, Reply& reply) {
        const error_code written =
            run([&](auto done) { http::async_write(*stream, request, std::move(done)); });
        if (written == asio::error::timed_out) return written;
        // A daemon that refuses may close before it has read all; its answer is there all the same.
        http::response_parser<http::string_body> parser;
        parser.body_limit(kLongestAnswer);
        error_code read = run(
            [&](auto done) { http::async_read_header(*stream, buffer, parser, std::move(done)); });
        // What it announces is memory that is taken before the limit is looked at.
        if (!read && parser.content_length().value_or(0) > kLongestAnswer)
            read = http::error::body_limit;
        if (!read)
            read =
                run([&](auto done) { http::async_read(*stream, buffer, parser, std::move(done)); });
        if (read) return written ? written : read;
        reply.status = static_cast<int>(parser.get().result_int());
        reply.body = std::move(parser.get().body());
        if (!parser.get().keep_alive()) stream.reset();
        return {};
    }

    Reply ask(Request request, bool may_repeat) {
        request.set(http::field::host, tls ? address.host : "localhost");
        request.prepare_payload();
        const bool kept = stream.has_value();
        if (!kept) connect();
        Reply reply;
        error_code error = exchange(request, reply);
        if (error && error != asio::error::timed_out && kept && may_repeat) {
            connect();
            error = exchange(request, reply);
        }
        if (!error) return reply;
        stream.reset();
        const bool late = error == asio::error::timed_out;
        // In TLS 1.3 a client learns only here that its certificate was refused.
        throw ClientError(
            "vibrigd at " + where +
            (late ? ": no answer within the time" : ": connection lost: " + error.message()));
    }

    void follow(const std::string& target, const std::function<bool(const std::string&)>& take) {
        connect();
        websocket::stream<AnyStream> socket(std::move(*stream));
        stream.reset();
        // The server pings; who hears nothing for so long asks himself, and then gives up.
        socket.set_option(websocket::stream_base::timeout{timeout, kSilence, true});
        socket.read_message_max(kLongestAnswer);
        beast::flat_buffer message;
        error_code lost;
        std::function<void()> read = [&] {
            socket.async_read(message, [&](error_code error, std::size_t) {
                lost = error;
                if (error || !take(beast::buffers_to_string(message.data()))) return io.stop();
                message.consume(message.size());
                read();
            });
        };
        socket.async_handshake(tls ? address.host : "localhost", target, [&](error_code error) {
            lost = error;
            error ? io.stop() : read();
        });
        io.restart();
        io.run();
        socket.next_layer().close();
        io.restart();
        io.poll();  // what was still waiting ends
        if (lost) throw ClientError("vibrigd at " + where + ": connection lost: " + lost.message());
    }

    const Address address;
    const std::chrono::milliseconds timeout;
    std::string where, host, port;
    std::optional<asio::ssl::context> tls;
    asio::io_context io{1};
    std::optional<AnyStream> stream;
    boost::beast::flat_buffer buffer;
};

Client::Client(std::string path, std::chrono::milliseconds timeout)
    : Client(Address{std::move(path), {}, {}, false}, timeout) {}

Client::Client(const Address& address, std::chrono::milliseconds timeout)
    : impl_(std::make_unique<Impl>(address, timeout)) {}

Client::~Client() = default;

Reply Client::get(const std::string& target) {
    Request request(http::verb::get, target, kHttp11);
    return impl_->ask(std::move(request), true);
}

Reply Client::post(const std::string& target, const std::string& json) {
    Request request(http::verb::post, target, kHttp11);
    request.set(http::field::content_type, "application/json");
    request.body() = json;
    impl_->stream.reset();
    return impl_->ask(std::move(request), false);
}

void Client::follow(const std::string& target,
                    const std::function<bool(const std::string&)>& take) {
    impl_->follow(target, take);
}

}  // namespace vibrig::serve
