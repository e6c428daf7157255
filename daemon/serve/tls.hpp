#pragma once

#include <boost/asio/ssl/context.hpp>
#include <string>

namespace vibrig::serve {

/// TLS 1.2 or later with certificates on both sides: an own one with its key, and the authority
/// that the other side's must come from. `revoked`: the authority's list of certificates that no
/// longer count; empty: none. Throws ServeError that names the file.
[[nodiscard]] boost::asio::ssl::context mutual_tls(const std::string& certificate,
                                                   const std::string& key,
                                                   const std::string& authority, bool server,
                                                   const std::string& revoked = {});

}  // namespace vibrig::serve
