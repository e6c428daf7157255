#include "daemon/tool/analysis/stated_lines.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <cstddef>
#include <numbers>

#include "estimator/identification/crlb.hpp"
#include "proto/printed.hpp"

namespace vibrig::tool {

namespace {

using estimator::spectrum::Band;
using Rows = std::vector<const proto::RecordingRow*>;

constexpr double kOff = 0.002;      // of a stated frequency: what one vibration may be off by
constexpr double kApart = 3;        // in 1 / duration: what tells two lines from one another
constexpr double kOfAll = 0.02;     // of all that shakes: noise, and what leaks from strong lines
constexpr double kFewestRows = 64;  // of which a power spectrum says something

struct Samples {
    std::vector<double> time_s;
    std::vector<std::array<double, 3>> force_g;  ///< about their mean
    double power = 0;                            ///< mean square, g^2
    double resolution_hz = 0;
    double rate_hz = 0;
};

Samples samples_of(const Rows& rows) {
    Samples s;
    std::array<double, 3> mean{};
    const auto n = static_cast<double>(rows.size());
    for (const auto* row : rows)
        for (std::size_t k = 0; k < 3; ++k) mean[k] += row->force_g[k] / n;
    for (const auto* row : rows) {
        s.time_s.push_back(row->time_s - rows.front()->time_s);
        s.force_g.push_back(row->force_g);
        for (std::size_t k = 0; k < 3; ++k) {
            s.force_g.back()[k] -= mean[k];
            s.power += s.force_g.back()[k] * s.force_g.back()[k] / n;
        }
    }
    s.resolution_hz = 1 / s.time_s.back();
    auto times_s = s.time_s;
    s.rate_hz = 1 / estimator::median_interval(times_s);
    return s;
}

/// Mean square of a sine at this frequency along whatever line.
double power_at(const Samples& s, double hz) {
    std::array<std::complex<double>, 3> sum{};
    for (std::size_t i = 0; i < s.time_s.size(); ++i) {
        const auto turn = std::polar(1.0, -2 * std::numbers::pi * hz * s.time_s[i]);
        for (std::size_t k = 0; k < 3; ++k) sum[k] += s.force_g[i][k] * turn;
    }
    const auto n = static_cast<double>(s.time_s.size());
    return 2 * (std::norm(sum[0]) + std::norm(sum[1]) + std::norm(sum[2])) / (n * n);
}

/// To both sides of it.
double width_hz(const Samples& s, double hz) { return std::max(kOff * hz, s.resolution_hz); }

double power_near(const Samples& s, double hz) {
    const double width = width_hz(s, hz);
    double most = 0;
    for (double at = hz - width; at <= hz + width; at += 0.5 * s.resolution_hz)
        most = std::max(most, power_at(s, at));
    return most;
}

/// Of those whose aliases are apart.
bool told_apart(const Samples& s, const std::vector<Band>& lines, std::size_t k) {
    const auto alias = [&](std::size_t i) {
        return std::abs(std::remainder(lines[i].hz, s.rate_hz));
    };
    const double apart = width_hz(s, lines[k].hz) + kApart * s.resolution_hz;
    if (alias(k) < apart || s.rate_hz / 2 - alias(k) < apart) return false;
    for (std::size_t i = 0; i < lines.size(); ++i) {
        if (i != k && std::abs(alias(i) - alias(k)) < apart + width_hz(s, lines[i].hz))
            return false;
    }
    return true;
}

}  // namespace

std::string against_lines(const Rows& rows, const std::vector<Band>& lines,
                          const estimator::AccelerometerResponse& seen_by) {
    if (static_cast<double>(rows.size()) < kFewestRows) return "";
    const Samples s = samples_of(rows);
    double stated = 0;
    for (const Band& line : lines) stated += line.share * seen_by.power(line.hz);
    if (!(s.power > 0) || !std::isfinite(s.resolution_hz) || !std::isfinite(s.rate_hz) ||
        !(stated > 0))
        return "";
    std::string worst;
    double furthest = 0;
    for (std::size_t k = 0; k < lines.size(); ++k) {
        if (!told_apart(s, lines, k)) continue;
        const double expected = lines[k].share * seen_by.power(lines[k].hz) / stated;
        const double found = power_near(s, lines[k].hz) / s.power;
        const double beyond =
            std::max(0.5 * expected - kOfAll - found, found - 2 * expected - kOfAll);
        if (!(beyond > furthest)) continue;
        furthest = beyond;
        worst = proto::printed("%g Hz with %.3g of all that shakes, expected %.3g as stated",
                               lines[k].hz, found, expected);
    }
    return worst;
}

}  // namespace vibrig::tool
