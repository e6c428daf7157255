#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "daemon/noise/noise_monitor.hpp"
#include "daemon/rt/estimator_stage.hpp"
#include "drivers/base/clock.hpp"
#include "estimator/identification/identification.hpp"
#include "estimator/spectrum/elastic.hpp"
#include "estimator/spectrum/sweep.hpp"

namespace vibrig::dwells {

/// The book of a campaign's dwells: the filter that takes them, the noise monitor that judges each,
/// and in which order one follows from the other when a dwell is over. Dwells go through it that
/// are measured, resumed from the journal, replayed from a recording or simulated in a study, so
/// that all of them come to the same state, to the last bit. Where the noise is known for all of
/// them there is nothing to decide between two dwells: feed() in anew.hpp is enough. Control thread
/// only, but for the filter, which is the estimator's while a dwell is ordered.
class DwellBook {
  public:
    enum class Noise : std::uint8_t {
        decided,  ///< by the monitor, from dwell to dwell
        given     ///< by use_noise(): the monitor is left alone
    };
    /// Without an `event` nobody hears of the noise (noise::NoiseMonitor). Throws SettingsError.
    explicit DwellBook(const estimator::Settings& settings, EventSink event = nullptr,
                       Noise noise = Noise::decided);

    /// A new campaign, of about so many dwells: everything is forgotten.
    void begin(std::size_t dwells);
    /// What `other` has come to is what this goes on from; it keeps whom it tells of the noise.
    void continue_from(DwellBook&& other, std::size_t dwells);

    /// For a stage to be made with; to be read between dwells.
    [[nodiscard]] estimator::Identification& identification() noexcept { return identification_; }
    [[nodiscard]] const estimator::Identification& identification() const noexcept {
        return identification_;
    }
    [[nodiscard]] const noise::NoiseMonitor& noise() const noexcept { return noise_; }
    void levelled(const LevelDrift& drift) { noise_.levelled(drift); }
    /// From the next dwell on; levels of 0 are none.
    void use_noise(const estimator::NoiseLevels& levels) noexcept;

    /// To the stage that was made with identification(). False: it has no room.
    [[nodiscard]] bool order(rt::EstimatorStage& stage, const rt::DwellOrder& order) noexcept;
    /// One dwell that the stage is done with, and what follows from it; false: there is none.
    [[nodiscard]] bool take_done(rt::EstimatorStage& stage, rt::DwellDone& done);
    /// No dwell is with a stage.
    [[nodiscard]] bool free() const noexcept { return with_stage_ == 0; }
    /// What was played in the random dwell that was done last: `summary` is then that of the dwell
    /// with it, if it changes anything.
    void played(const estimator::PlayedRandom& played, estimator::DwellSummary& summary);

    /// A dwell that was measured before.
    struct Again {
        const estimator::DwellInfo& info;
        drivers::Time length = 0;  ///< as it was ordered
        std::span<const estimator::Measurement> measurements;
        /// What the controller reported of a sweep's frequency, s since the dwell began and
        /// Hz.
        std::span<const std::array<double, 2>> swept_hz;
    };
    /// All of it at once, through the same steps as one from a stage, what was played in it and
    /// swept through included.
    [[nodiscard]] estimator::DwellSummary take_again(const Again& dwell);

    /// What is kept beside the filter for coefficients over frequency. The control thread enters
    /// what was measured, since bands need the rig's configuration; take_again() its sweeps.
    struct Spectrum {
        std::vector<estimator::spectrum::Sweep> sweeps;
        /// Bands at the platform of its random dwells whose PSD was reported, by DwellRow::psd.
        std::vector<std::vector<estimator::spectrum::Band>> psds;
        std::vector<std::array<double, 2>> psd_before;  ///< the newest as it was reported
    };
    [[nodiscard]] Spectrum& spectrum() noexcept { return spectrum_; }
    [[nodiscard]] const Spectrum& spectrum() const noexcept { return spectrum_; }

  private:
    void conclude(estimator::DwellSummary& dwell);

    estimator::Settings settings_;
    Noise decides_;
    estimator::Identification identification_;
    noise::NoiseMonitor noise_;
    Spectrum spectrum_;
    int with_stage_ = 0;  ///< ordered, not yet done
};

/// These levels from the next dwell on; levels of 0 are none. Those in force again would move a
/// last bit: the filter keeps their squares.
void use_noise(estimator::Identification& identification,
               const estimator::NoiseLevels& levels) noexcept;

}  // namespace vibrig::dwells
