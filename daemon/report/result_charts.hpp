#pragma once

#include <cstddef>
#include <functional>
#include <string>

#include "daemon/plot/chart.hpp"
#include "estimator/identification/identification.hpp"
#include "estimator/uncertainty/assessment.hpp"

namespace vibrig::report {

/// `correlation(i, j)`: of two coefficients, NaN where one is not determined.
[[nodiscard]] tool::plot::Chart correlation_chart(
    const std::function<double(std::size_t, std::size_t)>& correlation);
/// Drift of each dwell beyond the model, deg/h, over the time since the first, h.
[[nodiscard]] tool::plot::Chart residuals_chart(const estimator::uncertainty::Assessment& of);
/// Standard uncertainties of the 30 coefficients, of noise alone and combined.
[[nodiscard]] tool::plot::Chart uncertainties_chart(const estimator::Result& result,
                                                    const estimator::uncertainty::Assessment& of);

/// What `--plot PATH` of a result means: an SVG file, the uncertainties; or a folder, and
/// correlation and residuals beside them. `simulated`: the rig was a program, which each chart
/// says. Throws std::runtime_error naming the path.
void plot_result(const std::string& path, const estimator::Result& result,
                 const estimator::uncertainty::Assessment& assessed, bool simulated);

}  // namespace vibrig::report
