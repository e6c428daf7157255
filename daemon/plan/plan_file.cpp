#include "daemon/plan/plan_file.hpp"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <string_view>

#include "daemon/plan/number_table.hpp"
#include "proto/json_file.hpp"
#include "proto/text.hpp"

namespace vibrig::plan {

namespace {

using Json = nlohmann::json;

constexpr std::size_t kMostRuns = 100'000;
constexpr double kMostG = 1000, kMostHz = 20'000;
constexpr double kMostInner = 80;                                   // beyond it the gimbals lock
constexpr const char* kCounts = "a whole number from 1 to 100000";  // kMostRuns
constexpr double kAgreement = 0.01;
constexpr double kAtRestG = 1e-9;

std::string number(double value) { return Json(value).dump(); }

/// What a run does not have of its own, and of which no name is a misspelt one.
constexpr std::array<std::string_view, 3> kOfTheCampaign{"dwell_s", "settle_s", "ramp_s"};

bool any_of(const std::vector<std::string_view>& names, std::string_view name) {
    return std::ranges::find(names, name) != names.end();
}

/// As refuse_misspelt(), and where one of `keys` is meant to be the run's own.
void refuse_unknown(const std::vector<std::string_view>& keys,
                    const std::vector<std::string_view>& known, bool run,
                    const std::function<std::string(const std::string&)>& place_of) {
    constexpr std::string_view kHz = "_hz";
    const bool has_hz = std::ranges::any_of(
        keys, [&](std::string_view key) { return key.ends_with(kHz) && any_of(known, key); });
    for (const std::string_view key : keys) {
        if (any_of(known, key)) continue;
        const std::string place = place_of(proto::printable(key));
        if (run && std::ranges::find(kOfTheCampaign, key) != kOfTheCampaign.end())
            refuse(place, "one of a run",
                   "none: it is campaign." + std::string(key) + " of the configuration for all");
        if (run && key.ends_with(kHz) && !has_hz)
            refuse(place, "an unknown key", "a known one, perhaps frequency_hz");
    }
    refuse_misspelt(keys, known, place_of);
}

/// A misspelt key would leave the rig to its configuration without a word.
void refuse_unknown(const Json& object, const std::vector<std::string_view>& known,
                    const std::string& place, bool run = false) {
    std::vector<std::string_view> keys;
    for (const auto& one : object.items()) keys.emplace_back(one.key());
    refuse_unknown(keys, known, run, [&](const std::string& key) { return place + "." + key; });
}

void check_position(const std::array<double, 3>& position, const std::string& place) {
    for (const double angle : position) {
        if (!(std::abs(angle) <= 360))
            refuse(place, number(angle), "an angle from -360 to 360 deg");
    }
    if (std::abs(std::remainder(position[1], 360.0)) > kMostInner) {
        refuse(place, "an inner angle of " + number(position[1]) + " deg",
               "at most 80: beyond it the gimbals lock");
    }
}

/// Levels at the platform and at the table from what the file has of them.
void join_levels(PlannedRun& run, std::optional<double> level, std::optional<double> table,
                 const TransmissionAt& at, const std::string& place) {
    const double at_hz = run.sweep_to_hz > 0 ? run.sweep_from_hz : run.frequency_hz;
    const auto known = at(at_hz > 0 ? std::optional(at_hz) : std::nullopt);
    if (!known) refuse(place, number(at_hz) + " Hz", "a frequency of spectrum.transmission");
    const double transmission = *known;
    for (const auto& g : {level, table}) {
        if (g && !(*g >= 0 && *g <= kMostG)) refuse(place, number(*g), "0 to 1000 g");
    }
    if (!level && !table) refuse(place, "neither level_g nor table_g", "one of them");
    run.level_g = level ? *level : *table * transmission;
    run.table_g = table ? *table : *level / transmission;
    if (std::abs(run.level_g - run.table_g * transmission) >
        std::max(kAtRestG, kAgreement * run.level_g)) {
        refuse(place,
               number(run.level_g) + " g at the platform with " + number(run.table_g) +
                   " g at the table",
               "platform over table to be the transmission " + number(transmission));
    }
}

std::optional<double> number_at(const Json& run, const char* key, const std::string& place) {
    const auto found = run.find(key);
    if (found == run.end()) return std::nullopt;
    if (!found->is_number()) refuse(place + "." + key, found->dump(), "a number");
    return found->get<double>();
}

/// Of rest it is 0.
void take_frequency(PlannedRun& run, double hz, const std::string& place) {
    if (hz != 0 && !(hz >= 0.1 && hz <= kMostHz))
        refuse(place, number(hz), "0.1 to 20000 Hz, or 0 at rest");
    run.frequency_hz = hz;
}

void take_level_db(PlannedRun& run, double db, const std::string& place) {
    constexpr double kMostDb = 60;
    if (!(std::abs(db) <= kMostDb)) refuse(place, number(db), "-60 to 60 dB");
    run.level_db = db;
}

/// `beside`: a frequency of its own, which it has two of.
void take_sweep(PlannedRun& run, const std::array<double, 3>& from_to_s,
                std::optional<double> beside, const std::string& place) {
    constexpr double kLeastRatio = 1.1, kLeast_s = 10, kMost_s = 86'400;
    const auto [from, to, seconds] = from_to_s;
    for (const double hz : {from, to}) {
        if (!(hz >= 0.1 && hz <= kMostHz)) refuse(place, number(hz) + " Hz", "0.1 to 20000 Hz");
    }
    if (std::max(from, to) < kLeastRatio * std::min(from, to))
        refuse(place, number(from) + " to " + number(to) + " Hz",
               "ends that are 10 % apart at least");
    if (!(seconds >= kLeast_s && seconds <= kMost_s))
        refuse(place, number(seconds) + " s", "10 to 86400 s");
    if (beside && *beside != 0)
        refuse(place, number(*beside) + " Hz beside a sweep", "one of them");
    run.sweep_from_hz = from;
    run.sweep_to_hz = to;
    run.sweep_s = seconds;
    run.profile_place = place;
}

/// False: there is none.
bool take_sweep(PlannedRun& run, const Json& json, const std::string& place) {
    const auto found = json.find("sweep");
    if (found == json.end()) return false;
    const std::string at = place + ".sweep";
    if (!found->is_object())
        refuse(at, found->dump().substr(0, 60), "an object with from_hz, to_hz and s");
    refuse_unknown(*found, {"from_hz", "to_hz", "s"}, at);
    std::array<double, 3> values{};
    for (std::size_t k = 0; k < 3; ++k) {
        const char* key = std::array{"from_hz", "to_hz", "s"}[k];
        const auto value = number_at(*found, key, at);
        if (!value) refuse(at + "." + key, "nothing", "a number");
        values[k] = *value;
    }
    take_sweep(run, values, number_at(json, "frequency_hz", place), at);
    return true;
}

/// A profile in place of frequency and levels; false: there is none.
bool take_profile(PlannedRun& run, const Json& json, const std::string& place) {
    const auto found = json.find("profile");
    const auto level = number_at(json, "level_db", place);
    if (found == json.end()) {
        if (level) refuse(place + ".level_db", number(*level), "a profile beside it");
        return false;
    }
    if (found->is_string()) run.profile = found->get<std::string>();
    if (found->is_number_unsigned() && *found != 0) run.profile = found->dump();
    if (run.profile.empty())
        refuse(place + ".profile", found->dump().substr(0, 60), "a profile's name or number");
    for (const char* other : {"frequency_hz", "level_g", "table_g", "sweep"}) {
        if (const auto beside = json.find(other); beside != json.end())
            refuse(place + "." + other, beside->dump().substr(0, 60) + " beside a profile",
                   "level_db alone: the profile has frequencies and g");
    }
    run.profile_place = place + ".profile";
    take_level_db(run, level.value_or(0), place + ".level_db");
    return true;
}

bool held_out(const Json& json, const std::string& place) {
    const auto role = json.find("role");
    if (role == json.end() || *role == "identify") return false;
    if (*role != "verify")
        refuse(place + ".role", role->dump().substr(0, 60), "\"identify\" or \"verify\"");
    return true;
}

PlannedRun from_json(const Json& json, const TransmissionAt& transmission,
                     const std::string& place) {
    if (!json.is_object()) refuse(place, json.dump().substr(0, 60), "an object");
    refuse_unknown(json,
                   {"position", "level_g", "table_g", "count", "frequency_hz", "sweep", "profile",
                    "level_db", "role"},
                   place, true);
    PlannedRun run;
    const auto position = json.find("position");
    if (position == json.end() || !position->is_array() || position->size() != 3 ||
        !std::all_of(position->begin(), position->end(),
                     [](const Json& x) { return x.is_number(); })) {
        refuse(place + ".position",
               position == json.end() ? "nothing" : position->dump().substr(0, 60),
               "[alpha, beta, gamma] in deg");
    }
    for (std::size_t k = 0; k < 3; ++k) run.position_deg[k] = (*position)[k].get<double>();
    check_position(run.position_deg, place + ".position");
    run.verify = held_out(json, place);
    if (!take_profile(run, json, place)) {
        if (const auto hz = number_at(json, "frequency_hz", place);
            !take_sweep(run, json, place) && hz)
            take_frequency(run, *hz, place + ".frequency_hz");
        join_levels(run, number_at(json, "level_g", place), number_at(json, "table_g", place),
                    transmission, place);
    }
    if (const auto count = number_at(json, "count", place)) {
        if (!(*count >= 1 && *count <= kMostRuns && *count == std::floor(*count))) {
            refuse(place + ".count", number(*count), kCounts);
        }
        run.count = static_cast<std::size_t>(*count);
    }
    return run;
}

/// The plan's rig against this one, in what its runs take from it.
void check_rig(const Json& plan, const std::vector<PlannedRun>& runs,
               const TransmissionAt& transmission, std::optional<double> rig_hz,
               const std::string& path) {
    const auto apart = [](double a, double b) { return !(std::abs(a - b) <= kAgreement * b); };
    const std::string place = path + ": plan";
    // Runs with a frequency or a profile of their own have a transmission of their own, too.
    const bool taken = std::ranges::any_of(runs, [](const PlannedRun& run) {
        return run.profile.empty() && run.sweep_to_hz == 0 && run.frequency_hz == 0 &&
               run.table_g > 0;
    });
    if (!taken) return;
    const auto stated = number_at(plan, "transmission", place);
    const auto own = transmission(std::nullopt);
    if (stated && own && apart(*stated, *own))
        refuse(place + ".transmission", number(*stated), "the configuration's, " + number(*own));
    const auto hz = number_at(plan, "frequency_hz", place);
    if (hz && rig_hz && apart(*hz, *rig_hz))
        refuse(place + ".frequency_hz", number(*hz) + " Hz, and runs without one of their own",
               "the configuration's vibration.frequency_hz, " + number(*rig_hz) + " Hz");
}

PlanFile runs_from_json(const std::string& text, const std::string& path,
                        const TransmissionAt& transmission, std::optional<double> rig_hz) {
    Json json;
    try {
        json = proto::parse_json(text, path, "not JSON, expected a plan");
    } catch (const std::runtime_error& error) {
        throw PlanFileError(error.what());
    }
    const auto runs = json.find("runs");
    if (runs == json.end() || !runs->is_array()) refuse(path, "no array \"runs\"", "a plan");
    // What vibrig plan writes beside the runs, and what of it is read.
    refuse_unknown(json, {"runs", "dwell_s", "transmission", "frequency_hz"}, path + ": plan");
    PlanFile result{{}, number_at(json, "dwell_s", path + ": plan")};
    if (result.dwell_s && !(*result.dwell_s > 0))
        refuse(path + ": plan.dwell_s", number(*result.dwell_s), "more than 0 s");
    for (const Json& run : *runs) {
        result.runs.push_back(from_json(
            run, transmission, path + ": runs[" + std::to_string(result.runs.size()) + "]"));
    }
    check_rig(json, result.runs, transmission, rig_hz, path);
    return result;
}

std::vector<std::array<double, 3>> positions_of(const NumberTable& table, const std::string& path) {
    std::vector<std::array<double, 3>> result(table.rows.size());
    for (std::size_t k = 0; k < 3; ++k) {
        const auto* name = std::array{"alpha_deg", "beta_deg", "gamma_deg"}[k];
        const auto column = table.find(name);
        if (!column)
            refuse(path + ":1", "no column " + std::string(name),
                   "the columns alpha_deg, beta_deg and gamma_deg");
        for (std::size_t i = 0; i < result.size(); ++i) result[i][k] = table.rows[i][*column];
    }
    for (std::size_t i = 0; i < result.size(); ++i) {
        check_position(result[i], path + ":" + std::to_string(table.lines[i]));
    }
    return result;
}

/// A row of a CSV plan.
class PlanRow {
  public:
    PlanRow(const NumberTable& table, std::size_t row, const std::string& path)
        : table_(table), row_(row), place_(path + ":" + std::to_string(table.lines[row])) {}

    [[nodiscard]] const std::string& place() const { return place_; }
    [[nodiscard]] std::string place(std::string_view column) const {
        return place_ + ": column " + std::string(column);
    }
    /// None: no such column, or nothing in it.
    [[nodiscard]] std::optional<double> maybe(std::string_view column) const {
        const auto at = table_.find(column);
        if (!at || std::isnan(table_.rows[row_][*at])) return std::nullopt;
        return table_.rows[row_][*at];
    }
    /// None: no such column. Throws where there is nothing in it.
    [[nodiscard]] std::optional<double> number(std::string_view column) const {
        const auto value = maybe(column);
        if (!value && table_.find(column)) refuse(place(column), "nothing", "a number");
        return value;
    }
    [[nodiscard]] std::string word(std::string_view column) const {
        const auto at = table_.find(column);
        return at ? table_.words[row_][*at] : "";
    }

  private:
    const NumberTable& table_;
    std::size_t row_;
    std::string place_;
};

/// As take_profile() of JSON; what a sine would have may be 0 beside it.
bool take_profile(PlannedRun& run, const PlanRow& row) {
    const std::string profile = row.word("profile");
    const auto level = row.maybe("level_db");
    if (profile.empty() || profile == "0") {
        if (level && *level != 0)
            refuse(row.place("level_db"), number(*level), "a profile beside it");
        return false;
    }
    for (const char* other : {"frequency_hz", "level_g", "table_g"}) {
        if (const auto beside = row.maybe(other); beside && *beside != 0)
            refuse(row.place(other), number(*beside) + " beside a profile",
                   "level_db alone: the profile has frequencies and g");
    }
    run.profile = profile;
    run.profile_place = row.place("profile");
    take_level_db(run, level.value_or(0), row.place("level_db"));
    return true;
}

/// False: there is none.
bool take_sweep(PlannedRun& run, const PlanRow& row) {
    const auto from = row.maybe("sweep_from_hz"), to = row.maybe("sweep_to_hz"),
               seconds = row.maybe("sweep_s");
    if (from.value_or(0) == 0 && to.value_or(0) == 0 && seconds.value_or(0) == 0) return false;
    take_sweep(run, {from.value_or(0), to.value_or(0), seconds.value_or(0)},
               row.maybe("frequency_hz"), row.place("sweep_from_hz"));
    return true;
}

PlannedRun from_csv(const PlanRow& row, const std::array<double, 3>& position_deg,
                    const TransmissionAt& transmission) {
    PlannedRun run;
    run.position_deg = position_deg;
    if (const std::string role = row.word("role"); !role.empty() && role != "identify") {
        if (role != "verify")
            refuse(row.place("role"), "'" + proto::printable(role) + "'", "identify or verify");
        run.verify = true;
    }
    if (!take_profile(run, row)) {
        const bool swept = take_sweep(run, row);
        if (const auto hz = swept ? std::nullopt : row.number("frequency_hz"))
            take_frequency(run, *hz, row.place("frequency_hz"));
        join_levels(run, row.number("level_g"), row.number("table_g"), transmission, row.place());
    }
    if (const auto count = row.maybe("count")) {
        if (!(*count >= 1 && *count <= kMostRuns && *count == std::floor(*count)))
            refuse(row.place("count"), number(*count), kCounts);
        run.count = static_cast<std::size_t>(*count);
    }
    return run;
}

PlanFile plan_from_csv(const std::string& text, const std::string& path,
                       const TransmissionAt& transmission) {
    // Which of the levels a row needs depends on whether it has a profile.
    const TableForm form{{"alpha_deg", "beta_deg", "gamma_deg", "count"},
                         {"level_g", "table_g", "frequency_hz", "level_db", "sweep_from_hz",
                          "sweep_to_hz", "sweep_s"},
                         {"profile", "role"}};
    const NumberTable table = read_table(text, path, form);
    std::vector<std::string_view> known = form.numbers;
    known.insert(known.end(), form.maybe_numbers.begin(), form.maybe_numbers.end());
    known.insert(known.end(), form.words.begin(), form.words.end());
    refuse_unknown({table.names.begin(), table.names.end()}, known, true,
                   [&](const std::string& name) { return path + ":1: column " + name; });
    const auto positions = positions_of(table, path);
    PlanFile result{{}, {}, table.warning};
    for (std::size_t i = 0; i < positions.size(); ++i)
        result.runs.push_back(from_csv(PlanRow(table, i, path), positions[i], transmission));
    return result;
}

}  // namespace

void refuse_random(const std::vector<PlannedRun>& runs) {
    for (const PlannedRun& run : runs) {
        if (!run.profile.empty())
            refuse(run.profile_place, run.profile,
                   "a sine: random vibration is for vibrigd's campaigns");
    }
}

PlanFile read_plan_file(const std::string& path, const TransmissionAt& transmission,
                        std::optional<double> rig_hz) {
    const std::string text = content_of(path);
    const std::size_t first = text.find_first_not_of(" \t\r\n");
    PlanFile plan = first != std::string::npos && text[first] == '{'
                        ? runs_from_json(text, path, transmission, rig_hz)
                        : plan_from_csv(text, path, transmission);
    std::size_t sum = 0;
    for (const PlannedRun& run : plan.runs) sum += run.count;
    if (plan.runs.empty() || sum > kMostRuns) {
        refuse(path, std::to_string(sum) + " runs", "1 to " + std::to_string(kMostRuns));
    }
    return plan;
}

std::optional<PlanMount> read_plan_mount(const std::string& path) {
    // What is wrong with the file its reader says.
    const Json plan = Json::parse(content_of(path), nullptr, false);
    if (!plan.is_object()) return {};
    const auto ratio = [](const Json& of) -> std::optional<double> {
        const auto found = of.find("transmission");
        if (found == of.end() || !found->is_number() || !(found->get<double>() > 0)) return {};
        return found->get<double>();
    };
    const Json survey = plan.value("survey", Json());
    if (!survey.is_object()) {
        const auto stated = ratio(plan);
        return stated ? std::optional(PlanMount{*stated, 0}) : std::nullopt;
    }
    if (survey.value("mount", Json()) == "hard") return PlanMount{};
    const Json lines = survey.value("frequencies", Json());
    const Json first = lines.is_array() && !lines.empty() ? lines[0] : Json();
    if (!first.is_object() || !ratio(first) || !first.value("hz", Json()).is_number()) return {};
    return PlanMount{*ratio(first), first["hz"].get<double>()};
}

std::vector<std::array<double, 3>> read_positions(const std::string& path,
                                                  std::vector<std::string>& warnings) {
    const NumberTable table =
        read_table(content_of(path), path, {{"alpha_deg", "beta_deg", "gamma_deg"}});
    // It has these angles, too, in each of thousands of samples.
    if (table.find("time_s") && table.find("run"))
        refuse(path, "a recording (columns time_s and run)", "a position in each row");
    if (!table.warning.empty()) warnings.push_back(table.warning);
    return positions_of(table, path);
}

}  // namespace vibrig::plan
