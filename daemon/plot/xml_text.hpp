#pragma once

#include <string>

namespace vibrig::tool::plot {

/// As text or attribute of XML or HTML: characters that mean something there are written as
/// entities, control characters, which XML has not at all, as blanks, bytes that are not UTF-8 as
/// '?'; lines stay lines.
[[nodiscard]] std::string xml_text(const std::string& text);

}  // namespace vibrig::tool::plot
