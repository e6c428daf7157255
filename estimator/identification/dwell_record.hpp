#pragma once

#include <array>
#include <cstdint>

#include "estimator/identification/dwell_means.hpp"
#include "estimator/identification/identification.hpp"
#include "estimator/level/random_level.hpp"

namespace vibrig::estimator {

/// Counts of the dwell in progress; samples = used + rejected at any time nothing is buffered.
struct DwellRecord {
    DwellInfo info;
    DwellMeans means;  ///< of its readings as they came, but for a resolver that stands still
    Seen seen;         ///< of this vibration by the accelerometers
    std::uint32_t samples = 0, used = 0, rejected = 0, reinitialised = 0;
    std::uint32_t gated = 0;  ///< of the rejected: angles too far from the predicted ones
    double nis_sum = 0;
    std::uint32_t nis_count = 0;
    /// Sums of products of innovations with themselves and with those one sample before.
    double innovation_square = 0, innovation_product = 0;
    std::array<double, 3> last_innovation{};
    bool last_used = false;
    // Over the stretches of the dwell between gaps of more than 1 s, weighted by their samples.
    double level_samples = 0, kappa_sum = 0, mean_force_sum = 0, frequency_sum = 0,
           frequency_samples = 0;
    double shape_weight = 0;  ///< samples times kappa - 1
    LevelTensor shape_sum{};
    double period_s = 0, span_s = 0;
    RandomLevel random_level;                   ///< fed under random vibration
    double least_kappa = 0, largest_kappa = 0;  ///< of the streaming level; 0: none yet
    std::uint32_t stuck = 0;                    ///< samples with a resolver that stands still
    std::uint32_t locked = 0;                   ///< samples with the inner gimbal beyond 80 deg
    int saturated_axis = -1;                    ///< of the accelerometers; -1: none
    /// Periods from reading to reading, readings with a good force, and readings closer together
    /// than the period: where many are missing, it is not known.
    double slots = 0;
    std::uint32_t forces = 0, crowded = 0;
    /// Under a sweep: sums of the specific force and of its square, g.
    std::array<double, 3> force_sum{};
    double force_square = 0;
    std::optional<PlayedRandom> played{};  ///< under random vibration, once it is known
    bool cut_short = false;                ///< ended before its time

    /// 1 + the mean square, from what the accelerometers show of it.
    [[nodiscard]] double kappa_of(double shown) const noexcept {
        return 1 + (shown - 1) / seen.share;
    }
    void count(const StepResult& step) noexcept;
    void note_level(double kappa) noexcept;
    void note_swept(const std::array<double, 3>& force_g) noexcept;
    /// `periods` from the reading before to this one; not across a pause.
    void note_interval(double periods) noexcept;
};

/// Summary of an ended dwell; `rejected` tells whether its data must be taken out of the filter
/// again.
struct DwellVerdict {
    DwellSummary summary;
    bool rejected = false;
};

[[nodiscard]] DwellVerdict judge(const DwellRecord& record, const Settings& settings) noexcept;

}  // namespace vibrig::estimator
