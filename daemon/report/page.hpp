#pragma once

#include <string>
#include <vector>

namespace vibrig::report {

/// Rows of a table. First row: heads.
using Rows = std::vector<std::vector<std::string>>;

/// HTML in the order in which it is written.
class Page {
  public:
    void section(const std::string& id, const std::string& title);
    void paragraph(const std::string& text);
    /// Cells are escaped; one that starts with '!' stands out.
    void table(const Rows& rows, const std::string& kind = "");
    void figure(const std::string& svg, const std::string& caption);
    void details(const std::string& summary, const std::string& preformatted);
    /// Across every page, such as "SIMULATED"; several, one below the other.
    void mark(const std::string& word);
    /// Left of the page's number, on every printed page.
    void foot(const std::string& text);
    /// `signatures`: who signs below.
    [[nodiscard]] std::string html(const std::string& title,
                                   const std::vector<std::string>& signatures = {
                                       "Operator, date", "Approved by, date"}) const;

  private:
    std::string body_, contents_, mark_, foot_;
};

}  // namespace vibrig::report
