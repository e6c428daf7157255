#include "tests/plant/truth.hpp"

#include <cmath>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <numbers>
#include <optional>
#include <set>
#include <sstream>

#include "proto/durable_file.hpp"
#include "proto/json_file.hpp"
#include "tests/plant/input_file.hpp"
#include "tests/plant/truth_fields.hpp"

namespace vibrig::plant {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::array<const char*, 3> kGimbalNames{"outer", "inner", "azimuth"};
constexpr std::array<std::string_view, 3> kAmplitudeUnits{"g_peak", "g_rms", "mps2_peak"};
constexpr std::array<std::string_view, 7> kAngleUnits{"deg", "turn",  "rad", "arcmin",
                                                      "gon", "twice", "half"};

std::string text_of(const Json& json) {
    std::string text = json.dump();
    return text.size() > 60 ? text.substr(0, 57) + "..." : text;
}

struct Reader {
    const Json& root;
    const std::string& file;
    std::map<std::string, std::set<std::string>> known{};

    [[noreturn]] void fail(const std::string& key, const std::string& what) const {
        throw PlantError(file + ": " + key + ": " + what);
    }
    void number(const std::string& key, const Json& json, double& value, double low,
                double high) const {
        if (!json.is_number() || !std::isfinite(json.get<double>()) || json.get<double>() < low ||
            json.get<double>() > high) {
            std::ostringstream range;
            range << "a number from " << low << " to " << high;
            fail(key, "found " + text_of(json) + ", expected " + range.str());
        }
        value = json.get<double>();
    }
    void value(const std::string& key, const Json& json, double& out, double low,
               double high) const {
        number(key, json, out, low, high);
    }
    void value(const std::string& key, const Json& json, int& out, int low, int high) const {
        if (!json.is_number_integer() || json.get<double>() < low || json.get<double>() > high ||
            (low == -1 && json.get<int>() == 0)) {
            fail(key, "found " + text_of(json) + ", expected " +
                          (low == -1 ? std::string("-1 or 1")
                                     : "a whole number from " + std::to_string(low) + " to " +
                                           std::to_string(high)));
        }
        out = json.get<int>();
    }
    void value(const std::string& key, const Json& json, bool& out, int, int) const {
        if (!json.is_boolean()) fail(key, "found " + text_of(json) + ", expected true or false");
        out = json.get<bool>();
    }
    void value(const std::string& key, const Json& json, std::string& out, int, int) const {
        if (!json.is_string())
            fail(key, "found " + text_of(json) + ", expected the name of a file, or \"\"");
        out = json.get<std::string>();
    }
    void value(const std::string& key, const Json& json, Axis& out, int, int) const {
        const std::string text = json.is_string() ? json.get<std::string>() : std::string();
        if (text.size() != 2 || (text[0] != '+' && text[0] != '-') || text[1] < 'x' ||
            text[1] > 'z') {
            fail(key, "found " + text_of(json) + ", expected an axis such as \"+y\"");
        }
        out = {text[1] - 'x', text[0] == '+' ? 1 : -1};
    }
    void value(const std::string& key, const Json& json, GimbalAxis& out, int, int) const {
        for (std::size_t i = 0; i < kGimbalNames.size(); ++i) {
            if (json == kGimbalNames[i]) {
                out = static_cast<GimbalAxis>(i);
                return;
            }
        }
        fail(key, "found " + text_of(json) + ", expected \"outer\", \"inner\" or \"azimuth\"");
    }
    void value(const std::string& key, const Json& json, AmplitudeUnit& out, int, int) const {
        const auto* const at = std::ranges::find(kAmplitudeUnits, json);
        if (at == kAmplitudeUnits.end())
            fail(key,
                 "found " + text_of(json) + ", expected \"g_peak\", \"g_rms\" or \"mps2_peak\"");
        out = static_cast<AmplitudeUnit>(at - kAmplitudeUnits.begin());
    }
    void value(const std::string& key, const Json& json, AngleUnit& out, int, int) const {
        const auto* const at = std::ranges::find(kAngleUnits, json);
        if (at == kAngleUnits.end())
            fail(key, "found " + text_of(json) +
                          ", expected \"deg\", \"turn\", \"rad\", \"arcmin\", \"gon\", \"twice\" "
                          "or \"half\"");
        out = static_cast<AngleUnit>(at - kAngleUnits.begin());
    }
    void value(const std::string& key, const Json& json, std::uint16_t& out, int low,
               int high) const {
        int number = 0;
        value(key, json, number, low, high);
        out = static_cast<std::uint16_t>(number);
    }
    template <class T, class Low>
    void value(const std::string& key, const Json& json, std::optional<T>& out, Low low,
               Low high) const {
        out.reset();
        if (!json.is_null()) value(key, json, out.emplace(), low, high);
    }
    template <class T, std::size_t N, class Low>
    void value(const std::string& key, const Json& json, std::array<T, N>& out, Low low,
               Low high) const {
        if (!json.is_array() || json.size() != N) {
            fail(key,
                 "found " + text_of(json) + ", expected a list of " + (N == 2 ? "two" : "three"));
        }
        for (std::size_t i = 0; i < N; ++i) {
            value(key + "[" + std::to_string(i) + "]", json[i], out[i], low, high);
        }
    }
    template <class T, class Low>
    void operator()(const char* section, const char* name, T& out, Low low, Low high) {
        known[section].insert(name);
        const auto group = root.find(section);
        if (group == root.end()) return;
        if (!group->is_object()) fail(section, "found " + text_of(*group) + ", expected an object");
        const auto entry = group->find(name);
        if (entry != group->end()) value(std::string(section) + "." + name, *entry, out, low, high);
    }
};

struct Writer {
    Json& root;

    static Json json(double v) { return v; }
    static Json json(int v) { return v; }
    static Json json(bool v) { return v; }
    static Json json(std::uint16_t v) { return v; }
    static Json json(const std::string& v) { return v; }
    static Json json(AmplitudeUnit v) { return kAmplitudeUnits[static_cast<std::size_t>(v)]; }
    static Json json(AngleUnit v) { return kAngleUnits[static_cast<std::size_t>(v)]; }
    static Json json(GimbalAxis v) { return kGimbalNames[static_cast<std::size_t>(v)]; }
    template <class T>
    static Json json(const std::optional<T>& v) {
        return v ? json(*v) : Json(nullptr);
    }
    static Json json(const Axis& axis) {
        return std::string(axis.sign > 0 ? "+" : "-") + static_cast<char>('x' + axis.index);
    }
    template <class T, std::size_t N>
    static Json json(const std::array<T, N>& list) {
        Json out = Json::array();
        for (const T& entry : list) out.push_back(json(entry));
        return out;
    }
    template <class T, class Low>
    void operator()(const char* section, const char* name, const T& value, Low, Low) {
        root[section][name] = json(value);
    }
};

template <class Set>
std::string joined(const Set& names) {
    std::string text;
    for (const std::string& name : names) text += (text.empty() ? "" : ", ") + name;
    return text;
}

void read_coefficients(const Json& root, const std::string& file, Truth& truth) {
    const auto group = root.find("coefficients");
    if (group == root.end() || !group->is_object()) {
        throw PlantError(file + ": coefficients: missing, expected an object with D_Fx ... D_OSz");
    }
    std::set<std::string> names;
    for (std::size_t gyro = 0; gyro < 3; ++gyro) {
        for (std::size_t term = 0; term < kTerms; ++term) {
            const std::string name = coefficient_name(gyro, term);
            names.insert(name);
            const auto entry = group->find(name);
            if (entry == group->end()) {
                throw PlantError(file + ": coefficients." + name +
                                 ": missing, expected a number in " +
                                 std::string(coefficient_unit(term)));
            }
            if (!entry->is_number() || !(std::abs(entry->get<double>()) <= 1000)) {
                throw PlantError(file + ": coefficients." + name + ": found " + text_of(*entry) +
                                 ", expected a number from -1000 to 1000");
            }
            truth.coefficients[gyro][term] = entry->get<double>();
        }
    }
    for (const auto& [key, value] : group->items()) {
        if (!names.contains(key)) {
            throw PlantError(file + ": coefficients." + key +
                             ": unknown key, expected D_Fx ... D_OSz");
        }
    }
}

/// shaker.profiles: [{"number", "psd": [[hz, g2_hz], ..]}, ..].
void read_profiles(const Json& root, Reader& reader, Truth& truth) {
    reader.known["shaker"].insert("profiles");
    const auto shaker = root.find("shaker");
    if (shaker == root.end() || !shaker->contains("profiles")) return;
    const Json& list = (*shaker)["profiles"];
    const std::string key = "shaker.profiles";
    if (!list.is_array()) reader.fail(key, "found " + text_of(list) + ", expected a list");
    for (std::size_t i = 0; i < list.size(); ++i) {
        const std::string at = key + "[" + std::to_string(i) + "]";
        ShakerProfile profile;
        if (!list[i].is_object() || list[i].size() != 2 || !list[i].contains("psd") ||
            !list[i].contains("number"))
            reader.fail(at, "found " + text_of(list[i]) + ", expected {number, psd}");
        reader.value(at + ".number", list[i]["number"], profile.number, 1, 65535);
        const Json& psd = list[i]["psd"];
        if (!psd.is_array() || psd.size() < 2)
            reader.fail(at + ".psd", "found " + text_of(psd) + ", expected [[hz, g2_hz], ..]");
        for (std::size_t k = 0; k < psd.size(); ++k) {
            const std::string point = at + ".psd[" + std::to_string(k) + "]";
            std::array<double, 2> pair{};
            reader.value(point, psd[k], pair, 1e-9, 1e6);
            if (k > 0 && !(pair[0] > profile.psd.back().first))
                reader.fail(point, "found " + text_of(psd[k]) + ", expected growing frequencies");
            profile.psd.emplace_back(pair[0], pair[1]);
        }
        truth.profiles.push_back(std::move(profile));
    }
}

void check(const Truth& truth, const std::string& file) {
    for (std::size_t gyro = 0; gyro < 3; ++gyro) {
        std::array<bool, 3> used{};
        for (const Axis& axis : truth.gyro_axes[gyro])
            used[static_cast<std::size_t>(axis.index)] = true;
        if (!(used[0] && used[1] && used[2])) {
            throw PlantError(file + ": platform.gyro_" +
                             std::string(1, static_cast<char>('x' + gyro)) +
                             "_axes: an axis is used twice, expected each of x, y, z once");
        }
    }
    const auto each_once = [&](const std::array<GimbalAxis, 3>& list, const char* key) {
        if (list[0] == list[1] || list[1] == list[2] || list[0] == list[2])
            throw PlantError(file + ": " + key + ": a gimbal is there twice, expected each once");
    };
    each_once(truth.channel, "platform.channel");
    each_once(truth.command_channel, "platform.command_channel");
    if (truth.latency_s * truth.sample_rate_hz > 1) {
        throw PlantError(file + ": accelerometer.latency_s: found " +
                         std::to_string(truth.latency_s) +
                         ", expected at most the period of platform.sample_rate_hz");
    }
    if ((truth.latency_s + 1e-3 * truth.accelerometer_skew_ms) * truth.sample_rate_hz > 1) {
        throw PlantError(file + ": accelerometer.skew_ms: found " +
                         std::to_string(truth.accelerometer_skew_ms) +
                         ", expected with accelerometer.latency_s at most the period of "
                         "platform.sample_rate_hz");
    }
    if (std::abs(determinant(truth.matrix)) < 0.1) {
        throw PlantError(file +
                         ": accelerometer.matrix: singular, expected three independent axes");
    }
}

}  // namespace

double per_degree(AngleUnit unit) noexcept {
    constexpr std::array kPerDegree{1.0, 1 / 360.0, std::numbers::pi / 180, 60.0, 400 / 360.0,
                                    2.0, 0.5};
    return kPerDegree[static_cast<std::size_t>(unit)];
}

std::string coefficient_name(std::size_t gyro, std::size_t term) {
    return std::string("D_") + kTermNames.at(term) + static_cast<char>('x' + gyro);
}

std::string_view coefficient_unit(std::size_t term) noexcept {
    return term == kF ? "deg/h" : term <= kS ? "deg/h/g" : "deg/h/g^2";
}

std::array<GyroCoefficients, 3> Truth::table2() noexcept {
    std::array<GyroCoefficients, 3> all{};
    for (std::size_t gyro = 0; gyro < 3; ++gyro) {
        const double s = gyro == 1 ? -1 : 1;  // the signs alternate x, y, z
        const double q = 0.03 * s;
        //           F  I   O   S  II OO SS  IO IS  OS
        all[gyro] = {s, -s, -s, s, q, q, -q, q, -q, -q};
    }
    return all;
}

Truth parse_truth(std::string_view text, const std::string& file) {
    Json root;
    try {
        root = proto::parse_json<Json>(std::string(text), file, "not JSON, expected a truth file");
    } catch (const std::runtime_error& error) {
        throw PlantError(error.what());
    }
    if (!root.is_object())
        throw PlantError(file + ": found " + text_of(root) + ", expected an object");
    Truth truth;
    read_coefficients(root, file, truth);
    Reader reader{root, file};
    for_each_field(truth, reader);
    read_profiles(root, reader, truth);
    if (!truth.map.empty())
        truth.map = (std::filesystem::path(file).parent_path() / truth.map).string();
    ShakerLies& lies = truth.shaker_lies;
    lies.timeout_ignored = lies.timeout_ignored || !truth.watchdog_works;
    lies.unit_rms = lies.unit_rms || truth.amplitude_unit == AmplitudeUnit::g_rms;
    lies.unit_mps2 = lies.unit_mps2 || truth.amplitude_unit == AmplitudeUnit::mps2_peak;
    if (const auto seed = root.find("seed"); seed != root.end()) {
        if (!seed->is_number_unsigned()) {
            throw PlantError(file + ": seed: found " + text_of(*seed) +
                             ", expected a whole number from 0");
        }
        truth.seed = seed->get<std::uint64_t>();
    }
    for (const auto& [section, group] : root.items()) {
        if (section == "coefficients" || section == "seed") continue;
        const auto known = reader.known.find(section);
        if (known == reader.known.end()) {
            throw PlantError(file + ": " + section +
                             ": unknown key, expected coefficients, site, platform, accelerometer, "
                             "resolver, drift, noise, isolator, shaker or seed");
        }
        for (const auto& [key, value] : group.items()) {
            if (!known->second.contains(key)) {
                throw PlantError(file + ": " + section + "." + key +
                                 ": unknown key, expected one of " + joined(known->second));
            }
        }
    }
    check(truth, file);
    return truth;
}

Truth read_truth(const std::string& path) {
    return parse_truth(read_input(path, "a truth file (JSON)"), path);
}

std::string to_json(const Truth& truth) {
    Json root;
    for (std::size_t gyro = 0; gyro < 3; ++gyro) {
        for (std::size_t term = 0; term < kTerms; ++term) {
            root["coefficients"][coefficient_name(gyro, term)] = truth.coefficients[gyro][term];
        }
    }
    for_each_field(truth, Writer{root});
    for (const ShakerProfile& profile : truth.profiles)
        root["shaker"]["profiles"].push_back({{"number", profile.number}, {"psd", profile.psd}});
    root["seed"] = truth.seed;
    return root.dump(2) + "\n";
}

void write_truth(const Truth& truth, const std::string& path) {
    proto::write_output(path, to_json(truth));
}

}  // namespace vibrig::plant
