#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "estimator/levelling/network.hpp"
#include "estimator/levelling/noise_budget.hpp"

namespace vibrig::estimator::levelling {

inline constexpr double kPatience = 3;  ///< settling times that a loop is given to settle

struct LevellerSettings {
    Gains fast;
    double settling_s = 100;    ///< that the fast gains are for
    std::optional<Gains> slow;  ///< after settling; none: stay fast (exact reference)
    double ramp_s = 60;         ///< from fast to slow
    double period_s = 0.1;
    double window_s = 1;  ///< of the means; on a vibrating base whole vibration periods
    /// 0: the larger of 0.05' and four times the noise of the mean specific force
    double tolerance_rad = 0;
    double torquer_limit = std::numeric_limits<double>::infinity();  ///< rad/s
    Noise noise;
    Earth earth;
};

enum class Phase : std::uint8_t { fast, ramp, slow, undamped };
enum class Verdict : std::uint8_t { settling, settled, not_settled, cannot_settle };
enum class Trouble : std::uint8_t {
    none,
    missing_samples,
    not_a_number,
    reference_lost,
    tilt_too_large,
    torquer_limit,
    tolerance_below_noise,
    drift_above_limit
};

[[nodiscard]] const char* name_of(Phase phase) noexcept;
[[nodiscard]] const char* name_of(Verdict verdict) noexcept;

/// Two channels: the platform directions normal to the position's nominal vertical.
using Pair = std::array<double, 2>;

struct LevelInput {
    Pair force{};                ///< m/s^2; on a vibrating base means over whole periods
    Pair reference{};            ///< m/s
    bool missing = false;        ///< no sample came
    double reference_age_s = 0;  ///< since the reference was last measured
};

struct LevelOutput {
    Pair rate{};  ///< to the torquers, rad/s
    Phase phase = Phase::fast;
    Verdict verdict = Verdict::settling;
};

/// Closes the loop sample by sample, says when it has settled, and why not. The constructor throws
/// DesignError and allocates; step() does neither.
class Leveller {
  public:
    explicit Leveller(const LevellerSettings& settings);

    LevelOutput step(const LevelInput& input) noexcept;

    struct Observables {
        Pair force_rad{};  ///< mean specific force over g, in the end the tilt and minus the zero
        Pair rate_rad{};   ///< mean (1 + k2) w / (R sigma), the tilt that z has still to take up
    };
    [[nodiscard]] const Observables& observables() const noexcept { return observables_; }
    [[nodiscard]] Pair drift() const noexcept { return {axis_[0].drift(), axis_[1].drift()}; }
    /// 1 sigma of drift(): by the noise, and what z has still to take up by the observables; rad/s.
    [[nodiscard]] double drift_sigma() const noexcept;
    [[nodiscard]] const FastNetwork& axis(std::size_t i) const noexcept { return axis_[i]; }
    [[nodiscard]] const NoiseBudget& budget() const noexcept { return budget_; }
    [[nodiscard]] double tolerance() const noexcept { return tolerance_; }  ///< rad
    /// Tolerance of the second observable, whose noise is larger where the reference is noisy; rad.
    [[nodiscard]] double rate_tolerance() const noexcept { return rate_tolerance_; }
    /// 1 sigma of the observables once the loop is steady, rad. The first is that of the tilt
    /// together with what is left of the accelerometers' in the mean over the window.
    [[nodiscard]] double force_noise() const noexcept { return force_noise_; }
    [[nodiscard]] double rate_noise() const noexcept { return rate_noise_; }
    /// Shortest window with which the tolerance is four times the noise, s; empty: none would do.
    [[nodiscard]] std::optional<double> window_needed_s() const noexcept;
    /// Smallest tolerance that can be held, rad.
    [[nodiscard]] double tolerance_needed() const noexcept;
    [[nodiscard]] double sigma() const noexcept { return sigma_; }
    [[nodiscard]] double time_s() const noexcept { return time_s_; }
    [[nodiscard]] std::optional<double> settled_s() const noexcept { return settled_s_; }
    [[nodiscard]] Verdict verdict() const noexcept { return verdict_; }
    [[nodiscard]] Trouble trouble() const noexcept { return trouble_; }
    /// What is or was wrong, for people; empty if nothing. Allocates.
    [[nodiscard]] std::string message() const;

  private:
    class Window {
      public:
        explicit Window(std::size_t size) : values_(size) {}
        void add(double value) noexcept;
        void clear() noexcept { filled_ = next_ = 0, sum_ = 0; }
        [[nodiscard]] bool full() const noexcept { return filled_ == values_.size(); }
        [[nodiscard]] std::size_t filled() const noexcept { return filled_; }
        [[nodiscard]] double mean() const noexcept {
            return filled_ == 0 ? 0 : sum_ / static_cast<double>(filled_);
        }

      private:
        std::vector<double> values_;
        std::size_t next_ = 0, filled_ = 0;
        double sum_ = 0;
    };

    [[nodiscard]] bool usable(const LevelInput& input) noexcept;
    [[nodiscard]] Gains gains_now() const noexcept;
    void observe(const LevelInput& input) noexcept;
    void judge(const LevelInput& input) noexcept;
    void note(Trouble trouble, std::size_t channel, double value) noexcept;
    LevelOutput held(const LevelInput& input) noexcept;
    [[nodiscard]] LevelOutput limited(Pair rate) noexcept;

    LevellerSettings settings_;
    /// An observable that was outside its band.
    struct Outside {
        const char* what = "mean specific force";
        std::size_t channel = 0;
        double time_s = -1, value = 0, band = 0;
    };

    double sigma_, tolerance_, rate_tolerance_ = 0, force_noise_ = 0, rate_noise_ = 0;
    Outside outside_;
    NoiseBudget budget_;
    std::array<FastNetwork, 2> axis_;
    std::array<Window, 2> force_, rate_;
    Observables observables_;
    Phase phase_ = Phase::fast;
    Verdict verdict_ = Verdict::settling;
    Trouble trouble_ = Trouble::none;
    std::size_t trouble_channel_ = 0;
    double trouble_since_s_ = 0, trouble_value_ = 0;
    double time_s_ = 0, ramp_begin_s_ = 0, held_s_ = 0;
    int missing_in_a_row_ = 0;
    bool started_ = false;
    Pair last_rate_{}, last_reference_{};
    std::optional<double> settled_s_;
};

}  // namespace vibrig::estimator::levelling
