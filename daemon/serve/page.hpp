#pragma once

#include <string_view>

namespace vibrig::serve {

struct PageFile {
    const char* content_type;
    std::string_view text;
};

/// A part of the live page as it was built in; null: no such file.
[[nodiscard]] const PageFile* page_file(std::string_view path) noexcept;

/// "/values.js": the single values that the page shows line by line, as daemon/status/values.hpp
/// has them.
[[nodiscard]] const PageFile& page_values();

}  // namespace vibrig::serve
