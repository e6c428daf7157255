#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace vibrig::serve {

/// A Unix stream socket that sends whatever bytes a test wants. Reads give up after 20 s.
class RawConnection {
  public:
    /// A Unix socket's path, or "127.0.0.1:PORT".
    explicit RawConnection(const std::string& path);
    ~RawConnection();
    RawConnection(const RawConnection&) = delete;
    RawConnection& operator=(const RawConnection&) = delete;

    void send(std::string_view bytes) const;
    void finish_sending() const;
    /// So many bytes; fewer when the server closes before.
    [[nodiscard]] std::string bytes(std::size_t count) const;
    /// One whole answer by its Content-Length; what came, when the server closes before.
    [[nodiscard]] std::string answer() const;
    /// All until the server closes; "(open)" appended when it does not within the time.
    [[nodiscard]] std::string until_closed() const;

  private:
    int descriptor_;
};

/// The status number of an HTTP answer; 0: none.
[[nodiscard]] int status_of(const std::string& answer);
[[nodiscard]] std::string body_of(const std::string& answer);
/// GET on a connection of its own.
[[nodiscard]] std::string get(const std::string& path, const std::string& target);
[[nodiscard]] std::string post(const std::string& path, const std::string& target,
                               const std::string& body);

}  // namespace vibrig::serve
