#include "daemon/commission/shaker_parts.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>

#include "estimator/commissioning/amplitude_unit.hpp"

namespace vibrig::commission {

namespace {

constexpr double kOfTable = 0.02;      // accelerometer at the table, 1 sigma
constexpr double kOfIsolators = 0.2;   // transmission that somebody states
constexpr double kOfReference = 0.03;  // calibrated, on the table for once

double row_of(const Json& proof, const char* name) {
    for (const Json& row : proof.at("rows"))
        if (row.at("name") == name) return row.at("value");
    return NAN;
}

/// Rows of a proof whose names begin so, by their names.
Json rows_of(const Json& proof, std::initializer_list<const char*> beginnings) {
    Json rows = Json::object();
    for (const Json& row : proof.at("rows")) {
        const std::string name = row.at("name");
        const auto begins = [&name](const char* with) { return name.starts_with(with); };
        if (std::any_of(beginnings.begin(), beginnings.end(), begins)) rows[name] = row.at("value");
    }
    return rows;
}

Json hypotheses_of(const estimator::commissioning::UnitFinding& found) {
    Json all = Json::array();
    for (const auto& unit : found.all)
        all.push_back({{"unit", unit.name}, {"ln_ratio", unit.ln_ratio}});
    return all;
}

void judge_units(const Json& proof, const AmplitudeWitness& witness, ShakerParts& parts) {
    using estimator::commissioning::amplitude_unit;
    const double table = row_of(proof, "table over command");
    const bool at_table = std::isfinite(table);
    const double seen = at_table ? table : row_of(proof, "platform over command");
    auto found = amplitude_unit(seen, at_table ? kOfTable : kOfIsolators);
    Json evidence{{"witness", at_table ? "accelerometer at the table" : "platform"},
                  {"ratio", seen},
                  {"hypotheses", hypotheses_of(found)}};
    if (!found.decided && witness.reference_g > 0 && !witness.display.empty()) {
        const double by_hand = witness.reference_g / proof.at("table_g").get<double>();
        found = amplitude_unit(by_hand, kOfReference);
        evidence["reference_g"] = witness.reference_g;
        evidence["display"] = witness.display;
        evidence["reference_hypotheses"] = hypotheses_of(found);
        if (found.decided && witness.display != found.all[0].name) {
            parts.lacking[Part::units] = fmt::format("the display shows {}, the reference {}",
                                                     witness.display, found.all[0].name);
            return;
        }
    }
    if (!found.decided) {
        parts.lacking[Part::units] = fmt::format(
            "{} or {}, ln odds {:.1f}, 25 asked: what would tell is an accelerometer at the table, "
            "or the display's unit and a reference on the table (--display, --reference)",
            found.all[0].name, found.all[1].name, -found.all[1].ln_ratio);
    } else if (std::string(found.all[0].name) != "g peak") {
        parts.lacking[Part::units] = fmt::format(
            "the controller counts in {}, expected g peak: its scale goes into "
            "shaker.registers.amplitude",
            found.all[0].name);
    } else {
        parts.proven[Part::units] = evidence;
    }
}

}  // namespace

std::vector<std::string> amplitude_units() {
    std::vector<std::string> names;
    for (const auto& unit : estimator::commissioning::amplitude_unit(1, 1).all)
        names.emplace_back(unit.name);
    return names;
}

ShakerParts shaker_parts(const std::vector<Json>& proofs,
                         const std::vector<std::string>& buttons_left,
                         const AmplitudeWitness& witness) {
    ShakerParts parts;
    if (proofs.empty() || proofs.back().at("passed") != true) {
        const std::string why = proofs.empty() ? "no safe-state proof"
                                               : "the newest safe-state proof has not passed: " +
                                                     proofs.back().at("message").get<std::string>();
        for (const Part part : kShakerParts) parts.lacking[part] = why;
        return parts;
    }
    const auto newest_of = [&proofs](auto&& is) -> const Json* {
        const auto found = std::find_if(proofs.rbegin(), proofs.rend(), is);
        return found == proofs.rend() ? nullptr : &*found;
    };
    const Json* shaken = newest_of([](const Json& one) { return one.at("table_g") > 0; });
    const Json* at_zero = newest_of([](const Json& one) {
        return one.at("table_g") == 0 && one.at("passed") == true && one["emergency_stop"] != true;
    });
    if (shaken == nullptr || shaken->at("passed") != true) {
        for (const Part part : kShakerParts)
            parts.lacking[part] = shaken == nullptr
                                      ? "it has run at 0 g, and not shaken yet"
                                      : "the newest proof that shook has not passed: " +
                                            shaken->at("message").get<std::string>();
        return parts;
    }
    const Json& newest = *shaken;
    Json pressed = Json::object();
    for (const Json& one : proofs) {
        const std::string button = one.value("button", "");
        if (one.at("passed") != true || one.at("emergency_stop") != true || button.empty())
            continue;
        pressed[button] = rows_of(one, {"emergency stop", "closing"});
        pressed[button]["table_g"] = one.at("table_g");
    }
    if (at_zero == nullptr) {
        parts.lacking[Part::registers] = parts.lacking[Part::watchdog] = "it has not run at 0 g";
    } else {
        const auto also = [&](const char* beginning, Json rows) {
            rows.update(rows_of(*at_zero, {beginning}));
            return rows;
        };
        parts.proven[Part::registers] = also(
            "at 0 g",
            rows_of(newest, {"controller", "frequency", "stop, controller", "ladder", "f + 1 Hz"}));
        parts.proven[Part::watchdog] = also("watchdog", rows_of(newest, {"watchdog"}));
    }
    parts.proven[Part::excitation] =
        rows_of(newest, {"transmission", "frequency", "distortion", "cross-axis", "phase"});
    parts.proven[Part::excitation]["table_g"] = newest.at("table_g");
    std::string left;
    for (const auto& button : buttons_left) left += (left.empty() ? "\"" : ", \"") + button + "\"";
    if (left.empty()) {
        parts.proven[Part::stop] = {{"buttons", pressed}, {"stop", rows_of(newest, {"stop, "})}};
    } else {
        parts.lacking[Part::stop] = "not pressed yet: " + left;
    }
    judge_units(newest, witness, parts);
    return parts;
}

}  // namespace vibrig::commission
