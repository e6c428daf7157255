#pragma once

#include <array>

namespace vibrig::estimator::commissioning {

/// A unit in which a controller may count the amplitude that is written into it.
struct UnitHypothesis {
    const char* name = "";  ///< "g peak", "g rms", "g peak-peak", "m/s2 peak", "m/s2 rms"
    double factor = 1;      ///< peak g at the table of one unit
    double ln_ratio = 0;    ///< of its likelihood to the best one's, 0 or less
};

struct UnitFinding {
    std::array<UnitHypothesis, 5> all{};  ///< best first
    bool decided = false;                 ///< the next one is e^25 less likely, and the best fits
};

/// `ratio`: amplitude seen at the table, peak g, over the number that was written; `uncertainty`:
/// relative, 1 sigma, of what was seen (0.02 of an accelerometer at the table, 0.1 to 0.2 of one
/// behind isolators whose transmission somebody states). Decided from ln odds of 25 on, as the
/// descriptions of gravity are.
[[nodiscard]] UnitFinding amplitude_unit(double ratio, double uncertainty);

}  // namespace vibrig::estimator::commissioning
