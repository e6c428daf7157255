#pragma once

#include <array>
#include <optional>
#include <string>

#include "estimator/commissioning/consistency.hpp"

namespace vibrig::estimator::commissioning {

/// Where, at rest, two suspects expect something else.
struct ToldApart {
    std::array<double, 3> position_deg{};  ///< gimbal angles, as the configuration has them now
    double by_mg = 0;                      ///< of what the accelerometers read
    double by_deg_h = 0;                   ///< of free drift, where force does not tell; else 0
    /// "told apart at (90, 25, 0) deg, by 845 mg".
    [[nodiscard]] std::string words() const;
};
/// Among positions of the usual travel (outer +-120, inner +-25 deg, any azimuth), whether this rig
/// reaches it or not. Nothing: they expect the same everywhere, within 10 mg and 0.5 deg/h. What
/// drift terms may hide, the vertical Earth rate, counts as the same.
[[nodiscard]] std::optional<ToldApart> told_apart(const Settings& settings, const Suspect& a,
                                                  const Suspect& b);
/// For the two best of a list; empty: there are no two, or no such position.
[[nodiscard]] std::string told_apart_words(const Settings& settings,
                                           const std::vector<Suspect>& suspects);

}  // namespace vibrig::estimator::commissioning
