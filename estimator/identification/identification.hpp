#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "estimator/filter/measurement.hpp"
#include "estimator/filter/parameters.hpp"
#include "estimator/filter/settings.hpp"
#include "estimator/filter/vibration_moment.hpp"

namespace vibrig::estimator {

class DwellMeans;
struct DwellRow;
struct Result;

struct DwellSummary {
    int run = 0, position = 0;
    std::uint32_t samples = 0;  ///< offered
    std::uint32_t used = 0;     ///< of them in the filter
    std::uint32_t rejected = 0;
    std::uint32_t reinitialised = 0;
    double kappa = 1;               ///< whole dwell, spec section 6.3
    LevelTensor gamma = kVertical;  ///< whole dwell
    [[nodiscard]] VibrationMoment vibration() const noexcept { return {kappa, gamma}; }
    double amplitude_g = 0;             ///< sqrt(2 (kappa - 1)), platform
    double frequency_hz = 0;            ///< lock-in; 0 at rest, under random vibration, not found
    double relative_error = 0;          ///< of kappa - 1, 1 sigma; of random vibration
    double mean_force_g = 0;            ///< W{fu}; 1 within 2 % or the dwell is rejected
    double nis_per_dof = 0;             ///< 0 where the filter saw nothing, as of a sweep
    double innovation_correlation = 0;  ///< from one sample to the next; 0 when noise is white
    bool flagged = false;     ///< something is to be known of this dwell, or it is rejected:
    const char* reason = "";  ///< static text; empty when not flagged
    NoiseLevels noise;        ///< that the filter took in this dwell
    bool followed = false;    ///< flagged, but the estimate loses nothing by it
    bool left_out = false;    ///< rejected as a whole: the estimate takes nothing of it
};

/// Fixed-size state of the identification for displays; copied without allocation.
struct Estimate {
    std::array<double, kParameters> value{};  ///< in the order of parameter_names()
    std::array<double, kParameters> sigma{};
    std::array<bool, kParameters> observable{};
    double amplitude_g = 0;  ///< platform, present dwell
    double frequency_hz = 0;
    double kappa = 1;
    std::uint64_t samples = 0, used = 0, rejected = 0;
    double nis_per_dof = 0;
    std::array<double, 3> innovation_arcsec{};
    std::uint32_t dwells = 0;
};

/// The whole identification of one campaign: level, filter, recovery, observability (spec sections
/// 2-9). begin_dwell, add, end_dwell and estimate neither allocate nor throw; one thread.
class Identification {
  public:
    /// Throws SettingsError. Room for `max_dwells` dwell summaries is taken here.
    explicit Identification(const Settings& settings, std::size_t max_dwells = 4096);
    /// Room for so many in all, brought into memory: of those no dwell's end waits for a page.
    /// Between dwells only. Allocates.
    void reserve(std::size_t max_dwells);
    ~Identification();
    Identification(Identification&&) noexcept;
    Identification& operator=(Identification&&) noexcept;

    void begin_dwell(const DwellInfo& dwell) noexcept;
    StepResult add(const Measurement& measurement) noexcept;
    /// `cut_short`: before its time. A sweep is left out then: it counts whole or not at all.
    DwellSummary end_dwell(bool cut_short = false) noexcept;
    /// What was played in the random dwell that ended last, its summary once more with that: its
    /// row has the PSD's level in place of its profile's, may fall or rise again. After everything
    /// else that an end of a dwell brings about, so that a campaign comes out alike live, resumed
    /// and replayed. Nothing where the last dwell was no random one, or has had it already.
    DwellSummary played(const PlayedRandom& played) noexcept;
    /// By the filter: each D_F as it is now, after its walk from dwell to dwell.
    void estimate(Estimate& out) const noexcept;
    /// After the last ended dwell, as with constant biases: values and sigmas of result(), also of
    /// what is not determined one by one.
    void solved(Estimate& out) const noexcept;
    /// In place of the settings' noise, from the next dwell on; between dwells only.
    void set_noise(const NoiseLevels& levels) noexcept;
    [[nodiscard]] const NoiseLevels& noise() const noexcept;
    /// Final result over all ended dwells. Allocates; does not change the filter.
    [[nodiscard]] Result result() const;
    /// Those of result() and, in their order, those apart from them.
    [[nodiscard]] const std::vector<DwellRow>& rows() const noexcept;
    /// Of each dwell of result().dwells, in their order; nothing is known of one that is apart (see
    /// DwellRow), and of one whose accelerometers were at the end of their range.
    [[nodiscard]] const std::vector<DwellMeans>& means() const noexcept;
    /// Covariance of solved(), 30 x 30 row-major in the order of parameter_names(), whether or not
    /// they are observable. Allocates.
    [[nodiscard]] std::vector<double> covariance() const;
    /// The same of estimate(); between dwells only.
    [[nodiscard]] std::vector<double> covariance_now() const;

  private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace vibrig::estimator
