#include "daemon/noise/noise_monitor.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "estimator/allan/dwell_basis.hpp"
#include "estimator/filter/parameters.hpp"
#include "estimator/identification/dwell_row.hpp"

namespace vibrig::noise {

using estimator::NoiseLevels;
using namespace estimator::allan;

namespace {

constexpr std::array<char, 3> kNames{'x', 'y', 'z'};
constexpr std::size_t kMostAlarmsShown = 32;
// Safeguards of what is handed to the filter.
constexpr std::size_t kFewestDwells = 8;
constexpr double kContradiction = 4;  // standard errors
// Identified anew with what was found, a campaign loses nothing where that was a chance.
constexpr double kContradictionAtEnd = 3;
constexpr double kLargestSigma = 0.25;  // of the new value
constexpr double kLargestFactor = 2;

std::string words(const FittedTerm& term, const char* unit) {
    return term.detected ? fmt::format("{:.3g} +- {:.2g} {}", term.value, term.sigma, unit)
                         : fmt::format("not detected, below {:.2g} {}", term.below, unit);
}

const FittedTerm& of(const DwellMonitor& gyro, Term term) {
    return gyro.terms()[static_cast<std::size_t>(term)];
}

double limited(double wanted, double present) {
    return present > 0 ? std::clamp(wanted, present / kLargestFactor, present * kLargestFactor)
                       : wanted;
}

}  // namespace

NoiseMonitor::NoiseMonitor(const estimator::Settings& settings, EventSink event)
    : settings_(settings), event_(std::move(event)) {
    const auto sigma = estimator::prior_sigma(settings);
    prior_.covariance.assign(estimator::kParameters * estimator::kParameters, 0);
    for (std::size_t i = 0; i < estimator::kParameters; ++i) {
        prior_.covariance[i * (estimator::kParameters + 1)] =
            sigma[estimator::internal_of(i)] * sigma[estimator::internal_of(i)];
    }
    reset();
}

void NoiseMonitor::reset() {
    in_force_ = estimator::noise_levels(settings_);
    changed_ = false;
    DwellMonitorSettings start;
    start.angle_arcsec = std::max(in_force_.angle_arcsec, 1e-3);
    start.walk_deg_per_rt_h = std::max(in_force_.gyro_random_walk_deg_per_rt_h[0], 1e-6);
    gyros_.assign(3, DwellMonitor(start));
    blocks_.clear();
    known_ = prior_;
    level_squares_ = 0;
    status_ = {};
    status_.angle_in_force_arcsec = in_force_.angle_arcsec;
    for (std::size_t j = 0; j < 3; ++j) {
        status_.gyros[j].in_force = in_force_.gyro_random_walk_deg_per_rt_h[j];
    }
}

void NoiseMonitor::add(const rt::BlockRecord& block) {
    if (!blocks_.empty() && (blocks_.front().dwell.run != block.dwell.run ||
                             blocks_.front().dwell.position != block.dwell.position)) {
        blocks_.clear();
    }
    blocks_.push_back(block);
}

/// Those with at least nine tenths of the samples of the fullest: the others are too noisy, like
/// the first, where the filter waits for the vibration level, and the last.
std::vector<estimator::AngleBlock> NoiseMonitor::usable_blocks() const {
    std::uint32_t most = 0;
    for (const rt::BlockRecord& block : blocks_) most = std::max(most, block.samples);
    std::vector<estimator::AngleBlock> usable;
    for (const rt::BlockRecord& block : blocks_) {
        if (10 * block.samples >= 9 * most) {
            usable.push_back({block.number, block.time_s, block.angle_rad});
        }
    }
    return usable;
}

const std::shared_ptr<const DwellBasis>& NoiseMonitor::basis_of(std::vector<std::size_t> present) {
    if (!basis_ || basis_->present() != present) {
        basis_ = std::make_shared<const DwellBasis>(std::move(present));
    }
    return basis_;
}

bool NoiseMonitor::end_dwell(const estimator::DwellSummary& dwell, Knowledge now) {
    const Knowledge before = std::exchange(known_, std::move(now));
    const std::vector<rt::BlockRecord> blocks = blocks_;
    const std::vector<estimator::AngleBlock> usable = usable_blocks();
    blocks_.clear();
    const bool ours = !blocks.empty() && blocks.front().dwell.run == dwell.run &&
                      blocks.front().dwell.position == dwell.position;
    if (!ours || (dwell.flagged && !dwell.followed) || usable.size() < DwellBasis::kFewestBlocks) {
        ++status_.dwells_left_out;
        return false;
    }
    std::vector<std::size_t> present;
    double samples = 0;
    for (const estimator::AngleBlock& block : usable) {
        present.push_back(block.number - usable.front().number);
    }
    for (const rt::BlockRecord& block : blocks) samples = std::max<double>(samples, block.samples);
    const auto residual =
        estimator::dwell_residual(settings_, known_.coefficients, dwell.vibration(), usable);
    std::array<DwellAngles, 3> angles;
    for (std::size_t j = 0; j < 3; ++j) {
        angles[j].angle_arcsec = residual.angle_arcsec[j];
        angles[j].basis = basis_of(present);
        angles[j].block_s = blocks.front().block_s;
        angles[j].white_share = residual.noise_gain[j] / samples;
        angles[j].level = std::max(0.0, blocks.front().dwell.table_g);
    }
    status_.block_s = angles[0].block_s;
    const bool stepped = mean_has_stepped(dwell, before, usable, angles);
    const bool other = check(dwell, angles);
    if (event_) draw(dwell, angles, other || stepped);
    if (other) {
        ++status_.dwells_left_out;
        return true;
    }
    // A step is in nothing that is learnt: the contrasts are free of the rate.
    learn(angles);
    propose_levels();
    return stepped;
}

void NoiseMonitor::raise(const NoiseStatus::Alarm& alarm, const std::string& what) {
    ++status_.alarms_total;
    status_.alarms.push_back(alarm);
    if (status_.alarms.size() > kMostAlarmsShown) status_.alarms.erase(status_.alarms.begin());
    if (!event_) return;
    event_(Severity::alarm, fmt::format("gyro {}, run {} position {}: {}; worth repeating",
                                        kNames[alarm.gyro], alarm.run, alarm.position, what));
}

bool NoiseMonitor::check(const estimator::DwellSummary& dwell,
                         const std::array<DwellAngles, 3>& angles) {
    bool any = false;
    for (std::size_t j = 0; j < 3; ++j) {
        for (const Alarm& alarm : gyros_[j].check(angles[j])) {
            any = true;
            raise({dwell.run, dwell.position, j, alarm.tau, alarm.ratio, alarm.limit,
                   words_of(alarm.reading)},
                  fmt::format("at {:g} s the variance is {:.3g} times that of the earlier dwells "
                              "(limit {:.3g}); {}",
                              alarm.tau, alarm.ratio, alarm.limit, words_of(alarm.reading)));
        }
    }
    return any;
}

void NoiseMonitor::learn(const std::array<DwellAngles, 3>& angles) {
    ++status_.dwells;
    for (std::size_t j = 0; j < 3; ++j) {
        const auto slow_detected = [&] {
            return of(gyros_[j], Term::K).detected || of(gyros_[j], Term::R).detected;
        };
        const bool before = slow_detected();
        gyros_[j].learn(angles[j], event_ != nullptr);
        if (!event_) continue;
        status_.gyros[j].terms = gyros_[j].terms();
        status_.gyros[j].smallest_change = gyros_[j].smallest_change();
        status_.gyros[j].points = gyros_[j].points();
        if (!before && slow_detected()) {
            event_(Severity::warning,
                   fmt::format("gyro {}: the rate wanders within the dwells (K {}; R {}); the "
                               "coefficients are taken as constant: a longer soak may help",
                               kNames[j], words(of(gyros_[j], Term::K), "deg/h^1.5"),
                               words(of(gyros_[j], Term::R), "deg/h^2")));
        }
    }
}

void NoiseMonitor::draw(const estimator::DwellSummary& dwell,
                        const std::array<DwellAngles, 3>& angles, bool alarm) {
    NoiseStatus::Curve curve{dwell.run, dwell.position, alarm, {}, {}, {}};
    for (std::size_t j = 0; j < 3; ++j) {
        for (const auto& point : DwellMonitor::curve_of(angles[j])) {
            if (j == 0) curve.tau_s.push_back(point.tau_s);
            curve.deviation_deg_h[j].push_back(point.deviation);
            curve.classical_deg_h[j].push_back(point.classical);
        }
    }
    // Readers keep what they have: a status is taken by other threads.
    const auto& old = *status_.surface;
    const auto gone = static_cast<std::ptrdiff_t>(old.size() >= NoiseStatus::kMostCurves);
    auto next = std::make_shared<std::vector<NoiseStatus::Curve>>(old.begin() + gone, old.end());
    next->push_back(std::move(curve));
    status_.surface = std::move(next);
}

NoiseMonitor::MeanAngle NoiseMonitor::mean_angle() const {
    double value = 0, variance = 0;
    for (const DwellMonitor& gyro : gyros_) {
        const FittedTerm& q = of(gyro, Term::Q);
        value += q.value / 3;
        variance += q.sigma * q.sigma / 9;
    }
    return {value, std::sqrt(variance)};
}

template <typename Words>
void NoiseMonitor::tell(const Words& words) const {
    if (event_) event_(Severity::warning, words());
}

void NoiseMonitor::propose_levels() {
    if (status_.dwells < kFewestDwells) return;
    const auto [angle, angle_sigma] = mean_angle();
    for (std::size_t j = 0; j < 3; ++j) {
        const FittedTerm& n = of(gyros_[j], Term::N);
        double& present = in_force_.gyro_random_walk_deg_per_rt_h[j];
        if (!n.detected || n.sigma > kLargestSigma * n.value ||
            std::abs(gyros_[j].distance_from(present)) <= kContradiction) {
            continue;
        }
        const double next = limited(n.value, present);
        tell([&] {
            return fmt::format(
                "gyro {}: the filter takes N = {:.3g} instead of {:.3g} deg/sqrt(h) from the next "
                "position on (identified {}, {} dwells)",
                kNames[j], next, present, words(n, "deg/sqrt(h)"), status_.dwells);
        });
        present = status_.gyros[j].in_force = next;
        changed_ = true;
    }
    double& present = in_force_.angle_arcsec;
    if (std::abs(angle - present) > kContradiction * angle_sigma) {
        const double next = limited(angle, present);
        tell([&] {
            return fmt::format(
                "the filter takes {:.3g} instead of {:.3g} arcsec of angle noise from the next "
                "position on ({} dwells)",
                next, present, status_.dwells);
        });
        present = status_.angle_in_force_arcsec = next;
        changed_ = true;
    }
}

std::optional<NoiseLevels> NoiseMonitor::take_new_levels() {
    if (!std::exchange(changed_, false)) return {};
    return in_force_;
}

std::optional<Found> NoiseMonitor::found() const {
    if (status_.dwells < kFewestDwells) return {};
    const NoiseLevels configured = estimator::noise_levels(settings_);
    Found out{configured, std::numeric_limits<double>::infinity()};
    const auto [angle, angle_sigma] = mean_angle();
    for (std::size_t j = 0; j < 3; ++j) {
        const FittedTerm& n = of(gyros_[j], Term::N);
        const double was = configured.gyro_random_walk_deg_per_rt_h[j];
        const bool other = in_force_.gyro_random_walk_deg_per_rt_h[j] != was ||
                           std::abs(gyros_[j].distance_from(was)) > kContradictionAtEnd;
        if (!other || !n.detected || n.sigma > kLargestSigma * n.value) continue;
        out.levels.gyro_random_walk_deg_per_rt_h[j] = n.value;
        out.dof = std::min(out.dof, n.value * n.value / (2 * n.sigma * n.sigma));
    }
    if (in_force_.angle_arcsec != configured.angle_arcsec ||
        std::abs(angle - configured.angle_arcsec) > kContradictionAtEnd * angle_sigma)
        out.levels.angle_arcsec = angle;
    if (out.levels == configured) return {};
    return out;
}

void NoiseMonitor::conclude(estimator::DwellSummary& dwell,
                            estimator::Identification& identification) {
    // What is apart drifts otherwise than these coefficients say.
    const auto& rows = identification.rows();
    if (!rows.empty() && rows.back().apart && rows.back().run == dwell.run &&
        rows.back().position == dwell.position) {
        blocks_.clear();
        return;
    }
    estimator::Estimate estimate;
    identification.estimate(estimate);
    if (end_dwell(dwell, {estimate.value, identification.covariance_now()})) {
        dwell.flagged = true;
        dwell.reason = "noise is not that of the earlier dwells";
    }
    if (const auto levels = take_new_levels()) identification.set_noise(*levels);
}

void NoiseMonitor::continue_from(NoiseMonitor&& other) {
    EventSink own = std::move(event_);
    *this = std::move(other);
    event_ = std::move(own);
}

void NoiseMonitor::report() const {
    if (!event_ || status_.dwells == 0) return;
    for (std::size_t j = 0; j < 3; ++j) {
        const auto word = [&](Term term, const char* unit) {
            return words(of(gyros_[j], term), unit);
        };
        const double change = gyros_[j].smallest_change();
        event_(Severity::info,
               fmt::format("gyro {}, {} dwells: N {}; B {}; K {}; R {}{}", kNames[j],
                           status_.dwells, word(Term::N, "deg/sqrt(h)"), word(Term::B, "deg/h"),
                           word(Term::K, "deg/h^1.5"), word(Term::R, "deg/h^2"),
                           change > 0 ? fmt::format("; one dwell shows N when it grows {:.2g} "
                                                    "times",
                                                    change)
                                      : std::string()));
    }
}

}  // namespace vibrig::noise
