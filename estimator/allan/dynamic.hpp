#pragma once

#include <vector>

#include "estimator/allan/classical.hpp"
#include "estimator/allan/fit.hpp"
#include "estimator/allan/sliding_variance.hpp"

namespace vibrig::estimator::allan {

struct DynamicSettings {
    double tau0 = 1.0;          ///< s
    std::size_t window = 3600;  ///< samples
    double overlap = 0.5;       ///< of neighbouring windows, 0 to below 1
    MeanMode mode = MeanMode::corrected;
    double known_mean = 0;  ///< deg/h, for MeanMode::known_mean
    std::array<bool, kTerms> wanted = kAllTerms;
    WindowShape shape = WindowShape::rectangular;  ///< of the Allan variance
    bool fits = true;                              ///< of Q to R to each window's curve
};

/// One window of the surface, by the factors of the grid.
struct WindowRow {
    double begin_s = 0;  ///< from the first sample
    double centre_s = 0;
    double mean = 0;  ///< deg/h, NaN when all are missing
    std::size_t missing = 0;
    bool refused = false;           ///< more than a tenth is missing, or nothing varies: no fit
    std::vector<double> allan;      ///< (deg/h)^2, NaN where gaps leave no difference
    std::vector<double> classical;  ///< (deg/h)^2, likewise
    std::vector<double> share;      ///< degrees of freedom over those of a full window; 0: none
    Fit fit;
    ClassicalFit classical_fit;
};

/// Mean over windows: the paper averages classical coefficients and maps them, we fit the mean
/// AVAR.
struct DynamicSummary {
    std::size_t windows = 0;
    std::size_t refused = 0;
    ClassicalFit classical;
    Fit fit;
    std::uint64_t faults = 0;
};

class DynamicAllan {
  public:
    explicit DynamicAllan(const DynamicSettings& settings);

    /// True when a window is complete: then ask for row(). Allocates and throws nothing.
    [[nodiscard]] bool add(double rate) noexcept;
    /// Row of the window that ends with the newest sample. Fits, and so allocates.
    [[nodiscard]] WindowRow row() const;

    [[nodiscard]] const std::vector<std::size_t>& factors() const { return sliding_.factors(); }
    [[nodiscard]] const DynamicSettings& settings() const { return settings_; }
    [[nodiscard]] std::uint64_t faults() const { return sliding_.faults(); }
    /// Covariance of the Allan variances of one window.
    [[nodiscard]] const CurveCovariance& covariance() const { return covariance_; }

  private:
    DynamicSettings settings_;
    SlidingVariance sliding_;
    CurveCovariance covariance_;
    std::uint64_t hop_;
};

/// 20 log-spaced factors up to a third of the window, and the octaves up to a quarter.
[[nodiscard]] std::vector<std::size_t> window_factors(std::size_t window);

[[nodiscard]] DynamicSummary summarise(const DynamicAllan& dynamic,
                                       const std::vector<WindowRow>& rows);

}  // namespace vibrig::estimator::allan
