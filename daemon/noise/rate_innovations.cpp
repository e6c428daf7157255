// Drifts against what the coefficients say of them: a dwell's mean, and that of a levelling.
#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>

#include "daemon/noise/noise_monitor.hpp"
#include "estimator/allan/dwell_basis.hpp"
#include "estimator/allan/edf.hpp"
#include "estimator/filter/parameters.hpp"
#include "estimator/identification/dwell_row.hpp"
#include "estimator/identification/predicted_rate.hpp"

namespace vibrig::noise {

using namespace estimator::allan;

namespace {

constexpr double kKnown = 0.01;  // share of the prior's variance of a rate

/// Of the least squares' slope over the blocks' times, 1/s.
std::vector<double> slope_weights(const std::vector<estimator::AngleBlock>& blocks) {
    double mean = 0, squares = 0;
    for (const auto& block : blocks) mean += block.time_s / static_cast<double>(blocks.size());
    std::vector<double> weights;
    for (const auto& block : blocks) {
        weights.push_back(block.time_s - mean);
        squares += weights.back() * weights.back();
    }
    for (double& weight : weights) weight /= squares;
    return weights;
}

}  // namespace

/// The mean of a window is here the mean drift of a dwell, and what it should be is what the
/// coefficients from the dwells before it say: the innovation of the rate, chi-square with one
/// degree of freedom over the dwell's own variance and theirs.
bool NoiseMonitor::mean_has_stepped(const estimator::DwellSummary& dwell, const Knowledge& before,
                                    const std::vector<estimator::AngleBlock>& blocks,
                                    const std::array<DwellAngles, 3>& angles) {
    if (settings_.method != estimator::Method::joint) return false;
    const auto residual =
        estimator::dwell_residual(settings_, before.coefficients, dwell.vibration(), blocks);
    const auto& middle = blocks[blocks.size() / 2].angle_rad;
    const auto predicted = estimator::predicted_rate(settings_, before.coefficients,
                                                     before.covariance, middle, dwell.vibration());
    const auto at_first = estimator::predicted_rate(settings_, prior_.coefficients,
                                                    prior_.covariance, middle, dwell.vibration());
    const auto slope = slope_weights(blocks);
    const double tail = DwellMonitorSettings{}.alpha /
                        (2.0 * static_cast<double>(gyros_.size()) *
                         static_cast<double>(DwellMonitor::tests_of(*angles[0].basis)));
    const double limit = normal_quantile(1 - tail);
    // The coefficients are those of the dwell before; since then the bias has walked.
    const double since_s =
        blocks.back().time_s - blocks.front().time_s + estimator::kAssumedPause_s;
    const double walk = settings_.drift.model == estimator::uncertainty::BiasModel::constant
                            ? 0.0
                            : settings_.drift.walk_deg_h_rt_h;
    const double walked = walk * walk * since_s / 3600;
    // Variance of the slope for this N.
    const auto variance_of = [&](std::size_t j, double walk_deg_per_rt_h) {
        const double white =
            angles[j].white_share * in_force_.angle_arcsec * in_force_.angle_arcsec;
        double variance = 0, rest = 0;
        for (std::size_t i = blocks.size(); i-- > 0;) {
            variance += white * slope[i] * slope[i];
            rest += slope[i] * 60 * walk_deg_per_rt_h;
            if (i > 0) variance += (blocks[i].time_s - blocks[i - 1].time_s) * rest * rest;
        }
        return variance;
    };
    bool any = false;
    for (std::size_t j = 0; j < 3; ++j) {
        // What comes from the prior yet is no knowledge.
        if (predicted.covariance[j][j] > kKnown * at_first.covariance[j][j]) continue;
        if (gyros_[j].dwells() < DwellMonitorSettings{}.reference_dwells) continue;
        // A filter with too small an N believes its coefficients too much by as much.
        const double believed = variance_of(j, in_force_.gyro_random_walk_deg_per_rt_h[j]);
        const FittedTerm& n = gyros_[j].terms()[static_cast<std::size_t>(Term::N)];
        const double found = std::max(believed, n.detected ? variance_of(j, n.value) : 0.0);
        const double variance = walked + found + found / believed * predicted.covariance[j][j];
        double step = 0;
        for (std::size_t i = 0; i < blocks.size(); ++i)
            step += slope[i] * residual.angle_arcsec[j][i];
        const double ratio = step / std::sqrt(variance);
        if (std::abs(ratio) <= limit) continue;
        any = true;
        raise({dwell.run, dwell.position, j, blocks.back().time_s - blocks.front().time_s, ratio,
               std::copysign(limit, ratio), words_of(Reading::mean_step)},
              fmt::format("the mean drift has stepped by {:+.3g} deg/h from what the dwells before "
                          "it say, {:.3g} standard deviations (limit {:.3g})",
                          step, std::abs(ratio), limit));
    }
    return any;
}

void NoiseMonitor::levelled(const LevelDrift& drift) {
    if (settings_.method != estimator::Method::joint) return;
    const auto predicted = estimator::predicted_rate(settings_, known_.coefficients,
                                                     known_.covariance, drift.encoder_rad, {});
    NoiseStatus::Level& level = status_.level;
    level.run = drift.run;
    level.position = drift.position;
    std::array<std::array<double, 2>, 2> s{};  // covariance of the innovation
    for (std::size_t a = 0; a < 2; ++a) {
        double expected = 0;
        for (std::size_t i = 0; i < 3; ++i) {
            expected += drift.direction[a][i] * predicted.rate_deg_h[i];
            for (std::size_t b = 0; b < 2; ++b) {
                for (std::size_t k = 0; k < 3; ++k) {
                    s[a][b] +=
                        drift.direction[a][i] * predicted.covariance[i][k] * drift.direction[b][k];
                }
            }
        }
        s[a][a] += drift.sigma_deg_h * drift.sigma_deg_h;
        level.innovation_deg_h[a] = drift.rate_deg_h[a] - expected;
        level.sigma_deg_h[a] = std::sqrt(s[a][a]);
    }
    const auto& v = level.innovation_deg_h;
    const double square =
        (v[0] * v[0] * s[1][1] - 2 * v[0] * v[1] * s[0][1] + v[1] * v[1] * s[0][0]) /
        (s[0][0] * s[1][1] - s[0][1] * s[1][0]);
    level_squares_ += square / 2;
    level.mean_square = level_squares_ / ++level.samples;
    if (!event_ || square <= chi_square_quantile(1 - DwellMonitorSettings{}.alpha, 2)) return;
    event_(Severity::alarm,
           fmt::format("run {} position {}: while it was levelled the platform drifted by {:+.3g} "
                       "and {:+.3g} deg/h more than the coefficients say (sigma {:.2g}, {:.2g}): "
                       "torquers' scale, gyros, or latitude and azimuth of the rig",
                       drift.run, drift.position, v[0], v[1], level.sigma_deg_h[0],
                       level.sigma_deg_h[1]));
}

}  // namespace vibrig::noise
