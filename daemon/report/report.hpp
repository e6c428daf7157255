#pragma once

#include <optional>
#include <string>

#include "daemon/report/analysis.hpp"
#include "daemon/report/paperwork.hpp"

namespace vibrig::report {

/// Another campaign of the same unit.
struct Earlier {
    std::string path, name, when;
    configuration::Paperwork paperwork;
    estimator::uncertainty::Assessment assessed;
    Frequencies at_hz{};
};

/// Result of a recorded campaign, of its replay; throws for the campaign that it is to be compared
/// with itself, and unless both state the unit's serial number or somebody says that it is the
/// `same_unit`.
[[nodiscard]] Earlier earlier_of(const record::Campaign& earlier, const record::Campaign& now,
                                 bool same_unit);

/// One page that needs nothing else: HTML with its plots as inline SVG, light and dark, for print
/// too.
[[nodiscard]] std::string make_page(const record::Campaign& campaign, const Analysis& analysis,
                                    const std::optional<Earlier>& earlier);

}  // namespace vibrig::report
