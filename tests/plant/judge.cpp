#include "tests/plant/judge.hpp"

#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>

#include "proto/json_file.hpp"
#include "proto/json_text.hpp"

namespace vibrig::plant {
namespace {

using Json = nlohmann::json;

double number_or_nan(const Json& entry, const char* key) {
    const auto it = entry.find(key);
    return it != entry.end() && it->is_number() ? it->get<double>()
                                                : std::numeric_limits<double>::quiet_NaN();
}

void judge_one(JudgedCoefficient& c, const Json* entry, double limit) {
    c.estimate = c.sigma = c.ratio = std::numeric_limits<double>::quiet_NaN();
    if (entry == nullptr) {
        c.fault = "missing";
        return;
    }
    c.estimate = number_or_nan(*entry, "value");
    // Where there is an assessment sigma belongs to value_constant, and u_a to value. Not u: it has
    // room for errors of the rig that a simulated one does not have unless somebody wants them.
    const double u_a = number_or_nan(*entry, "u_a");
    c.sigma = std::isnan(u_a) ? number_or_nan(*entry, "sigma") : u_a;
    c.ratio = (c.estimate - c.truth) / c.sigma;
    const auto observable = entry->find("observable");
    const auto unit = entry->find("unit");
    if (observable == entry->end() || !observable->is_boolean() || !observable->get<bool>()) {
        c.fault = "not observable";
    } else if (!std::isfinite(c.estimate) || !std::isfinite(c.sigma)) {
        c.fault = "not finite";
    } else if (c.sigma <= 0) {
        c.fault = "sigma not positive";
    } else if (unit == entry->end() || !unit->is_string() || unit->get<std::string>() != c.unit) {
        c.fault = "unit is not " + c.unit;
    } else if (std::abs(c.ratio) > limit) {
        c.fault = "too far off";
    }
}

}  // namespace

Verdict judge(const std::string& text, const std::string& file, const Truth& truth, double limit) {
    Json root;
    try {
        root = proto::parse_json(text, file, "not JSON, expected an identification result");
    } catch (const std::runtime_error& error) {
        throw PlantError(error.what());
    }
    if (!root.is_object() || !root.contains("parameters") || !root["parameters"].is_array()) {
        throw PlantError(file +
                         ": parameters: missing, expected the list of an identification result");
    }
    std::map<std::string, const Json*> entries;
    std::size_t index = 0;
    for (const Json& entry : root["parameters"]) {
        const std::string place = file + ": parameters[" + std::to_string(index++) + "]";
        if (!entry.is_object() || !entry.contains("name") || !entry["name"].is_string()) {
            throw PlantError(
                place +
                ": no name, expected {\"name\", \"value\", \"sigma\", \"unit\", \"observable\"}");
        }
        const auto name = entry["name"].get<std::string>();
        if (!entries.emplace(name, &entry).second)
            throw PlantError(place + ": " + name + " is there twice");
    }
    Verdict verdict;
    verdict.passed = true;
    double worst = -1;
    for (std::size_t gyro = 0; gyro < 3; ++gyro) {
        for (std::size_t term = 0; term < kTerms; ++term) {
            JudgedCoefficient c;
            c.name = coefficient_name(gyro, term);
            c.unit = coefficient_unit(term);
            c.truth = truth.coefficients[gyro][term];
            const auto it = entries.find(c.name);
            judge_one(c, it == entries.end() ? nullptr : it->second, limit);
            const double badness = std::isfinite(c.ratio) ? std::abs(c.ratio)
                                                          : std::numeric_limits<double>::infinity();
            if (badness > worst) {
                worst = badness;
                verdict.worst = verdict.coefficients.size();
            }
            verdict.passed = verdict.passed && c.fault.empty();
            verdict.coefficients.push_back(c);
        }
    }
    return verdict;
}

std::string table_of(const Verdict& verdict) {
    std::string text = "coefficient  unit            truth     estimate      sigma  error/sigma\n";
    const auto line = [&text](const JudgedCoefficient& c) {
        std::array<char, 160> row{};
        std::snprintf(row.data(), row.size(), "%-11s  %-9s %11.6f  %11.6f  %9.6f  %11.2f",
                      c.name.c_str(), c.unit.c_str(), c.truth, c.estimate, c.sigma, c.ratio);
        text += row.data();
        if (!c.fault.empty()) text += "  " + c.fault;
        text += "\n";
    };
    for (const JudgedCoefficient& c : verdict.coefficients) line(c);
    const JudgedCoefficient& worst = verdict.coefficients[verdict.worst];
    std::array<char, 120> end{};
    std::snprintf(end.data(), end.size(), "worst: %s, %.2f sigma; %s\n", worst.name.c_str(),
                  std::abs(worst.ratio),
                  verdict.passed ? "all 30 within the limit" : "NOT all 30 within the limit");
    return text + end.data();
}

std::string json_of(const Verdict& verdict) {
    using Ordered = nlohmann::ordered_json;  // which writes NaN as null
    Ordered list = Ordered::array();
    for (const JudgedCoefficient& c : verdict.coefficients) {
        list.push_back({{"name", c.name},
                        {"unit", c.unit},
                        {"truth", c.truth},
                        {"estimate", c.estimate},
                        {"sigma", c.sigma},
                        {"error_over_sigma", c.ratio},
                        {"fault", c.fault}});
    }
    const Ordered all{{"passed", verdict.passed},
                      {"worst", verdict.coefficients[verdict.worst].name},
                      {"coefficients", list}};
    return proto::json_text(all, 2) + "\n";
}

}  // namespace vibrig::plant
