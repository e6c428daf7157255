#include "daemon/serve/status_server.hpp"

#include <pthread.h>
#include <sys/socket.h>

#include <boost/asio/io_context.hpp>
#include <boost/asio/local/stream_protocol.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/core/basic_stream.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/http/parser.hpp>
#include <boost/beast/http/read.hpp>
#include <boost/beast/http/string_body.hpp>
#include <boost/beast/http/write.hpp>
#include <csignal>
#include <cstdio>
#include <optional>
#include <random>
#include <thread>
#include <utility>

#include "daemon/serve/api.hpp"

namespace vibrig::serve {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = boost::beast::http;
using Protocol = asio::local::stream_protocol;
using Socket = Protocol::socket;
using boost::system::error_code;

constexpr auto kAcceptPause = std::chrono::milliseconds(100);

/// The peer as the kernel recorded it at connect().
unsigned uid_of(Socket& socket) {
    ucred peer{};
    socklen_t size = sizeof peer;
    if (::getsockopt(socket.native_handle(), SOL_SOCKET, SO_PEERCRED, &peer, &size) != 0) {
        return static_cast<unsigned>(-1);
    }
    return peer.uid;
}

std::string random_instance() {
    std::random_device random;
    std::array<char, 17> text{};
    std::snprintf(text.data(), text.size(), "%08x%08x", random(), random());
    return text.data();
}

using Response = http::response<http::string_body>;

Response response_of(ApiAnswer answer, unsigned version, bool keep_alive) {
    Response response(static_cast<http::status>(answer.status), version);
    response.set(http::field::server, "vibrigd");
    response.set(http::field::content_type, answer.content_type);
    response.set(http::field::cache_control, "no-store");
    if (!answer.allow.empty()) response.set(http::field::allow, answer.allow);
    response.keep_alive(keep_alive);
    response.body() = std::move(answer.body);
    response.prepare_payload();
    return response;
}

/// One connection: read a request, answer, again. Server thread only; lives while a handler of it
/// waits.
class Session : public std::enable_shared_from_this<Session> {
  public:
    Session(Socket socket, Api& api, const ServerLimits& limits, std::size_t& open)
        : uid_(uid_of(socket)),
          stream_(std::move(socket)),
          api_(api),
          limits_(limits),
          open_(open),
          buffer_(limits.header_bytes + limits.body_bytes + 4096) {
        ++open_;
    }
    ~Session() { --open_; }
    Session(const Session&) = delete;
    Session& operator=(const Session&) = delete;

    void read() {
        parser_.emplace();
        parser_->header_limit(limits_.header_bytes);
        parser_->body_limit(limits_.body_bytes);
        // One deadline for the whole request: who sends a byte now and then does not hold a place.
        stream_.expires_after(limits_.idle_timeout);
        http::async_read(
            stream_, buffer_, *parser_,
            [self = shared_from_this()](error_code error, std::size_t) { self->on_read(error); });
    }

    void write(Response response) {
        response_ = std::move(response);
        stream_.expires_after(limits_.idle_timeout);
        http::async_write(stream_, response_,
                          [self = shared_from_this()](error_code error, std::size_t) {
                              if (error) return;
                              if (self->response_.need_eof()) return self->close();
                              self->read();
                          });
    }

  private:
    void on_read(error_code error) {
        if (error == http::error::header_limit || error == http::error::buffer_overflow) {
            return refuse(431,
                          "header: more than " + std::to_string(limits_.header_bytes) + " bytes");
        }
        if (error == http::error::body_limit) {
            return refuse(413, "body: more than " + std::to_string(limits_.body_bytes) + " bytes");
        }
        if (error == http::error::end_of_stream || error == http::error::partial_message) {
            return close();
        }
        if (error &&
            error.category() == http::make_error_code(http::error::bad_method).category()) {
            return refuse(400, "not a request in HTTP/1.1: " + error.message());
        }
        if (error) return;  // gone, or out of time

        const auto& request = parser_->get();
        const bool head = request.method() == http::verb::head;
        const auto method = request.method_string();
        const auto target = request.target();
        const auto type = request[http::field::content_type];
        ApiAnswer answer = api_.answer({{method.data(), method.size()},
                                        {target.data(), target.size()},
                                        {type.data(), type.size()},
                                        request.body(),
                                        uid_});
        // HEAD is refused like any other method, but its answer may not carry a body.
        if (head) answer.body.clear();
        write(response_of(std::move(answer), request.version(), request.keep_alive()));
    }

    /// After a request that could not be read the place of the next one is not known: answer and
    /// close.
    void refuse(int status, const std::string& detail) {
        constexpr unsigned kHttp11 = 11;
        write(response_of(Api::problem(status, detail), kHttp11, false));
    }

    void close() {
        error_code ignored;
        stream_.socket().shutdown(Socket::shutdown_send, ignored);
    }

    const unsigned uid_;
    beast::basic_stream<Protocol> stream_;
    Api& api_;
    const ServerLimits& limits_;
    std::size_t& open_;
    beast::flat_buffer buffer_;
    std::optional<http::request_parser<http::string_body>> parser_;
    Response response_;
};

/// Answers without reading, as far as the socket takes it at once, and closes.
void turn_away(Socket socket, std::size_t limit) {
    constexpr unsigned kHttp11 = 11;
    const std::string detail = "all " + std::to_string(limit) + " connections are taken";
    error_code ignored;
    socket.non_blocking(true, ignored);
    const Response response = response_of(Api::problem(503, detail), kHttp11, false);
    http::write(socket, response, ignored);
}

}  // namespace

struct StatusServer::Impl {
    Impl(StatusSource& source, const std::string& path, const ServerLimits& given)
        : limits(given), file(path), api(source, random_instance()), acceptor(io), pause(io) {
        acceptor.assign(Protocol(), file.release());
        accept();
        // Signals are for the main thread.
        sigset_t all, before;
        sigfillset(&all);
        pthread_sigmask(SIG_BLOCK, &all, &before);
        thread = std::thread([this] {
            pthread_setname_np(pthread_self(), "server");
            io.run();
        });
        pthread_sigmask(SIG_SETMASK, &before, nullptr);
    }

    ~Impl() {
        io.stop();
        thread.join();
    }

    void accept() {
        acceptor.async_accept([this](error_code error, Socket socket) {
            if (error == asio::error::operation_aborted) return;
            if (error) {
                // Out of descriptors, mostly: a waiting connection would be reported again at once.
                pause.expires_after(kAcceptPause);
                pause.async_wait([this](error_code stopped) {
                    if (!stopped) accept();
                });
                return;
            }
            if (open >= limits.connections) {
                turn_away(std::move(socket), limits.connections);
            } else {
                std::make_shared<Session>(std::move(socket), api, limits, open)->read();
            }
            accept();
        });
    }

    const ServerLimits limits;
    SocketFile file;
    Api api;
    std::size_t open = 0;  // outlives the io_context, whose end destroys the waiting sessions
    asio::io_context io{1};
    Protocol::acceptor acceptor;
    asio::steady_timer pause;
    std::thread thread;
};

StatusServer::StatusServer(StatusSource& source, const std::string& path,
                           const ServerLimits& limits)
    : impl_(std::make_unique<Impl>(source, path, limits)) {}

StatusServer::~StatusServer() = default;

}  // namespace vibrig::serve
