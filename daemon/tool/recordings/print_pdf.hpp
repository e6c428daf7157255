#pragma once

#include <string>

namespace vibrig::tool {

/// Prints an HTML file with chromium. Throws std::runtime_error.
void print_pdf(const std::string& html, const std::string& pdf);

}  // namespace vibrig::tool
