#pragma once

#include <array>
#include <string>
#include <vector>

#include "daemon/plan/plan_file.hpp"
#include "estimator/filter/settings.hpp"
#include "estimator/identification/crlb.hpp"
#include "estimator/plan/model.hpp"

namespace vibrig::plan {

namespace planning = estimator::plan;

/// What a campaign will know at its end, before it starts.
struct Forecast {
    /// Standard errors of the 30 coefficients, order of parameter_names(); infinite: not
    /// determined.
    std::array<double, estimator::kParameters> sigma{};
    std::size_t rank = 0;  ///< of one gyro's ten coefficients
    bool identifies_all = false;
    std::string refusal;  ///< what is not determined, and the cheapest remedy
    std::string warning;  ///< of levels that lie close together
};

/// `dwell_s` at each run, samples `period_s` apart; rank and refusal are those of a model with
/// these terms.
[[nodiscard]] Forecast forecast(const estimator::Settings& settings,
                                const std::vector<PlannedRun>& runs, double dwell_s,
                                double period_s,
                                const planning::Terms& terms = planning::kAllTerms);

/// For people: one line per coefficient of a gyro, one column per gyro.
[[nodiscard]] std::string forecast_table(const Forecast& forecast);

/// "D_F" of every gyro, or "D_IIx, D_SSy, D_OOz": the gyros' names of a term of the platform model.
[[nodiscard]] std::string gyro_names(const estimator::Settings& settings, std::size_t term);

}  // namespace vibrig::plan
