#include "daemon/archive/entry.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <string_view>

#include "daemon/archive/manifest.hpp"
#include "daemon/archive/vibration.hpp"
#include "daemon/configuration/configuration.hpp"
#include "daemon/record/campaign_checks.hpp"
#include "daemon/record/campaign_file.hpp"
#include "daemon/record/disk.hpp"
#include "daemon/record/whole_campaign.hpp"
#include "drivers/sample/sample.hpp"

namespace vibrig::archive {

namespace {

using Json = nlohmann::json;

constexpr std::size_t kMostShown = 40;
constexpr double kNothing = std::numeric_limits<double>::quiet_NaN();

double number_in(const Json& object, const char* key) {
    const auto found = object.find(key);
    return found != object.end() && found->is_number() ? found->get<double>() : kNothing;
}

/// As the result says it; where it speaks of no other frequency, that of the configuration.
double at_hz_of(const Json& root, const Json& parameter, double frequency_hz) {
    if (!parameter.contains("at_hz"))
        return root.contains("spectrum") ? kAtNoFrequency : frequency_hz;
    const double said = number_in(parameter, "at_hz");
    return said >= 0 ? said : kAtNoFrequency;
}

/// Whether nothing shook in any dwell: what is known of quadratic coefficients is gravity's then.
bool at_rest(const Json& root) {
    const Json rates = root.value("dwell_rates", Json::array());
    return !rates.empty() && std::ranges::all_of(rates, [](const Json& rate) {
        return number_in(rate, "level") == 0;
    });
}

void take_coefficients(const Json& root, double frequency_hz, Entry& to) {
    if (at_rest(root)) frequency_hz = 0;
    const Json& list = root.at("parameters");
    for (std::size_t i = 0; i < std::min(list.size(), to.coefficients.size()); ++i) {
        const Json& one = list[i];
        const double value = number_in(one, "value"), sigma = number_in(one, "sigma");
        if (!std::isfinite(value) || !std::isfinite(sigma)) continue;
        Coefficient of{value, sigma, number_in(one, "u_a"), number_in(one, "u"),
                       number_in(one, "expanded")};
        if (!std::isfinite(of.u_a)) of.u_a = sigma;
        if (!std::isfinite(of.u)) of.u = of.u_a;
        if (!std::isfinite(of.expanded)) of.expanded = 2 * of.u;
        if (estimator::is_quadratic(i)) of.at_hz = at_hz_of(root, one, frequency_hz);
        to.coefficients[i] = of;
    }
    const char* const which =
        root.contains("covariance_combined") ? "covariance_combined" : "covariance";
    if (!root.contains(which)) return;
    for (std::size_t i = 0; i < root.at(which).size(); ++i)
        for (std::size_t j = 0; j <= i; ++j) {
            const Json& cell = root.at(which)[i].at(j);
            to.covariance.push_back(cell.is_number() ? cell.get<double>() : kNothing);
        }
}

void take_temperatures(const std::vector<record::ConditionRow>& rows,
                       std::map<std::string, std::vector<double>>& to) {
    for (const auto& row : rows) {
        if (std::isfinite(row.temperature_c)) to["inner"].push_back(row.temperature_c);
        for (std::size_t k = 0; k < row.sensor_c.size(); ++k)
            if (std::isfinite(row.sensor_c[k]))
                to[drivers::kTemperatureSensors[k]].push_back(row.sensor_c[k]);
    }
}

/// The frequency of its vibration, Hz.
double take_settings(const record::Campaign& part, Entry& to) {
    const auto settings =
        configuration::parse(record::identification_sections(part.head.configuration),
                             "configuration in " + part.path, false)
            .configuration;
    to.unit_type = settings.paperwork.unit_type;
    to.unit_serial = settings.paperwork.unit_serial;
    to.instruments.clear();
    for (const auto& i : settings.paperwork.instruments)
        to.instruments.push_back({i.name, i.serial, i.certificate, i.due});
    const auto& noise = settings.estimator;
    to.noise = {{"configured angle, arcsec", noise.resolver_arcsec},
                {"configured random walk, deg/sqrt(h)", noise.gyro_random_walk_deg_per_rt_h}};
    return settings.estimator.frequency_hz;
}

}  // namespace

void take_result(const std::string& result_json, double frequency_hz, Entry& to) {
    if (result_json.empty()) return;
    const Json root = Json::parse(result_json, nullptr, false);
    if (!root.is_object())
        throw ArchiveError(fmt::format("/result: found {}, expected the JSON of a result",
                                       record::shown(result_json.substr(0, kMostShown))));
    try {
        take_coefficients(root, frequency_hz, to);
        to.nis = std::max(0.0, number_in(root, "nis"));
        if (root.contains("verdict")) {
            to.verdict = root.at("verdict").value("word", "");
            to.sentence = root.at("verdict").value("sentence", "");
        }
        if (root.contains("identified_anew")) {
            const Json& noise = root.at("identified_anew").at("noise");
            to.noise.emplace_back("found angle, arcsec", number_in(noise, "angle_arcsec"));
            const Json& walk = noise.at("gyro_random_walk_deg_per_rt_h");
            for (std::size_t i = 0; i < walk.size(); ++i)
                to.noise.emplace_back(
                    fmt::format("found random walk {}, deg/sqrt(h)", "xyz"[std::min(i, 2UL)]),
                    walk[i].get<double>());
        }
    } catch (const Json::exception& error) {
        // The library's own number stands before a bracket.
        const std::string_view words = error.what();
        const std::size_t end = words.find("] ");
        throw ArchiveError("/result: expected a result of vibrigd: " +
                           std::string(words.substr(end == words.npos ? 0 : end + 2)));
    }
}

Entry read_entry(const std::string& folder) {
    Entry entry = read_recorded(folder);
    entry.files = list_files(folder);
    entry.hash = campaign_hash(entry.files);
    return entry;
}

Entry read_recorded(const std::string& folder) {
    const auto parts = record::part_files(folder);
    if (parts.empty())
        throw ArchiveError(folder + ": found no campaign.h5 in it, expected a campaign's folder");
    Entry entry;
    std::map<std::string, std::vector<double>> degrees;
    std::string result;
    double frequency_hz = 0;
    const record::WholeCampaign whole(
        folder, record::read_part_head(parts.begin()->second).head.campaign, parts);
    for (const auto& [number, path] : parts) {
        if (record::WriterLock::held(path))
            throw ArchiveError(path + ": is being written; a campaign is archived when it is over");
        const record::Campaign part = record::read_part_around(path);
        if (part.state == "running")
            throw ArchiveError(path +
                               ": found the state \"running\" and nobody who writes it, "
                               "expected a closed file: vibrig recover " +
                               folder);
        whole.check(number, part);
        if (entry.name.empty()) {
            entry.key = part.head.campaign;
            entry.name = part.head.name;
            entry.started_by = part.head.started_by;
            entry.started_utc_ns = part.head.utc_ns;
            entry.simulated = part.head.simulated;
        }
        entry.state = part.state;
        entry.reason = part.reason;
        entry.mark = part.mark;
        entry.ended_utc_ns = part.ended_utc_ns;
        entry.version = part.head.version;
        entry.compiler = part.head.compiler;
        entry.instruction_set = part.head.instruction_set;
        entry.configuration_hash = part.head.configuration_hash;
        entry.dwells += static_cast<std::int64_t>(part.parts.front().dwells);
        frequency_hz = take_settings(part, entry);
        take_temperatures(part.conditions, degrees);
        result = part.result_json;
    }
    whole.check_end(entry.state);
    try {
        if (result.empty() && entry.state == "finished")
            throw ArchiveError("/result: found nothing, expected that of a finished campaign");
        take_result(result, frequency_hz, entry);
    } catch (const ArchiveError& error) {
        throw ArchiveError(parts.rbegin()->second + ": " + error.what());
    }
    for (const auto& [sensor, of] : degrees) {
        double sum = 0;
        for (const double t : of) sum += t;
        entry.temperatures.push_back({sensor, sum / static_cast<double>(of.size()),
                                      *std::ranges::min_element(of),
                                      *std::ranges::max_element(of)});
    }
    return entry;
}

}  // namespace vibrig::archive
