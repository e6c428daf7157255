#pragma once

#include <string>
#include <vector>

#include "daemon/status/status.hpp"

namespace vibrig::serve {

/// What is looked at before a campaign: what /readyz and `vibrig selftest` say.
struct Readiness {
    struct Check {
        std::string name;
        bool passed = false;
        std::string text;
    };
    std::vector<Check> checks;
    [[nodiscard]] bool ready() const;
    [[nodiscard]] std::string failures() const;
};

[[nodiscard]] Readiness readiness(const StatusData& status);

}  // namespace vibrig::serve
