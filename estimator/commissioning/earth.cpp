// Free drift at several attitudes: rates of the angles = M (D_F + G u - C w), and what people say
// of the sense in which it all turns.
#include "estimator/commissioning/earth.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "estimator/filter/angles.hpp"
#include "estimator/filter/kinematics.hpp"
#include "estimator/filter/linear_algebra.hpp"
#include "estimator/filter/text.hpp"

namespace vibrig::estimator::commissioning {

namespace {

// ln odds: the most that a measured quantity against a statement may weigh (100 : 1), what a look
// at a drawing or a hand's sense weighs (40 : 1), and what is asked of all together.
constexpr double kMostOdds = 4.6, kSeenOdds = 3.7, kAsked = 6;
constexpr double kCompassSigma_deg = 15, kCompassBlind_deg = 20;
// An azimuth axis nearer to the horizontal has no upper end to look from.
constexpr double kUpright = 0.3;
constexpr int kUnknown = 15;  // north, east, up; D_F; G by rows

using Normal = Eigen::Matrix<double, kUnknown, kUnknown>;
using Unknown = Eigen::Matrix<double, kUnknown, 1>;

/// Level axes north, east, up in those of a rig whose outer axis points up by the elevation.
Eigen::Matrix3d rig_from_level(double elevation_deg) {
    const double c = std::cos(elevation_deg / kDegPerRad), s = std::sin(elevation_deg / kDegPerRad);
    Eigen::Matrix3d r;
    r << c, 0, s, -s, 0, c, 0, 1, 0;
    return r;
}

Eigen::Matrix<double, 3, kUnknown> rows_at(const Description& d, const Vec3& reading,
                                           const Kinematics& kinematics) {
    const auto pose = kinematics.pose(d.angles(reading));
    const Eigen::Vector3d u = d.up(reading);
    Eigen::Matrix<double, 3, kUnknown> h;
    h.leftCols<3>() = -pose.m * pose.c * rig_from_level(d.elevation_deg);
    h.middleCols<3>(3) = pose.m;
    for (int gyro = 0; gyro < 3; ++gyro)
        for (int k = 0; k < 3; ++k) h.col(6 + 3 * gyro + k) = pose.m.col(gyro) * u[k];
    return h;
}

Eigen::Vector3d rates_of(const Description& d, const Vec3& slope) {
    Eigen::Vector3d rate;
    for (std::size_t k = 0; k < 3; ++k)
        rate[static_cast<int>(k)] = d.sign[k] *
                                    angle_units()[static_cast<std::size_t>(d.unit[k])].degrees *
                                    slope[static_cast<std::size_t>(d.channel[k])];
    return rate;
}

double limited(double ln_odds, double most) { return std::clamp(ln_odds, -most, most); }

/// Between lines, not arrows: at most 90.
double apart_deg(double a, double b) { return std::abs(std::remainder(a - b, 180.0)); }

std::vector<Witness> hear(const Description& d, const std::optional<EarthRate>& rate,
                          const Statements& said) {
    std::vector<Witness> witnesses;
    if (rate && said.latitude_deg) {
        const double stated = kEarthRateDegPerHour * std::sin(*said.latitude_deg / kDegPerRad);
        const double sigma = rate->sigma[2];
        witnesses.push_back(
            {"latitude", limited(2 * rate->neu[2] * stated / (sigma * sigma), kMostOdds)});
    }
    if (rate && said.compass_deg) {
        const double azimuth = rate->azimuth_deg();
        const double line = apart_deg(azimuth, 0);  // 0: north-south, 90: east-west
        const double as_is = apart_deg(azimuth, *said.compass_deg) / kCompassSigma_deg;
        const double mirrored = apart_deg(-azimuth, *said.compass_deg) / kCompassSigma_deg;
        const bool blind = line < kCompassBlind_deg || line > 90 - kCompassBlind_deg;
        witnesses.push_back(
            {"compass",
             blind ? 0 : limited(0.5 * (mirrored * mirrored - as_is * as_is), kMostOdds)});
    }
    if (said.right_handed) {
        const bool right = d.accelerometers.determinant() > 0;
        witnesses.push_back({"drawing", right == *said.right_handed ? kSeenOdds : -kSeenOdds});
    }
    if (said.sense) {
        // d azimuth / dt = -w_z: anticlockwise about an upward z counts down.
        const double upright = d.up(said.sense->reading)[2];
        const bool grows = -d.sign[2] * upright > 0;
        const double odds = std::abs(upright) < kUpright ? 0 : kSeenOdds;
        witnesses.push_back({"sense", grows == said.sense->grew ? odds : -odds});
    }
    return witnesses;
}

Description other_parity(const Description& d) {
    const auto family = family_of(d);
    return family[family.size() / 2];
}

std::string of_all(const std::vector<Witness>& witnesses) {
    std::string all;
    for (const Witness& witness : witnesses)
        all += text("%s%s %+.1f", all.empty() ? "" : ", ", witness.name.c_str(), witness.ln_odds);
    return all.empty() ? "nobody says anything" : all;
}

/// A latitude and a clock that the horizontal rate does not allow; empty: it does.
std::string contradiction(const EarthRate& rate, const Statements& said) {
    if (!said.latitude_deg) return {};
    const double horizontal = rate.neu.head<2>().norm();
    if (auto doubt = time_unit_doubt(horizontal, *said.latitude_deg);
        !doubt.empty() && (horizontal > 1.1 * kEarthRateDegPerHour || horizontal < 0.1))
        return "clock or latitude: " + doubt;
    const double off = std::abs(rate.latitude_deg() - std::abs(*said.latitude_deg));
    const double allowed = 1 + 3 * rate.latitude_sigma_deg();
    if (off <= allowed) return {};
    return text(
        "site.latitude_deg: %.2f stated, %.2f measured (either hemisphere), %.2f apart "
        "at most",
        *said.latitude_deg, rate.latitude_deg(), allowed);
}

}  // namespace

double EarthRate::azimuth_deg() const { return std::atan2(-neu[1], neu[0]) * kDegPerRad; }

double EarthRate::latitude_deg() const {
    return std::acos(std::min(1.0, neu.head<2>().norm() / kEarthRateDegPerHour)) * kDegPerRad;
}

double EarthRate::latitude_sigma_deg() const {
    const double horizontal = neu.head<2>().norm(), sd = std::max(sigma[0], sigma[1]);
    // Where the cosine is flat the error is that of the second order.
    const double sine =
        std::sqrt(std::max(0.0, 1 - std::pow(horizontal / kEarthRateDegPerHour, 2)));
    return kDegPerRad * sd / kEarthRateDegPerHour /
           std::max(sine, std::sqrt(2 * sd / kEarthRateDegPerHour));
}

EarthRate earth_rate(const Description& description, const std::vector<FreeDrift>& drifts,
                     const EarthSettings& settings) {
    if (drifts.size() < 3)
        throw std::invalid_argument("commissioning: got " + std::to_string(drifts.size()) +
                                    " free drifts, expected 3 at least");
    const Kinematics kinematics{Settings{}};
    Normal normal = Normal::Zero();
    Unknown right = Unknown::Zero();
    const double weight = 1 / (settings.rate_sigma * settings.rate_sigma);
    for (const FreeDrift& drift : drifts) {
        const auto h = rows_at(description, drift.reading, kinematics);
        const Eigen::Vector3d rate = rates_of(description, drift.slope);
        if (!h.allFinite() || !rate.allFinite())
            throw std::invalid_argument("commissioning: a reading or a slope is not finite");
        normal += weight * h.transpose() * h;
        right += weight * h.transpose() * rate;
    }
    normal.topLeftCorner<3, 3>().diagonal().array() += 1e-12;
    for (int i = 3; i < kUnknown; ++i) {
        const double sigma = i < 6 ? settings.bias_sigma : settings.linear_sigma;
        normal(i, i) += 1 / (sigma * sigma);
    }
    const linear_algebra::PivotedCholesky solver(normal);
    const Unknown x = solver.solve(right);
    const Normal covariance = solver.solve(Normal::Identity());
    return {x.head<3>(), covariance.diagonal().head<3>().cwiseSqrt()};
}

Eigen::Vector3d platform_rate(const Description& d, const FreeDrift& drift, const EarthRate& rate) {
    const auto pose = Kinematics{Settings{}}.pose(d.angles(drift.reading));
    return pose.m.inverse() * rates_of(d, drift.slope) +
           pose.c * rig_from_level(d.elevation_deg) * rate.neu;
}

std::string time_unit_doubt(double horizontal, double latitude_deg) {
    const double expected = kEarthRateDegPerHour * std::cos(latitude_deg / kDegPerRad);
    const double ratio = horizontal / expected;
    if (ratio >= 0.9 && ratio <= 1.1) return {};
    constexpr std::array<std::pair<double, const char*>, 6> kFactors{
        {{60, "time in minutes?"},
         {3600, "time in hours?"},
         {1000, "time in ms taken for us?"},
         {1 / 60.0, "time 60 times too fine?"},
         {1 / 3600.0, "time 3600 times too fine?"},
         {1e-3, "time in ms?"}}};
    for (const auto& [factor, question] : kFactors)
        if (std::abs(ratio / factor - 1) < 0.1)
            return text("the horizontal Earth rate is %.4g times too large: %s", ratio, question);
    return text("the horizontal Earth rate is %.4g deg/h, %.4g expected at this latitude",
                horizontal, expected);
}

EarthFinding find_by_earth(const Description& description, const std::vector<FreeDrift>& drifts,
                           const Statements& statements, const EarthSettings& settings) {
    EarthFinding finding;
    finding.description = description;
    std::optional<EarthRate> rate;
    if (!drifts.empty()) rate = finding.rate = earth_rate(description, drifts, settings);
    finding.witnesses = hear(description, rate, statements);
    double sum = 0;
    for (const Witness& witness : finding.witnesses) sum += witness.ln_odds;
    if (std::abs(sum) < kAsked) {
        finding.why = text("accelerometers inverted or not: %s; a sum of %g is asked, %.1f found",
                           of_all(finding.witnesses).c_str(), kAsked, std::abs(sum));
        return finding;
    }
    for (const Witness& witness : finding.witnesses)
        if (witness.ln_odds * sum < 0)
            finding.outvoted.push_back(witness.name + " contradicts the others");
    if (sum < 0) {
        // Of the other parity another member bears the names that the bus has.
        finding.description = preferred_of(other_parity(description));
        if (rate) finding.rate = earth_rate(finding.description, drifts, settings);
    }
    if (rate) finding.why = contradiction(finding.rate, statements);
    finding.verdict = finding.why.empty() ? Verdict::decided : Verdict::undecided;
    return finding;
}

}  // namespace vibrig::estimator::commissioning
