#include "daemon/tool/analysis/spectrum_dwells.hpp"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string_view>

#include "daemon/plan/number_table.hpp"
#include "daemon/tool/analysis/profile_options.hpp"
#include "estimator/spectrum/profile.hpp"
#include "proto/json_file.hpp"

namespace vibrig::tool {

namespace {

using estimator::spectrum::Band;
using SpectraJson = nlohmann::json;

int count_of(const SpectraJson& entry, const char* key, const std::string& place) {
    const auto found = entry.find(key);
    if (found == entry.end() || !found->is_number_integer() || found->get<int>() < 1)
        plan::refuse(place + key, found == entry.end() ? "nothing" : found->dump(),
                     "a number from 1");
    return found->get<int>();
}

using Pairs = std::vector<std::pair<double, double>>;

Pairs pairs_of(const SpectraJson& list, const std::string& key, const std::string& form) {
    if (!list.is_array()) plan::refuse(key, list.dump(), "[" + form + ", ..]");
    Pairs pairs;
    for (const SpectraJson& one : list) {
        const bool good = one.is_array() && one.size() == 2 && one[0].is_number() &&
                          one[1].is_number() && one[0].get<double>() > 0 &&
                          one[1].get<double>() > 0;
        if (!good)
            plan::refuse(key + "[" + std::to_string(pairs.size()) + "]", one.dump(),
                         form + ", both above 0");
        pairs.emplace_back(one[0].get<double>(), one[1].get<double>());
    }
    return pairs;
}

/// lines, profile or psd: one of them.
StatedSpectrum stated_of(const SpectraJson& entry, const std::string& place) {
    std::vector<std::string_view> keys;
    for (const auto& one : entry.items()) keys.emplace_back(one.key());
    plan::refuse_misspelt(keys, {"run", "position", "lines", "psd", "profile", "level_db"},
                          [&place](const std::string& key) { return place + key; });
    StatedSpectrum of;
    of.place = place;
    int count = 0;
    if (const auto found = entry.find("lines"); found != entry.end()) {
        of.lines = pairs_of(*found, place + "lines", "[hz, g_peak]");
        estimator::spectrum::refuse_one_frequency_twice(of.lines, place + "lines");
        ++count;
    }
    if (const auto found = entry.find("psd"); found != entry.end()) {
        of.psd = pairs_of(*found, place + "psd", "[hz, g2_hz]");
        of.profile = found->dump();
        ++count;
    }
    if (const auto found = entry.find("profile"); found != entry.end()) {
        of.profile = found->is_string()            ? found->get<std::string>()
                     : found->is_number_unsigned() ? found->dump()
                                                   : "";
        if (of.profile.empty() || of.profile == "0")
            plan::refuse(place + "profile", found->dump(), "a profile's name or number");
        ++count;
    }
    if (count != 1)
        plan::refuse(place + "lines", count == 0 ? "nothing" : "more beside it",
                     "[[hz, g_peak], ..], empty at rest; or profile or psd");
    if (const auto found = entry.find("level_db"); found != entry.end()) {
        if (!found->is_number() || of.profile.empty())
            plan::refuse(place + "level_db", found->dump(), "the level of a profile, dB");
        of.level_db = found->get<double>();
    }
    return of;
}

/// By its name, or by its number in the controller.
plan::StatedProfile profile_of(const StatedSpectrum& of, const configuration::Configuration& rig,
                               const std::string& place) {
    if (!of.psd.empty()) {
        plan::StatedProfile stated{{"psd", of.psd, {}, {0, 1, 0}, 0}, "platform"};
        estimator::spectrum::check(stated.profile, place);
        return stated;
    }
    for (const auto& one : rig.profiles) {
        if (one.profile.name == of.profile ||
            (one.number > 0 && std::to_string(one.number) == of.profile))
            return one.controller_psd.empty()
                       ? plan::StatedProfile{one.profile, one.at_table ? "table" : "platform"}
                       : plan::StatedProfile{
                             {one.profile.name, one.controller_psd, {}, one.profile.direction, 0},
                             "table"};
    }
    for (const auto& one : estimator::spectrum::built_in_profiles()) {
        if (one.name == of.profile) return {one, "platform"};
    }
    std::string known;
    for (const auto& one : rig.profiles) known += one.profile.name + ", ";
    plan::refuse(place + "profile", "'" + of.profile + "'",
                 "the name or number of a [[profile]] of the configuration: one of " + known +
                     "minimum-integrity, truck");
}

std::vector<Band> bands_of_lines(const Pairs& lines) {
    double all = 0;
    for (const auto& [hz, peak] : lines) all += peak * peak;
    std::vector<Band> bands;
    for (const auto& [hz, peak] : lines) bands.push_back({hz, peak * peak / all, 0});
    return bands;
}

bool alike(const std::vector<Band>& a, const std::vector<Band>& b) {
    return a.size() == b.size() &&
           std::equal(a.begin(), a.end(), b.begin(), [](const Band& x, const Band& y) {
               return std::abs(x.hz / y.hz - 1) < 0.002 && std::abs(x.share - y.share) < 0.01;
           });
}

}  // namespace

Spectra read_spectra(const std::string& path) {
    const SpectraJson root = proto::read_json(path);
    if (!root.is_array())
        throw std::runtime_error(
            path + ": expected a JSON list of {run, position, lines | profile | psd}");
    Spectra spectra;
    for (std::size_t i = 0; i < root.size(); ++i) {
        const std::string place = path + ": [" + std::to_string(i) + "].";
        if (!root[i].is_object())
            plan::refuse(path + ": [" + std::to_string(i) + "]", root[i].dump(),
                         "{run, position, lines | profile | psd}");
        const std::pair key{count_of(root[i], "run", place), count_of(root[i], "position", place)};
        if (!spectra.emplace(key, stated_of(root[i], place)).second)
            plan::refuse(place + "run",
                         "run " + std::to_string(key.first) + ", position " +
                             std::to_string(key.second) + " twice",
                         "once");
    }
    return spectra;
}

void DwellKinds::expect_listed(const std::string& file) const {
    bool left_out = false;
    for (std::size_t d = 0; d < said_.size(); ++d)
        left_out = left_out || (said_[d] == Said::configuration && of_dwell_[d]);
    if (!left_out) return;
    for (const auto& [key, stated] : spectra_) {
        if (!dwells_.contains(key))
            plan::refuse(stated.place + "run",
                         "run " + std::to_string(key.first) + ", position " +
                             std::to_string(key.second) + ", of which there is no dwell",
                         "one of " + file);
    }
}

void DwellKinds::add(const std::vector<const proto::RecordingRow*>& rows,
                     const std::vector<std::string>& profiles, const std::string& file) {
    const proto::RecordingRow& first = *rows.front();
    const auto line = [&](const proto::RecordingRow& row) {
        return file + ":" + std::to_string(row.line) + ": ";
    };
    for (const auto* row : rows) {
        if (row->frequency_hz != first.frequency_hz)
            plan::refuse(
                line(*row) + "column frequency_hz",
                std::to_string(row->frequency_hz) + " after " + std::to_string(first.frequency_hz),
                "one frequency in a dwell, or a sweep through 10 % at least");
        if (row->profile != first.profile || row->level_db != first.level_db)
            plan::refuse(line(*row) + "column profile",
                         "another profile or level than in the row before", "one in a dwell");
    }
    dwells_.emplace(first.run, first.position);
    const auto found = spectra_.find({first.run, first.position});
    said_.push_back(found != spectra_.end() || first.profile > 0 ? Said::stated
                    : first.frequency_hz < 0                     ? Said::configuration
                                                                 : Said::column);
    std::vector<Band> bands;
    if (found != spectra_.end()) {
        if (!found->second.profile.empty()) return add_random(found->second, line(first));
        bands = bands_of_lines(found->second.lines);
    } else if (first.profile > 0) {
        if (first.frequency_hz > 0)
            plan::refuse(line(first) + "column frequency_hz",
                         std::to_string(first.frequency_hz) + " with profile '" +
                             profiles.at(first.profile - 1U) + "'",
                         "0 under random vibration");
        return add_random({{}, profiles.at(first.profile - 1U), {}, first.level_db},
                          line(first) + "column ");
    } else if (const double hz = first.frequency_hz < 0 ? configured_hz_ : first.frequency_hz;
               hz > 0) {
        bands = {{hz, 1, 0}};
    }
    random_.emplace_back();
    if (bands.empty())
        of_dwell_.emplace_back();
    else
        of_dwell_.emplace_back(kind_of(std::move(bands)));
}

/// A profile is a kind by its name, whatever the levels at which it is played.
void DwellKinds::add_random(const StatedSpectrum& of, const std::string& place) {
    const plan::StatedProfile stated = profile_of(of, rig_, place);
    const estimator::spectrum::Profile& profile = stated.profile;
    if (profile.axes.stated() || std::abs(std::abs(profile.direction[1]) - 1) > 1e-6)
        plan::refuse(place + "profile", "'" + profile.name + "', which is not along the vertical",
                     "what a shaker under the platform plays");
    if (!profile.sines.empty())
        plan::refuse(place + "profile", "'" + profile.name + "' with sines", "a psd alone");
    AtPlatform there = at_platform(profile, stated.at, rig_);
    random_.push_back({there.moment(1, 1) * std::pow(10, of.level_db / 10),
                       estimator::spectrum::bandwidth_hz(there.bands),
                       rig_.spectrum.controller_gain, profile.psd.back().first});
    const std::string name = of.psd.empty() ? profile.name : of.profile;
    for (std::size_t k = 0; k < kinds_.size(); ++k) {
        if (kinds_[k].profile == name) return of_dwell_.push_back(k);
    }
    kinds_.push_back({name, std::move(there.bands)});
    of_dwell_.emplace_back(kinds_.size() - 1);
}

std::size_t DwellKinds::kind_of(std::vector<Band> bands) {
    for (std::size_t k = 0; k < kinds_.size(); ++k) {
        if (kinds_[k].profile.empty() && alike(kinds_[k].bands, bands)) return k;
    }
    kinds_.push_back({"", std::move(bands)});
    return kinds_.size() - 1;
}

void DwellKinds::put_at_rest(const std::vector<std::size_t>& dwells) {
    for (const std::size_t d : dwells) of_dwell_[d].reset();
    for (std::size_t k = kinds_.size(); k-- > 0;) {
        if (std::ranges::count(of_dwell_, std::optional(k)) > 0) continue;
        kinds_.erase(kinds_.begin() + static_cast<std::ptrdiff_t>(k));
        for (auto& kind : of_dwell_)
            if (kind && *kind > k) --*kind;
    }
}

std::optional<std::size_t> DwellKinds::reference() const {
    std::optional<std::size_t> most;
    long largest = 0;
    for (std::size_t k = 0; k < kinds_.size(); ++k) {
        if (!kinds_[k].profile.empty()) continue;
        if (estimator::same_vibration(kinds_[k].hz(), configured_hz_)) return k;
        const auto count = std::count(of_dwell_.begin(), of_dwell_.end(), std::optional(k));
        if (count <= largest) continue;
        largest = count;
        most = k;
    }
    return most;
}

}  // namespace vibrig::tool
