#pragma once

#include <cstddef>
#include <optional>
#include <string>

#include "daemon/noise/found.hpp"
#include "estimator/identification/identification.hpp"
#include "estimator/identification/result.hpp"

namespace vibrig::estimator::uncertainty {
struct Assessment;
}

namespace vibrig::dwells {

/// One dwell of `count` measurements, measurement(n), into a filter with the noise in force, what
/// was played in it included; `each(n, step)` hears of them. As live the filter never hears of a
/// dwell without any.
template <typename Measurement, typename Each>
void feed(estimator::Identification& identification, const estimator::DwellInfo& dwell,
          std::size_t count, const Measurement& measurement, bool cut_short, const Each& each) {
    if (count == 0) return;
    identification.begin_dwell(dwell);
    for (std::size_t n = 0; n < count; ++n) each(n, identification.add(measurement(n)));
    static_cast<void>(identification.end_dwell(cut_short));
    if (dwell.played) static_cast<void>(identification.played(*dwell.played));
}

/// A campaign identified once more from its recorded dwells, all of them with the noise that the
/// whole of it was found to have. Live, resumed and replayed it is fed alike, to the last bit.
class Anew {
  public:
    Anew(const estimator::Settings& settings, const noise::Found& found, std::size_t dwells);

    [[nodiscard]] estimator::Identification& identification() noexcept { return identification_; }
    [[nodiscard]] const estimator::Identification& identification() const noexcept {
        return identification_;
    }
    /// With a warning that says what was done.
    [[nodiscard]] estimator::Result result() const;
    /// What can be believed of it: the noise is known no better than it was found.
    [[nodiscard]] static estimator::Settings settings_of(estimator::Settings settings,
                                                         const std::optional<noise::Found>& found);

  private:
    estimator::Identification identification_;
    std::string words_;
};

/// What can be believed of a result, identified anew where noise was found.
[[nodiscard]] estimator::uncertainty::Assessment assess(const estimator::Settings& settings,
                                                        const std::optional<noise::Found>& found,
                                                        const estimator::Result& result);

/// As a result's JSON has it.
[[nodiscard]] std::string noise_in_json(const noise::Found& found);
/// With what noise a result's JSON says that it was identified anew; nothing: it was not.
[[nodiscard]] std::optional<noise::Found> noise_found_in(const std::string& result_json);

}  // namespace vibrig::dwells
