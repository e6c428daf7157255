#include "estimator/spectrum/profile.hpp"

#include <algorithm>
#include <cmath>
#include <functional>

#include "estimator/filter/linear_algebra.hpp"
#include "estimator/filter/mapped.hpp"
#include "estimator/filter/settings.hpp"
#include "estimator/spectrum/profile_moments.hpp"

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

/// Of a spectrum with either sign, between two of its points.
double signed_density(const Breakpoint& from, const Breakpoint& to, double hz) {
    const double both = from.second * to.second;
    if (!(both > 0))
        return from.second +
               (to.second - from.second) * (hz - from.first) / (to.first - from.first);
    return std::copysign(
        density_at({from.first, std::abs(from.second)}, {to.first, std::abs(to.second)}, hz),
        from.second);
}

/// From one frequency to another, between which there is no point of it.
double signed_power(const Breakpoints& of, double low, double high) {
    for (std::size_t i = 1; i < of.size(); ++i) {
        if (low < of[i - 1].first || high > of[i].first) continue;
        const Breakpoint a{low, signed_density(of[i - 1], of[i], low)},
            b{high, signed_density(of[i - 1], of[i], high)};
        if (!(a.second * b.second > 0)) return (a.second + b.second) / 2 * (high - low);
        return std::copysign(power_between({low, std::abs(a.second)}, {high, std::abs(b.second)}),
                             a.second);
    }
    return 0;
}

/// A part of a random vibration along more than one line.
struct AxesBand {
    double hz = 0, width_hz = 0;
    Eigen::Matrix3d moment;
};

std::vector<AxesBand> bands_of(const AxesPsd& of, int per_decade) {
    std::vector<double> edges;
    for (const auto& list : {std::cref(of.psd), std::cref(of.cross)}) {
        for (const Breakpoints& points : list.get())
            for (const auto& point : points) edges.push_back(point.first);
    }
    std::ranges::sort(edges);
    edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
    std::vector<AxesBand> out;
    for (std::size_t i = 1; i < edges.size(); ++i) {
        const double from = edges[i - 1], ratio = edges[i] / from;
        const int count = std::max(1, static_cast<int>(std::ceil(std::log10(ratio) * per_decade)));
        double low = from;
        for (int b = 1; b <= count; ++b) {
            const double high =
                b < count ? from * std::pow(ratio, static_cast<double>(b) / count) : edges[i];
            AxesBand band{std::sqrt(low * high), high - low, Eigen::Matrix3d::Zero()};
            for (Eigen::Index k = 0; k < 3; ++k)
                band.moment(k, k) = signed_power(of.psd[static_cast<std::size_t>(k)], low, high);
            constexpr std::array<std::pair<int, int>, 3> kPairs{{{0, 1}, {0, 2}, {1, 2}}};
            for (std::size_t k = 0; k < 3; ++k) {
                const auto [a, c] = kPairs[k];
                band.moment(a, c) = band.moment(c, a) = signed_power(of.cross[k], low, high);
            }
            if (band.moment.any()) out.push_back(band);
            low = high;
        }
    }
    return out;
}

/// No vibration has a spectral matrix with a negative power in some direction.
void check_axes(const AxesPsd& of, const std::string& path) {
    for (const AxesBand& band : bands_of(of, 200)) {
        const double least = linear_algebra::symmetric_eigenvalues(band.moment)[0];
        if (!(least >= -1e-9 * std::abs(band.moment.trace())))
            throw SettingsError(path + "cross: found " + text_of(band.hz) +
                                " Hz with more in common between axes than they have, expected "
                                "cross-spectra of at most the root of both densities, and together "
                                "those of a vibration");
    }
}

enum class Points { density, cross, sine };

void check_points(const Breakpoints& points, const std::string& place, Points what) {
    for (std::size_t i = 0; i < points.size(); ++i) {
        const auto& [hz, value] = points[i];
        const std::string at = place + "[" + std::to_string(i) + "]: ";
        if (!(hz > 0) || !std::isfinite(hz))
            throw SettingsError(at + "found " + text_of(hz) + " Hz, expected a frequency above 0");
        if ((what != Points::cross && !(value > 0)) || !std::isfinite(value))
            throw SettingsError(at + "found " + text_of(value) +
                                (what == Points::sine      ? " g, expected a peak above 0"
                                 : what == Points::density ? " g^2/Hz, expected a density above 0"
                                                           : " g^2/Hz, expected a number"));
        if (what != Points::sine && i > 0 && !(hz > points[i - 1].first))
            throw SettingsError(at + "found " + text_of(hz) + " Hz after " +
                                text_of(points[i - 1].first) + " Hz, expected growing frequencies");
    }
}

}  // namespace

void refuse_one_frequency_twice(const Breakpoints& sines, const std::string& place) {
    // Closer ones beat with a period longer than a dwell.
    constexpr double kSame_hz = 0.01;
    std::vector<std::pair<double, std::size_t>> sorted;
    for (std::size_t i = 0; i < sines.size(); ++i) sorted.emplace_back(sines[i].first, i);
    std::ranges::sort(sorted);
    for (std::size_t k = 1; k < sorted.size(); ++k) {
        const auto [low, high] = std::minmax(sorted[k - 1].second, sorted[k].second);
        if (sorted[k].first - sorted[k - 1].first >= kSame_hz) continue;
        throw SettingsError(
            place + "[" + std::to_string(high) + "]: found " + text_of(sines[high].first) +
            " Hz as in [" + std::to_string(low) + "], expected one sine of that frequency with " +
            "the peak of their sum, " + text_of(sines[low].second + sines[high].second) +
            " g where they are in phase or their phase is not known");
    }
}

bool AxesPsd::stated() const noexcept {
    return std::ranges::any_of(psd, [](const auto& points) { return !points.empty(); }) ||
           std::ranges::any_of(cross, [](const auto& points) { return !points.empty(); });
}

std::optional<std::array<double, 3>> direction_along(const std::array<double, 3>& axes) noexcept {
    if (!(mapped(axes).norm() > 0)) return {};
    std::array<double, 3> out{};
    mapped(out) = mapped(axes).normalized();
    return out;
}

void check(const Profile& profile, const std::string& path) {
    if (profile.psd.empty() && profile.sines.empty() && !profile.axes.stated())
        throw SettingsError(path +
                            "psd: found neither breakpoints nor sines, expected one of them");
    const auto spectrum = [&](const Breakpoints& points, const std::string& key, Points what) {
        if (points.size() == 1)
            throw SettingsError(path + key + ": found 1 breakpoint, expected two or more");
        check_points(points, path + key, what);
    };
    if (!profile.psd.empty() && profile.axes.stated())
        throw SettingsError(path + "psd: found it along one line and along axes, expected either");
    spectrum(profile.psd, "psd", Points::density);
    check_points(profile.sines, path + "sines", Points::sine);
    refuse_one_frequency_twice(profile.sines, path + "sines");
    for (std::size_t k = 0; k < 3; ++k) {
        spectrum(profile.axes.psd[k], std::string("psd.") + kAxes[k], Points::density);
        spectrum(profile.axes.cross[k], std::string("cross.") + kAxisPairs[k], Points::cross);
    }
    constexpr double kMostRms = 1e4;  // g; nothing that is tested survives it
    if (!(mean_square(profile) <= kMostRms * kMostRms))
        throw SettingsError(path + "found more than 10000 g rms, expected a vibration");
    check_axes(profile.axes, path);
    const double length = mapped(profile.direction).norm();
    if (!(std::abs(length - 1) < 1e-6))
        throw SettingsError(path + "direction: found a length of " + text_of(length) +
                            ", expected a direction (north, up, east)");
    const double rms = std::sqrt(mean_square(profile));
    if (profile.g_rms != 0 && !(std::abs(profile.g_rms / rms - 1) <= 0.01))
        throw SettingsError(path + "g_rms: found " + text_of(profile.g_rms) +
                            ", expected that of the table within 1 %: " + text_of(rms));
}

double mean_square(const Profile& profile) {
    double sum = 0;
    for (const Breakpoints& points : profile.axes.psd)
        for (std::size_t i = 1; i < points.size(); ++i)
            sum += power_between(points[i - 1], points[i]);
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
    for (const AxesBand& band : bands_of(profile.axes, per_decade))
        bands.push_back({band.hz, band.moment.trace() / all, band.width_hz});
    for (const auto& [hz, peak] : profile.sines) bands.push_back({hz, peak * peak / 2 / all, 0});
    return bands;
}

std::vector<Eigen::Matrix3d> moments_of(const Profile& profile, int per_decade) {
    const auto direction = mapped(profile.direction);
    const Eigen::Matrix3d along = direction * direction.transpose();
    const double all = mean_square(profile);
    std::vector<Eigen::Matrix3d> out;
    for (const Band& band : bands_of(profile, per_decade))
        out.emplace_back(band.share * all * along);
    std::size_t k = 0;
    for (const AxesBand& band : bands_of(profile.axes, per_decade)) out[k++] = band.moment;
    return out;
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
