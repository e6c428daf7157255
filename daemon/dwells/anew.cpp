#include "daemon/dwells/anew.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "estimator/uncertainty/assessment.hpp"

namespace vibrig::dwells {

namespace {

std::string levels_in_words(const estimator::NoiseLevels& levels) {
    const auto& n = levels.gyro_random_walk_deg_per_rt_h;
    return fmt::format("N {:.3g}, {:.3g}, {:.3g} deg/sqrt(h) and {:.3g} arcsec", n[0], n[1], n[2],
                       levels.angle_arcsec);
}

}  // namespace

Anew::Anew(const estimator::Settings& settings, const noise::Found& found, std::size_t dwells)
    : identification_(settings, std::max<std::size_t>(1, dwells)),
      words_(fmt::format("identified anew from the recorded dwells with the noise found, {} "
                         "(configured {})",
                         levels_in_words(found.levels),
                         levels_in_words(estimator::noise_levels(settings)))) {
    identification_.set_noise(found.levels);
}

estimator::Result Anew::result() const {
    estimator::Result result = identification_.result();
    result.warnings.push_back(words_);
    return result;
}

estimator::Settings Anew::settings_of(estimator::Settings settings,
                                      const std::optional<noise::Found>& found) {
    double& dof = settings.uncertainty.noise_dof;
    if (found) dof = std::min(dof, found->dof);
    return settings;
}

estimator::uncertainty::Assessment assess(const estimator::Settings& settings,
                                          const std::optional<noise::Found>& found,
                                          const estimator::Result& result) {
    return estimator::uncertainty::assess(Anew::settings_of(settings, found), result);
}

std::string noise_in_json(const noise::Found& found) {
    const auto& levels = found.levels;
    nlohmann::ordered_json noise{
        {"angle_arcsec", levels.angle_arcsec},
        {"gyro_random_walk_deg_per_rt_h", levels.gyro_random_walk_deg_per_rt_h},
        {"dof", nullptr}};
    if (std::isfinite(found.dof)) noise["dof"] = found.dof;
    return nlohmann::ordered_json{{"identified_anew", {{"noise", std::move(noise)}}}}.dump();
}

std::optional<noise::Found> noise_found_in(const std::string& result_json) {
    const auto root = nlohmann::json::parse(result_json, nullptr, false);
    if (!root.is_object() || !root.contains("identified_anew")) return {};
    try {
        const auto& noise = root.at("identified_anew").at("noise");
        noise::Found found;
        found.levels.angle_arcsec = noise.at("angle_arcsec").get<double>();
        found.levels.gyro_random_walk_deg_per_rt_h =
            noise.at("gyro_random_walk_deg_per_rt_h").get<std::array<double, 3>>();
        const auto& dof = noise.at("dof");
        found.dof = dof.is_null() ? std::numeric_limits<double>::infinity() : dof.get<double>();
        return found;
    } catch (const nlohmann::json::exception&) {  // somebody else's
        return {};
    }
}

}  // namespace vibrig::dwells
