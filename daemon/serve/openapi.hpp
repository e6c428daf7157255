#pragma once

#include <string>

namespace vibrig::serve {

/// OpenAPI 3.1 of what the server answers; the schemas are made from the messages themselves, so
/// that they cannot differ.
[[nodiscard]] const std::string& openapi_json();

}  // namespace vibrig::serve
