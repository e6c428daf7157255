#pragma once

#include <array>
#include <cstddef>
#include <deque>
#include <memory>
#include <optional>
#include <vector>

#include "estimator/allan/alarm.hpp"
#include "estimator/allan/noise_terms.hpp"

namespace vibrig::estimator::allan {

class DwellBasis;

/// Block means of one gyro's angle residual in one dwell; any offset and rate may be left in them.
struct DwellAngles {
    std::vector<double> angle_arcsec;
    std::shared_ptr<const DwellBasis> basis;  ///< of the blocks present
    double block_s = 1;
    double white_share = 1;  ///< variance of a block mean over that of one sample's angle noise
    double level = 0;        ///< vibration; dwells of different levels are never compared
};

struct DwellMonitorSettings {
    double alpha = 1e-3;               ///< of one dwell, shared by the tests and the gyros
    std::size_t reference_dwells = 5;  ///< of one level, before alarms are raised
    std::size_t keep = 64;             ///< dwells, the newest
    double angle_arcsec = 5;           ///< where the search begins
    double walk_deg_per_rt_h = 1e-3;
};

/// Noise of one gyro from many short dwells together. The angle's noise is that of the resolver (Q
/// here: per sample, on each level its own) and the gyro's random walk N: maximum likelihood over
/// all contrasts of all dwells. N, and B, K, R one at a time beside N, are "not detected" unless
/// their score test exceeds three standard errors.
class DwellMonitor {
  public:
    explicit DwellMonitor(const DwellMonitorSettings& settings) : settings_(settings) {}

    /// Tests of one gyro in one dwell: its octaves, and the mean, which is not judged here.
    [[nodiscard]] static std::size_t tests_of(const DwellBasis& basis);
    /// Octaves whose MDEV is not that of the earlier dwells of the same level. Changes nothing.
    [[nodiscard]] std::vector<Alarm> check(const DwellAngles& dwell) const;
    /// `all`: not Q and N alone but all terms and the smallest change, which takes longer.
    void learn(const DwellAngles& dwell, bool all = true);

    [[nodiscard]] std::size_t dwells() const { return dwells_.size(); }
    /// In the units of kTermUnits, `below` two standard errors above the estimate; Q is the one of
    /// the newest dwell's level. Zeros before learn().
    [[nodiscard]] const std::array<FittedTerm, kTerms>& terms() const { return terms_; }
    /// Curve of one dwell alone, by growing averaging time; `expected` stays 0. One row of the
    /// dynamic surface (docs/theory/allan.md).
    [[nodiscard]] static std::vector<DwellPoint> curve_of(const DwellAngles& dwell);
    /// Measured, by growing averaging time; none before learn().
    [[nodiscard]] std::vector<DwellPoint> points() const;
    /// How many times N must grow for one dwell like the newest to raise an alarm when its ratio is
    /// as expected; 0: not known.
    [[nodiscard]] double smallest_change() const { return smallest_change_; }
    /// How far the data are from a given N, in standard errors of what that N predicts.
    [[nodiscard]] double distance_from(double walk_deg_per_rt_h) const;

  private:
    struct Kept {
        DwellAngles dwell;
        std::vector<double> contrasts;
        std::size_t level = 0;
        std::vector<double> measured;  ///< squared differences of each octave, summed
    };
    struct Solution {
        double walk = 0;  ///< q, arcsec^2/s
        double walk_sigma = 0;
        double score = 0;           ///< d log-likelihood / dq over its standard deviation
        std::vector<double> white;  ///< by level, arcsec^2
        std::vector<double> white_sigma;
    };
    [[nodiscard]] Solution solve(std::optional<double> fixed_walk) const;
    void test_slow_terms(const Solution& solution);
    void find_smallest_change();
    [[nodiscard]] std::size_t dwells_at(std::size_t level) const;
    /// Of the dwell's basis the octave of this number.
    [[nodiscard]] std::array<double, 2> bounds(const DwellAngles& dwell, std::size_t octave,
                                               std::size_t level) const;

    DwellMonitorSettings settings_;
    std::deque<Kept> dwells_;
    std::vector<double> levels_;
    Solution solution_;
    std::array<FittedTerm, kTerms> terms_{};
    double smallest_change_ = 0;
};

}  // namespace vibrig::estimator::allan
