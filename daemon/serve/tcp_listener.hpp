#pragma once

#include <string>

namespace vibrig::serve {

/// A listening TCP socket; the caller closes the descriptor.
struct TcpListener {
    int descriptor = -1;
    std::string address;  ///< as it came out, "127.0.0.1:8090", "[::1]:8090"
};

/// "HOST:PORT", "[::1]:PORT"; port 0: any free one. Throws ServeError that names `key`.
[[nodiscard]] TcpListener listen_tcp(const std::string& key, const std::string& address,
                                     bool loopback_only);

}  // namespace vibrig::serve
