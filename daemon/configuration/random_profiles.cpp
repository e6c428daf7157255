#include "daemon/configuration/random_profiles.hpp"

#include <algorithm>
#include <bit>
#include <boost/crc.hpp>
#include <cmath>

#include "daemon/configuration/value.hpp"
#include "daemon/plan/number_table.hpp"
#include "estimator/spectrum/controller_psd.hpp"
#include "estimator/spectrum/seen.hpp"

namespace vibrig::configuration {

namespace spectrum = estimator::spectrum;

namespace {

using Named = Configuration::NamedProfile;

/// CRC-32 over Hz and g^2/Hz of each point as big-endian IEEE 754 floats.
std::uint32_t checksum_of(const std::vector<std::pair<double, double>>& psd) {
    boost::crc_32_type crc;
    for (const auto& [hz, density] : psd) {
        for (const double value : {hz, density}) {
            const auto bits = std::bit_cast<std::uint32_t>(static_cast<float>(value));
            for (const int shift : {24, 16, 8, 0})
                crc.process_byte(static_cast<unsigned char>(bits >> shift));
        }
    }
    return crc.checksum();
}

const Named& profile_of(const Configuration& rig, const plan::PlannedRun& run,
                        const std::string& place) {
    std::string known;
    for (const Named& one : rig.profiles) {
        if (one.profile.name == run.profile ||
            (one.number > 0 && std::to_string(one.number) == run.profile))
            return one;
        known += (known.empty() ? "" : ", ") + one.profile.name;
    }
    plan::refuse(
        place, "'" + run.profile + "'",
        "the name or number of a [[profile]]" + (known.empty() ? "" : ": one of " + known));
}

/// Of bands with a ratio each: their mean square becomes so many times as large.
double weigh(const Configuration& rig, std::vector<spectrum::Band>& bands, bool up) {
    double kept = 0;
    for (spectrum::Band& band : bands) {
        const auto ratio = rig.spectrum.mount.transmission(band.hz);
        if (!ratio) return 0;
        band.share *= up ? *ratio * *ratio : 1 / (*ratio * *ratio);
        kept += band.share;
    }
    for (spectrum::Band& band : bands) band.share /= kept;
    return kept;
}

}  // namespace

std::optional<PlayedProfile> played(const Configuration& rig, const Named& of) {
    if (of.profile.psd.empty()) return std::nullopt;
    const auto stated = spectrum::bands_of(of.profile);
    auto other = stated;
    const double power = spectrum::mean_square(of.profile);
    const double kept = weigh(rig, other, of.at_table);
    if (!(kept > 0)) return std::nullopt;
    PlayedProfile out;
    const auto& table = of.at_table ? stated : other;
    out.table_g = std::sqrt(of.at_table ? power : power * kept);
    out.table_bandwidth_hz = spectrum::bandwidth_hz(table);
    out.at_platform = of.at_table ? other : stated;
    out.platform_g = std::sqrt(of.at_table ? power * kept : power);
    if (!of.controller_psd.empty()) {
        // What was played, not what was to be.
        const spectrum::Profile seen{of.profile.name, of.controller_psd, {}, {0, 1, 0}, 0};
        out.at_platform = spectrum::bands_of(seen);
        const double through = weigh(rig, out.at_platform, true);
        if (!(through > 0)) return std::nullopt;
        out.platform_g = std::sqrt(spectrum::mean_square(seen) * through);
    }
    out.platform_bandwidth_hz = spectrum::bandwidth_hz(out.at_platform);
    out.highest_hz = of.profile.psd.back().first;
    if (!of.controller_psd.empty())
        out.highest_hz = std::max(out.highest_hz, of.controller_psd.back().first);
    out.checksum = checksum_of(of.profile.psd);
    return out;
}

std::optional<PsdAtPlatform> at_platform(const Configuration& rig,
                                         const spectrum::Profile& at_table) {
    constexpr int kPerDecade = 100;  // 1/24 octave is 80
    PsdAtPlatform out;
    out.bands = spectrum::bands_of(at_table, kPerDecade);
    const double through = weigh(rig, out.bands, true);
    if (!(through > 0)) return std::nullopt;
    out.random.mean_square_g2 = spectrum::mean_square(at_table) * through;
    out.random.bandwidth_hz = spectrum::bandwidth_hz(out.bands);
    out.random.gain_error = rig.spectrum.controller_gain;
    out.random.highest_hz = at_table.psd.back().first;
    const auto& response = rig.estimator.accelerometer_response;
    if (!response.flat() || response.skew_ms > 0) out.seen = spectrum::seen_of(response, out.bands);
    if (out.seen.share < estimator::kLeastSeen) return std::nullopt;
    return out;
}

std::vector<spectrum::Band> reported_bands(const Configuration& rig, int number, double level_db,
                                           std::span<const std::array<double, 2>> pairs) {
    const auto nominal = stated_at(rig, number, level_db);
    if (!nominal) return {};
    const auto taken = spectrum::lines_of(pairs, nominal->name);
    if (taken.psd.size() < 2) return {};
    auto there = at_platform(rig, taken);
    return there ? std::move(there->bands) : std::vector<spectrum::Band>{};
}

std::optional<spectrum::Profile> stated_at(const Configuration& rig, int number, double level_db) {
    const auto found = std::ranges::find(rig.profiles, number, &Named::number);
    if (found == rig.profiles.end()) return std::nullopt;
    spectrum::Profile profile = found->profile;
    for (auto& [hz, density] : profile.psd) density *= std::pow(10, level_db / 10);
    return profile;
}

campaign::Stop random_stop(Configuration& rig, const plan::PlannedRun& run) {
    const std::string& place = run.profile_place;
    const Named& named = profile_of(rig, run, place);
    const std::string name = "'" + named.profile.name + "'";
    if (named.number == 0)
        plan::refuse(place, name + " without a number",
                     "its number in the controller: profile.number");
    if (!named.profile.sines.empty()) plan::refuse(place, name + " with sines", "a psd alone");
    if (std::abs(std::abs(named.profile.direction[1]) - 1) > 1e-6)
        plan::refuse(place, name + " across the vertical",
                     "what a shaker under the platform plays");
    if (!named.at_table && !rig.spectrum.mount.hard)
        plan::refuse(place, name + " at the platform, behind isolators",
                     "at = \"table\": the controller's breakpoints, of which the checksum is");
    const auto found = played(rig, named);
    if (!found) plan::refuse(place, name, "a psd within spectrum.transmission");
    const auto number = static_cast<std::uint16_t>(named.number);
    const double level = std::pow(10, run.level_db / 20);
    const double seen =
        spectrum::seen_of(rig.estimator.accelerometer_response, found->at_platform).share;
    campaign::Stop stop{run.position_deg, found->table_g * level, 0, run.verify,
                        found->platform_g / found->table_g * std::sqrt(seen)};
    const double platform_g = found->platform_g * level;
    stop.random = campaign::RandomStop{
        {number, run.level_db, found->checksum},
        {platform_g * platform_g, found->platform_bandwidth_hz, rig.spectrum.controller_gain,
         found->highest_hz, number, run.level_db},
        0,
        named.profile.name,
        rig.spectrum.mount.hard ? std::vector<spectrum::Band>{} : found->at_platform};
    auto& numbers = rig.played_numbers;
    const auto known = std::ranges::find(numbers, number);
    stop.random->place = static_cast<std::uint16_t>(known - numbers.begin() + 1);
    if (known != numbers.end()) return stop;
    numbers.push_back(number);
    rig.abort_bands.push_back({1e9 / static_cast<double>(rig.assembler.sample_period),
                               found->table_bandwidth_hz, found->platform_bandwidth_hz,
                               rig.estimator.accelerometer_zero_g});
    return stop;
}

void take_seen(Configuration& rig) {
    const auto& response = rig.estimator.accelerometer_response;
    if (response.flat() && response.skew_ms == 0) return;
    for (const auto& [number, kind] : numbered_kinds(rig))
        rig.estimator.seen_profiles.emplace_back(number, spectrum::seen_of(response, kind.bands));
}

std::vector<std::pair<std::uint16_t, spectrum::Kind>> numbered_kinds(const Configuration& rig) {
    std::vector<std::pair<std::uint16_t, spectrum::Kind>> kinds;
    for (const Named& one : rig.profiles) {
        if (one.number == 0) continue;
        if (auto found = played(rig, one))
            kinds.push_back({static_cast<std::uint16_t>(one.number),
                             {one.profile.name, std::move(found->at_platform)}});
    }
    return kinds;
}

}  // namespace vibrig::configuration
