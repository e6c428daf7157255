#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <stdexcept>
#include <string>

namespace vibrig::serve {

/// The daemon cannot be asked; the message names the socket and the cause.
class ClientError : public std::runtime_error {
  public:
    using std::runtime_error::runtime_error;
};
/// Nobody listens at the socket.
class NotRunning : public ClientError {
  public:
    using ClientError::ClientError;
};

struct Reply {
    int status = 0;  ///< of HTTP
    std::string body;
};

/// Where a daemon is asked: at its Unix socket, or with TLS when there is a host.
struct Address {
    std::string socket;
    std::string host;          ///< "rig.lab", "rig.lab:8443"; empty: the socket
    std::string identity;      ///< "FOLDER/NAME": NAME.crt, NAME.key and authority.crt are there
    bool expired_too = false;  ///< for a stop: the daemon's certificate may have expired
};

/// Asks a running vibrigd. Blocks up to the timeout; one thread.
class Client {
  public:
    explicit Client(std::string path, std::chrono::milliseconds timeout = std::chrono::seconds(5));
    /// Throws ClientError when the identity cannot be read.
    explicit Client(const Address& address,
                    std::chrono::milliseconds timeout = std::chrono::seconds(5));
    ~Client();
    Client(const Client&) = delete;
    Client& operator=(const Client&) = delete;

    /// Keeps the connection, and makes a new one when the daemon has closed it meanwhile. Throws
    /// ClientError.
    [[nodiscard]] Reply get(const std::string& target);
    /// On a connection of its own and never sent twice. Throws ClientError.
    [[nodiscard]] Reply post(const std::string& target, const std::string& json);
    /// Gives each text message of the WebSocket there to `take` until that says false. Throws
    /// ClientError when the connection ends before, or nothing is heard for long.
    void follow(const std::string& target, const std::function<bool(const std::string&)>& take);

  private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace vibrig::serve
