#include "daemon/campaign/opening_check.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "estimator/commissioning/opening.hpp"
#include "estimator/commissioning/told_apart.hpp"
#include "estimator/filter/angles.hpp"

namespace vibrig::campaign {

namespace room = estimator::commissioning;

namespace {

constexpr std::size_t kDriftSeconds = 30, kStillSeconds = 3;
constexpr drivers::Time kComesToRest = 3 * drivers::kSecond, kSpare = 15 * drivers::kSecond;
constexpr double kSlewGuess_s = 25;

std::string in_one(const std::vector<std::string>& all) {
    return fmt::format("{}", fmt::join(all, "; "));
}

/// Of the readings, least squares; angles may pass half a turn.
estimator::DwellMean mean_of(const std::vector<rt::MeanMotion>& seconds, bool drifts) {
    estimator::DwellMean mean;
    mean.level_known = drifts;
    const double n = static_cast<double>(seconds.size());
    using estimator::kDegPerRad;
    for (std::size_t i = 0; i < 3; ++i) {
        double t = 0, tt = 0, a = 0, ta = 0, last = seconds.front().angle[i];
        const double first = last;
        for (const auto& second : seconds) {
            const double hours = drivers::to_seconds(second.from - seconds.front().from) / 3600;
            last += std::remainder(second.angle[i] - last, 2 * std::numbers::pi);
            t += hours;
            tt += hours * hours;
            a += last - first;
            ta += hours * (last - first);
            mean.force_g[i] += second.force[i] / n;
        }
        mean.encoder_rad[i] = first + a / n;
        if (drifts) mean.slope_deg_h[i] = kDegPerRad * (n * ta - t * a) / (n * tt - t * t);
    }
    return mean;
}

}  // namespace

OpeningCheck::OpeningCheck(const Settings& settings) : settings_(settings) {}

void OpeningCheck::begin() {
    at_ = 0;
    stops_.clear();
    under_way_ = true;
}

std::string OpeningCheck::words() const {
    return fmt::format("opening check, position {} of {}", at_ + 1, settings_.opening.size());
}

std::size_t OpeningCheck::wanted() const { return drifts() ? kDriftSeconds : kStillSeconds; }

double OpeningCheck::expected_s() const {
    double all = 0;
    for (const OpeningStop& stop : settings_.opening)
        all += kSlewGuess_s + drivers::to_seconds(kComesToRest) +
               static_cast<double>(stop.drifts ? kDriftSeconds : kStillSeconds);
    return all;
}

void OpeningCheck::arrived(drivers::Time now) {
    since_ = now + kComesToRest;
    stops_.push_back({here(), {}});
}

void OpeningCheck::add(const rt::MeanMotion& second) {
    auto& seconds = stops_.back().seconds;
    if (!second.good || second.from < since_ || measured()) return;
    if (!seconds.empty() && second.from <= seconds.back().from) return;
    seconds.push_back(second);
}

bool OpeningCheck::measured() const { return stops_.back().seconds.size() >= wanted(); }

bool OpeningCheck::overdue(drivers::Time now) const {
    return now - since_ > drivers::from_seconds(static_cast<double>(wanted())) + kSpare;
}

bool OpeningCheck::next() {
    under_way_ = ++at_ < settings_.opening.size();
    return under_way_;
}

OpeningCheck::Verdict OpeningCheck::judge(const Vector& zero_g) const {
    auto rig = settings_.rig;
    for (std::size_t i = 0; i < 3; ++i) rig.accelerometer_zero_g[i] += zero_g[i];
    room::OpeningLimits limits;
    // Slope of readings with this noise, and what the model leaves.
    const double n = static_cast<double>(kDriftSeconds) / settings_.sample_s;
    const double noise = rig.resolver_arcsec / 3600 * std::sqrt(12 / n) /
                         (static_cast<double>(kDriftSeconds) / 3600);
    // Of the angle's random walk, the slope by least squares over T: N sqrt(1.2 / T).
    const double walk = rig.gyro_random_walk_deg_per_rt_h *
                        std::sqrt(1.2 * 3600 / static_cast<double>(kDriftSeconds));
    limits.rate_sigma = std::hypot(noise, walk, 0.01);
    limits.refused_deg = std::max(limits.refused_deg, settings_.gravity_refused_deg);
    std::vector<estimator::DwellMean> means;
    for (const Stood& stood : stops_) means.push_back(mean_of(stood.seconds, stood.stop.drifts));
    const auto found = room::hold_at_rest(rig, means, limits);
    Verdict verdict{in_one(found.refused), in_one(found.warned), {}, {}};
    if (found.refused.empty()) {  // what would do away with what is warned of
        limits.refused_deg = limits.warn_deg;
        limits.refused_deg_h = limits.warn_deg_h;
        limits.refused_vertical_deg_h = limits.warn_vertical_deg_h;
    }
    if (!found.refused.empty() || !found.warned.empty()) {
        const auto suspects = room::suspects_at_rest(rig, means, limits);
        for (const auto& suspect : suspects) verdict.suspects.push_back(suspect.words);
        verdict.apart = room::told_apart_words(rig, suspects);
    }
    if (!found.earth_known)
        verdict.warned +=
            std::string(verdict.warned.empty() ? "" : "; ") +
            "the travel leaves fewer than three free drifts: nothing is said of north "
            "and latitude";
    return verdict;
}

std::string OpeningCheck::Verdict::suspects_text() const {
    if (suspects.empty()) return "no single key explains it";
    return "suspects: " + in_one(suspects) + (apart.empty() ? "" : "; " + apart);
}

}  // namespace vibrig::campaign
