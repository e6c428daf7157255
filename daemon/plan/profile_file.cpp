#include "daemon/plan/profile_file.hpp"

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "daemon/plan/number_table.hpp"
#include "proto/json_file.hpp"

namespace vibrig::plan {

namespace {

using estimator::spectrum::Breakpoints;
using estimator::spectrum::Profile;

Breakpoints read_pairs(const nlohmann::json& root, const std::string& path, const char* key,
                       const char* form) {
    Breakpoints out;
    const auto found = root.find(key);
    if (found == root.end()) return out;
    const std::string place = path + key;
    if (!found->is_array()) refuse(place, found->dump(), std::string("[") + form + ", ..]");
    for (const auto& one : *found) {
        if (!one.is_array() || one.size() != 2 || !one[0].is_number() || !one[1].is_number())
            refuse(place + "[" + std::to_string(out.size()) + "]", one.dump(), form);
        out.emplace_back(one[0].get<double>(), one[1].get<double>());
    }
    return out;
}

void refuse_unknown(const nlohmann::json& root, const std::string& path) {
    constexpr std::array<const char*, 7> kKnown{"name",      "psd",   "cross", "sines",
                                                "direction", "g_rms", "at"};
    if (root.contains("quadrature"))
        refuse(path + ": quadrature", "cross-spectra with an imaginary part",
               "real ones: a campaign with one shaker does not excite what answers elliptic "
               "motion");
    for (const auto& [key, value] : root.items()) {
        if (std::ranges::find(kKnown, key) == kKnown.end())
            refuse(path + ": " + key, "an unknown key",
                   "name, psd, cross, sines, direction, g_rms or at");
    }
}

/// Lists of pairs by the names of axes, or pairs of them.
std::array<Breakpoints, 3> read_axes(const nlohmann::json& of,
                                     const std::array<const char*, 3>& names,
                                     const std::string& place) {
    std::array<Breakpoints, 3> out;
    const std::string known = std::string(names[0]) + ", " + names[1] + ", " + names[2];
    if (!of.is_object() || of.empty())
        refuse(place, of.dump().substr(0, 60), "an object with " + known);
    for (const auto& [key, value] : of.items()) {
        const auto name = std::ranges::find(names, key);
        if (name == names.end()) refuse(place + "." + key, "an unknown axis", known);
        out[static_cast<std::size_t>(name - names.begin())] =
            read_pairs(of, place + ".", *name, "[hz, g2_hz]");
    }
    return out;
}

/// Along one line, or along axes.
void read_psd(const nlohmann::json& root, Profile& profile, const std::string& path) {
    const auto psd = root.find("psd"), cross = root.find("cross");
    const bool axes = psd != root.end() && psd->is_object();
    if (cross != root.end() && !axes)
        refuse(path + ": cross", "without a psd of several axes", "psd {north, up, east}");
    if (!axes) {
        profile.psd = read_pairs(root, path + ": ", "psd", "[hz, g2_hz]");
        return;
    }
    if (root.contains("direction") && !root.contains("sines"))
        refuse(path + ": direction", "with a psd of several axes",
               "it for sines, or psd [[hz, g2_hz], ..] along one line");
    profile.axes.psd = read_axes(*psd, estimator::spectrum::kAxes, path + ": psd");
    if (cross != root.end())
        profile.axes.cross = read_axes(*cross, estimator::spectrum::kAxisPairs, path + ": cross");
}

}  // namespace

StatedProfile read_profile(const std::string& path) {
    const nlohmann::json root = proto::read_json(path);
    if (!root.is_object())
        throw std::runtime_error(path + ": expected a JSON object with psd or sines");
    refuse_unknown(root, path);
    StatedProfile stated;
    Profile& profile = stated.profile;
    profile.name = path;
    if (const auto found = root.find("name"); found != root.end()) {
        if (!found->is_string()) refuse(path + ": name", found->dump(), "a text");
        profile.name = found->get<std::string>();
    }
    read_psd(root, profile, path);
    profile.sines = read_pairs(root, path + ": ", "sines", "[hz, g_peak]");
    if (const auto found = root.find("direction"); found != root.end()) {
        if (!found->is_array() || found->size() != 3 ||
            !std::ranges::all_of(*found, [](auto& x) { return x.is_number(); }))
            refuse(path + ": direction", found->dump(), "[north, up, east]");
        const auto axes = found->get<std::array<double, 3>>();
        profile.direction = estimator::spectrum::direction_along(axes).value_or(axes);
    }
    if (const auto found = root.find("g_rms"); found != root.end()) {
        if (!found->is_number() || !(found->get<double>() > 0))
            refuse(path + ": g_rms", found->dump(), "a number above 0");
        profile.g_rms = found->get<double>();
    }
    if (const auto found = root.find("at"); found != root.end()) {
        if (*found != "platform" && *found != "table")
            refuse(path + ": at", found->dump(), "\"platform\" or \"table\"");
        stated.at = found->get<std::string>();
    }
    check(profile, path + ": ");
    return stated;
}

std::vector<Profile> read_controller_psd(const std::string& path) {
    const nlohmann::json root = proto::read_json(path);
    constexpr const char* kForm = "[{\"profile\": NAME, \"psd\": [[hz, g2_hz], ..]}, ..]";
    if (!root.is_array())
        refuse(path, root.dump().substr(0, 60), std::string("a JSON list ") + kForm);
    std::vector<Profile> out;
    for (const auto& one : root) {
        const std::string place = path + ": [" + std::to_string(out.size()) + "]";
        const auto name = one.is_object() ? one.find("profile") : one.end();
        if (!one.is_object() || name == one.end() || !name->is_string())
            refuse(place, one.dump().substr(0, 60), std::string("an entry of ") + kForm);
        Profile profile;
        profile.name = name->get<std::string>();
        profile.psd = read_pairs(one, place + ": ", "psd", "[hz, g2_hz]");
        if (profile.psd.empty()) refuse(place + ".psd", "nothing", "[[hz, g2_hz], ..]");
        check(profile, place + ".");
        if (std::ranges::find(out, profile.name, &Profile::name) != out.end())
            refuse(place + ".profile", name->dump() + " a second time", "each once");
        out.push_back(std::move(profile));
    }
    return out;
}

}  // namespace vibrig::plan
