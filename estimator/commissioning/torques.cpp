// Rates of the angles under a torque less those without are M R command: R has sign, scale and axis
// of each torquer.
#include "estimator/commissioning/torques.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <optional>
#include <stdexcept>
#include <utility>

#include "estimator/filter/angles.hpp"
#include "estimator/filter/text.hpp"

namespace vibrig::estimator::commissioning {

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
constexpr std::array<char, 3> kAxis{'x', 'y', 'z'};
constexpr std::array<char, 3> kCommand{'X', 'Y', 'Z'};

/// Rate of the platform over a command, one way of one axis.
struct Way {
    Vector3d rate = Vector3d::Zero();
    double command = 0;  ///< deg/h; 0: not there
};

struct Ways {
    std::array<std::array<Way, 2>, 3> of;  ///< of an axis, up and down
    std::optional<Vector3d> without;
};

Ways sorted(const Description& d, const EarthRate& rate, const std::vector<Torqued>& drifts) {
    Ways ways;
    for (const Torqued& one : drifts) {
        const Vector3d seen = platform_rate(d, one.drift, rate);
        const auto& command = one.command_deg_h;
        const auto axes = std::ranges::count_if(command, [](double c) { return c != 0; });
        if (!seen.allFinite() ||
            !std::ranges::all_of(command, [](double c) { return std::isfinite(c); }))
            throw std::invalid_argument("commissioning: a rate or a torque is not finite");
        if (axes > 1)
            throw std::invalid_argument("commissioning: got a torque about " +
                                        std::to_string(axes) + " axes, expected one at a time");
        if (axes == 0) ways.without = seen;
        for (std::size_t k = 0; k < 3; ++k)
            if (command[k] != 0) ways.of[k][command[k] > 0 ? 0 : 1] = {seen, command[k]};
    }
    for (std::size_t k = 0; k < 3; ++k)
        for (const Way& way : ways.of[k])
            if (way.command == 0 || !ways.without)
                throw std::invalid_argument(
                    "commissioning: expected each axis torqued both ways, and a drift without");
    return ways;
}

/// Why a torquer does not do what is commanded; empty: it does.
std::string doubt_of(std::size_t k, const Vector3d& up, const Vector3d& down, double command,
                     double sigma, const TorqueSettings& settings) {
    const double one = up.norm(), other = down.norm(), least = 5 * sigma;
    if (std::max(one, other) < std::max(least, settings.warn_scale))
        return text("torque command %c turns nothing: %.2f +- %.2f deg/h for %.0f commanded",
                    kCommand[k], std::max(one, other) * command, sigma * command, command);
    const auto within = [&settings](double scale) {
        return scale >= 1 / settings.factor && scale <= settings.factor;
    };
    if (!within(one) || !within(other))
        return text(
            "torque command %c: %.2f of the rate commanded one way, %.2f the other, %.2f to %.2f "
            "expected",
            kCommand[k], one, other, 1 / settings.factor, settings.factor);
    if (up.dot(down) < 0.5 * one * other)
        return text("torque command %c turns the platform the same way whatever its sign",
                    kCommand[k]);
    return {};
}

/// The axes that the commands turn, where they are three; else why not.
std::string name_axes(TorqueFinding& f) {
    for (int k = 0; k < 3; ++k) {
        int largest = 0;
        f.response.col(k).cwiseAbs().maxCoeff(&largest);
        const auto at = static_cast<std::size_t>(k);
        if (const auto* const other = std::find(f.axis.begin(), f.axis.begin() + k, largest);
            other != f.axis.begin() + k)
            return text("torque commands %c and %c both turn platform axis %c",
                        kCommand[static_cast<std::size_t>(other - f.axis.begin())], kCommand[at],
                        kAxis[static_cast<std::size_t>(largest)]);
        f.axis[at] = largest;
        f.sign[at] = f.response(largest, k) > 0 ? 1 : -1;
        f.scale[at] = f.response.col(k).norm();
    }
    return {};
}

/// The torquers' directions as a rotation of the platform's axes about z, and what is left of it.
std::string turn_axes(TorqueFinding& f, const TorqueSettings& settings) {
    Matrix3d axes;  // by platform axis, unit vectors
    for (std::size_t k = 0; k < 3; ++k)
        axes.col(f.axis[k]) = f.sign[k] / f.scale[k] * f.response.col(static_cast<int>(k));
    const double turn = std::atan2(axes(1, 0) - axes(0, 1), axes(0, 0) + axes(1, 1));
    if (std::abs(turn) * kDegPerRad > settings.turn_deg)
        return text(
            "the torquers' axes are turned by %.1f deg about z against the accelerometers, "
            "%g at most",
            turn * kDegPerRad, settings.turn_deg);
    const Matrix3d about_z = Eigen::AngleAxisd(turn, Vector3d::UnitZ()).toRotationMatrix();
    const Matrix3d left = about_z.transpose() * axes;
    for (std::size_t k = 0; k < 3; ++k) {
        const int a = f.axis[k];
        const double off = std::acos(std::clamp(left(a, a), -1.0, 1.0)) * kDegPerRad;
        if (off > settings.skew_deg)
            return text("torque command %c turns the platform %.1f deg off its axis %c, %g at most",
                        kCommand[k], off, kAxis[static_cast<std::size_t>(a)], settings.skew_deg);
    }
    f.turn_arcmin = turn * kDegPerRad * 60;
    f.response = about_z.transpose() * f.response;
    f.description.accelerometers *= about_z;
    f.description.zero_deg[2] = std::remainder(
        f.description.zero_deg[2] + f.description.sign[2] * turn * kDegPerRad, 360.0);
    return {};
}

}  // namespace

TorqueFinding find_by_torque(const Description& description, const EarthRate& rate,
                             const std::vector<Torqued>& drifts, const TorqueSettings& settings) {
    const Ways ways = sorted(description, rate, drifts);
    TorqueFinding f;
    f.description = description;
    f.verdict = Verdict::refused;
    for (std::size_t k = 0; k < 3; ++k) {
        const auto& [above, below] = ways.of[k];
        const double span = above.command - below.command;
        // Half of it is what one way alone has against none.
        const double sigma = std::sqrt(2.0) * settings.rate_sigma / (span / 2);
        f.sigma = std::max(f.sigma, sigma / 2);
        f.response.col(static_cast<int>(k)) = (above.rate - below.rate) / span;
        f.why = doubt_of(k, (above.rate - *ways.without) / above.command,
                         (below.rate - *ways.without) / below.command, span / 2, sigma, settings);
        if (!f.why.empty()) return f;
    }
    f.why = name_axes(f);
    if (f.why.empty()) f.why = turn_axes(f, settings);
    if (!f.why.empty()) return f;
    f.verdict = Verdict::decided;
    for (std::size_t k = 0; k < 3; ++k)
        if (std::abs(f.scale[k] - 1) > settings.warn_scale)
            f.warnings.push_back(
                text("torque command %c: the platform turns by %.3f of what is "
                     "commanded",
                     kCommand[k], f.scale[k]));
    if (std::abs(f.turn_arcmin) > settings.warn_turn_arcmin)
        f.warnings.push_back(
            text("gyros against accelerometers: %.0f' about z; the azimuth zero is "
                 "the torquers'",
                 f.turn_arcmin));
    return f;
}

TorqueFinding named_by_torquers(const Description& description, const EarthRate& rate,
                                const std::vector<Torqued>& drifts,
                                const TorqueSettings& settings) {
    TorqueFinding best = find_by_torque(description, rate, drifts, settings);
    if (best.verdict != Verdict::decided) return best;
    // Which end of an axis is positive is a convention: that of the accelerometers' names, then
    // that of as many torquers as may be. Noise decides nothing.
    const auto family = family_of(description);
    const auto kept = [](const TorqueFinding& f) {
        return std::pair(std::lround(f.description.wiring().trace()),
                         f.sign[0] + f.sign[1] + f.sign[2]);
    };
    bool any = false;
    for (std::size_t i = 0; i < family.size() / 2; ++i) {
        if (family[i].sign[0] != description.sign[0]) continue;
        auto one = find_by_torque(family[i], rate, drifts, settings);
        if (one.verdict != Verdict::decided || !one.named()) continue;
        if (any && kept(one) <= kept(best)) continue;
        any = true;
        best = std::move(one);
    }
    return best;
}

}  // namespace vibrig::estimator::commissioning
