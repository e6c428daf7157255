#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>

#include "daemon/serve/socket_file.hpp"
#include "daemon/status.hpp"

namespace vibrig::serve {

struct ServerLimits {
    std::size_t connections = 64;  ///< at a time; one more is answered 503
    std::chrono::milliseconds idle_timeout{
        30'000};  ///< for a whole request to come, and for an answer to be taken
    std::uint32_t header_bytes = 8 * 1024;
    std::uint64_t body_bytes = 16 * 1024;
};

/// HTTP/1.1 over a Unix domain socket, on a thread of its own: it asks the StatusSource, and
/// nothing waits for it. Whoever may open the socket may read and command.
class StatusServer {
  public:
    /// Listens when it returns. Throws ServeError ("another vibrigd answers at PATH", no such
    /// folder, ...).
    StatusServer(StatusSource& source, const std::string& path, const ServerLimits& limits = {});
    /// Closes all connections and removes the socket's file.
    ~StatusServer();
    StatusServer(const StatusServer&) = delete;
    StatusServer& operator=(const StatusServer&) = delete;

  private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace vibrig::serve
