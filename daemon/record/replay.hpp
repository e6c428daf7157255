#pragma once

#include <functional>
#include <string>
#include <vector>

#include "daemon/dwells/anew.hpp"
#include "daemon/record/campaign_file.hpp"
#include "estimator/identification/dwell_means.hpp"
#include "estimator/identification/result.hpp"
#include "estimator/spectrum/read_sweep.hpp"

namespace vibrig::record {

struct ReplayOptions {
    double speed = 0;  ///< times the recording's; 0: as fast as it goes
    std::function<void(std::size_t done, std::size_t all)> progress = {};
    std::function<void(const Dwell&)> on_dwell = {};
};

struct ReplayResult {
    estimator::Result result;
    std::vector<estimator::DwellRow> rows;     ///< of all dwells, those apart from the result's too
    std::vector<estimator::DwellMeans> means;  ///< of the result's dwells
    std::vector<Dwell> dwells;                 ///< as they were shown live
    /// Where the result was identified anew: what it replaces, and the coefficients as a dwell has
    /// them.
    std::optional<noise::Found> found;
    estimator::Result live;
    std::optional<Dwell> anew;
    std::size_t samples = 0;
    double recorded_s = 0, took_s = 0;
    /// Dwells, and rows of /estimates, that are not those of the recording to the last bit.
    std::size_t compared = 0, different = 0;
    std::size_t estimates = 0, estimates_different = 0;
    std::string first_difference;  ///< empty: none
    [[nodiscard]] bool as_recorded() const { return different == 0 && estimates_different == 0; }
};

/// Whether every dwell says which noise levels the filter took; they are then taken again, else
/// the noise monitor decides again.
[[nodiscard]] bool noise_known(const Campaign& campaign);
/// For an identification with other settings.
void forget_noise(Campaign& campaign);

using OnStep = std::function<void(std::size_t sample, const estimator::StepResult&)>;
/// A sweep with what the controller reported of its frequency, and the recorded samples.
[[nodiscard]] estimator::spectrum::ReadSweep sweep_of(const Campaign& campaign,
                                                      const estimator::Settings& settings,
                                                      const RecordedDwell& dwell);

/// One dwell into a filter, with the zeros of the recording and the noise levels of its result.
void feed(estimator::Identification& identification, const Campaign& campaign,
          const RecordedDwell& dwell, const OnStep& on_step = {});

/// All dwells once more with this noise, as the daemon does at a campaign's end.
[[nodiscard]] dwells::Anew anew(const Campaign& campaign, const estimator::Settings& settings,
                                const noise::Found& found, const OnStep& on_step = {});

/// What the campaign adds to the filter's result of its first dwells, so many: zeros in the
/// amplitudes' uncertainty, its mark.
void qualify(const Campaign& campaign, std::size_t done, estimator::Result& result);

/// With the noise that was in force in each dwell.
[[nodiscard]] estimator::Result live_result(const Campaign& campaign,
                                            const estimator::Settings& settings);

/// The recorded samples and orders through the daemon's estimator stage, its noise monitor and
/// what the control thread does between dwells, without a clock. Throws.
[[nodiscard]] ReplayResult replay(const Campaign& campaign, const estimator::Settings& settings,
                                  const ReplayOptions& options);

}  // namespace vibrig::record
