#pragma once

#include <string>
#include <vector>

#include "estimator/spectrum/elastic.hpp"

namespace vibrig::estimator::spectrum {

/// A vibration that some dwells had in common: a frequency, or a profile.
struct Kind {
    std::string profile;  ///< its name; empty: a sine, whose harmonics are bands of their own
    std::vector<Band> bands;

    /// Strongest line of a sine, centre of the power of a profile, Hz.
    [[nodiscard]] double hz() const noexcept;
};

}  // namespace vibrig::estimator::spectrum
