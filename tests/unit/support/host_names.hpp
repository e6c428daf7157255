#pragma once

#include <string>
#include <vector>

namespace vibrig {

/// A host name of a test's own, known as long as this lives to programs that link
/// vibrig_host_names. They look up other names as ever.
class HostName {
  public:
    enum class Server { answers, is_silent };

    HostName(std::string name, std::vector<std::string> addresses, Server server = Server::answers);
    /// Whoever still waits is told to try again later.
    ~HostName();
    HostName(const HostName&) = delete;
    HostName& operator=(const HostName&) = delete;

    /// From a server that was silent, to those that wait for it as well.
    void answer();
    /// Somebody has looked it up, or waits for that.
    [[nodiscard]] bool asked() const;

  private:
    const std::string name_;
};

}  // namespace vibrig
