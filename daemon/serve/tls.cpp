#include "daemon/serve/tls.hpp"

#include <openssl/ssl.h>

#include "daemon/serve/socket_file.hpp"

namespace vibrig::serve {

namespace ssl = boost::asio::ssl;
using boost::system::error_code;

ssl::context mutual_tls(const std::string& certificate, const std::string& key,
                        const std::string& authority, bool server) {
    ssl::context context(server ? ssl::context::tls_server : ssl::context::tls_client);
    const auto must = [](const error_code& error, const std::string& what,
                         const std::string& file) {
        if (error) throw ServeError(what + ": found '" + file + "': " + error.message());
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
    context.set_verify_mode(ssl::verify_peer | ssl::verify_fail_if_no_peer_cert);
    return context;
}

}  // namespace vibrig::serve
