#pragma once

#include <cstddef>
#include <cstdint>
#include <list>
#include <memory>
#include <string>
#include <vector>

#include "daemon/serve/any_stream.hpp"
#include "daemon/serve/api.hpp"
#include "daemon/serve/status_server.hpp"
#include "daemon/serve/stream_feed.hpp"

namespace vibrig::serve {

struct GiveBack {
    void operator()(std::size_t* taken) const noexcept { --*taken; }
};
/// A connection's place, given back with it.
using Place = std::unique_ptr<std::size_t, GiveBack>;

/// The places of one door: who fills it leaves the other doors open. Outlives its connections.
struct Places {
    std::string door;  ///< "the page"
    std::size_t most;
    std::size_t taken = 0;
    TokenBucket logged{1. / 60, 1};  ///< a full door, once a minute

    /// Null: none is left.
    [[nodiscard]] Place take() { return Place(taken < most ? &++taken : nullptr); }
    [[nodiscard]] std::string none_left() const {
        return "all " + std::to_string(most) + " connections of " + door + " are taken";
    }
};

/// What all connections of the server share; outlives them.
struct Shared {
    Api& api;
    const ServerLimits& limits;
    TokenBucket strangers{1, 20};  ///< that are logged
    TokenBucket crowd{1. / 60, 1};
    /// Who has not shown a certificate, the oldest first: these take no places from those who have.
    std::list<AnyStream*> newcomers = {};
    /// Another one when certificates or the list of revoked ones have changed: of who came in with
    /// TLS before the certificate is looked at again. Empty without TLS.
    std::shared_ptr<boost::asio::ssl::context> tls = {};
    /// Who is connected with a certificate, while he is.
    std::vector<std::weak_ptr<const CertificateStatus>> clients = {};
};

/// Serves one connection until it ends. With TLS the role comes from the certificate, and a place
/// is taken once it is known; without, one who finds none is answered 503 without reading, as far
/// as the socket takes it at once.
void serve_connection(AnyStream stream, Caller caller, Shared& shared, Places& places);

}  // namespace vibrig::serve
