#pragma once

#include <string>
#include <utility>
#include <vector>

namespace vibrig::v1 {
class Status;
}

namespace vibrig::serve {

/// The single values of a status as people read them, line by line, as the table of
/// daemon/status/values.hpp has them.
class ValueLines {
  public:
    explicit ValueLines(const v1::Status& status);

    /// What this line says: `head`, where there is one, and its values. It is left no longer.
    [[nodiscard]] std::string take(const std::string& line, const std::string& head = {});
    /// The lines that were not taken, in the table's order, each with what it says.
    [[nodiscard]] const std::vector<std::pair<std::string, std::string>>& left() const {
        return lines_;
    }

  private:
    std::vector<std::pair<std::string, std::string>> lines_;
};

}  // namespace vibrig::serve
