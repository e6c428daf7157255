#include "estimator/spectrum/controller_psd.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "estimator/filter/text.hpp"

namespace vibrig::estimator::spectrum {

namespace {

using Pairs = std::span<const std::array<double, 2>>;

constexpr double kSigmas = 4;    ///< docs/theory/spectrum.md
constexpr double kBands_db = 3;  ///< beyond it the interlock stops a random vibration
constexpr double kLeastAlike = 0.5;
constexpr double kNothing = 1e-9;  ///< of the largest density

std::string at(std::size_t i) { return "psd_block[" + std::to_string(i) + "]: "; }

/// Without what is not used behind its last line.
Pairs without_rest(Pairs pairs) {
    while (!pairs.empty() && pairs.back()[0] == 0 && pairs.back()[1] == 0)
        pairs = pairs.first(pairs.size() - 1);
    return pairs;
}

std::string malformed(Pairs pairs) {
    if (pairs.size() < 2)
        return "psd_block: found " + std::to_string(pairs.size()) +
               " lines before the zeros at its end, expected 2 at least";
    for (std::size_t i = 0; i < pairs.size(); ++i) {
        const auto [hz, density] = pairs[i];
        if (!std::isfinite(hz) || !(hz > 0))
            return at(i) + text("found %g Hz, expected a frequency above 0", hz);
        if (i > 0 && !(hz > pairs[i - 1][0]))
            return at(i) + text("found %g Hz after %g Hz, expected rising frequencies", hz,
                                pairs[i - 1][0]);
        if (!std::isfinite(density) || density < 0)
            return at(i) + text("found %g g^2/Hz at %g Hz, expected 0 or above", density, hz);
    }
    if (std::ranges::all_of(pairs, [](const auto& pair) { return pair[1] == 0; }))
        return "psd_block: found no power at any of " + std::to_string(pairs.size()) +
               " frequencies, expected that of a vibration";
    return {};
}

double power_within(std::span<const Band> bands, double from_hz, double to_hz) {
    double share = 0;
    for (const Band& band : bands)
        if (band.hz >= from_hz && band.hz <= to_hz) share += band.share;
    return share;
}

/// How much of two spectra lies at the same frequencies, 0 to 1.
double alike(std::span<const Band> a, std::span<const Band> b) {
    constexpr double kThirds = 3;  // of an octave each
    constexpr int kCells = 60;     // from 1 Hz
    std::array<double, kCells> first{}, second{};
    const auto cell = [](double hz) {
        return static_cast<std::size_t>(
            std::clamp(static_cast<int>(kThirds * std::log2(hz)), 0, kCells - 1));
    };
    for (const Band& band : a) first[cell(band.hz)] += band.share;
    for (const Band& band : b) second[cell(band.hz)] += band.share;
    double both = 0;
    for (std::size_t i = 0; i < first.size(); ++i) both += std::min(first[i], second[i]);
    return both;
}

/// Of a sound one: whether it is of this dwell, and of this vibration.
std::string contradicted(const Profile& psd, const PsdExpected& expected) {
    const std::vector<Band> nominal = bands_of(expected.nominal), bands = bands_of(psd);
    const double power = mean_square(psd), stated = mean_square(expected.nominal);
    const double from = psd.psd.front().first, to = psd.psd.back().first;
    if (1 - power_within(nominal, from, to) > kSigmas * expected.gain_error)
        return text("psd_block: found lines from %g to %g Hz, ", from, to) +
               text(
                   "expected those of the profile, which has %.3g of its power beyond (%.3g at "
                   "most)",
                   1 - power_within(nominal, from, to), kSigmas * expected.gain_error);
    const double rms = std::sqrt(power), asked = std::sqrt(stated);
    if (!(std::abs(20 * std::log10(rms / asked)) < kBands_db))
        return text("psd_block: found %.4g g rms, expected the profile's %.4g g within 3 dB", rms,
                    asked);
    if (expected.measured_g_rms > 0 && expected.seconds > 0) {
        const double one =
            std::hypot(1 / std::sqrt(bandwidth_hz(bands) * expected.seconds), expected.gain_error);
        const double most = kSigmas * std::sqrt(2.0) * one;
        const double measured = expected.measured_g_rms;
        if (!(std::abs(power / (measured * measured) - 1) <= most))
            return text("psd_block: found %.4g g rms, expected the %.4g g of measured_g_rms ", rms,
                        measured) +
                   text("within %.2g of the mean square", most);
    }
    if (const double share = alike(nominal, bands); share < kLeastAlike)
        return text(
            "psd_block: found another shape, of which %.2g lies where the profile's power "
            "does, expected %.2g at least",
            share, kLeastAlike);
    return {};
}

}  // namespace

Profile lines_of(Pairs pairs, const std::string& name) {
    Profile out;
    out.name = name;
    double largest = 0;
    pairs = without_rest(pairs);
    for (const auto& [hz, density] : pairs) largest = std::max(largest, density);
    for (const auto& [hz, density] : pairs)
        out.psd.emplace_back(hz, std::max(density, kNothing * largest));
    return out;
}

PsdTaken take_controller_psd(Pairs pairs, const PsdExpected& expected) {
    PsdTaken out;
    pairs = without_rest(pairs);
    out.wrong = malformed(pairs);
    if (!out.wrong.empty()) return out;
    if (std::ranges::equal(pairs, without_rest(expected.before))) {
        out.wrong =
            "psd_block: found to the last bit what it was after the random dwell before, expected "
            "what was measured in this one";
        return out;
    }
    out.psd = lines_of(pairs, expected.nominal.name);
    out.wrong = contradicted(out.psd, expected);
    return out;
}

}  // namespace vibrig::estimator::spectrum
