#include "daemon/serve/any_stream.hpp"

#include <openssl/x509v3.h>

#include <algorithm>
#include <boost/asio/ssl/host_name_verification.hpp>
#include <boost/asio/ssl/stream.hpp>
#include <optional>

#include "daemon/serve/tls.hpp"

namespace vibrig::serve {

namespace asio = boost::asio;
using boost::system::error_code;

struct AnyStream::Impl {
    std::optional<Socket> plain;
    std::optional<asio::ssl::stream<Socket>> tls;
};

AnyStream::AnyStream(Socket socket) : impl_(std::make_unique<Impl>()) {
    impl_->plain.emplace(std::move(socket));
}
AnyStream::AnyStream(Socket socket, asio::ssl::context& tls) : impl_(std::make_unique<Impl>()) {
    impl_->tls.emplace(std::move(socket), tls);
}
AnyStream::AnyStream(AnyStream&&) noexcept = default;
AnyStream& AnyStream::operator=(AnyStream&&) noexcept = default;
AnyStream::~AnyStream() = default;

AnyStream::Socket& AnyStream::socket() noexcept {
    return impl_->tls ? impl_->tls->next_layer() : *impl_->plain;
}
AnyStream::executor_type AnyStream::get_executor() noexcept { return socket().get_executor(); }
bool AnyStream::encrypted() const noexcept { return impl_->tls.has_value(); }

void AnyStream::read(asio::mutable_buffer into, Done done) {
    if (impl_->tls)
        impl_->tls->async_read_some(asio::mutable_buffers_1(into), std::move(done));
    else
        impl_->plain->async_read_some(asio::mutable_buffers_1(into), std::move(done));
}

void AnyStream::write(const Buffers& from, Done done) {
    if (impl_->tls)
        impl_->tls->async_write_some(from, std::move(done));
    else
        impl_->plain->async_write_some(from, std::move(done));
}

void AnyStream::accept_handshake(std::function<void(error_code)> done) {
    impl_->tls->async_handshake(asio::ssl::stream_base::server, std::move(done));
}

void AnyStream::connect_handshake(const std::string& host, std::function<void(error_code)> done,
                                  bool expired_too) {
    SSL* const ssl = impl_->tls->native_handle();
    error_code numeric;
    asio::ip::make_address(host, numeric);
    // As the macro SSL_set_tlsext_host_name does, without its cast.
    if (numeric) {
        std::string name = host;
        SSL_ctrl(ssl, SSL_CTRL_SET_TLSEXT_HOSTNAME, TLSEXT_NAMETYPE_host_name, name.data());
    }
    impl_->tls->set_verify_callback([named = asio::ssl::host_name_verification(host), expired_too](
                                        bool good, asio::ssl::verify_context& at) {
        return named(good || (expired_too && only_expired(at)), at);
    });
    impl_->tls->async_handshake(asio::ssl::stream_base::client, std::move(done));
}

std::pair<std::string, std::string> AnyStream::peer_subject() const {
    if (!impl_->tls) return {};
    const std::unique_ptr<X509, void (*)(X509*)> certificate(
        SSL_get1_peer_certificate(impl_->tls->native_handle()), X509_free);
    if (!certificate) return {};
    X509_NAME* const subject = X509_get_subject_name(certificate.get());
    const auto entry = [subject](int nid) -> std::string {
        // More than one would leave open which of them counts.
        const int at = X509_NAME_get_index_by_NID(subject, nid, -1);
        if (at < 0 || X509_NAME_get_index_by_NID(subject, nid, at) >= 0) return {};
        unsigned char* text = nullptr;
        const int size =
            ASN1_STRING_to_UTF8(&text, X509_NAME_ENTRY_get_data(X509_NAME_get_entry(subject, at)));
        if (size < 0) return {};
        const std::string found(text, text + size);
        OPENSSL_free(text);
        return found;
    };
    return {entry(NID_commonName), entry(NID_organizationalUnitName)};
}

bool AnyStream::peer_is_good_for(asio::ssl::context& now) const {
    SSL* const ssl = impl_->tls->native_handle();
    const std::unique_ptr<X509, void (*)(X509*)> certificate(SSL_get1_peer_certificate(ssl),
                                                             X509_free);
    const std::unique_ptr<X509_STORE_CTX, void (*)(X509_STORE_CTX*)> at(X509_STORE_CTX_new(),
                                                                        X509_STORE_CTX_free);
    if (!certificate || !at ||
        X509_STORE_CTX_init(at.get(), SSL_CTX_get_cert_store(now.native_handle()),
                            certificate.get(), SSL_get_peer_cert_chain(ssl)) != 1 ||
        X509_STORE_CTX_set_default(at.get(), "ssl_client") != 1)
        return false;
    X509_STORE_CTX_set_verify_cb(at.get(), [](int good, X509_STORE_CTX* found) {
        asio::ssl::verify_context context(found);
        return good == 1 || only_expired(context) ? 1 : 0;
    });
    return X509_verify_cert(at.get()) == 1;
}

std::int64_t AnyStream::peer_expiry() const {
    if (!impl_->tls) return 0;
    SSL* const ssl = impl_->tls->native_handle();
    const std::unique_ptr<X509, void (*)(X509*)> certificate(SSL_get1_peer_certificate(ssl),
                                                             X509_free);
    std::int64_t end = end_of(certificate.get());
    const STACK_OF(X509)* const chain = SSL_get0_verified_chain(ssl);
    for (int i = 0; chain != nullptr && i < sk_X509_num(chain); ++i)
        end = std::min(end, end_of(sk_X509_value(chain, i)));
    return end;
}

std::string AnyStream::certificate_problem() const {
    if (!impl_->tls) return {};
    const long found = SSL_get_verify_result(impl_->tls->native_handle());
    return found == X509_V_OK ? "" : X509_verify_cert_error_string(found);
}

void AnyStream::finish() noexcept {
    error_code ignored;
    socket().shutdown(Socket::shutdown_send, ignored);
}

void AnyStream::close() noexcept {
    error_code ignored;
    socket().close(ignored);
}

}  // namespace vibrig::serve
