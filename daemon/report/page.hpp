#pragma once

#include <string>
#include <vector>

namespace vibrig::report {

/// HTML in the order in which it is written.
class Page {
  public:
    void section(const std::string& id, const std::string& title);
    void paragraph(const std::string& text);
    /// First row: heads. Cells are escaped; one that starts with '!' stands out.
    void table(const std::vector<std::vector<std::string>>& rows, const std::string& kind = "");
    void figure(const std::string& svg, const std::string& caption);
    void details(const std::string& summary, const std::string& preformatted);
    [[nodiscard]] std::string html(const std::string& title) const;

  private:
    std::string body_, contents_;
};

}  // namespace vibrig::report
