#include "daemon/serve/session.hpp"

#include <algorithm>
#include <boost/asio/ssl/error.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/write.hpp>
#include <boost/beast/core/buffers_to_string.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/http/parser.hpp>
#include <boost/beast/http/read.hpp>
#include <boost/beast/http/string_body.hpp>
#include <boost/beast/http/write.hpp>
#include <boost/beast/websocket.hpp>
#include <ctime>
#include <memory>
#include <optional>
#include <sstream>
#include <utility>

#include "daemon/serve/expiry_watch.hpp"
#include "proto/text.hpp"

namespace vibrig::serve {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = boost::beast::http;
namespace websocket = boost::beast::websocket;
using boost::system::error_code;
using Clock = std::chrono::steady_clock;
using Request = http::request<http::string_body>;
using Response = http::response<http::string_body>;

constexpr unsigned kHttp11 = 11;
constexpr auto kHandshakeTime = std::chrono::seconds(5);
constexpr std::size_t kLongestStreamMessage = 1024;

Response response_of(ApiAnswer answer, unsigned version, bool keep_alive) {
    Response response(static_cast<http::status>(answer.status), version);
    response.set(http::field::server, "vibrigd");
    response.set(http::field::content_type, answer.content_type);
    response.set(http::field::cache_control, "no-store");
    response.set("X-Content-Type-Options", "nosniff");
    if (answer.is_page) {
        response.set("Content-Security-Policy",
                     "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' "
                     "data:; connect-src 'self'; base-uri 'none'; form-action 'none'; "
                     "frame-ancestors 'none'");
        response.set("Referrer-Policy", "no-referrer");
    }
    if (!answer.allow.empty()) response.set(http::field::allow, answer.allow);
    if (answer.try_later) response.set(http::field::retry_after, "1");
    response.keep_alive(keep_alive);
    response.body() = std::move(answer.body);
    response.prepare_payload();
    return response;
}

/// Until that moment, s UTC.
std::chrono::seconds left_of(std::int64_t expires) {
    return std::chrono::seconds(expires - static_cast<std::int64_t>(std::time(nullptr)));
}

std::string_view repeated(const Request& request) {
    if (request.count(http::field::host) > 1) return "Host";
    if (request.count(http::field::origin) > 1) return "Origin";
    return request.count(http::field::content_type) > 1 ? "Content-Type" : "";
}

std::string_view view(beast::string_view text) { return {text.data(), text.size()}; }

using Tls = std::shared_ptr<asio::ssl::context>;

/// By the certificates and lists of now, too: who is, is not sent away in the middle of a stop.
bool still_admitted(const AnyStream& stream, const Shared& shared, Tls& admitted) {
    if (!stream.encrypted() || admitted == shared.tls) return true;
    if (!stream.peer_is_good_for(*shared.tls)) return false;
    admitted = shared.tls;
    return true;
}

/// One WebSocket client of the stream. Server thread only; lives while a handler of it waits.
class Stream : public std::enable_shared_from_this<Stream> {
  public:
    /// `admitted`: Shared::tls when the client's was looked at.
    Stream(AnyStream stream, StreamClient client, Shared& shared, Place place, Tls admitted,
           std::shared_ptr<const CertificateStatus> certificate)
        : socket_(std::move(stream)),
          client_(std::move(client)),
          shared_(shared),
          place_(std::move(place)),
          admitted_(std::move(admitted)),
          certificate_(std::move(certificate)),
          timer_(socket_.get_executor()) {
        ++shared_.api.traffic.streams;
        ++shared_.api.traffic.connections;
        auto timeout = websocket::stream_base::timeout::suggested(beast::role_type::server);
        timeout.idle_timeout = shared_.limits.idle_timeout;
        timeout.keep_alive_pings = true;
        socket_.set_option(timeout);
        socket_.read_message_max(kLongestStreamMessage);
        socket_.text(true);
    }
    ~Stream() {
        --shared_.api.traffic.streams;
        --shared_.api.traffic.connections;
    }
    Stream(const Stream&) = delete;
    Stream& operator=(const Stream&) = delete;

    void start(const Request& request) {
        socket_.async_accept(request, [self = shared_from_this()](error_code error) {
            if (error) return;
            self->read();
            self->go_on();
        });
    }

  private:
    void read() {
        socket_.async_read(buffer_, [self = shared_from_this()](error_code error, std::size_t) {
            if (error) return self->end();
            try {
                self->client_.take(beast::buffers_to_string(self->buffer_.data()));
            } catch (const std::exception& wrong) {
                return self->close(websocket::close_code::policy_error, wrong.what());
            }
            self->buffer_.consume(self->buffer_.size());
            self->read();
        });
    }

    /// Writes what is next, or waits until there is something. One of both is always under way.
    void go_on() {
        if (ended_) return;
        if (!still_admitted(socket_.next_layer(), shared_, admitted_))
            return close(websocket::close_code::policy_error, "the certificate no longer counts");
        if (certificate_ && left_of(certificate_->expires) <= std::chrono::seconds(0))
            return close(websocket::close_code::policy_error, "the certificate has expired");
        try {
            text_ = client_.next(Clock::now());
        } catch (const std::exception& slow) {
            ++shared_.api.traffic.streams_dropped;
            return close(websocket::close_code::try_again_later, slow.what());
        }
        if (!text_) {
            timer_.expires_at(certificate_ ? std::min(client_.due(),
                                                      Clock::now() + left_of(certificate_->expires))
                                           : client_.due());
            timer_.async_wait([self = shared_from_this()](error_code error) {
                if (!error) self->go_on();
            });
            return;
        }
        socket_.async_write(asio::buffer(*text_),
                            [self = shared_from_this()](error_code error, std::size_t) {
                                if (error) return self->end();
                                self->go_on();
                            });
    }

    void close(websocket::close_code code, const std::string& why) {
        if (std::exchange(ended_, true)) return;
        timer_.cancel();
        constexpr std::size_t kLongestReason = 120;
        websocket::close_reason reason(code);
        reason.reason = why.substr(0, kLongestReason);
        socket_.async_close(reason, [self = shared_from_this()](error_code) {
            self->socket_.next_layer().close();
        });
    }
    void end() {
        ended_ = true;
        timer_.cancel();
        socket_.next_layer().close();
    }

    websocket::stream<AnyStream> socket_;
    StreamClient client_;
    Shared& shared_;
    const Place place_;
    Tls admitted_;  ///< lives as long as its handshake
    const std::shared_ptr<const CertificateStatus> certificate_;  ///< null: none
    asio::steady_timer timer_;
    beast::flat_buffer buffer_;
    std::shared_ptr<const std::string> text_;
    bool ended_ = false;
};

/// One connection: read a request, answer, again. Server thread only; lives while a handler of it
/// waits.
class Session : public std::enable_shared_from_this<Session> {
  public:
    Session(AnyStream stream, Caller caller, Shared& shared, Places& places)
        : stream_(std::move(stream)),
          caller_(std::move(caller)),
          shared_(shared),
          places_(places),
          admitted_(shared.tls),
          deadline_(stream_.get_executor()),
          buffer_(shared.limits.header_bytes + shared.limits.body_bytes + 4096),
          requests_(shared.limits.requests_per_s, shared.limits.requests_per_s) {
        ++shared_.api.traffic.connections;
    }
    ~Session() {
        shared_.newcomers.remove(&stream_);
        --shared_.api.traffic.connections;
    }
    Session(const Session&) = delete;
    Session& operator=(const Session&) = delete;

    void start() {
        if (!caller_.encrypted) {
            if (take_place()) return read();
            // Who may command is heard: it may be a stop.
            if (caller_.role < Role::operate) return turn_away();
            become_newcomer();
            return read();
        }
        become_newcomer();
        arm(kHandshakeTime);
        stream_.accept_handshake([self = shared_from_this()](error_code error) {
            if (error) {
                const std::string why = self->stream_.certificate_problem();
                if (!why.empty() || error.category() == asio::error::get_ssl_category())
                    self->shared_.api.turned_away(self->caller_,
                                                  why.empty() ? error.message() : why,
                                                  self->shared_.strangers);
                return self->end();
            }
            const auto [name, unit] = self->stream_.peer_subject();
            Caller& who = self->caller_;
            who.role = role_named(unit);
            const std::int64_t expires = self->stream_.peer_expiry();
            who.expired = left_of(expires) <= std::chrono::seconds(0);
            // It goes into the audit.
            const std::string from = who.identity;
            who.identity = "certificate " + proto::printable(name, proto::kLongestLine) + ", " +
                           name_of(who.role);
            self->certificate_ =
                std::make_shared<const CertificateStatus>(CertificateStatus{who.identity, expires});
            if (!who.expired) self->shared_.clients.push_back(self->certificate_);
            if (who.expired) who.identity += ", expired " + date_of(expires);
            who.identity += from;
            // Nothing but a stop is taken, and one needs no place.
            if (who.expired) return self->read();
            // Without a place one stays a newcomer until the first request, which says so.
            self->take_place();
            self->read();
        });
    }

  private:
    /// Strangers may hold connections open, but no place that somebody with a certificate needs:
    /// one who has one is quicker than so many others come.
    void become_newcomer() {
        if (shared_.newcomers.size() >= shared_.limits.newcomers) {
            shared_.api.turned_away(caller_,
                                    std::to_string(shared_.limits.newcomers) +
                                        " wait to show a certificate: the oldest has to go",
                                    shared_.crowd);
            shared_.newcomers.front()->close();
            shared_.newcomers.pop_front();
        }
        shared_.newcomers.push_back(&stream_);
    }
    bool take_place() {
        place_ = places_.take();
        if (place_) shared_.newcomers.remove(&stream_);
        return place_ != nullptr;
    }
    void none_left() { shared_.api.turned_away(caller_, places_.none_left(), places_.logged); }
    void turn_away() {
        none_left();
        error_code ignored;
        stream_.socket().non_blocking(true, ignored);
        std::ostringstream text;
        text << response_of(Api::problem(503, places_.none_left()), kHttp11, false);
        asio::write(stream_.socket(), asio::buffer(text.str()), ignored);
    }

    void arm(std::chrono::milliseconds time) {
        deadline_.expires_after(time);
        deadline_.async_wait([weak = weak_from_this()](error_code error) {
            const auto self = weak.lock();
            if (!error && self) self->stream_.close();
        });
    }
    void end() {
        deadline_.cancel();
        stream_.close();
    }

    void read() {
        parser_.emplace();
        parser_->header_limit(shared_.limits.header_bytes);
        parser_->body_limit(shared_.limits.body_bytes);
        // One deadline for the whole request: who sends a byte now and then does not hold a place.
        std::chrono::milliseconds patience = place_ ? shared_.limits.idle_timeout : kHandshakeTime;
        // A connection lives no longer than its certificate.
        if (certificate_ && !caller_.expired)
            patience = std::clamp<std::chrono::milliseconds>(
                left_of(certificate_->expires), std::chrono::milliseconds(1), patience);
        arm(patience);
        http::async_read(
            stream_, buffer_, *parser_,
            [self = shared_from_this()](error_code error, std::size_t) { self->on_read(error); });
    }

    void write(Response response) {
        response_ = std::move(response);
        arm(shared_.limits.idle_timeout);
        http::async_write(stream_, response_,
                          [self = shared_from_this()](error_code error, std::size_t) {
                              if (error) return self->end();
                              if (self->response_.need_eof()) return self->finish();
                              self->read();
                          });
    }

    void on_read(error_code error) {
        const ServerLimits& limits = shared_.limits;
        if (error == http::error::header_limit || error == http::error::buffer_overflow) {
            return refuse(431,
                          "header: more than " + std::to_string(limits.header_bytes) + " bytes");
        }
        if (error == http::error::body_limit) {
            return refuse(413, "body: more than " + std::to_string(limits.body_bytes) + " bytes");
        }
        if (error == http::error::end_of_stream || error == http::error::partial_message) {
            return finish();
        }
        if (error &&
            error.category() == http::make_error_code(http::error::bad_method).category()) {
            return refuse(400, "not a request in HTTP/1.1: " + error.message());
        }
        if (error) return end();  // gone, or out of time
        if (!still_admitted(stream_, shared_, admitted_)) return finish();
        if (certificate_ && !caller_.expired &&
            left_of(certificate_->expires) <= std::chrono::seconds(0))
            return finish();  // he may come again, with a stop

        const Request& request = parser_->get();
        const bool head = request.method() == http::verb::head;
        const std::string_view target = view(request.target());
        const bool wants_stream = websocket::is_upgrade(request) &&
                                  target.substr(0, target.find('?')) == "/api/v1/stream";
        const ApiRequest asked{view(request.method_string()),
                               view(request.target()),
                               view(request[http::field::content_type]),
                               view(request[http::field::host]),
                               view(request[http::field::origin]),
                               request.body(),
                               repeated(request)};
        const bool stop = Api::is_stop(asked, caller_);
        if (!place_ && !stop && !caller_.expired && !take_place()) {
            none_left();
            return refuse(503, places_.none_left());
        }
        // HEAD is refused like any other method, but its answer may not carry a body.
        const auto reply = [self = shared_from_this(), head, version = request.version(),
                            keep = request.keep_alive() && place_](ApiAnswer answer) {
            if (head) answer.body.clear();
            self->write(response_of(std::move(answer), version, keep));
        };
        // What is carried out has no deadline of the connection's; its answer has.
        deadline_.cancel();
        ApiAnswer answer;
        if (!stop && !requests_.take(Clock::now())) {
            answer = Api::problem(429, "too many requests on this connection");
        } else if (wants_stream && caller_.role != Role::none && !caller_.expired) {
            answer = upgrade(asked);
            if (answer.status == 200) return;
        } else {
            return shared_.api.answer(asked, caller_, reply);
        }
        reply(std::move(answer));
    }

    /// Hands the connection to a Stream; status 200: done.
    ApiAnswer upgrade(const ApiRequest& asked) {
        if (ApiAnswer refusal = shared_.api.check_browser(asked, caller_); refusal.status != 200)
            return refusal;
        const std::size_t mark = std::min(asked.target.find('?'), asked.target.size());
        const std::string_view query = asked.target.substr(std::min(mark + 1, asked.target.size()));
        double rate = 0;
        std::uint64_t after = 0;
        bool with_status = true;
        try {
            check_query("/api/v1/stream", query);
            rate = parse_rate(query_value(query, "rate_hz"));
            if (const auto id = query_value(query, "after"); !id.empty())
                after = parse_count("after", id);
            if (const auto wanted = query_value(query, "status"); !wanted.empty()) {
                with_status = wanted != "false";
                if (with_status && wanted != "true")
                    throw std::invalid_argument("status: expected true or false");
            }
        } catch (const std::invalid_argument& error) {
            return Api::problem(400, error.what());
        }
        deadline_.cancel();
        StreamClient client(shared_.api.feed(), shared_.api.instance(), caller_.role, rate, after,
                            with_status);
        std::make_shared<Stream>(std::move(stream_), std::move(client), shared_, std::move(place_),
                                 admitted_, std::move(certificate_))
            ->start(parser_->get());
        return {};
    }

    /// After a request that could not be read the place of the next one is not known: answer and
    /// close.
    void refuse(int status, const std::string& detail) {
        write(response_of(Api::problem(status, detail), kHttp11, false));
    }

    void finish() {
        deadline_.cancel();
        stream_.finish();
    }

    AnyStream stream_;
    Caller caller_;
    Shared& shared_;
    Places& places_;
    Place place_;
    Tls admitted_;                                          ///< lives as long as its handshake
    std::shared_ptr<const CertificateStatus> certificate_;  ///< null: none
    asio::steady_timer deadline_;
    beast::flat_buffer buffer_;
    TokenBucket requests_;
    std::optional<http::request_parser<http::string_body>> parser_;
    Response response_;
};

}  // namespace

void serve_connection(AnyStream stream, Caller caller, Shared& shared, Places& places) {
    std::make_shared<Session>(std::move(stream), std::move(caller), shared, places)->start();
}

}  // namespace vibrig::serve
