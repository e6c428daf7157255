#include "daemon/serve/client.hpp"

#include <boost/asio/io_context.hpp>
#include <boost/asio/local/stream_protocol.hpp>
#include <boost/beast/core/basic_stream.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/http/parser.hpp>
#include <boost/beast/http/read.hpp>
#include <boost/beast/http/string_body.hpp>
#include <boost/beast/http/write.hpp>
#include <optional>
#include <utility>

namespace vibrig::serve {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = boost::beast::http;
using Protocol = asio::local::stream_protocol;
using Request = http::request<http::string_body>;
using boost::system::error_code;
using boost::system::system_error;

constexpr unsigned kHttp11 = 11;
constexpr std::uint64_t kLongestAnswer = 64 * 1024 * 1024;

}  // namespace

struct Client::Impl {
    Impl(std::string socket_path, std::chrono::milliseconds limit)
        : path(std::move(socket_path)), timeout(limit) {}

    /// Asynchronous underneath: only so does a deadline hold.
    template <typename Start>
    error_code run(Start&& start) {
        error_code result = asio::error::would_block;
        stream->expires_after(timeout);
        start([&result](error_code error, std::size_t = 0) { result = error; });
        io.restart();
        io.run();
        return result;
    }

    void connect() {
        stream.emplace(io);
        buffer.clear();
        Protocol::endpoint endpoint;
        try {
            endpoint = Protocol::endpoint(path);
        } catch (const system_error&) {
            stream.reset();
            throw ClientError("socket: found '" + path + "', expected at most 107 bytes");
        }
        const error_code error = run([&](auto done) {
            stream->async_connect(endpoint, [done](error_code code) mutable { done(code); });
        });
        if (!error) return;
        stream.reset();
        if (error == boost::system::errc::no_such_file_or_directory ||
            error == asio::error::connection_refused) {
            throw NotRunning("no vibrigd answers at " + path +
                             " (is it running? --socket PATH or VIBRIG_SOCKET names another one)");
        }
        throw ClientError("cannot connect to " + path + ": " + error.message());
    }

    error_code exchange(const Request& request, Reply& reply) {
        const error_code written =
            run([&](auto done) { http::async_write(*stream, request, std::move(done)); });
        if (written == beast::error::timeout) return written;
        // A daemon that refuses may close before it has read all; its answer is there all the same.
        http::response_parser<http::string_body> parser;
        parser.body_limit(kLongestAnswer);
        const error_code read =
            run([&](auto done) { http::async_read(*stream, buffer, parser, std::move(done)); });
        if (read) return written ? written : read;
        reply.status = static_cast<int>(parser.get().result_int());
        reply.body = std::move(parser.get().body());
        if (!parser.get().keep_alive()) stream.reset();
        return {};
    }

    Reply ask(const Request& request, bool may_repeat) {
        const bool kept = stream.has_value();
        if (!kept) connect();
        Reply reply;
        error_code error = exchange(request, reply);
        if (error && error != beast::error::timeout && kept && may_repeat) {
            connect();
            error = exchange(request, reply);
        }
        if (!error) return reply;
        stream.reset();
        const bool late = error == beast::error::timeout;
        throw ClientError(
            "vibrigd at " + path +
            (late ? ": no answer within the time" : ": connection lost: " + error.message()));
    }

    std::string path;
    std::chrono::milliseconds timeout;
    asio::io_context io{1};
    std::optional<beast::basic_stream<Protocol>> stream;
    beast::flat_buffer buffer;
};

Client::Client(std::string path, std::chrono::milliseconds timeout)
    : impl_(std::make_unique<Impl>(std::move(path), timeout)) {}

Client::~Client() = default;

Reply Client::get(const std::string& target) {
    Request request(http::verb::get, target, kHttp11);
    request.set(http::field::host, "localhost");
    request.prepare_payload();
    return impl_->ask(request, true);
}

Reply Client::post(const std::string& target, const std::string& json) {
    Request request(http::verb::post, target, kHttp11);
    request.set(http::field::host, "localhost");
    request.set(http::field::content_type, "application/json");
    request.body() = json;
    request.prepare_payload();
    impl_->stream.reset();
    return impl_->ask(request, false);
}

const std::string& Client::path() const noexcept { return impl_->path; }

}  // namespace vibrig::serve
