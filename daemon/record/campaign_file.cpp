#include "daemon/record/campaign_file.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <limits>
#include <set>
#include <sstream>

#include "daemon/record/campaign_writer.hpp"
#include "daemon/record/hdf5.hpp"

namespace vibrig::record {

namespace fs = std::filesystem;
using hdf5::Array;
using hdf5::File;

namespace {

constexpr std::size_t kCoefficients = estimator::kParameters;
constexpr double kNotKnown = std::numeric_limits<double>::quiet_NaN();

/// Columns of one table; as long as the shortest, since a reader may come between two columns.
class Columns {
  public:
    Columns(const File& file, std::string group) : file_(file), group_(std::move(group)) {}

    std::vector<double> doubles(const char* name, std::size_t width = 1) {
        auto found = file_.doubles(group_ + "/" + name);
        check(name, found.dimensions, width);
        return std::move(found.values);
    }
    std::vector<std::int64_t> integers(const char* name, std::size_t width = 1) {
        auto found = file_.integers(group_ + "/" + name);
        check(name, found.dimensions, width);
        const auto end = std::ranges::find(found.values, hdf5::kUnwritten);
        rows_ = std::min(rows_, static_cast<std::size_t>(end - found.values.begin()) / width);
        return std::move(found.values);
    }
    /// A column that older files do not have: empty then.
    std::vector<double> doubles_if_any(const char* name) {
        return file_.has(group_ + "/" + name) ? doubles(name) : std::vector<double>{};
    }
    auto integers_if_any(const char* name) {
        return file_.has(group_ + "/" + name) ? integers(name) : decltype(integers(name)){};
    }
    std::vector<std::string> texts(const char* name) {
        auto found = file_.texts(group_ + "/" + name);
        rows_ = std::min(rows_, found.size());
        return found;
    }
    [[nodiscard]] std::size_t rows() const { return rows_; }

  private:
    void check(const char* name, const std::vector<std::size_t>& dimensions, std::size_t width) {
        std::size_t found = 1;
        for (std::size_t i = 1; i < dimensions.size(); ++i) found *= dimensions[i];
        if (dimensions.empty() || found != width)
            throw hdf5::Error(fmt::format("{}: {}/{}: found {} numbers in a row, expected {}",
                                          file_.path(), group_, name, found, width));
        rows_ = std::min(rows_, dimensions[0]);
    }

    const File& file_;
    std::string group_;
    std::size_t rows_ = static_cast<std::size_t>(-1);
};

template <std::size_t N>
std::array<double, N> row(const std::vector<double>& values, std::size_t index) {
    std::array<double, N> out;
    std::copy_n(values.begin() + static_cast<std::ptrdiff_t>(index * N), N, out.begin());
    return out;
}

void read_samples(const File& file, Campaign& to) {
    Columns c(file, "/samples");
    const auto time = c.integers("time_ns"), sequence = c.integers("sequence"),
               lost = c.integers("lost_before"),
               quality = c.integers("quality", drivers::kChannels);
    const auto angle = c.doubles("angle_rad", 3), force = c.doubles("force_g", 3),
               table = c.doubles("table_accel_g");
    to.samples.resize(c.rows());
    for (std::size_t i = 0; i < c.rows(); ++i) {
        drivers::Sample& s = to.samples[i];
        s.time = time[i];
        s.sequence = static_cast<std::uint32_t>(sequence[i]);
        s.dropped_before = static_cast<std::uint32_t>(lost[i]);
        s.angle = row<3>(angle, i);
        s.force = row<3>(force, i);
        s.table_accel = table[i];
        for (std::size_t k = 0; k < drivers::kChannels; ++k) {
            const auto q = quality[i * drivers::kChannels + k];
            // Anything unknown is not good.
            s.quality[k] =
                q >= 0 && q <= 5 ? static_cast<drivers::Quality>(q) : drivers::Quality::flagged;
        }
    }
}

void read_orders(const File& file, Campaign& to) {
    Columns c(file, "/orders");
    const auto announced = c.integers("announced_ns"), from = c.integers("from_ns"),
               until = c.integers("to_ns"), run = c.integers("run"),
               position = c.integers("position"), cancel = c.integers("cancel");
    const auto table = c.doubles("table_g"), zero = c.doubles("zero_g", 3),
               level = c.doubles("level_sigma_g"), angle = c.doubles("noise_angle_arcsec"),
               walk = c.doubles("noise_walk", 3), begin = c.doubles_if_any("begin_s"),
               frequency = c.doubles_if_any("frequency_hz");
    const auto power = c.integers_if_any("power_lost"), held_out = c.integers_if_any("held_out"),
               profile = c.integers_if_any("profile");
    const auto level_db = c.doubles_if_any("level_db"),
               square = c.doubles_if_any("random_mean_square_g2"),
               bandwidth = c.doubles_if_any("random_bandwidth_hz"),
               gain = c.doubles_if_any("random_gain_error"),
               highest = c.doubles_if_any("random_highest_hz");
    const auto random = [&](std::size_t i) -> estimator::RandomVibration {
        if (i >= std::min({profile.size(), level_db.size(), square.size(), bandwidth.size(),
                           gain.size(), highest.size()}))
            return {};
        return {
            square[i],  bandwidth[i], gain[i], highest[i], static_cast<std::uint16_t>(profile[i]),
            level_db[i]};
    };
    const auto sweep_from = c.doubles_if_any("sweep_from_hz"),
               sweep_to = c.doubles_if_any("sweep_to_hz"), sweep_s = c.doubles_if_any("sweep_s");
    const auto sweep = [&](std::size_t i) -> estimator::SweptSine {
        if (i >= std::min({sweep_from.size(), sweep_to.size(), sweep_s.size()})) return {};
        return {sweep_from[i], sweep_to[i], sweep_s[i]};
    };
    for (std::size_t i = 0; i < c.rows(); ++i) {
        to.orders.push_back({announced[i],
                             from[i],
                             until[i],
                             static_cast<int>(run[i]),
                             static_cast<int>(position[i]),
                             table[i],
                             cancel[i] != 0,
                             row<3>(zero, i),
                             level[i],
                             {angle[i], row<3>(walk, i)},
                             i < begin.size() ? begin[i] : kNotKnown,
                             i < power.size() && power[i] != 0,
                             i < frequency.size() ? frequency[i] : 0,
                             i < held_out.size() && held_out[i] != 0,
                             random(i),
                             sweep(i),
                             std::nullopt,
                             {}});
    }
}

/// Recordings made before there were any have none.
void read_played(const File& file, Campaign& to) {
    if (!file.has("/played")) return;
    Columns c(file, "/played"), lines(file, "/psd_lines");
    const auto from = c.integers("from_ns"), run = c.integers("run"),
               position = c.integers("position"), word = c.integers("word");
    const auto square = c.doubles("mean_square_g2"), bandwidth = c.doubles("bandwidth_hz"),
               gain = c.doubles("gain_error"), highest = c.doubles("highest_hz"),
               share = c.doubles("seen_share"), error = c.doubles("seen_error");
    const auto of = lines.integers("from_ns");
    const auto hz = lines.doubles("frequency_hz"), density = lines.doubles("psd_g2_hz");
    using Word = estimator::PlayedRandom::Word;
    for (std::size_t i = 0; i < c.rows(); ++i) {
        Played played{from[i],
                      static_cast<std::int32_t>(run[i]),
                      static_cast<std::int32_t>(position[i]),
                      // Anything unknown is not good.
                      {word[i] == 0 || word[i] == 1 ? static_cast<Word>(word[i]) : Word::refused,
                       {square[i], bandwidth[i], gain[i], highest[i]},
                       {share[i], error[i]}},
                      {}};
        for (std::size_t k = 0; k < of.size(); ++k)
            if (of[k] == from[i]) played.psd.push_back({hz[k], density[k]});
        to.played.push_back(std::move(played));
    }
    place_played(to);
}

/// Recordings made before there were any have none.
void read_swept(const File& file, Campaign& to) {
    if (!file.has("/sweeps")) return;
    Columns c(file, "/sweeps");
    const auto time = c.integers("time_ns"), run = c.integers("run"),
               position = c.integers("position");
    const auto hz = c.doubles("frequency_hz");
    for (std::size_t i = 0; i < c.rows(); ++i)
        to.swept.push_back({time[i], static_cast<std::int32_t>(run[i]),
                            static_cast<std::int32_t>(position[i]), hz[i]});
}

void read_dwells(const File& file, Campaign& to) {
    Columns c(file, "/dwells");
    const auto time = c.integers("time_ns"), run = c.integers("run"),
               position = c.integers("position"), samples = c.integers("samples"),
               used = c.integers("used"), rejected = c.integers("rejected"),
               reinitialised = c.integers("reinitialised"), flagged = c.integers("flagged"),
               observable = c.integers("observable", kCoefficients);
    const auto kappa = c.doubles("kappa"), amplitude = c.doubles("amplitude_g"),
               frequency = c.doubles("frequency_hz"), force = c.doubles("mean_force_g"),
               nis = c.doubles("nis_per_dof"), correlation = c.doubles("innovation_correlation"),
               value = c.doubles("value", kCoefficients), sigma = c.doubles("sigma", kCoefficients),
               covariance = c.doubles("covariance", kCoefficients * kCoefficients);
    const auto reason = c.texts("reason");
    for (std::size_t i = 0; i < c.rows(); ++i) {
        Dwell d;
        d.time = time[i];
        auto& s = d.summary;
        s.run = static_cast<int>(run[i]);
        s.position = static_cast<int>(position[i]);
        s.samples = static_cast<std::uint32_t>(samples[i]);
        s.used = static_cast<std::uint32_t>(used[i]);
        s.rejected = static_cast<std::uint32_t>(rejected[i]);
        s.reinitialised = static_cast<std::uint32_t>(reinitialised[i]);
        s.kappa = kappa[i];
        s.amplitude_g = amplitude[i];
        s.frequency_hz = frequency[i];
        s.mean_force_g = force[i];
        s.nis_per_dof = nis[i];
        s.innovation_correlation = correlation[i];
        s.flagged = flagged[i] != 0;
        d.reason = reason[i];
        d.value = row<kCoefficients>(value, i);
        d.sigma = row<kCoefficients>(sigma, i);
        for (std::size_t k = 0; k < kCoefficients; ++k)
            d.observable[k] = observable[i * kCoefficients + k] != 0;
        d.covariance.assign(
            covariance.begin() + static_cast<std::ptrdiff_t>(i * kCoefficients * kCoefficients),
            covariance.begin() +
                static_cast<std::ptrdiff_t>((i + 1) * kCoefficients * kCoefficients));
        to.dwells.push_back(std::move(d));
    }
}

void read_estimates(const File& file, Campaign& to) {
    Columns c(file, "/estimates");
    const auto time = c.integers("time_ns");
    const auto amplitude = c.doubles("amplitude_g"), frequency = c.doubles("frequency_hz"),
               kappa = c.doubles("kappa"), nis = c.doubles("nis_per_dof"),
               innovation = c.doubles("innovation_arcsec", 3),
               value = c.doubles("value", kCoefficients), sigma = c.doubles("sigma", kCoefficients);
    for (std::size_t i = 0; i < c.rows(); ++i) {
        to.estimates.push_back({time[i], amplitude[i], frequency[i], kappa[i], nis[i],
                                row<3>(innovation, i), row<kCoefficients>(value, i),
                                row<kCoefficients>(sigma, i)});
    }
}

std::size_t width_of(const File& file, const std::string& name) {
    const auto dimensions = file.doubles(name).dimensions;
    return dimensions.size() == 2 ? dimensions[1] : 1;
}

/// Recordings made before there were any have none.
void read_conditions(const File& file, Campaign& to) {
    if (!file.has("/conditions")) return;
    Columns c(file, "/conditions");
    constexpr std::size_t kSensors = drivers::kTemperatureSensors.size();
    const auto time = c.integers("time_ns"), state = c.integers("shaker_state");
    const auto temperature = c.doubles("temperature_c"), sensor = c.doubles("sensor_c", kSensors),
               command = c.doubles("command_g"), command_hz = c.doubles("command_hz"),
               set_point = c.doubles("set_point_g"), set_point_hz = c.doubles("set_point_hz"),
               measured = c.doubles("measured_g"), platform = c.doubles("witness_platform_g"),
               table = c.doubles("witness_table_g");
    constexpr std::array<std::int8_t ConditionRow::*, 8> kFlags{
        &ConditionRow::shaker_running, &ConditionRow::emergency_stop_open,
        &ConditionRow::ready,          &ConditionRow::loop_closed,
        &ConditionRow::gyros_at_speed, &ConditionRow::fault,
        &ConditionRow::in_position,    &ConditionRow::slewing};
    std::vector<std::vector<std::int64_t>> flags;
    for (const char* name : {"shaker_running", "emergency_stop_open", "ready", "loop_closed",
                             "gyros_at_speed", "fault", "in_position", "slewing"})
        flags.push_back(c.integers(name));
    const bool rows = file.has("/conditions/interlock_value");
    const std::size_t width = rows ? width_of(file, "/conditions/interlock_value") : 0;
    const auto value = rows ? c.doubles("interlock_value", width) : std::vector<double>{};
    const auto raised = rows ? c.integers("interlock_raised", width) : std::vector<std::int64_t>{};
    for (std::size_t i = 0; i < c.rows(); ++i) {
        ConditionRow at;
        at.time = time[i];
        at.temperature_c = temperature[i];
        at.sensor_c = row<kSensors>(sensor, i);
        at.command_g = command[i];
        at.command_hz = command_hz[i];
        at.set_point_g = set_point[i];
        at.set_point_hz = set_point_hz[i];
        at.measured_g = measured[i];
        at.witness_platform_g = platform[i];
        at.witness_table_g = table[i];
        at.shaker_state = static_cast<std::int32_t>(state[i]);
        for (std::size_t k = 0; k < kFlags.size(); ++k)
            at.*kFlags[k] = static_cast<std::int8_t>(flags[k][i]);
        for (std::size_t k = i * width; k < (i + 1) * width; ++k) {
            at.interlock_value.push_back(value[k]);
            at.interlock_raised.push_back(static_cast<std::uint8_t>(raised[k]));
        }
        to.conditions.push_back(std::move(at));
    }
}

Severity severity_of(const std::string& word) {
    for (const Severity s : {Severity::warning, Severity::alarm, Severity::trip}) {
        if (word == name_of(s)) return s;
    }
    return Severity::info;
}

void read_events(const File& file, Campaign& to) {
    Columns c(file, "/events");
    const auto time = c.integers("time_ns"), utc = c.integers("utc_ns");
    const auto severity = c.texts("severity"), source = c.texts("source"), text = c.texts("text");
    for (std::size_t i = 0; i < c.rows(); ++i) {
        EventRecord event;
        event.id = i + 1;
        event.time = time[i];
        event.utc_ns = utc[i];
        event.severity = severity_of(severity[i]);
        event.source = source[i];
        event.text = text[i];
        to.events.push_back(std::move(event));
    }
}

void read_gaps(const File& file, Campaign& to) {
    Columns c(file, "/gaps");
    const auto from = c.integers("from_ns"), until = c.integers("to_ns"), lost = c.integers("lost");
    const auto stream = c.texts("stream"), reason = c.texts("reason");
    for (std::size_t i = 0; i < c.rows(); ++i) {
        to.gaps.push_back(
            {from[i], until[i], stream[i], static_cast<std::uint64_t>(lost[i]), reason[i]});
    }
}

void read_head(const File& file, Campaign& to) {
    std::string format;
    try {
        format = file.text("/", "format");
    } catch (const hdf5::Error&) {
    }
    if (format != "vibrig-campaign")
        throw hdf5::Error(to.path + ": attribute format: found " +
                          (format.empty() ? "nothing" : "\"" + format + "\"") +
                          ", expected \"vibrig-campaign\"");
    if (const auto version = file.number("/", "format_version"); version != kFormatVersion)
        throw hdf5::Error(fmt::format("{}: format_version: found {}, expected {}", to.path, version,
                                      kFormatVersion));
    Head& head = to.head;
    head.name = file.text("/", "name");
    head.started_by = file.text("/", "started_by");
    head.utc_ns = file.number("/", "started_utc_ns");
    head.utc_offset_ns = file.number("/", "utc_offset_ns");
    head.clock = file.text("/", "clock");
    head.version = file.text("/", "version");
    head.compiler = file.text("/", "compiler");
    head.instruction_set = file.text("/", "instruction_set");
    head.configuration_hash = file.text("/", "configuration_hash");
    head.dwells_before = static_cast<std::size_t>(file.number("/", "dwells_before"));
    head.campaign = file.text("/", "campaign");
    head.part = static_cast<int>(file.number("/", "part"));
    head.restart = file.number("/", "restart") != 0;
    head.configuration = file.read_text("/configuration");
    head.dbc = file.read_text("/dbc");
    head.plan = file.read_text("/plan");
    try {
        head.simulated = file.number("/", "simulated") != 0;
    } catch (const hdf5::Error&) {  // of vibrigd 0.1.0
        head.simulated = of_simulated_rig(head.configuration);
    }
    if (file.has("/interlocks")) head.interlocks = file.read_text("/interlocks");
    if (file.has("/proof")) head.proof = file.read_text("/proof");
    try {
        head.journal_head = file.text("/", "journal_head");
    } catch (const hdf5::Error&) {  // of a daemon that kept no journal, or of one that signed none
    }
    to.state = file.text("/", "state");
    if (to.state != "running") {
        to.reason = file.text("/", "reason");
        to.ended_utc_ns = file.number("/", "ended_utc_ns");
        to.mark = file.text("/", "mark");
    }
    if (file.has("/result")) to.result_json = file.read_text("/result");
}

}  // namespace

bool of_simulated_rig(const std::string& configuration) {
    std::istringstream lines(configuration);
    for (std::string line; std::getline(lines, line);) {
        std::istringstream words(line);
        std::string key, equals, value;
        if (!(words >> key >> equals >> value)) continue;
        if (key == "commission.simulated" && value == "true") return true;
        if (key == "clock.source" && value == "\"rig\"") return true;
    }
    return false;
}

void place_played(Campaign& campaign) {
    for (Order& order : campaign.orders) {
        if (order.cancel || order.played) continue;
        const auto found = std::ranges::find_if(campaign.played, [&order](const Played& one) {
            return one.from == order.from && one.run == order.run && one.position == order.position;
        });
        if (found == campaign.played.end()) continue;
        order.played = found->random;
        order.played->random.profile = order.random.profile;
        order.played->random.level_db = order.random.level_db;
        order.psd = found->psd;
    }
}

bool is_hdf5(const std::string& path) {
    std::array<char, 8> head{};
    std::ifstream file(path, std::ios::binary);
    file.read(head.data(), head.size());
    constexpr std::array<char, 8> kSignature{'\x89', 'H', 'D', 'F', '\r', '\n', '\x1a', '\n'};
    return file.good() && head == kSignature;
}

Campaign read_part(const std::string& path) {
    Campaign campaign;
    campaign.path = path;
    campaign.folder = folder_of(path);
    const File file = File::open(campaign.path, File::Mode::read);
    read_head(file, campaign);
    read_samples(file, campaign);
    read_orders(file, campaign);
    read_played(file, campaign);
    read_dwells(file, campaign);
    read_swept(file, campaign);
    read_estimates(file, campaign);
    read_events(file, campaign);
    read_gaps(file, campaign);
    read_conditions(file, campaign);
    return campaign;
}

Campaign read_part_head(const std::string& path) {
    Campaign campaign;
    campaign.path = path;
    campaign.folder = folder_of(path);
    read_head(File::open(path, File::Mode::read), campaign);
    return campaign;
}

Campaign read_part_around(const std::string& path) {
    Campaign campaign;
    campaign.path = path;
    campaign.folder = folder_of(path);
    const File file = File::open(path, File::Mode::read);
    read_head(file, campaign);
    read_conditions(file, campaign);
    campaign.parts = {{path, campaign.state, 0, file.rows("/dwells/time_ns")}};
    return campaign;
}

Span part_span(const std::string& path) {
    const auto times = File::open(path, File::Mode::read).integers("/samples/time_ns").values;
    if (times.empty()) return {};
    return {times.front(), times.back(), times.size()};
}

std::string identification_sections(const std::string& configuration) {
    static const std::set<std::string> kSections{
        "site",        "vibration", "platform", "accelerometer", "noise",    "estimator",
        "uncertainty", "drift",     "unit",     "instrument",    "spectrum", "profile"};
    std::istringstream lines(configuration);
    std::string kept;
    for (std::string line; std::getline(lines, line);) {
        if (kSections.contains(line.substr(0, line.find_first_of(". =")))) kept += line + "\n";
    }
    return kept;
}

}  // namespace vibrig::record
