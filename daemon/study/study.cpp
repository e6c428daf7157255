#include "daemon/study/study.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <map>
#include <numbers>
#include <optional>
#include <set>
#include <sstream>
#include <string_view>

#include "daemon/configuration/problems.hpp"
#include "daemon/configuration/value.hpp"
#include "daemon/study/rig_keys.hpp"
#include "daemon/study/toml_text.hpp"
#include "proto/text.hpp"

namespace vibrig::study {

namespace {

using configuration::describe;
using configuration::place_of;
using configuration::Problems;

constexpr std::size_t kMostAxes = 20, kMostValues = 10'000;
constexpr std::array kIdentifySections{"site", "vibration", "platform",    "accelerometer", "noise",
                                       "can",  "estimator", "uncertainty", "drift"};
constexpr std::array<std::string_view, 3> kKinds{"campaigns", "recordings", "uncertainty"};
constexpr std::uint64_t kDefaultBlocks = 50;  // suffice for one digit whatever u is
/// Kinds that have a key of [study]; the others are everybody's.
const std::map<std::string, std::set<std::string>> kKeysOf{{"seed", {"campaigns", "uncertainty"}},
                                                           {"runs", {"campaigns"}},
                                                           {"folders", {"recordings"}},
                                                           {"select", {"recordings"}},
                                                           {"recording", {"uncertainty"}},
                                                           {"trials", {"uncertainty"}},
                                                           {"digits", {"uncertainty"}}};
constexpr std::array kShapes{"normal", "rectangular", "triangular", "arcsine"};
constexpr const char* kDistributions =
    "{ normal = [MEAN, SIGMA] }, or { rectangular | triangular | arcsine = [LOW, HIGH] }";

class Reader {
  public:
    explicit Reader(std::string name) : name_(std::move(name)) {}

    Study read(const std::string& text) {
        toml::table root;
        try {
            root = toml::parse(text, name_);
        } catch (const toml::parse_error& error) {
            throw StudyError(where(error.source()) + ": " + std::string(error.description()));
        }
        for (const auto& [key, node] : root) {
            const std::string section(key.str());
            const toml::table* table = node.as_table();
            if (section != "study" && section != "campaign" && section != "rig" &&
                section != "grid" && section != "identify") {
                problem(node, section, describe(node),
                        "[study], [campaign], [rig], [grid] or [identify]");
            } else if (table == nullptr) {
                problem(node, section, describe(node), "a table");
            } else {
                read_section(section, *table);
            }
        }
        if (!root.contains("study"))
            problems_.add({}, "study", "nothing", "[study] with name and kind");
        check_kind(root);
        if (problems_.empty() && study_.kind == "campaigns") check_size(root);
        if (!problems_.empty()) throw StudyError(problems_.text(name_));
        return std::move(study_);
    }

  private:
    [[nodiscard]] std::string where(const toml::source_region& source) const {
        return name_ + ":" + std::to_string(source.begin.line) + ":" +
               std::to_string(source.begin.column);
    }
    void problem(const toml::node& node, const std::string& key, const std::string& found,
                 const std::string& expected) {
        problems_.add(place_of(node.source()), key, found, expected);
    }

    void read_section(const std::string& section, const toml::table& table) {
        if (section == "study") {
            read_study(table);
        } else if (section == "grid") {
            for (const auto& [line, axis] : in_order_of_the_file(table))
                read_axis(axis, *table.get(axis));
        } else if (section == "rig") {
            read_rig("", table);
        } else {
            read_settings(section, table);
        }
    }

    /// A TOML table is sorted by its keys.
    static std::map<std::pair<std::uint32_t, std::uint32_t>, std::string> in_order_of_the_file(
        const toml::table& table) {
        std::map<std::pair<std::uint32_t, std::uint32_t>, std::string> keys;
        for (const auto& [key, node] : table) {
            const auto begin = node.source().begin;
            keys.emplace(std::pair(begin.line, begin.column), key.str());
        }
        return keys;
    }

    void read_study(const toml::table& table) {
        for (const auto& [key, node] : table) {
            const std::string name(key.str());
            if (name == "name") {
                study_.name = node.value_or(std::string());
                constexpr std::size_t kLongestName = 64;
                if (study_.name.empty() || study_.name.size() > kLongestName ||
                    proto::printable(study_.name, kLongestName) != study_.name)
                    problem(node, "study.name", describe(node), "1 to 64 characters on one line");
            } else if (name == "kind") {
                study_.kind = node.value_or(std::string());
                if (std::ranges::find(kKinds, study_.kind) == kKinds.end())
                    problem(node, "study.kind", describe(node),
                            "\"campaigns\", \"recordings\" or \"uncertainty\"");
            } else if (name == "seed") {
                study_.seed = whole(node, "study.seed", 0, std::int64_t{1} << 62);
            } else if (name == "runs") {
                study_.runs = whole(node, "study.runs", 1, kMostTasks);
            } else if (name == "recording") {
                study_.recording = node.value_or(std::string());
                if (study_.recording.empty())
                    problem(node, "study.recording", describe(node), "a campaign's folder");
            } else if (name == "trials") {
                read_trials(node);
            } else if (name == "digits") {
                study_.digits = static_cast<int>(whole(node, "study.digits", 1, 3));
            } else if (name == "folders") {
                read_folders(node);
            } else if (name == "select") {
                read_selection(node);
            } else {
                problem(node, "study." + name, describe(node),
                        "name, kind, seed, runs, folders, select, recording, trials or digits");
            }
        }
        for (const char* name : {"name", "kind"}) {
            if (!table.contains(name))
                problems_.add(place_of(table.source()), std::string("study.") + name, "nothing",
                              "it to be given");
        }
    }

    void read_folders(const toml::node& node) {
        const toml::array* list = node.as_array();
        if (list != nullptr) {
            for (const toml::node& one : *list) study_.folders.push_back(one.value_or(""));
        }
        if (study_.folders.empty() || std::ranges::find(study_.folders, "") != study_.folders.end())
            problem(node, "study.folders", describe(node), "a list of folders, as [\"/lab\"]");
    }

    void read_selection(const toml::node& node) {
        const toml::table* table = node.as_table();
        if (table == nullptr)
            return problem(node, "study.select", describe(node),
                           "{ serial = \"17\", since = 2026-01-31 }, or one of them");
        for (const auto& [key, value] : *table) {
            const toml::date* date = value.is_date() ? &value.as_date()->get() : nullptr;
            if (key.str() == "serial" && value.is_string() && !value.as_string()->get().empty()) {
                study_.select.serial = value.as_string()->get();
            } else if (key.str() == "since" && date != nullptr) {
                const std::chrono::sys_days day{std::chrono::year(date->year) /
                                                std::chrono::month(date->month) /
                                                std::chrono::day(date->day)};
                study_.select.since_utc_ns =
                    std::chrono::nanoseconds(day.time_since_epoch()).count();
            } else {
                problem(value, "study.select." + std::string(key.str()), describe(value),
                        "serial = \"17\" or since = 2026-01-31");
            }
        }
    }

    void read_trials(const toml::node& node) {
        constexpr std::int64_t kMost = 1'000'000'000;
        const auto trials = whole(node, "study.trials", kTrialsOfBlock, kMost);
        study_.runs = trials / kTrialsOfBlock;
        if (trials % kTrialsOfBlock != 0)
            problem(node, "study.trials", describe(node),
                    "a multiple of 10000: they come in blocks");
    }

    /// What other kinds have.
    void check_kind(const toml::table& root) {
        if (std::ranges::find(kKinds, study_.kind) == kKinds.end()) return;
        const std::string no = "it not to be set in a study of kind \"" + study_.kind + "\"";
        for (const char* section : {"campaign", "rig", "grid"}) {
            if (study_.kind != "campaigns" && root.contains(section))
                problem(*root.get(section), section, "a table", no);
        }
        const toml::table* table = root["study"].as_table();
        if (table == nullptr) return;
        for (const auto& [key, node] : *table) {
            const auto of = kKeysOf.find(std::string(key.str()));
            if (of == kKeysOf.end() || of->second.contains(study_.kind)) continue;
            // One [study] is copied from kind to kind: what every kind may have does no harm.
            if (key == "seed" || key == "runs")
                study_.warnings.push_back(
                    where(node.source()) + ": study." + of->first + ": found " + describe(node) +
                    ", without effect in a study of kind \"" + study_.kind + "\"");
            else
                problem(node, "study." + of->first, describe(node), no);
        }
        if (study_.kind == "recordings" && !table->contains("folders"))
            problem(*table, "study.folders", "nothing", "a list of folders, as [\"/lab\"]");
        if (study_.kind == "uncertainty" && !table->contains("recording"))
            problem(*table, "study.recording", "nothing", "a campaign's folder");
        if (study_.kind == "uncertainty" && !table->contains("trials"))
            study_.runs = kDefaultBlocks;
    }

    std::uint64_t whole(const toml::node& node, const std::string& key, std::int64_t low,
                        std::int64_t high) {
        const auto value = node.is_integer() ? node.value<std::int64_t>() : std::nullopt;
        if (!value || *value < low || *value > high) {
            problem(node, key, describe(node),
                    "a whole number from " + std::to_string(low) + " to " + std::to_string(high));
            return static_cast<std::uint64_t>(low);
        }
        return static_cast<std::uint64_t>(*value);
    }

    /// Keys of the daemon's configuration: what they may be its own reader knows.
    void read_settings(const std::string& prefix, const toml::table& table) {
        for (const auto& [key, node] : table) {
            const std::string name = prefix + "." + std::string(key.str());
            const toml::table* inner = node.as_table();
            // { u = 20, shape = "rectangular" } is the value of a key.
            const bool value =
                inner != nullptr && inner->is_inline() && prefix.find('.') != std::string::npos;
            if (inner != nullptr && !value) {
                read_settings(name, *inner);
            } else if (const auto setting = setting_of(name, node, node)) {
                study_.configuration.push_back(*setting);
            }
        }
    }

    /// `name` with "campaign." or "identify." before it.
    std::optional<Setting> setting_of(const std::string& name, const toml::node& value,
                                      const toml::node& at) {
        std::string key = name;
        if (name.starts_with("identify.")) {
            key = name.substr(std::string("identify.").size());
            const std::string section = key.substr(0, key.find('.'));
            if (std::ranges::find(kIdentifySections, section) == kIdentifySections.end()) {
                problem(at, name, describe(value),
                        "site, vibration, platform, accelerometer, noise, can, estimator, "
                        "uncertainty or drift, and a key of it");
                return std::nullopt;
            }
        }
        for (const char* other :
             {"campaign.levelling", "campaign.zeroing", "campaign.adaptive", "campaign.plan"}) {
            if (key == other) {
                problem(at, name, describe(value), "it not to be set: a study has dwells only");
                return std::nullopt;
            }
        }
        return Setting{key, toml_text(value), where(at.source())};
    }

    void read_rig(const std::string& prefix, const toml::table& table) {
        for (const auto& [part, node] : table) {
            const std::string key = prefix + std::string(part.str());
            if (rig_keys().contains(key)) {
                if (auto setting = rig_setting(key, node)) study_.rig.push_back(*setting);
            } else if (node.is_table() && prefix.empty() && key.find('.') == std::string::npos) {
                read_rig(key + ".", *node.as_table());
            } else {
                unknown_rig_key("rig." + key, node);
            }
        }
    }

    void unknown_rig_key(const std::string& key, const toml::node& node) {
        const std::string section = key.substr(4, key.find('.', 4) - 4);
        std::string known;
        for (const auto& [name, what] : rig_keys()) {
            if (name.starts_with(section + ".") && known.size() < 400)
                known += (known.empty() ? "" : ", ") + name.substr(section.size() + 1);
        }
        problem(node, key, describe(node),
                known.empty() ? "a section of the rig's truth and its key, as "
                                "\"platform.slew_error_deg\"; the seed is the study's"
                              : "a key of " + section + ": " + known);
    }

    std::optional<RigSetting> rig_setting(const std::string& key, const toml::node& node) {
        RigSetting out;
        out.key = key;
        out.place = where(node.source());
        if (const toml::table* table = node.as_table()) {
            if (!read_distribution(key, *table, out.distribution)) return std::nullopt;
            return out;
        }
        out.json = json_text(node);
        if (out.json.empty()) {
            problem(node, "rig." + key, describe(node),
                    "a value, or " + std::string(kDistributions));
            return std::nullopt;
        }
        return out;
    }

    bool read_distribution(const std::string& key, const toml::table& table, Distribution& out) {
        const std::string name = "rig." + key;
        const RigKey& what = rig_keys().at(key);
        const std::string found = toml_text(table);
        if (!what.number || what.whole) {
            problem(table, name, found, "a value: this key is not drawn");
            return false;
        }
        const auto shape = table.size() == 1
                               ? std::ranges::find(kShapes, std::string(table.begin()->first.str()))
                               : kShapes.end();
        const toml::array* numbers =
            shape != kShapes.end() ? table.begin()->second.as_array() : nullptr;
        const bool two = numbers != nullptr && numbers->size() == 2 && (*numbers)[0].is_number() &&
                         (*numbers)[1].is_number();
        if (!two) {
            problem(table, name, found, kDistributions);
            return false;
        }
        out.shape = static_cast<Distribution::Shape>(shape - kShapes.begin());
        out.first = (*numbers)[0].value_or(0.0);
        out.second = (*numbers)[1].value_or(0.0);
        out.low = what.low;
        out.high = what.high;
        return fits(table, name, found, out);
    }

    /// Of a normal distribution, without loss of digits at either end.
    static double share_within(const Distribution& d) {
        const double low = (d.low - d.first) / (d.second * std::numbers::sqrt2);
        const double high = (d.high - d.first) / (d.second * std::numbers::sqrt2);
        return low > 0 ? (std::erfc(low) - std::erfc(high)) / 2
                       : (std::erfc(-high) - std::erfc(-low)) / 2;
    }

    bool fits(const toml::table& table, const std::string& name, const std::string& found,
              const Distribution& d) {
        const std::string range =
            configuration::plain(d.low) + " to " + configuration::plain(d.high);
        if (!std::isfinite(d.first) || !std::isfinite(d.second)) {
            problem(table, name, found, "finite numbers");
        } else if (d.shape == Distribution::Shape::normal) {
            // What is beyond 3 sigma at one side of the range: 1.35 in a thousand. Draws.
            if (d.second > 0 && share_within(d) >= 0.00134) return true;
            problem(table, name, found,
                    "a sigma above 0, and values from " + range + " not to be too rare");
        } else if (!(d.first < d.second) || d.first < d.low || d.second > d.high) {
            problem(table, name, found, "LOW below HIGH, both from " + range);
        } else {
            return true;
        }
        return false;
    }

    void read_axis(const std::string& key, const toml::node& node) {
        const toml::array* values = node.as_array();
        if (values == nullptr || values->empty() || values->size() > kMostValues) {
            problem(node, "grid.\"" + key + "\"", describe(node),
                    "a list of 1 to " + std::to_string(kMostValues) +
                        " values, with the key in "
                        "quotes: \"campaign.table_g\" = [[9, 7], [9, 0]]");
            return;
        }
        Axis axis;
        axis.key = key;
        const std::string rig_key = key.starts_with("rig.") ? key.substr(4) : key;
        const bool settings = key.starts_with("campaign.") || key.starts_with("identify.");
        if (!settings && !rig_keys().contains(rig_key)) {
            problem(node, "grid.\"" + key + "\"", describe(node),
                    "campaign.KEY, identify.SECTION.KEY, or a key of the rig");
            return;
        }
        std::set<std::string> seen;
        for (const toml::node& value : *values) {
            axis.values.push_back(toml_text(value));
            if (!seen.insert(axis.values.back()).second)
                problem(value, "grid.\"" + key + "\"", axis.values.back() + " again",
                        "each value once: points that are the same have one name");
            if (settings) {
                if (auto one = setting_of(key, value, value)) axis.settings.push_back(*one);
            } else if (auto one = rig_setting(rig_key, value)) {
                axis.rig.push_back(*one);
            }
        }
        study_.grid.push_back(std::move(axis));
    }

    void check_size(const toml::table& root) {
        long double tasks = static_cast<long double>(study_.runs);
        for (const Axis& axis : study_.grid) tasks *= static_cast<long double>(axis.values.size());
        const toml::node& at = root.contains("grid") ? *root.get("grid") : *root.get("study");
        if (study_.grid.size() > kMostAxes) {
            problem(at, "grid", std::to_string(study_.grid.size()) + " axes",
                    "at most " + std::to_string(kMostAxes));
        } else if (tasks > static_cast<long double>(kMostTasks)) {
            std::ostringstream found;
            found << static_cast<double>(tasks) << " tasks";
            problem(at, "grid", found.str(),
                    "at most 1e7: the product of the lists' lengths and study.runs");
        }
    }

    std::string name_;
    Study study_;
    Problems problems_;
};

}  // namespace

std::uint64_t Study::points() const {
    std::uint64_t points = 1;
    for (const Axis& axis : grid) points *= axis.values.size();
    return points;
}

std::vector<std::size_t> Study::place_of(std::uint64_t point) const {
    std::vector<std::size_t> place(grid.size());
    for (std::size_t a = grid.size(); a-- > 0;) {
        place[a] = static_cast<std::size_t>(point % grid[a].values.size());
        point /= grid[a].values.size();
    }
    return place;
}

Study parse_study(const std::string& text, const std::string& name) {
    return Reader(name).read(text);
}

void put(std::vector<Setting>& settings, const Setting& setting) {
    const auto same = std::ranges::find(settings, setting.key, &Setting::key);
    if (same == settings.end())
        settings.push_back(setting);
    else
        *same = setting;
}

std::string configuration_text(const std::vector<Setting>& settings) {
    std::string text;
    for (const Setting& setting : settings) text += setting.key + " = " + setting.value + "\n";
    return text;
}

std::string with_own_places(const std::string& message, const std::string& name,
                            const std::vector<Setting>& settings) {
    std::istringstream lines(message);
    std::string out;
    for (std::string line; std::getline(lines, line);) {
        std::size_t number = 0, used = 0;
        if (line.starts_with(name + ":")) {
            try {
                number = std::stoul(line.substr(name.size() + 1), &used);
            } catch (const std::exception&) {
                number = 0;
            }
        }
        const std::size_t rest = line.find(": ", name.size() + 1 + used);
        if (number >= 1 && number <= settings.size() && rest != std::string::npos)
            line = settings[number - 1].place + line.substr(rest);
        out += (out.empty() ? "" : "\n") + line;
    }
    return out;
}

}  // namespace vibrig::study
