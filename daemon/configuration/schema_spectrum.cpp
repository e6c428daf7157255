// Several frequencies: what stands between table and platform, and the users' profiles.
#include <cmath>
#include <stdexcept>

#include "daemon/configuration/key.hpp"
#include "daemon/configuration/value.hpp"
#include "estimator/filter/settings.hpp"

namespace vibrig::configuration {

namespace {

using C = Configuration;
using Pairs = std::vector<std::pair<double, double>>;
using estimator::spectrum::Profile;

constexpr std::size_t kMostPoints = 1000, kMostProfiles = 50;
constexpr Range kFrequency{0.1, 20'000}, kRatio{0.001, 100}, kAny{-1e12, 1e12};
constexpr const char* kProfileSchema =
    R"({"type":"array","maxItems":50,"items":{"type":"object","required":["name"],)"
    R"("additionalProperties":false,"properties":{"name":{"type":"string"},)"
    R"("number":{"type":"integer"},"psd":{"type":"array"},"file":{"type":"string"},)"
    R"("controller_psd":{"type":"array"},"g_rms":{"type":"number"},"direction":{"type":"array"},)"
    R"("at":{"enum":["platform","table"]}}}})";
constexpr const char* kPairsSchema = R"({"type":"array","items":{"type":"array",)"
                                     R"("minItems":2,"maxItems":2,"items":{"type":"number"}}})";
constexpr const char* kTransmissionSchema =
    R"({"anyOf":[{"const":"pads"},{"type":"array","minItems":2,"items":{"type":"array",)"
    R"("minItems":2,"maxItems":2,"items":{"type":"number"}}}]})";

/// [[a, b], ..] of finite numbers, or a problem and false.
bool read_pairs(const toml::node& node, const std::string& key, const std::string& form,
                Range first, Range second, Pairs& to, Problems& problems) {
    const toml::array* rows = read_array(node, key, 2, kMostPoints, form, problems);
    if (rows == nullptr) return false;
    to.clear();
    for (std::size_t i = 0; i < rows->size(); ++i) {
        const std::string at = key + "[" + std::to_string(i) + "]";
        const toml::array* row = read_array(*rows->get(i), at, 2, 2, "numbers: " + form, problems);
        if (row == nullptr) return false;
        const auto a = read_number(*row->get(0), at + "[0]", first, "Hz", problems);
        const auto b = read_number(*row->get(1), at + "[1]", second, "", problems);
        if (!a || !b) return false;
        to.emplace_back(*a, *b);
    }
    return true;
}

std::string write_pairs(const Pairs& pairs) {
    std::string text;
    for (const auto& [a, b] : pairs)
        text += (text.empty() ? "[" : ", [") + write_number(a) + ", " + write_number(b) + "]";
    return "[" + text + "]";
}

bool growing(const toml::node& node, const char* key, const Pairs& pairs, Problems& problems) {
    for (std::size_t i = 1; i < pairs.size(); ++i) {
        if (pairs[i].first > pairs[i - 1].first) continue;
        problems.add(place_of(node.source()), std::string(key) + "[" + std::to_string(i) + "]",
                     plain(pairs[i].first) + " Hz after " + plain(pairs[i - 1].first) + " Hz",
                     "growing frequencies");
        return false;
    }
    return true;
}

void read_transmission(const toml::node& node, C& c, Problems& problems) {
    constexpr const char* kKey = "spectrum.transmission";
    if (const auto* word = node.as_string()) {
        if (word->get() == "pads") return c.spectrum.transmission.clear();
        return problems.add(place_of(node.source()), kKey, describe(node),
                            "\"pads\" or [[hz, ratio], ..]");
    }
    Pairs pairs;
    if (!read_pairs(node, kKey, "[hz, ratio]", kFrequency, kRatio, pairs, problems)) return;
    if (growing(node, kKey, pairs, problems)) c.spectrum.transmission = std::move(pairs);
}

void read_response(const toml::node& node, C& c, Problems& problems) {
    constexpr const char* kKey = "accelerometer.response";
    Pairs pairs;
    if (node.is_array() && node.as_array()->empty())
        return c.estimator.accelerometer_response.table.clear();
    if (read_pairs(node, kKey, "[[hz, ratio], ..]", kFrequency, kRatio, pairs, problems) &&
        growing(node, kKey, pairs, problems))
        c.estimator.accelerometer_response.table = std::move(pairs);
}

/// One [[profile]]; its breakpoints are looked at by whoever has all of it.
class ProfileReader {
  public:
    ProfileReader(const toml::table& table, std::string key, Problems& problems)
        : table_(table), key_(std::move(key)), problems_(problems) {}

    bool read(C::NamedProfile& to) {
        for (const auto& [name, node] : table_) {
            const std::string part(name.str());
            if (part == "name" || part == "file") {
                text(node, part, part == "name" ? to.profile.name : to.file);
            } else if (part == "number") {
                number(node, to.number);
            } else if (part == "psd") {
                // Zero and negative densities get their own words below.
                good_ &= read_pairs(node, key_ + ".psd", "[hz, g2_hz]", kAny, kAny, to.profile.psd,
                                    problems_);
            } else if (part == "controller_psd") {
                good_ &= read_pairs(node, key_ + ".controller_psd", "[hz, g2_hz]", kAny, kAny,
                                    to.controller_psd, problems_);
            } else if (part == "g_rms") {
                const auto rms = read_number(node, key_ + ".g_rms", {1e-6, 1e4}, "g", problems_);
                good_ &= rms.has_value();
                to.profile.g_rms = rms.value_or(0);
            } else if (part == "direction") {
                direction(node, to.profile);
            } else if (part == "at") {
                at(node, to.at_table);
            } else {
                refuse(node, part, "an unknown key",
                       "name, number, psd, file, controller_psd, g_rms, direction or at");
            }
        }
        if (good_ && to.profile.name.empty()) refuse(table_, "name", "nothing", "a name");
        if (good_ && to.profile.psd.empty() == to.file.empty())
            refuse(table_, "psd", to.file.empty() ? "neither psd nor file" : "psd and file",
                   "one of them");
        return good_ && checked(to.profile, "") &&
               checked({to.profile.name, to.controller_psd, {}, {0, 1, 0}, 0}, "controller_");
    }

  private:
    void refuse(const toml::node& node, const std::string& part, const std::string& found,
                const std::string& expected) {
        problems_.add(place_of(node.source()), key_ + "." + part, found, expected);
        good_ = false;
    }
    void text(const toml::node& node, const std::string& part, std::string& to) {
        const auto* value = node.as_string();
        if (value == nullptr || value->get().empty() || value->get().size() > 120)
            return refuse(node, part, describe(node), "a string of 1 to 120 bytes");
        to = value->get();
    }
    void number(const toml::node& node, int& to) {
        const auto* value = node.as_integer();
        if (value == nullptr || value->get() < 1 || value->get() > 65535)
            return refuse(node, "number", describe(node), "a whole number from 1 to 65535");
        to = static_cast<int>(value->get());
    }
    void at(const toml::node& node, bool& table) {
        const auto* value = node.as_string();
        if (value == nullptr || (value->get() != "platform" && value->get() != "table"))
            return refuse(node, "at", describe(node), "\"platform\" or \"table\"");
        table = value->get() == "table";
    }
    void direction(const toml::node& node, Profile& to) {
        constexpr Range kPart{-1e3, 1e3};
        const auto value =
            read_triple(node, key_ + ".direction", {kPart, kPart, kPart}, "", problems_);
        if (!value) {
            good_ = false;
            return;
        }
        to.direction = {(*value)[0], (*value)[1], (*value)[2]};
        if (!(to.direction.norm() > 0))
            return refuse(node, "direction", describe(node), "a direction (north, up, east)");
        to.direction.normalize();
    }
    /// `as`: before "psd".
    bool checked(const Profile& profile, const std::string& as) {
        if (profile.psd.empty()) return true;
        try {
            estimator::spectrum::check(profile, "");
            return true;
        } catch (const estimator::SettingsError& error) {
            const std::string what = error.what();
            const auto colon = what.find(": found "), expected = what.find(", expected ");
            const std::string part = as + what.substr(0, colon);
            const toml::node* node = table_.get(part.substr(0, part.find('[')));
            refuse(node != nullptr ? *node : table_, part,
                   what.substr(colon + 8, expected - colon - 8), what.substr(expected + 11));
            return false;
        }
    }

    const toml::table& table_;
    std::string key_;
    Problems& problems_;
    bool good_ = true;
};

void read_profiles(const toml::node& node, C& c, Problems& problems) {
    const auto* rows = node.as_array();
    if (rows == nullptr || rows->size() > kMostProfiles) {
        problems.add(place_of(node.source()), "profile", describe(node),
                     "[[profile]] tables, at most 50");
        return;
    }
    c.profiles.clear();
    for (std::size_t i = 0; i < rows->size(); ++i) {
        const std::string key = "profile[" + std::to_string(i) + "]";
        const auto* table = rows->get(i)->as_table();
        if (table == nullptr) {
            problems.add(place_of(rows->get(i)->source()), key, describe(*rows->get(i)), "a table");
            continue;
        }
        C::NamedProfile profile;
        if (!ProfileReader(*table, key, problems).read(profile)) continue;
        for (const auto& other : c.profiles) {
            if (other.profile.name == profile.profile.name)
                problems.add(place_of(table->source()), key + ".name",
                             write_text(profile.profile.name) + " a second time",
                             "a name of its own");
            if (profile.number > 0 && other.number == profile.number)
                problems.add(place_of(table->source()), key + ".number",
                             std::to_string(profile.number) + " a second time",
                             "a number of its own");
        }
        c.profiles.push_back(std::move(profile));
    }
}

std::string write_profiles(C& c) {
    std::string text;
    for (const auto& one : c.profiles) {
        const auto& d = one.profile.direction;
        text +=
            (text.empty() ? "{ name = " : ", { name = ") + write_text(one.profile.name) +
            (one.number > 0 ? ", number = " + std::to_string(one.number) : "") +
            (one.file.empty() || !one.profile.psd.empty()
                 ? ", psd = " + write_pairs(one.profile.psd)
                 : ", file = " + write_text(one.file)) +
            (one.controller_psd.empty() ? ""
                                        : ", controller_psd = " + write_pairs(one.controller_psd)) +
            (one.profile.g_rms > 0 ? ", g_rms = " + write_number(one.profile.g_rms) : "") +
            ", direction = " + write_triple({d[0], d[1], d[2]}) +
            ", at = " + (one.at_table ? "\"table\"" : "\"platform\"") + " }";
    }
    return "[" + text + "]";
}

}  // namespace

void add_response_keys(std::vector<Key>& keys) {
    keys.push_back(
        number("accelerometer.bandwidth_hz", "Hz", {0, 100'000},
               "where accelerometers see half of the power of what vibrates; 0: no "
               "limit",
               [](C& c) -> double& { return c.estimator.accelerometer_response.bandwidth_hz; }));
    keys.push_back(integer("accelerometer.order", "", 1, 8,
                           "of the Butterworth low-pass that bandwidth_hz is of",
                           [](C& c) -> int& { return c.estimator.accelerometer_response.order; }));
    keys.push_back({"accelerometer.response", "pairs", "Hz, 1",
                    "[[hz, ratio], ..], growing frequencies; none: []",
                    "in place of bandwidth_hz: what is shown over what is, over frequency; beyond "
                    "the last one nothing is known",
                    read_response,
                    [](C& c) { return write_pairs(c.estimator.accelerometer_response.table); },
                    kPairsSchema});
    keys.push_back(
        number("accelerometer.skew_ms", "ms", {0, 100},
               "between the samples of two accelerometers, at most",
               [](C& c) -> double& { return c.estimator.accelerometer_response.skew_ms; }));
}

void add_spectrum_keys(std::vector<Key>& keys) {
    keys.push_back(choice<bool>(
        "spectrum.mode", {{"sine", false}, {"mixed", true}},
        "what the shaker does: sines, or random vibration and sweeps too",
        [](C & c) -> auto& { return c.spectrum.mixed; }));
    keys.push_back(choice<bool>(
        "spectrum.mount", {{"isolated", false}, {"hard", true}},
        "the platform on its isolators, or bolted to the table: then the transmission is 1 and "
        "campaign.resonance_hz is ignored",
        [](C & c) -> auto& { return c.spectrum.hard; }));
    keys.push_back({"spectrum.transmission", "\"pads\" or pairs", "Hz, 1",
                    "[[hz, ratio], ..], growing frequencies",
                    "platform over table over frequency: measured, or pads that have "
                    "vibration.transmission at vibration.frequency_hz",
                    read_transmission,
                    [](C& c) {
                        return c.spectrum.transmission.empty()
                                   ? std::string("\"pads\"")
                                   : write_pairs(c.spectrum.transmission);
                    },
                    kTransmissionSchema});
    keys.push_back(number("spectrum.pads_damping", "", {0.001, 1}, "of the isolators, of critical",
                          [](C& c) -> double& { return c.spectrum.pads_damping; }));
    keys.push_back(number("spectrum.controller_gain", "", {1e-6, 1},
                          "of the mean square that the controller plays about a profile, relative, "
                          "1 sigma",
                          [](C& c) -> double& { return c.spectrum.controller_gain; }));
    keys.push_back(number("spectrum.sweep_begins_s", "s", {0, 60},
                          "that a controller lets pass between its level and its sweep, at most",
                          [](C& c) -> double& { return c.campaign.swept_by.begins_s; }));
    keys.push_back(number("spectrum.sweep_rate_tolerance", "", {0, 0.3},
                          "of a controller's sweep rate, relative, at most",
                          [](C& c) -> double& { return c.campaign.swept_by.rate_tolerance; }));
    keys.push_back(text(
        "spectrum.controller_psd", "\"nominal\", \"registers\", \"profile\" or a file",
        "how a random profile lies over frequency at the table: as stated; as the controller says "
        "after each dwell (shaker.registers.psd_block); as profile.controller_psd says, where it "
        "does; or as a file does (JSON: [{profile, psd}, ..])",
        [](const std::string& value) -> std::string {
            return value.empty() ? "\"nominal\", \"registers\", \"profile\" or a file" : "";
        },
        [](C & c) -> auto& { return c.spectrum.controller_psd; }));
    keys.push_back(number("spectrum.highest_hz", "Hz", {1, 20'000},
                          "up to which a survey is planned for a profile",
                          [](C& c) -> double& { return c.spectrum.highest_hz; }));
    keys.push_back(number("spectrum.elastic_beyond", "", {0, 100},
                          "elastic part, of the static coefficient, that a prediction allows for "
                          "beyond what was measured",
                          [](C& c) -> double& { return c.spectrum.elastic_beyond; }));
    keys.push_back(number("spectrum.tolerance_deg_h", "deg/h", {0, 1000},
                          "that two standard deviations of a verification stay below; 0: any",
                          [](C& c) -> double& { return c.spectrum.tolerance_deg_h; }));
    keys.push_back(
        {"profile", "tables", "",
         "rows: name, number (in the controller), psd ([[hz, g2_hz], ..]) or file, "
         "controller_psd (in place of psd, as it was played at the table), g_rms, direction "
         "(north, up, east), at (platform or table)",
         "random vibrations that predictions and surveys are made for; g_rms has to be "
         "that of psd within 1 %",
         read_profiles, write_profiles, kProfileSchema});
}

}  // namespace vibrig::configuration
