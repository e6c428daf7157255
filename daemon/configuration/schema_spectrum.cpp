// Several frequencies: what stands between table and platform, and the users' profiles.
#include <array>
#include <optional>

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

/// [[a, b], ..] of finite numbers.
std::optional<Pairs> read_pairs(const Entry& entry, const std::string& form, Range first,
                                Range second) {
    const toml::array* rows = entry.array(2, kMostPoints, form);
    if (rows == nullptr) return std::nullopt;
    Pairs pairs;
    for (std::size_t i = 0; i < rows->size(); ++i) {
        const Entry row = entry.element(i);
        if (row.array(2, 2, "numbers: " + form) == nullptr) return std::nullopt;
        const auto a = row.element(0).number(first, "Hz");
        const auto b = row.element(1).number(second, "");
        if (!a || !b) return std::nullopt;
        pairs.emplace_back(*a, *b);
    }
    return pairs;
}

std::string write_pairs(const Pairs& pairs) {
    return write_list(pairs, [](const auto& pair) {
        return write_list(std::array{pair.first, pair.second}, write_number);
    });
}

/// Ratios over growing frequencies.
std::optional<Pairs> read_ratios(const Entry& entry, const std::string& form) {
    auto pairs = read_pairs(entry, form, kFrequency, kRatio);
    for (std::size_t i = 1; pairs && i < pairs->size(); ++i) {
        const double before = (*pairs)[i - 1].first, hz = (*pairs)[i].first;
        if (hz > before) continue;
        entry.problems.add(place_of(entry.node.source()), entry.key + "[" + std::to_string(i) + "]",
                           plain(hz) + " Hz after " + plain(before) + " Hz", "growing frequencies");
        return std::nullopt;
    }
    return pairs;
}

void read_transmission(const Entry& entry, C& c) {
    if (const auto* word = entry.node.as_string()) {
        if (word->get() == "pads") return c.spectrum.transmission.clear();
        return entry.refuse("\"pads\" or [[hz, ratio], ..]");
    }
    if (const auto pairs = read_ratios(entry, "[hz, ratio]")) c.spectrum.transmission = *pairs;
}

void read_response(const Entry& entry, C& c) {
    Pairs& table = c.estimator.accelerometer_response.table;
    if (entry.node.is_array() && entry.node.as_array()->empty()) return table.clear();
    if (const auto pairs = read_ratios(entry, "[[hz, ratio], ..]")) table = *pairs;
}

/// One [[profile]]; its breakpoints are looked at by whoever has all of it.
class ProfileReader {
  public:
    ProfileReader(const Entry& entry, const toml::table& table) : entry_(entry), table_(table) {}

    bool read(C::NamedProfile& to) {
        for (const auto& [name, node] : table_) {
            const std::string part(name.str());
            const Entry of = entry_.part(node, part);
            if (part == "name" || part == "file") {
                text(of, part == "name" ? to.profile.name : to.file);
            } else if (part == "number") {
                number(of, to.number);
            } else if (part == "psd" || part == "controller_psd") {
                // Zero and negative densities get their own words below.
                (part == "psd" ? to.profile.psd : to.controller_psd) =
                    read_pairs(of, "[hz, g2_hz]", kAny, kAny).value_or(Pairs{});
            } else if (part == "g_rms") {
                to.profile.g_rms = of.number({1e-6, 1e4}, "g").value_or(0);
            } else if (part == "direction") {
                direction(of, to.profile);
                to.states_direction = true;
            } else if (part == "at") {
                at(of, to.at_table);
                to.states_at = true;
            } else {
                of.refuse("an unknown key",
                          "name, number, psd, file, controller_psd, g_rms, direction or at");
            }
        }
        if (good() && to.profile.name.empty())
            entry_.part(table_, "name").refuse("nothing", "a name");
        if (good() && to.profile.psd.empty() == to.file.empty())
            entry_.part(table_, "psd")
                .refuse(to.file.empty() ? "neither psd nor file" : "psd and file", "one of them");
        return good() && checked(to.profile, "") &&
               checked({to.profile.name, to.controller_psd, {}, {0, 1, 0}, 0}, "controller_");
    }

  private:
    [[nodiscard]] bool good() const { return entry_.problems.count() == problems_; }

    static void text(const Entry& of, std::string& to) {
        const auto* value = of.node.as_string();
        if (value == nullptr || value->get().empty() || value->get().size() > 120)
            return of.refuse("a string of 1 to 120 bytes");
        to = value->get();
    }
    static void number(const Entry& of, int& to) {
        const auto* value = of.node.as_integer();
        if (value == nullptr || value->get() < 1 || value->get() > 65535)
            return of.refuse("a whole number from 1 to 65535");
        to = static_cast<int>(value->get());
    }
    static void at(const Entry& of, bool& table) {
        const auto* value = of.node.as_string();
        if (value == nullptr || (value->get() != "platform" && value->get() != "table"))
            return of.refuse("\"platform\" or \"table\"");
        table = value->get() == "table";
    }
    static void direction(const Entry& of, Profile& to) {
        constexpr Range kPart{-1e3, 1e3};
        const auto value = of.triple({kPart, kPart, kPart}, "");
        if (!value) return;
        const auto direction = estimator::spectrum::direction_along(*value);
        if (!direction) return of.refuse("a direction (north, up, east)");
        to.direction = *direction;
    }
    /// `as`: before "psd".
    [[nodiscard]] bool checked(const Profile& profile, const std::string& as) const {
        if (profile.psd.empty()) return true;
        try {
            estimator::spectrum::check(profile, "");
            return true;
        } catch (const estimator::SettingsError& error) {
            const std::string what = error.what();
            const auto colon = what.find(": found "), expected = what.find(", expected ");
            const std::string part = as + what.substr(0, colon);
            const toml::node* node = table_.get(part.substr(0, part.find('[')));
            entry_.part(node != nullptr ? *node : table_, part)
                .refuse(what.substr(colon + 8, expected - colon - 8), what.substr(expected + 11));
            return false;
        }
    }

    const Entry& entry_;
    const toml::table& table_;
    std::size_t problems_ = entry_.problems.count();
};

void read_profile(const Entry& entry, const toml::table& table, C& c) {
    C::NamedProfile profile;
    if (!ProfileReader(entry, table).read(profile)) return;
    for (const auto& other : c.profiles) {
        if (other.profile.name == profile.profile.name)
            entry.part(table, "name")
                .refuse(write_text(profile.profile.name) + " a second time", "a name of its own");
        if (profile.number > 0 && other.number == profile.number)
            entry.part(table, "number")
                .refuse(std::to_string(profile.number) + " a second time", "a number of its own");
    }
    c.profiles.push_back(std::move(profile));
}

void read_profiles(const Entry& entry, C& c) {
    c.profiles.clear();
    entry.tables(
        "[[profile]] tables, at most 50",
        [&c](const Entry& row, const toml::table& table) { read_profile(row, table, c); },
        kMostProfiles);
}

std::string write_profile(const C::NamedProfile& one) {
    return "{ name = " + write_text(one.profile.name) +
           (one.number > 0 ? ", number = " + std::to_string(one.number) : "") +
           (one.file.empty() || !one.profile.psd.empty() ? ", psd = " + write_pairs(one.profile.psd)
                                                         : ", file = " + write_text(one.file)) +
           (one.controller_psd.empty() ? ""
                                       : ", controller_psd = " + write_pairs(one.controller_psd)) +
           (one.profile.g_rms > 0 ? ", g_rms = " + write_number(one.profile.g_rms) : "") +
           ", direction = " + write_triple(one.profile.direction) +
           ", at = " + (one.at_table ? "\"table\"" : "\"platform\"") + " }";
}

std::string write_profiles(C& c) { return write_list(c.profiles, write_profile); }

}  // namespace

std::vector<Key> response_keys() {
    using R = estimator::AccelerometerResponse;
    const auto response = part(&C::estimator, &estimator::Settings::accelerometer_response);
    return {
        number("accelerometer.bandwidth_hz", response(&R::bandwidth_hz), "Hz", {0, 100'000},
               "where accelerometers see half of the power of what vibrates; 0: no limit"),
        integer("accelerometer.order", response(&R::order), "", 1, 8,
                "of the Butterworth low-pass that bandwidth_hz is of"),
        {"accelerometer.response", "pairs", "Hz, 1",
         "[[hz, ratio], ..], growing frequencies; none: []",
         "in place of bandwidth_hz: what is shown over what is, over frequency; beyond the last "
         "one nothing is known",
         read_response, [](C& c) { return write_pairs(c.estimator.accelerometer_response.table); },
         kPairsSchema},
        number("accelerometer.skew_ms", response(&R::skew_ms), "ms", {0, 100},
               "between the samples of two accelerometers, at most"),
    };
}

std::vector<Key> spectrum_keys() {
    using S = C::Spectrum;
    using B = estimator::spectrum::SweptBy;
    const auto spectrum = part(&C::spectrum);
    const auto swept_by = part(&C::campaign, &campaign::Settings::swept_by);
    return {
        choice<bool>("spectrum.mode", spectrum(&S::mixed), {{"sine", false}, {"mixed", true}},
                     "what the shaker does: sines, or random vibration and sweeps too"),
        choice<bool>("spectrum.mount", spectrum(&S::hard), {{"isolated", false}, {"hard", true}},
                     "the platform on its isolators, or bolted to the table: then the transmission "
                     "is 1 and campaign.resonance_hz is ignored"),
        {"spectrum.transmission", "\"pads\" or pairs", "Hz, 1",
         "[[hz, ratio], ..], growing frequencies",
         "platform over table over frequency: measured, or pads that have vibration.transmission "
         "at vibration.frequency_hz",
         read_transmission,
         [](C& c) {
             return c.spectrum.transmission.empty() ? std::string("\"pads\"")
                                                    : write_pairs(c.spectrum.transmission);
         },
         kTransmissionSchema},
        number("spectrum.pads_damping", spectrum(&S::pads_damping), "", {0.001, 1},
               "of the isolators, of critical"),
        number("spectrum.controller_gain", spectrum(&S::controller_gain), "", {1e-6, 1},
               "of the mean square that the controller plays about a profile, relative, 1 sigma"),
        number("spectrum.sweep_begins_s", swept_by(&B::begins_s), "s", {0, 60},
               "that a controller lets pass between its level and its sweep, at most"),
        number("spectrum.sweep_rate_tolerance", swept_by(&B::rate_tolerance), "", {0, 0.3},
               "of a controller's sweep rate, relative, at most"),
        text("spectrum.controller_psd", spectrum(&S::controller_psd),
             "\"nominal\", \"registers\", \"profile\" or a file",
             "how a random profile lies over frequency at the table: as stated; as the controller "
             "says after each dwell (shaker.registers.psd_block); as profile.controller_psd says, "
             "where it does; or as a file does (JSON: [{profile, psd}, ..])",
             [](const std::string& value) -> std::string {
                 return value.empty() ? "\"nominal\", \"registers\", \"profile\" or a file" : "";
             }),
        number("spectrum.highest_hz", spectrum(&S::highest_hz), "Hz", {1, 20'000},
               "up to which a survey is planned for a profile"),
        number("spectrum.elastic_beyond", spectrum(&S::elastic_beyond), "", {0, 100},
               "elastic part, of the static coefficient, that a prediction allows for beyond what "
               "was measured"),
        number("spectrum.tolerance_deg_h", spectrum(&S::tolerance_deg_h), "deg/h", {0, 1000},
               "that two standard deviations of a verification stay below; 0: any"),
        {"profile", "tables", "",
         "rows: name, number (in the controller), psd ([[hz, g2_hz], ..]) or file, controller_psd "
         "(in place of psd, as it was played at the table), g_rms, direction (north, up, east), at "
         "(platform or table)",
         "random vibrations that predictions and surveys are made for; g_rms has to be that of psd "
         "within 1 %",
         read_profiles, write_profiles, kProfileSchema},
    };
}

}  // namespace vibrig::configuration
