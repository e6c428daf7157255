#pragma once

#include <optional>
#include <vector>

#include "estimator/allan/alarm.hpp"
#include "estimator/allan/dynamic.hpp"

namespace vibrig::estimator::allan {

struct MonitorSettings {
    double alpha = 1e-3;                ///< of one window, shared by the octaves and the mean
    std::size_t reference_windows = 5;  ///< that teach the reference when none is given
};

/// Compares windows with a reference, octave by octave. Model: the record is one mixture of Q, N,
/// B, K and R throughout. The variance of a window at an octave then has mean mu and the degrees of
/// freedom nu = 2 mu^2 / C of that mixture (CurveCovariance). Against an accepted calibration
/// ratio x nu follows chi-square(nu); against a learnt reference, the mean of n windows that
/// overlap, the ratio follows F(nu, nu n_eff), n_eff = 1 + (n - 1) (1 - overlap), and a ramp, which
/// a few windows cannot tell from a walk, counts as the walk that does as much over a window. Gaps
/// take degrees of freedom from window and reference; where they leave none nothing is compared.
/// The mean of a window less that of the one before it has variance 2 AVAR(T), with a learnt
/// reference the largest that its slow noise may have. Each gets an equal share of alpha.
class StationarityMonitor {
  public:
    StationarityMonitor(const MonitorSettings& settings, const DynamicAllan& dynamic);

    /// An accepted calibration, exact in comparison with a window.
    void set_reference(const Terms& terms);
    /// Alarms of this window; while the reference is learnt there are none. Refused rows change
    /// nothing.
    [[nodiscard]] std::vector<Alarm> check(const WindowRow& row);

    [[nodiscard]] bool has_reference() const {
        return !octaves_.empty() && octaves_[0].degrees > 0;
    }
    /// Smallest relative change of N that a window shows at the octave most apt to show it.
    [[nodiscard]] double smallest_change() const;

  private:
    struct Octave {
        std::size_t k = 0;  ///< index in the row
        std::size_t m = 1;
        double reference = 0;  ///< 0: none
        double degrees = 0;    ///< of freedom of a window without gaps
        double taught = 1;     ///< part of them that the windows of the reference had
        std::optional<double> since;
    };
    /// Of the ratio.
    struct Bounds {
        double low = 0, high = 0;
    };
    /// `present`: degrees of freedom over those of a window without gaps.
    [[nodiscard]] Bounds bounds_of(const Octave& octave, double present) const;
    void learn(const WindowRow& row);
    void set_bounds(const Terms& terms, double reference_windows);
    [[nodiscard]] double share_of_alpha() const;

    MonitorSettings settings_;
    CurveCovariance covariance_;
    double window_share_;  ///< of the degrees of freedom, by the window's shape
    double tau0_;
    std::size_t window_;
    std::size_t back_;  ///< rows from one window to the adjacent one
    double overlap_;
    std::vector<Octave> octaves_;
    double reference_windows_ = 0;  ///< that taught, as if apart; 0: the reference is exact
    std::vector<WindowRow> lessons_;
    std::vector<double> means_;
    double mean_sigma_ = 0;  ///< of the difference of adjacent means
    std::optional<double> step_since_;
};

}  // namespace vibrig::estimator::allan
