#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "estimator/level/hann.hpp"
#include "estimator/level/lock_in.hpp"

namespace vibrig::estimator {

/// kappa = mean of (1 + A1)^2, A1 the vibration along the vertical in g, from the specific force
/// projected on the vertical: W{fu^2} / W{fu}^2 - sigma_a^2 with Hann means W. The division by the
/// mean lets gravity calibrate the accelerometers; no frequency is needed. One dwell at a time, at
/// a constant sample period; never allocates after construction.
class VibrationLevel {
  public:
    static constexpr double kFirstWindow_s = 2.0;
    static constexpr double kRefresh_s = 0.2;
    static constexpr double kHighestRate_hz = 2000.0;
    static constexpr double kAtRest = 1e-4;  ///< below this kappa - 1 the table is at rest

    VibrationLevel(double window_s, double noise_g, double nominal_hz);

    /// Frequency of the vibration to come; before begin().
    void nominal(double hz) noexcept { nominal_hz_ = hz; }
    /// A new stretch of data begins.
    void begin(double period_s) noexcept;
    /// One sample of the first window; prime() ends it.
    void add_first(double vertical_force_g) noexcept { push(vertical_force_g, true); }
    void add_first_missing() noexcept { push(0.0, false); }
    /// Fills the gaps of the first window and computes the first kappa.
    void prime() noexcept;
    /// One sample after prime(). A missing one is replaced by what the fitted vibration says it
    /// was.
    void add(double vertical_force_g) noexcept;
    void add_missing() noexcept;

    [[nodiscard]] double kappa() const noexcept { return kappa_; }
    /// At the platform, sqrt(2 (kappa - 1)), g.
    [[nodiscard]] double amplitude_g() const noexcept;
    /// 0 at rest, and where what vibrates is not within some 2 Hz of the nominal frequency.
    [[nodiscard]] double frequency_hz() const noexcept;
    /// Phase, rad, of A1 = a0 sin(w t + phase) with t from the first sample of the window of the
    /// last fit.
    [[nodiscard]] const Vibration& vibration() const noexcept { return fitted(); }
    [[nodiscard]] std::size_t count() const noexcept { return whole_.count(); }

    struct Whole {
        double kappa = 1, mean_force_g = 0;
    };
    /// Over everything since begin().
    [[nodiscard]] Whole whole() const noexcept;

    /// True if at this sample period order * f aliases to within 4 / window_s of zero. Order 2 is
    /// the square of the vibration itself: no test on the data can tell the level then. Order 3 is
    /// the product of the vibration with its second harmonic, order 4 the square of that: kappa is
    /// wrong by up to e a0^2 / kappa and e^2 a0^2 / (2 kappa) for a harmonic of relative size e.
    [[nodiscard]] static bool excluded(double frequency_hz, double period_s, double window_s,
                                       int order = 2) noexcept;
    /// From how long a window on neither the vibration nor its square is excluded, s.
    [[nodiscard]] static double shortest_window_s(double frequency_hz, double period_s) noexcept;
    /// What a harmonic of the shaker does to the level at this sample period, orders 3 to 5 of
    /// excluded(); empty: nothing. Static text.
    [[nodiscard]] static const char* aliasing(double frequency_hz, double period_s,
                                              double window_s) noexcept;

  private:
    void push(double value, bool valid) noexcept;
    void take(double value, bool valid) noexcept;
    void refresh() noexcept;
    /// To the newest samples; done when somebody asks for it, mostly nobody does.
    void fit(std::size_t samples) noexcept;
    const Vibration& fitted() const noexcept;
    /// Takes out of short windows what the lines of the fitted vibration leak into the means.
    void remove_leakage(HannMeans& means, std::size_t n) const noexcept;
    [[nodiscard]] double kappa_of(const HannMeans& means) const noexcept;

    double window_s_, noise_g_, nominal_hz_;
    double period_s_ = 0;  ///< begin() knows it
    std::vector<double> ring_;
    std::unique_ptr<bool[]> valid_;
    HannWindow hann_;
    std::size_t next_ = 0, filled_ = 0;
    std::size_t window_ = 0, shortest_ = 0, refresh_every_ = 1, fit_every_ = 1;
    std::size_t since_refresh_ = 0, since_fit_ = 0;
    GrowingHann whole_;
    mutable Vibration fit_;
    mutable bool fit_is_due_ = false;
    std::size_t fit_begin_ = 0, fit_samples_ = 0;  ///< its window in the ring
    std::size_t fit_age_ = 0;  ///< samples since the first sample of the fitted window
    double kappa_ = 1;
};

}  // namespace vibrig::estimator
