#pragma once

#include <string>
#include <vector>

#include "estimator/spectrum/elastic.hpp"

namespace vibrig::estimator::spectrum {

/// A vibration that some dwells had in common: a frequency, or a profile.
struct Kind {
    std::string profile;  ///< its name; empty: a sine, whose harmonics are bands of their own
    std::vector<Band> bands;

    /// Of a sine its strongest line; of a profile the power's centre, Hz.
    [[nodiscard]] double hz() const noexcept;
};

}  // namespace vibrig::estimator::spectrum
