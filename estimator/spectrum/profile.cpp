#include "estimator/spectrum/profile.hpp"

#include <algorithm>
#include <cmath>

#include "estimator/identification/identification.hpp"

namespace vibrig::estimator::spectrum {
namespace {

using Breakpoint = std::pair<double, double>;

std::string text_of(double value) {
    std::string text = std::to_string(value);
    while (text.back() == '0') text.pop_back();
    if (text.back() == '.') text.pop_back();
    return text;
}

double density_at(const Breakpoint& from, const Breakpoint& to, double hz) {
    const double slope = std::log(to.second / from.second) / std::log(to.first / from.first);
    return from.second * std::pow(hz / from.first, slope);
}

/// Of a straight line on logarithmic scales, exactly.
double power_between(const Breakpoint& from, const Breakpoint& to) {
    const double slope = std::log(to.second / from.second) / std::log(to.first / from.first);
    // From a slope of -1 on the integral of f^slope changes its form; expm1 joins both.
    const double log_ratio = std::log(to.first / from.first), exponent = (slope + 1) * log_ratio;
    const double shape =
        std::abs(exponent) < 1e-12 ? 1 + exponent / 2 : std::expm1(exponent) / exponent;
    return from.second * from.first * log_ratio * shape;
}

void check_points(const std::vector<Breakpoint>& points, const std::string& place, bool sines) {
    for (std::size_t i = 0; i < points.size(); ++i) {
        const auto& [hz, value] = points[i];
        const std::string at = place + "[" + std::to_string(i) + "]: ";
        if (!(hz > 0) || !std::isfinite(hz))
            throw SettingsError(at + "found " + text_of(hz) + " Hz, expected a frequency above 0");
        if (!(value > 0) || !std::isfinite(value))
            throw SettingsError(
                at + "found " + text_of(value) +
                (sines ? " g, expected a peak above 0" : " g^2/Hz, expected a density above 0"));
        if (!sines && i > 0 && !(hz > points[i - 1].first))
            throw SettingsError(at + "found " + text_of(hz) + " Hz after " +
                                text_of(points[i - 1].first) + " Hz, expected growing frequencies");
    }
}

}  // namespace

void check(const Profile& profile, const std::string& path) {
    if (profile.psd.empty() && profile.sines.empty())
        throw SettingsError(path +
                            "psd: found neither breakpoints nor sines, expected one of them");
    if (profile.psd.size() == 1)
        throw SettingsError(path + "psd: found 1 breakpoint, expected two or more");
    check_points(profile.psd, path + "psd", false);
    check_points(profile.sines, path + "sines", true);
    if (!(std::abs(profile.direction.norm() - 1) < 1e-6))
        throw SettingsError(path + "direction: found a length of " +
                            text_of(profile.direction.norm()) +
                            ", expected a direction (north, up, east)");
    const double rms = std::sqrt(mean_square(profile));
    if (profile.g_rms != 0 && !(std::abs(profile.g_rms / rms - 1) <= 0.01))
        throw SettingsError(path + "g_rms: found " + text_of(profile.g_rms) +
                            ", expected that of the table within 1 %: " + text_of(rms));
}

double mean_square(const Profile& profile) {
    double sum = 0;
    for (std::size_t i = 1; i < profile.psd.size(); ++i)
        sum += power_between(profile.psd[i - 1], profile.psd[i]);
    for (const auto& [hz, peak] : profile.sines) sum += peak * peak / 2;
    return sum;
}

std::vector<Band> bands_of(const Profile& profile, int per_decade) {
    const double all = mean_square(profile);
    std::vector<Band> bands;
    for (std::size_t i = 1; i < profile.psd.size(); ++i) {
        const Breakpoint &from = profile.psd[i - 1], &to = profile.psd[i];
        const double decades = std::log10(to.first / from.first);
        const int count = std::max(1, static_cast<int>(std::ceil(decades * per_decade)));
        Breakpoint low = from;
        for (int b = 1; b <= count; ++b) {
            Breakpoint high = to;
            if (b < count) {
                high.first =
                    from.first * std::pow(to.first / from.first, static_cast<double>(b) / count);
                high.second = density_at(from, to, high.first);
            }
            bands.push_back({std::sqrt(low.first * high.first), power_between(low, high) / all,
                             high.first - low.first});
            low = high;
        }
    }
    for (const auto& [hz, peak] : profile.sines) bands.push_back({hz, peak * peak / 2 / all, 0});
    return bands;
}

double bandwidth_hz(std::span<const Band> bands) noexcept {
    double square = 0;
    for (const Band& band : bands)
        if (band.width_hz > 0) square += band.share * band.share / band.width_hz;
    return square > 0 ? 1 / square : 0;
}

double pads_power(double hz, const Resonance& pads) noexcept {
    const double r = hz / pads.hz, damped = 2 * pads.damping * r;
    return (1 + damped * damped) / ((1 - r * r) * (1 - r * r) + damped * damped);
}

Resonance pads_with(double hz, double ratio, double damping) noexcept {
    // Power falls with r from r = sqrt 2 on, where it is 1.
    double low = hz / 100, high = hz / std::sqrt(2.0);
    for (int i = 0; i < 80; ++i) {
        const double middle = std::sqrt(low * high);
        (pads_power(hz, {middle, damping}) > ratio * ratio ? high : low) = middle;
    }
    return {std::sqrt(low * high), damping};
}

std::pair<std::vector<Band>, double> behind(std::span<const Band> bands, double mean_square,
                                            const Resonance& pads) {
    std::vector<Band> out(bands.begin(), bands.end());
    double kept = 0;
    for (Band& band : out) kept += band.share *= pads_power(band.hz, pads);
    for (Band& band : out) band.share /= kept;
    return {out, mean_square * kept};
}

std::span<const Profile> built_in_profiles() {
    static const std::vector<Profile> kAll{
        {"minimum-integrity", {{20, 0.04}, {1000, 0.04}, {2000, 0.01}}, {}, {0, 1, 0}, 0},
        {"truck", {{10, 0.015}, {40, 0.015}, {500, 0.00015}}, {}, {0, 1, 0}, 0}};
    return kAll;
}

}  // namespace vibrig::estimator::spectrum
