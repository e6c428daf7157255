#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "daemon/serve/any_stream.hpp"
#include "daemon/serve/api.hpp"
#include "daemon/serve/status_server.hpp"
#include "daemon/serve/stream_feed.hpp"

namespace vibrig::serve {

/// What all connections of the server share; outlives them.
struct Shared {
    Api& api;
    const ServerLimits& limits;
    /// Grows when certificates or the list of revoked ones change: who came in with TLS before has
    /// to show his certificate again.
    std::uint64_t certificates = 0;
};

/// Serves one connection until it ends. With TLS the role comes from the certificate.
void serve_connection(AnyStream stream, Caller caller, Shared& shared);
/// Answers without reading, as far as the socket takes it at once, and closes.
void turn_away(AnyStream::Socket socket, std::size_t limit);

}  // namespace vibrig::serve
