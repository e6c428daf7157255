#include "daemon/tool/analysis/profile_options.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <nlohmann/json.hpp>
#include <numbers>
#include <stdexcept>

#include "daemon/results/text_line.hpp"
#include "estimator/spectrum/profile_moments.hpp"

namespace vibrig::tool {

using namespace estimator::spectrum;

plan::StatedProfile find_profile(const std::string& name, const configuration::Configuration& rig) {
    std::string known;
    for (const auto& one : rig.profiles) {
        if (one.profile.name == name) return {one.profile, one.at_table ? "table" : "platform"};
        known += one.profile.name + ", ";
    }
    for (const Profile& profile : built_in_profiles()) {
        if (profile.name == name) return {profile, ""};
    }
    if (!std::ifstream(name))
        throw std::runtime_error("--profile: found '" + name +
                                 "', expected a JSON file or one of " + known +
                                 "minimum-integrity, truck");
    return plan::read_profile(name);
}

std::string where_it_holds(const plan::StatedProfile& stated,
                           const std::optional<std::string>& asked) {
    if (asked && !stated.at.empty() && *asked != stated.at)
        throw std::runtime_error("--at: found " + *asked + ", expected " + stated.at +
                                 ", where the profile '" + stated.profile.name + "' holds");
    return stated.at.empty() ? asked.value_or("platform") : stated.at;
}

double strongest_g_rms(const nlohmann::json& result) {
    const auto rows = result.find("dwell_rates");
    if (rows == result.end() || !rows->is_array()) return 0;
    // Levels are peaks of a sine of the same mean square.
    double peak = 0;
    for (const auto& row : *rows) {
        const auto level = row.find("level");
        if (level != row.end() && level->is_number()) peak = std::max(peak, level->get<double>());
    }
    return peak / std::numbers::sqrt2;
}

AtPlatform at_platform(const Profile& profile, const std::string& at,
                       const configuration::Configuration& rig) {
    AtPlatform out{bands_of(profile), Eigen::Matrix3d::Zero()};
    std::vector<Eigen::Matrix3d> moments = moments_of(profile);
    if (at == "table") {
        if (!rig.spectrum.mount_stated && !(rig.estimator.transmission < 1))
            throw std::runtime_error("vibration.transmission: found " +
                                     std::to_string(rig.estimator.transmission) +
                                     ", expected pads (below 1) for a profile at the table");
        out.behind_pads = !rig.spectrum.mount.hard;
        double kept = 0;
        for (std::size_t b = 0; b < moments.size(); ++b) {
            Band& band = out.bands[b];
            const auto ratio = rig.spectrum.mount.transmission(band.hz);
            if (!ratio)
                throw std::runtime_error("spectrum.transmission: found nothing at " +
                                         std::to_string(band.hz) +
                                         " Hz, expected the whole profile within it");
            moments[b] *= *ratio * *ratio;
            kept += band.share *= *ratio * *ratio;
        }
        for (Band& band : out.bands) band.share /= kept;
    }
    for (const Eigen::Matrix3d& moment : moments) out.moment += moment;
    if (profile.axes.stated()) out.moments = std::move(moments);
    return out;
}

std::string profiles_text() {
    std::string text;
    for (const Profile& profile : built_in_profiles()) {
        text += line("%s: %.2f g rms", profile.name.c_str(), std::sqrt(mean_square(profile)));
        for (const auto& [hz, density] : profile.psd)
            text += line("    %6g Hz %10g g^2/Hz", hz, density);
    }
    return text + "Examples of the types, not a standard's text.\n";
}

nlohmann::ordered_json profiles_json() {
    auto list = nlohmann::ordered_json::array();
    for (const Profile& profile : built_in_profiles())
        list.push_back({{"name", profile.name},
                        {"g_rms", std::sqrt(mean_square(profile))},
                        {"psd", profile.psd}});
    return {{"profiles", std::move(list)}};
}

std::array<double, 3> read_attitude(const std::string& text) {
    std::array<double, 3> deg{};
    int used = 0;
    if (std::sscanf(text.c_str(), "%lf,%lf,%lf%n", &deg[0], &deg[1], &deg[2], &used) != 3 ||
        static_cast<std::size_t>(used) != text.size() ||
        !std::all_of(deg.begin(), deg.end(), [](double x) { return std::abs(x) <= 360; }))
        throw std::runtime_error("--attitude: found '" + text +
                                 "', expected ALPHA,BETA,GAMMA of the gimbals, deg, -360 to 360");
    if (std::abs(std::remainder(deg[1], 360)) > 80)
        throw std::runtime_error("--attitude: found " + text +
                                 ", expected an inner angle of at most 80 deg");
    return deg;
}

}  // namespace vibrig::tool
