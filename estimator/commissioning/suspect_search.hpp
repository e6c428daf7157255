#pragma once

#include <functional>
#include <vector>

#include "estimator/commissioning/consistency.hpp"

namespace vibrig::estimator::commissioning {

/// What a configuration is held against while one key after the other is changed.
struct Judge {
    /// Whether nothing contradicts it.
    std::function<bool(const Settings&, const std::vector<DwellMean>&)> fits;
    /// -2 ln likelihood of the rates, with all slopes too large by a factor.
    std::function<double(const Settings&, double time_factor)> rates;
    double gravity_deg = 0.5;  ///< vertical by the encoders against the mean force
    bool earth = false;        ///< the rates say something
};

[[nodiscard]] std::vector<Suspect> search_suspects(const Settings& settings,
                                                   const std::vector<DwellMean>& dwells,
                                                   const Judge& judge, std::size_t most);

}  // namespace vibrig::estimator::commissioning
