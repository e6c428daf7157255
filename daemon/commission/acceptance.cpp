// What goes into the record is what was measured, and what it was measured with.
#include "daemon/commission/acceptance.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>

#include "estimator/filter/parameters.hpp"
#include "proto/json_text.hpp"
#include "proto/person_name.hpp"

namespace vibrig::commission {

namespace {

/// The same but for how it is written.
bool same_value(const Json& a, const Json& b) {
    if (a.is_number() && b.is_number())
        return std::abs(a.get<double>() - b.get<double>()) <=
               1e-9 * std::max(1.0, std::abs(b.get<double>()));
    if (!a.is_array() || !b.is_array()) return a == b;
    return a.size() == b.size() && std::equal(a.begin(), a.end(), b.begin(), same_value);
}

bool same_text(const std::string& a, const std::string& b) {
    return same_value(Json::parse(a, nullptr, false), Json::parse(b, nullptr, false));
}

Json value_in(const configuration::Loaded& file, const std::string& key) {
    const auto at = std::ranges::find(file.effective, key, &configuration::EffectiveValue::key);
    return at == file.effective.end() ? Json() : Json::parse(at->value, nullptr, false);
}

bool was_found(const Finding& finding, const std::string& key) {
    return std::ranges::find(finding.keys, key, &FoundKey::key) != finding.keys.end();
}

}  // namespace

std::string name_of_person(const std::string& by) { return by.substr(0, by.find(" (")); }

std::string not_two(const std::string& by, const std::string& second) {
    if (!proto::plain_name(second).empty() && !proto::same_person(by, second)) return {};
    return fmt::format("second: found \"{}\", expected the name of another person than {}", second,
                       name_of_person(by));
}

std::string against_certificate(
    const std::vector<configuration::Configuration::Commission::Coefficient>& certificate,
    std::span<const double> value, std::span<const double> sigma) {
    constexpr double kSigmas = 5;
    const auto& names = estimator::parameter_names();
    std::string words;
    for (const auto& one : certificate) {
        const auto i = static_cast<std::size_t>(std::ranges::find(names, one.name) - names.begin());
        if (i >= value.size() || !(value[i] * one.value < 0) ||
            !(std::abs(value[i]) > kSigmas * sigma[i]))
            continue;
        words += fmt::format("{}{} is {:.4g} +- {:.2g}, {:g} by the certificate",
                             words.empty() ? "" : ", ", one.name, value[i], sigma[i], one.value);
    }
    return words.empty() ? words : words + ": sign of platform.drift_sign, or axes of the gyro?";
}

std::string not_as_found(const Finding& finding, const configuration::Loaded& file) {
    for (const auto& key : finding.keys) {
        const auto at =
            std::ranges::find(file.effective, key.key, &configuration::EffectiveValue::key);
        const std::string value = at == file.effective.end() ? "nothing" : at->value;
        if (!same_text(value, key.value))
            return fmt::format("{}: {}: found {}, expected {}", file.path, key.key, value,
                               key.value);
    }
    return {};
}

std::string not_as_running(const std::vector<Part>& parts, const Finding& finding,
                           const Book& running, const configuration::Loaded& file) {
    for (const Part part : parts) {
        const Keys& ran = running.keys(part);
        const Keys now = keys_of(part, file);
        for (const auto& [key, value] : now) {
            if (was_found(finding, key)) continue;
            const auto was = ran.find(key);
            if (was != ran.end() && was->second == value) continue;
            return fmt::format("{}: {} is {}, was {} when vibrigd started", file.path, key, value,
                               was == ran.end() ? "not there" : was->second);
        }
        for (const auto& [key, value] : ran)
            if (!now.contains(key))
                return fmt::format("{}: {} is gone, was {} when vibrigd started", file.path, key,
                                   value);
    }
    return {};
}

std::string not_as_torqued(const Json& torquers, const configuration::Loaded& file) {
    if (!torquers.is_object() || !torquers.contains("sign")) return {};
    const Json said = value_in(file, "levelling.torque_sign");
    if (same_value(said, torquers["sign"])) return {};
    return fmt::format(
        "{}: levelling.torque_sign: found {}, expected {} as the torquers were "
        "measured",
        file.path, said.dump(), torquers["sign"].dump());
}

std::string not_as_counted(const Json& increments, const configuration::Loaded& file) {
    if (!increments.is_object() || !increments.contains("sign")) return {};
    for (std::size_t g = 0; g < 3; ++g) {
        const std::string letter(1, "xyz"[g]);
        const std::string key = "platform.gyro_" + letter + "_axes";
        const std::string expected = (increments["sign"].at(g) < 0 ? "-" : "+") + letter;
        const Json axes = value_in(file, key.c_str());
        const Json said = axes.is_array() && !axes.empty() ? axes[0] : Json();
        if (said != Json(expected))
            return fmt::format(
                "{}: {}[0]: found {}, expected \"{}\" as its increments were counted", file.path,
                key, said.dump(), expected);
    }
    return {};
}

std::vector<SignStatement> sign_statements(const Json& json) {
    std::vector<SignStatement> all;
    if (!json.is_array()) return all;
    for (const Json& one : json) {
        SignStatement s;
        if (one.is_object()) {
            s.by = proto::text_at(one, "by");
            s.source = proto::text_at(one, "source");
            if (one.contains("says") && one["says"].is_number_integer()) s.says = one["says"];
        }
        all.push_back(std::move(s));
    }
    return all;
}

std::string doubt_of_drift_sign(const std::vector<SignStatement>& statements, const std::string& by,
                                const std::string& second, const configuration::Loaded& file) {
    if (statements.size() != 2 || !proto::same_person(statements[0].by, by) ||
        !proto::same_person(statements[1].by, second))
        return fmt::format("drift_sign: expected what {} and {} say of it, each alone",
                           name_of_person(by), second);
    for (const auto& one : statements) {
        if (one.says < 1 || one.says > 3)
            return fmt::format("drift_sign: {}: found {}, expected 1, 2 or 3", one.by, one.says);
        if (one.source.find_first_not_of(' ') == std::string::npos)
            return fmt::format(
                "drift_sign: {}: found no source, expected the drawing's or the "
                "certificate's name",
                one.by);
    }
    if (statements[0].says != statements[1].says)
        return fmt::format("drift_sign: {} says {} ({}), {} says {} ({}): they differ",
                           statements[0].by, statements[0].says, statements[0].source,
                           statements[1].by, statements[1].says, statements[1].source);
    const Json torque = value_in(file, "levelling.torque_sign");
    int expected = statements[0].says == 1 ? -1 : 1;
    if (statements[0].says == 3) {
        if (torque != Json({1, 1, 1}) && torque != Json({-1, -1, -1}))
            return fmt::format(
                "drift_sign: 3 says the torque, whose signs differ from axis to "
                "axis: found levelling.torque_sign {}, expected 1 or 2 instead",
                torque.dump());
        expected = -torque[0].get<int>();
    }
    const Json found = value_in(file, "platform.drift_sign");
    if (found == expected) return {};
    return fmt::format("{}: platform.drift_sign: found {}, expected {} as both say", file.path,
                       found.dump(), expected);
}

}  // namespace vibrig::commission
