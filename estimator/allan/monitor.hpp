#pragma once

#include <optional>
#include <vector>

#include "estimator/allan/dynamic.hpp"

namespace vibrig::estimator::allan {

struct MonitorSettings {
    double alpha = 1e-3;                ///< of one window, shared by the octaves
    std::size_t reference_windows = 5;  ///< that teach the reference when none is given
};

enum class Reading : unsigned char {
    short_tau,   ///< quantisation or vibration leakage
    middle_tau,  ///< angle random walk N
    long_tau,    ///< temperature, K, R
    mean_step    ///< the mean of adjacent windows differs
};
[[nodiscard]] const char* words_of(Reading reading);

struct Alarm {
    Reading reading = Reading::middle_tau;
    double tau = 0;    ///< s; the window's length for a step
    double ratio = 1;  ///< AVAR over the reference; a step: in standard deviations, signed
    double limit = 1;  ///< the bound that was crossed
    double since_s = 0;
};

/// Compares windows with a reference, octave by octave: ratio x edf follows chi-square(edf).
class StationarityMonitor {
  public:
    StationarityMonitor(const MonitorSettings& settings, const DynamicAllan& dynamic);

    /// An accepted calibration, exact in comparison with a window.
    void set_reference(const Terms& terms);
    /// Alarms of this window; while the reference is learnt there are none. Refused rows change
    /// nothing.
    [[nodiscard]] std::vector<Alarm> check(const WindowRow& row);

    [[nodiscard]] bool has_reference() const { return !octaves_.empty() && octaves_[0].low > 0; }
    /// Smallest relative change of N that a window shows at the octave most apt to show it.
    [[nodiscard]] double smallest_change() const;

  private:
    struct Octave {
        std::size_t k = 0;  ///< index in the row
        std::size_t m = 1;
        double reference = 0;
        double low = 0;  ///< bounds of the ratio
        double high = 0;
        std::optional<double> since;
    };
    void learn(const WindowRow& row);
    void set_bounds(const Terms& terms, double reference_windows);
    [[nodiscard]] Reading reading_of(std::size_t octave) const;

    MonitorSettings settings_;
    double tau0_;
    std::size_t window_;
    std::size_t back_;  ///< rows from one window to the adjacent one
    double overlap_;
    std::vector<Octave> octaves_;
    std::vector<WindowRow> lessons_;
    std::vector<double> means_;
    double mean_sigma_ = 0;  ///< of the difference of adjacent means
    std::optional<double> step_since_;
};

}  // namespace vibrig::estimator::allan
