#include "daemon/serve/tls.hpp"

#include <openssl/err.h>
#include <openssl/pem.h>
#include <openssl/ssl.h>
#include <openssl/x509_vfy.h>
#include <unistd.h>

#include <algorithm>
#include <boost/asio/ssl/error.hpp>
#include <cerrno>
#include <cstring>
#include <ctime>
#include <memory>

#include "daemon/serve/socket_file.hpp"

namespace vibrig::serve {

namespace asio = boost::asio;
namespace ssl = boost::asio::ssl;
using boost::system::error_code;

ssl::context mutual_tls(const std::string& certificate, const std::string& key,
                        const std::string& authority, bool server, const std::string& revoked,
                        bool expired_too) {
    ssl::context context(server ? ssl::context::tls_server : ssl::context::tls_client);
    const auto must = [](const error_code& error, const std::string& what,
                         const std::string& file) {
        if (!error) return;
        const bool there = ::access(file.c_str(), R_OK) == 0;
        throw ServeError(
            what + ": found '" + file + "': " +
            (there ? "expected it in PEM: " + error.message() : std::string(std::strerror(errno))));
    };
    context.set_options(ssl::context::default_workarounds | ssl::context::no_compression);
    SSL_CTX_set_min_proto_version(context.native_handle(), TLS1_2_VERSION);
    SSL_CTX_set_options(context.native_handle(), SSL_OP_NO_RENEGOTIATION);
    // A session taken up again would be judged by the certificate of back then.
    SSL_CTX_set_session_cache_mode(context.native_handle(), SSL_SESS_CACHE_OFF);
    SSL_CTX_set_options(context.native_handle(), SSL_OP_NO_TICKET);
    error_code error;
    context.use_certificate_chain_file(certificate, error);
    must(error, "certificate", certificate);
    context.use_private_key_file(key, ssl::context::pem, error);
    must(error, "key of the certificate", key);
    context.load_verify_file(authority, error);
    must(error, "authority's certificate", authority);
    if (!revoked.empty()) {
        X509_STORE* const store = SSL_CTX_get_cert_store(context.native_handle());
        X509_LOOKUP* const lookup = X509_STORE_add_lookup(store, X509_LOOKUP_file());
        ERR_clear_error();
        if (lookup == nullptr || X509_load_crl_file(lookup, revoked.c_str(), X509_FILETYPE_PEM) < 1)
            must(error_code(static_cast<int>(ERR_get_error()), asio::error::get_ssl_category()),
                 "list of revoked certificates", revoked);
        X509_STORE_set_flags(store, X509_V_FLAG_CRL_CHECK);
    }
    context.set_verify_mode(ssl::verify_peer | ssl::verify_fail_if_no_peer_cert);
    if (expired_too) {
        context.set_verify_callback(
            [](bool good, ssl::verify_context& at) { return good || only_expired(at); });
    }
    return context;
}

bool only_expired(ssl::verify_context& context) noexcept {
    const int why = X509_STORE_CTX_get_error(context.native_handle());
    return why == X509_V_ERR_CERT_HAS_EXPIRED || why == X509_V_ERR_CRL_HAS_EXPIRED;
}

std::int64_t end_of(const X509* certificate) noexcept {
    std::tm parts{};
    if (certificate == nullptr || ASN1_TIME_to_tm(X509_get0_notAfter(certificate), &parts) != 1)
        return 0;
    return ::timegm(&parts);
}

std::int64_t expiry_of(const std::string& file, bool first_alone) {
    const std::unique_ptr<BIO, decltype(&BIO_free_all)> in(BIO_new_file(file.c_str(), "r"),
                                                           BIO_free_all);
    std::int64_t end = 0;
    while (in) {
        const std::unique_ptr<X509, decltype(&X509_free)> certificate(
            PEM_read_bio_X509(in.get(), nullptr, nullptr, nullptr), X509_free);
        if (!certificate) break;
        end = std::max(end, end_of(certificate.get()));
        if (first_alone) break;
    }
    ERR_clear_error();
    if (end == 0) throw ServeError("certificate: found '" + file + "', expected one in PEM");
    return end;
}

}  // namespace vibrig::serve
