#include "daemon/serve/tls.hpp"

#include <openssl/err.h>
#include <openssl/ssl.h>
#include <openssl/x509_vfy.h>
#include <unistd.h>

#include <boost/asio/ssl/error.hpp>
#include <cerrno>
#include <cstring>

#include "daemon/serve/socket_file.hpp"

namespace vibrig::serve {

namespace asio = boost::asio;
namespace ssl = boost::asio::ssl;
using boost::system::error_code;

ssl::context mutual_tls(const std::string& certificate, const std::string& key,
                        const std::string& authority, bool server, const std::string& revoked) {
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
    return context;
}

}  // namespace vibrig::serve
