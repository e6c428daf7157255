#include "estimator/allan/dwell_monitor.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <map>

#include "estimator/allan/dwell_basis.hpp"
#include "estimator/allan/edf.hpp"
#include "estimator/allan/fit.hpp"

namespace vibrig::estimator::allan {

namespace {

using Eigen::VectorXd;

constexpr int kMostIterations = 50;
constexpr double kConverged = 1e-9;
constexpr double kSharers = 3;  // share the level of a dwell's alarms
constexpr double kSameLevel = 0.005;

double squared(double x) { return x * x; }

/// q [arcsec^2/s] of N [deg/sqrt(h)] and back.
double walk_of(double n) { return squared(60 * n); }
double n_of(double walk) { return std::sqrt(walk) / 60; }

Eigen::Map<const VectorXd> mapped(const std::vector<double>& of) {
    return {of.data(), static_cast<Eigen::Index>(of.size())};
}

/// Of the contrasts of a dwell, by the angle's noise on its level and the gyro's random walk.
VectorXd variances(const DwellAngles& dwell, double white, double walk) {
    return (dwell.white_share * white + walk * dwell.block_s * dwell.basis->walk.array()).matrix();
}

/// An offset common to all cancels in differences, but not its rounding.
VectorXd centred(const DwellAngles& dwell) {
    return (mapped(dwell.angle_arcsec).array() - dwell.angle_arcsec[0]).matrix();
}

/// Variance of averages over m blocks side by side in the longest part without gaps, about the mean
/// of just those, over all positions of the first. For blocks of unit length.
double classical_variance_of(const VectorXd& angle, const std::vector<std::size_t>& present,
                             std::size_t m) {
    std::size_t first = 0, count = 0;
    for (std::size_t from = 0, i = 1; i <= present.size(); ++i) {
        if (i < present.size() && present[i] == present[i - 1] + 1) continue;
        if (i - from > count) {
            first = from;
            count = i - from;
        }
        from = i;
    }
    const std::size_t tiles = (count - 1) / m;  // two at least: an octave has 3 m blocks in a row
    const auto at = [&](std::size_t i) { return angle[static_cast<Eigen::Index>(first + i)]; };
    double sum = 0;
    const std::size_t covered = tiles * m;
    for (std::size_t start = 0; start + covered < count; ++start) {
        const double mean = (at(start + covered) - at(start)) / static_cast<double>(tiles);
        for (std::size_t i = start; i < start + covered; i += m)
            sum += squared(at(i + m) - at(i) - mean);
    }
    return sum / (static_cast<double>(tiles * (count - covered)) * squared(static_cast<double>(m)));
}

double scale_of(std::size_t slow_term, double block_s) {
    return std::pow(block_s, static_cast<double>(slow_term) + 2);
}

}  // namespace

std::size_t DwellMonitor::tests_of(const DwellBasis& basis) { return basis.octaves.size() + 1; }

std::size_t DwellMonitor::dwells_at(std::size_t level) const {
    return static_cast<std::size_t>(std::ranges::count(dwells_, level, &Kept::level));
}

void DwellMonitor::learn(const DwellAngles& dwell, bool all) {
    const auto same = [&](double level) {
        return std::abs(level - dwell.level) <= kSameLevel * std::max(level, dwell.level);
    };
    const auto at = std::find_if(levels_.begin(), levels_.end(), same);
    const auto level = static_cast<std::size_t>(at - levels_.begin());
    if (at == levels_.end()) levels_.push_back(dwell.level);
    std::vector<double> measured;
    for (const DwellBasis::Octave& octave : dwell.basis->octaves)
        measured.push_back((octave.differences * centred(dwell)).squaredNorm());
    const VectorXd contrasts = dwell.basis->contrasts(dwell.angle_arcsec);
    dwells_.push_back({dwell, {contrasts.begin(), contrasts.end()}, level, std::move(measured)});
    if (dwells_.size() > settings_.keep) dwells_.pop_front();

    solution_ = solve({});
    FittedTerm& q = terms_[static_cast<std::size_t>(Term::Q)];
    q.detected = true;
    q.value = std::sqrt(solution_.white[level]);
    q.sigma = solution_.white_sigma[level] / (2 * q.value);
    FittedTerm& n = terms_[static_cast<std::size_t>(Term::N)];
    n.detected = solve(0.0).score > kDetected && solution_.walk > 0;
    n.value = n_of(solution_.walk);
    n.sigma = n.value > 0 ? solution_.walk_sigma / (2 * 3600 * n.value) : 0;
    q.below = std::sqrt(solution_.white[level] + kBound * solution_.white_sigma[level]);
    n.below = n_of(solution_.walk + kBound * solution_.walk_sigma);
    if (!all) return;
    test_slow_terms(solution_);
    find_smallest_change();
}

/// Fisher's scoring. The information matrix is an arrow: each level's white noise meets only q.
DwellMonitor::Solution DwellMonitor::solve(std::optional<double> fixed_walk) const {
    const std::size_t levels = levels_.size();
    Solution s;
    s.walk = fixed_walk.value_or(walk_of(settings_.walk_deg_per_rt_h));
    s.white.assign(levels, squared(settings_.angle_arcsec));
    s.white_sigma.assign(levels, 0);
    for (int iteration = 0; iteration < kMostIterations; ++iteration) {
        double score_q = 0, qq = 0;
        std::vector<double> score_r(levels, 0), qr(levels, 0), rr(levels, 0);
        for (const Kept& kept : dwells_) {
            const VectorXd v = variances(kept.dwell, s.white[kept.level], s.walk);
            const double a = kept.dwell.white_share;
            for (Eigen::Index i = 0; i < v.size(); ++i) {
                const double b = kept.dwell.block_s * kept.dwell.basis->walk[i];
                const double weight = 1 / squared(v[i]);
                const double excess =
                    (squared(kept.contrasts[static_cast<std::size_t>(i)]) - v[i]) * weight;
                score_q += excess * b;
                score_r[kept.level] += excess * a;
                qq += b * b * weight;
                qr[kept.level] += a * b * weight;
                rr[kept.level] += a * a * weight;
            }
        }
        for (std::size_t l = 0; l < levels; ++l) {
            if (rr[l] > 0) {
                qq -= squared(qr[l]) / rr[l];
                score_q -= qr[l] / rr[l] * score_r[l];
            }
        }
        // The information is half of these sums, and so is the score.
        s.walk_sigma = std::sqrt(2 / qq);
        s.score = score_q / std::sqrt(2 * qq);
        const double walk = fixed_walk ? s.walk : std::max(0.0, s.walk + score_q / qq);
        double change = std::abs(walk - s.walk) / s.walk_sigma;
        for (std::size_t l = 0; l < levels; ++l) {
            if (rr[l] <= 0) continue;
            s.white_sigma[l] = std::sqrt(2 / rr[l] * (1 + squared(qr[l]) / (rr[l] * qq)));
            const double step = (score_r[l] - qr[l] * (walk - s.walk)) / rr[l];
            change = std::max(change, std::abs(step) / s.white_sigma[l]);
            // Never to zero or below in one step.
            s.white[l] = std::max(s.white[l] / 10, s.white[l] + step);
        }
        s.walk = walk;
        if (change < kConverged) break;
    }
    return s;
}

double DwellMonitor::distance_from(double walk_deg_per_rt_h) const {
    return dwells_.empty() ? 0 : solve(walk_of(walk_deg_per_rt_h)).score;
}

void DwellMonitor::test_slow_terms(const Solution& solution) {
    const std::size_t levels = levels_.size();
    for (std::size_t t = 0; t < 3; ++t) {
        double score = 0, tt = 0, tq = 0, qq = 0;
        std::vector<double> tr(levels, 0), qr(levels, 0), rr(levels, 0);
        for (const Kept& kept : dwells_) {
            const VectorXd weight =
                variances(kept.dwell, solution.white[kept.level], solution.walk).cwiseInverse();
            const VectorXd z = mapped(kept.contrasts).cwiseProduct(weight);
            const double scale = scale_of(t, kept.dwell.block_s);
            const Eigen::MatrixXd& c = kept.dwell.basis->slow[t];
            const Eigen::MatrixXd& squares = kept.dwell.basis->slow_squares[t];
            const VectorXd diagonal = c.diagonal().cwiseProduct(weight);
            const VectorXd walk = kept.dwell.block_s * kept.dwell.basis->walk.cwiseProduct(weight);
            const VectorXd white = kept.dwell.white_share * weight;
            score += scale * (z.dot(c * z) - diagonal.sum());
            VectorXd of_squares = VectorXd::Zero(weight.size());
            for (Eigen::Index k = 0; k < weight.size(); ++k)
                of_squares += weight[k] * squares.col(k);
            tt += squared(scale) * weight.dot(of_squares);
            tq += scale * diagonal.dot(walk);
            qq += walk.squaredNorm();
            tr[kept.level] += scale * diagonal.dot(white);
            qr[kept.level] += walk.dot(white);
            rr[kept.level] += white.squaredNorm();
        }
        // What resolver and random walk could explain as well is no information.
        for (std::size_t l = 0; l < levels; ++l) {
            if (rr[l] <= 0) continue;
            tt -= squared(tr[l]) / rr[l];
            tq -= tr[l] * qr[l] / rr[l];
            qq -= squared(qr[l]) / rr[l];
        }
        tt -= squared(tq) / qq;
        const double estimate = score / tt;  // of the squared coefficient
        const double sigma = std::sqrt(2 / tt);
        FittedTerm& term = terms_[static_cast<std::size_t>(Term::B) + t];
        term.detected = estimate > kDetected * sigma;
        term.value = std::sqrt(std::max(0.0, estimate));
        term.sigma = term.value > 0 ? sigma / (2 * term.value) : 0;
        term.below = std::sqrt(std::max(0.0, estimate) + kBound * sigma);
    }
}

/// Bounds of the ratio of an octave to what the earlier dwells of the level let expect.
std::array<double, 2> DwellMonitor::bounds(const DwellAngles& dwell, std::size_t number,
                                           std::size_t level) const {
    const DwellBasis::Octave& octave = dwell.basis->octaves[number];
    const double white = dwell.white_share * solution_.white[level];
    const double walk = solution_.walk * dwell.block_s;
    const double trace = white * octave.white_trace + walk * octave.walk_trace;
    const double norm = white * white * octave.white_square + 2 * white * walk * octave.product +
                        walk * walk * octave.walk_square;
    const auto taught = static_cast<double>(dwells_at(level));
    // The reference is uncertain too; variances of the logarithm add.
    const double degrees = trace * trace / norm * taught / (1 + taught);
    const double tail =
        settings_.alpha / (2 * kSharers * static_cast<double>(tests_of(*dwell.basis)));
    return {chi_square_quantile(tail, degrees) / degrees,
            chi_square_quantile(1 - tail, degrees) / degrees};
}

std::vector<DwellPoint> DwellMonitor::curve_of(const DwellAngles& dwell) {
    const VectorXd angles = centred(dwell);
    std::vector<DwellPoint> curve;
    for (const DwellBasis::Octave& octave : dwell.basis->octaves) {
        const double tau = static_cast<double>(octave.m) * dwell.block_s;
        const auto differences = static_cast<double>(octave.differences.rows());
        const double sum = (octave.differences * angles).squaredNorm();
        const double classical =
            std::sqrt(classical_variance_of(angles, dwell.basis->present(), octave.m));
        curve.push_back(
            {tau, std::sqrt(sum / (2 * differences)) / tau, 0, classical / dwell.block_s});
    }
    return curve;
}

std::vector<DwellPoint> DwellMonitor::points() const {
    struct Sums {
        double measured = 0, expected = 0, differences = 0;
    };
    std::map<double, Sums> by_tau;
    for (const Kept& kept : dwells_) {
        const DwellAngles& dwell = kept.dwell;
        for (std::size_t i = 0; i < kept.measured.size(); ++i) {
            const DwellBasis::Octave& octave = dwell.basis->octaves[i];
            Sums& sums = by_tau[static_cast<double>(octave.m) * dwell.block_s];
            sums.measured += kept.measured[i];
            sums.expected += dwell.white_share * solution_.white[kept.level] * octave.white_trace +
                             solution_.walk * dwell.block_s * octave.walk_trace;
            sums.differences += static_cast<double>(octave.differences.rows());
        }
    }
    std::vector<DwellPoint> points;
    for (const auto& [tau, sums] : by_tau) {
        // MVAR = <(second difference of averages)^2> / (2 tau^2); 1 arcsec/s is 1 deg/h.
        const double scale = std::sqrt(1 / (2 * sums.differences)) / tau;
        points.push_back({tau, scale * std::sqrt(sums.measured), scale * std::sqrt(sums.expected)});
    }
    return points;
}

std::vector<Alarm> DwellMonitor::check(const DwellAngles& dwell) const {
    std::vector<Alarm> alarms;
    const auto at = std::find_if(levels_.begin(), levels_.end(), [&](double level) {
        return std::abs(level - dwell.level) <= kSameLevel * std::max(level, dwell.level);
    });
    const auto level = static_cast<std::size_t>(at - levels_.begin());
    if (at == levels_.end() || dwells_at(level) < settings_.reference_dwells) return alarms;
    const std::size_t count = dwell.basis->octaves.size();
    for (std::size_t i = 0; i < count; ++i) {
        const DwellBasis::Octave& octave = dwell.basis->octaves[i];
        const double expected = dwell.white_share * solution_.white[level] * octave.white_trace +
                                solution_.walk * dwell.block_s * octave.walk_trace;
        const double ratio = (octave.differences * centred(dwell)).squaredNorm() / expected;
        const auto [low, high] = bounds(dwell, i, level);
        if (ratio >= low && ratio <= high) continue;
        alarms.push_back({reading_of(i, count), static_cast<double>(octave.m) * dwell.block_s,
                          ratio, ratio < low ? low : high, 0});
    }
    return alarms;
}

void DwellMonitor::find_smallest_change() {
    const Kept& newest = dwells_.back();
    smallest_change_ = 0;
    if (!terms_[static_cast<std::size_t>(Term::N)].detected) return;
    const auto& octaves = newest.dwell.basis->octaves;
    for (std::size_t i = 0; i < octaves.size(); ++i) {
        const double white =
            newest.dwell.white_share * solution_.white[newest.level] * octaves[i].white_trace;
        const double walk = solution_.walk * newest.dwell.block_s * octaves[i].walk_trace;
        const double high = bounds(newest.dwell, i, newest.level)[1];
        const double change = std::sqrt((high * (white + walk) - white) / walk);
        smallest_change_ = smallest_change_ > 0 ? std::min(smallest_change_, change) : change;
    }
}

}  // namespace vibrig::estimator::allan
