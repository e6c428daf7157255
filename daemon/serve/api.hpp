#pragma once

#include <string>
#include <string_view>

#include "daemon/status.hpp"

namespace vibrig::serve {

/// One request, as far as the answer depends on it.
struct ApiRequest {
    std::string_view method;        ///< "GET", "POST", ...
    std::string_view target;        ///< path and query
    std::string_view content_type;  ///< may be empty
    std::string body;
    unsigned uid = 0;  ///< of the process at the other end
};

struct ApiAnswer {
    int status = 200;
    std::string content_type = "application/json";
    std::string body;
    std::string allow;  ///< for 405: the methods that would do
};

/// What each path answers, whatever carries it. Server thread only.
class Api {
  public:
    /// `instance` names this start of the daemon: event ids are unique within it.
    Api(StatusSource& source, std::string instance);
    /// Never throws for what a client sends; a failing source is a 500.
    [[nodiscard]] ApiAnswer answer(const ApiRequest& request);

    [[nodiscard]] static ApiAnswer problem(int status, const std::string& detail);

  private:
    ApiAnswer get(std::string_view path, std::string_view query);
    ApiAnswer command(const ApiRequest& request);

    StatusSource& source_;
    std::string instance_;
};

}  // namespace vibrig::serve
