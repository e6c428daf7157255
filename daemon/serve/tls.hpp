#pragma once

#include <openssl/x509.h>

#include <boost/asio/ssl/context.hpp>
#include <cstdint>
#include <string>

namespace vibrig::serve {

/// TLS 1.2 or later with certificates on both sides: an own one with its key, and the authority
/// that the other side's must come from. `revoked`: the authority's list of certificates that no
/// longer count; empty: none. `expired_too`: the other side's may have expired, and whoever talks
/// to it looks at peer_expiry(). Throws ServeError that names the file.
[[nodiscard]] boost::asio::ssl::context mutual_tls(const std::string& certificate,
                                                   const std::string& key,
                                                   const std::string& authority, bool server,
                                                   const std::string& revoked = {},
                                                   bool expired_too = false);

/// Whether all that is wrong at this place of a chain is its age.
[[nodiscard]] bool only_expired(boost::asio::ssl::verify_context& context) noexcept;

/// When the certificate in a PEM file ends, s UTC; of several the last end (a renewed authority
/// stands beside the old one), or the first certificate's own (a server's, before its chain).
/// Throws ServeError.
[[nodiscard]] std::int64_t expiry_of(const std::string& file, bool first_alone);
/// s UTC; 0: none or not readable.
[[nodiscard]] std::int64_t end_of(const X509* certificate) noexcept;

}  // namespace vibrig::serve
