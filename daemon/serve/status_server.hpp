#pragma once

#include <sys/types.h>

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>

#include "daemon/serve/documents.hpp"
#include "daemon/serve/socket_file.hpp"
#include "daemon/status/source.hpp"

namespace vibrig::serve {

struct ServerLimits {
    std::size_t connections = 64;  ///< at a time through each door; one more is answered 503
    std::size_t newcomers = 64;    ///< in TLS, without a certificate so far; the oldest has to go
    std::chrono::milliseconds idle_timeout{
        30'000};  ///< for a whole request to come, and for an answer to be taken
    std::uint32_t header_bytes = 8 * 1024;
    std::uint64_t body_bytes = 16'384;
    double requests_per_s = 2000;  ///< of one connection; more are answered 429
};

/// Where it listens; an empty text: not there.
struct ServerSettings {
    std::string socket;          ///< control: who may open it may read, operators may command
    std::string operator_group;  ///< of the control socket's peers; empty: all are operators
    std::string status_socket;   ///< read-only
    std::string page;            ///< "127.0.0.1:8090": plain HTTP on loopback, read-only
    std::string remote;          ///< "0.0.0.0:8443": TLS with certificates on both sides
    std::string certificate, key, clients_ca;  ///< of `remote`, PEM files
    std::string revoked;  ///< list of clients' certificates that no longer count; empty: none
    ServerLimits limits = {};
    Documents documents = {};  ///< all there is to be read; empty: the daemon's own API and page
};

/// Of `server.operator_group`. Throws ServeError where this machine has no such group.
[[nodiscard]] gid_t group_named(const std::string& name);

/// HTTP/1.1 and WebSocket on a thread of its own: it asks the StatusSource, and nothing waits for
/// it.
class StatusServer {
  public:
    /// Listens when it returns, so that nobody else does; clients wait for answer(). Throws
    /// ServeError ("another vibrigd answers at PATH", no such folder, a certificate that cannot be
    /// read, ...).
    StatusServer(StatusSource& source, const ServerSettings& settings);
    /// The control socket alone, answered at once.
    StatusServer(StatusSource& source, const std::string& path, const ServerLimits& limits = {});
    /// Closes all connections and removes the sockets' files.
    ~StatusServer();
    StatusServer(const StatusServer&) = delete;
    StatusServer& operator=(const StatusServer&) = delete;

    /// Once, when `source` may be asked.
    void answer();
    /// With the port that was found for port 0; empty: not listening there.
    [[nodiscard]] std::string page_address() const;
    [[nodiscard]] std::string remote_address() const;

  private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace vibrig::serve
