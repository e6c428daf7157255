#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "estimator/dwell_row.hpp"
#include "estimator/uncertainty/declared.hpp"

namespace vibrig::estimator {

inline constexpr std::size_t kParameters = 30;

/// Settings that cannot work; the message names the key ("platform.up"), the value and what was
/// expected.
class SettingsError : public std::invalid_argument {
  public:
    using std::invalid_argument::invalid_argument;
};

/// A signed platform axis, "+x" ... "-z".
struct SignedAxis {
    int axis = 0;  ///< 0 x, 1 y, 2 z
    int sign = 1;
};

enum class Method : std::uint8_t { joint, two_step };

/// Whether the shape is measured, or taken as along the vertical.
enum class SecondMoment : std::uint8_t { measured, vertical };

/// Units are those of the configuration file; names are its keys.
struct Settings {
    // site
    double latitude_deg = 45.75;
    double azimuth_deg = 0.0;
    double elevation_deg = 0.0;  ///< of the rig's north axis: the base is not level
    double gravity_mps2 = 9.80665;
    // vibration
    double frequency_hz = 15.0;
    double transmission = 0.6667;
    double level_window_s = 10.0;
    // platform
    SignedAxis up{1, 1};
    /// [gyro x, y, z][input, output, spin]
    std::array<std::array<SignedAxis, 3>, 3> gyro_axes{
        {{{{0, 1}, {1, 1}, {2, 1}}}, {{{1, 1}, {2, 1}, {0, 1}}}, {{{2, 1}, {0, 1}, {1, 1}}}}};
    int drift_sign = -1;
    SecondMoment second_moment = SecondMoment::measured;
    std::array<int, 3> encoder_sign{1, 1, 1};
    std::array<double, 3> encoder_zero_deg{0, 0, 0};
    // accelerometer
    std::array<double, 3> accelerometer_zero_g{0, 0, 0};
    std::array<std::array<double, 3>, 3> accelerometer_matrix{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
    double accelerometer_range_g = 0;  ///< raw readings from here on are saturated; 0: not known
    // noise
    double resolver_arcsec = 5.0;
    int resolver_bits = 20;
    double gyro_random_walk_deg_per_rt_h = 0.001;
    double accelerometer_g = 1e-4;
    // estimator
    Method method = Method::joint;
    /// Two-step: D_OO is not fixed, as in a run of its own (Tang et al. 2009, trial 3).
    bool all_at_once = false;
    double prior_bias = 10.0;      ///< deg/h, 1 sigma
    double prior_linear = 10.0;    ///< deg/h/g
    double prior_quadratic = 1.0;  ///< deg/h/g^2
    double forgetting = 0.95;
    double gate_nis = 25.0;
    // uncertainty, drift
    uncertainty::Inputs uncertainty;
    uncertainty::Drift drift;
};

/// One sample as the estimator takes it: raw encoder angles and raw specific force.
struct Measurement {
    double time_s = 0;                  ///< grows within a dwell
    std::array<double, 3> angle_rad{};  ///< outer, inner, azimuth
    std::array<double, 3> force_g{};    ///< accelerometer axes
    bool angles_good = true;
    bool force_good = true;
};

/// Noise as the filter takes it.
struct NoiseLevels {
    double angle_arcsec = 0;  ///< of one encoder reading, quantisation included
    std::array<double, 3> gyro_random_walk_deg_per_rt_h{};
    bool operator==(const NoiseLevels&) const = default;
};
[[nodiscard]] NoiseLevels noise_levels(const Settings& settings) noexcept;

struct DwellInfo {
    int run = 1;          ///< from 1; the two-step route joins two runs
    int position = 1;     ///< from 1
    double table_g = -1;  ///< commanded peak at the table; negative: not known (a CSV recording)
    /// When its measurements' time is 0, on a clock common to all dwells, s; NaN: there is none.
    double begin_s = std::numeric_limits<double>::quiet_NaN();
};

enum class StepOutcome : std::uint8_t {
    initialised,
    used,
    buffered,
    gated,
    bad_angles,
    bad_force,
    bad_time,
    reinitialised
};

struct StepResult {
    StepOutcome outcome = StepOutcome::used;
    double nis = 0;  ///< three-axis, before the gate
    std::array<double, 3> innovation_arcsec{};
};

struct DwellSummary {
    int run = 0, position = 0;
    std::uint32_t samples = 0;  ///< offered
    std::uint32_t used = 0;     ///< of them in the filter
    std::uint32_t rejected = 0;
    std::uint32_t reinitialised = 0;
    double kappa = 1;               ///< whole dwell, spec section 6.3
    LevelTensor gamma = kVertical;  ///< whole dwell
    [[nodiscard]] VibrationMoment vibration() const noexcept { return {kappa, gamma}; }
    double amplitude_g = 0;   ///< sqrt(2 (kappa - 1)), platform
    double frequency_hz = 0;  ///< lock-in; 0 at rest
    double mean_force_g = 0;  ///< W{fu}; 1 within 2 % or the dwell is rejected
    double nis_per_dof = 0;
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

struct RunAmplitude {
    int run = 0;
    double amplitude_g = 0, kappa = 1, sigma_g = 0, frequency_hz = 0;
};

/// A determined combination of coefficients that are not determined one by one.
struct Combination {
    std::vector<std::pair<std::string, double>> weights;
    double value = 0, sigma = 0;
};

/// Agreement of the filter with an independent batch least squares over the same readings.
struct CrossCheck {
    static constexpr double kLimit = 0.05;  ///< of a standard deviation
    bool done = false;
    double largest = 0;       ///< difference of all that is determined, in standard deviations
    std::string coefficient;  ///< where: a name, or the first of a combination

    [[nodiscard]] bool agrees() const noexcept { return largest <= kLimit; }
};

struct Result {
    std::array<double, kParameters> value{};
    std::array<double, kParameters> sigma{};
    std::array<bool, kParameters> observable{};
    /// 30 x 30, rows in the order of parameter_names(); rows of what is not observable are NaN
    /// (null in JSON).
    Eigen::Matrix<double, kParameters, kParameters> covariance =
        Eigen::Matrix<double, kParameters, kParameters>::Zero();
    std::vector<RunAmplitude> amplitudes;
    std::vector<Combination> combinations;
    double nis_per_dof = 0;
    std::uint64_t samples = 0, rejected = 0;
    std::vector<DwellSummary> dwells;
    std::vector<DwellRow> rows;  ///< of the dwells kept, in their order
    CrossCheck cross_check;
    std::vector<std::string> warnings;
};

/// Adds what uncertain zeros of the accelerometers do to the runs' amplitudes. `level_variances`:
/// for each dwell with known zeros its run and the variance of the vertical force, relative. The
/// zeros are the same in every dwell: they do not average out.
void widen_amplitudes(Result& result, const std::vector<std::pair<int, double>>& level_variances);

/// D_Fx D_Ix D_Ox D_Sx D_IIx D_OOx D_SSx D_IOx D_ISx D_OSx, then y, z (IEEE Std 517 usage).
[[nodiscard]] const std::array<const char*, kParameters>& parameter_names() noexcept;
/// "deg/h", "deg/h/g" or "deg/h/g^2".
[[nodiscard]] const char* parameter_unit(std::size_t index) noexcept;

/// The whole identification of one campaign: level, filter, recovery, observability (spec sections
/// 2-9). begin_dwell, add, end_dwell and estimate neither allocate nor throw; one thread.
class Identification {
  public:
    /// Throws SettingsError. Room for `max_dwells` dwell summaries is taken here.
    explicit Identification(const Settings& settings, std::size_t max_dwells = 4096);
    /// Room for so many in all; between dwells only. Allocates.
    void reserve(std::size_t max_dwells);
    ~Identification();
    Identification(Identification&&) noexcept;
    Identification& operator=(Identification&&) noexcept;

    void begin_dwell(const DwellInfo& dwell) noexcept;
    StepResult add(const Measurement& measurement) noexcept;
    DwellSummary end_dwell() noexcept;
    void estimate(Estimate& out) const noexcept;
    /// In place of the settings' noise, from the next dwell on; between dwells only.
    void set_noise(const NoiseLevels& levels) noexcept;
    [[nodiscard]] const NoiseLevels& noise() const noexcept;
    /// Final result over all ended dwells. Allocates; does not change the filter.
    [[nodiscard]] Result result() const;
    /// Those of result(), without a copy.
    [[nodiscard]] const std::vector<DwellRow>& rows() const noexcept;
    /// Of the coefficients after the last ended dwell, 30 x 30 row-major in the order of
    /// parameter_names(), whether or not they are observable. Allocates.
    [[nodiscard]] std::vector<double> covariance() const;

  private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace vibrig::estimator
