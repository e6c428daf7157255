#pragma once

#include <functional>
#include <string>
#include <string_view>

namespace vibrig::serve {

/// What another program than the daemon shows through the same doors.
struct Document {
    int status = 200;
    std::string content_type = "text/html; charset=utf-8";
    std::string body;  ///< with another status than 200: what is wrong, in words
};
/// Server thread. May throw std::exception: 503 with its words.
using Documents = std::function<Document(std::string_view path, std::string_view query)>;

}  // namespace vibrig::serve
