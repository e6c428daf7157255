#include <array>
#include <cmath>
#include <cstdio>
#include <iostream>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <string_view>

#include "daemon/tool/allan_analysis.hpp"
#include "proto/text.hpp"

namespace vibrig::tool {

namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t kLongestReading = 4096;

std::string_view without_blanks(std::string_view text) {
    const std::size_t first = text.find_first_not_of(" \t\r");
    if (first == std::string_view::npos) return {};
    return text.substr(first, text.find_last_not_of(" \t\r") - first + 1);
}

/// One number; an empty line and "nan" are a missing sample.
double sample_of(std::string_view line, std::size_t number) {
    const std::string_view text = without_blanks(line);
    if (text.empty() || text == "nan" || text == "NaN" || text == "NA") return kNaN;
    double value = 0;
    if (text.size() > kLongestReading || !proto::read_number(text, value) ||
        !(std::abs(value) <= kLargestValue)) {
        throw std::runtime_error("standard input:" + std::to_string(number) + ": found '" +
                                 proto::printable(text.substr(0, 60)) +
                                 "', expected a number up to 1e60");
    }
    return value;
}

std::string json_of(const allan::WindowRow& row, const std::vector<allan::Alarm>& alarms,
                    const allan::DynamicAllan& dynamic) {
    const auto number = [](double v) { return std::isfinite(v) ? Json(v) : Json(nullptr); };
    Json out{{"t", row.centre_s},
             {"mean", number(row.mean)},
             {"missing", row.missing},
             {"refused", row.refused}};
    Json tau = Json::array(), allan_dev = Json::array(), classical = Json::array();
    for (std::size_t k = 0; k < row.allan.size(); ++k) {
        tau.push_back(static_cast<double>(dynamic.factors()[k]) * dynamic.settings().tau0);
        allan_dev.push_back(number(std::sqrt(row.allan[k])));
        classical.push_back(number(std::sqrt(row.classical[k])));
    }
    out["tau"] = std::move(tau);
    out["dev"] = std::move(allan_dev);
    out["classical_dev"] = std::move(classical);
    Json list = Json::array();
    for (const allan::Alarm& alarm : alarms) {
        list.push_back({{"tau", alarm.tau},
                        {"ratio", number(alarm.ratio)},
                        {"limit", number(alarm.limit)},
                        {"since", alarm.since_s},
                        {"reading", allan::words_of(alarm.reading)}});
    }
    out["alarms"] = std::move(list);
    return out.dump();
}

std::string text_of(const allan::WindowRow& row, const std::vector<allan::Alarm>& alarms) {
    std::array<char, 160> line{};
    std::snprintf(line.data(), line.size(), "%12.6g s  mean %13.6g deg/h  ", row.centre_s,
                  row.mean);
    std::string out = line.data();
    if (row.refused) return out + "refused: samples are missing, or nothing varies";
    for (std::size_t j = 0; j < allan::kTerms; ++j) {
        const allan::FittedTerm& term = row.fit.terms[j];
        if (!term.detected) continue;
        std::snprintf(line.data(), line.size(), "%s %.3g  ", allan::kTermNames[j], term.value);
        out += line.data();
    }
    if (row.fit.slow.found && !row.fit.slow.determined) out += row.fit.verdict() + "  ";
    for (const allan::Alarm& alarm : alarms) {
        std::snprintf(line.data(), line.size(),
                      "\n      alarm since %.6g s at tau %.4g s: ratio %.3g, "
                      "limit %.3g; %s",
                      alarm.since_s, alarm.tau, alarm.ratio, alarm.limit,
                      allan::words_of(alarm.reading));
        out += line.data();
    }
    return out;
}

}  // namespace

bool allan_live(const AllanRequest& request, bool json) {
    if (!(request.tau0 > 0) || !(request.window_s > 0) || request.phase || request.file != "-" ||
        !request.column.empty() || !request.time.empty()) {
        throw std::runtime_error(
            "--live: expected rates, one a line, on standard input (FILE -), with --tau0 and "
            "--dynamic");
    }
    const allan::DynamicSettings settings = dynamic_settings(request);
    allan::DynamicAllan dynamic(settings);
    allan::StationarityMonitor monitor({request.alpha, 5}, dynamic);
    if (request.reference) monitor.set_reference(*request.reference);
    const double to_deg_h = to_deg_per_hour(request.unit, false);
    bool alarmed = false;
    std::size_t number = 0;
    for (std::string line; std::getline(std::cin, line);) {
        if (!dynamic.add(sample_of(line, ++number) * to_deg_h)) continue;
        const allan::WindowRow row = dynamic.row();
        const auto alarms = monitor.check(row);
        alarmed = alarmed || row.refused || !alarms.empty();
        std::cout << (json ? json_of(row, alarms, dynamic) : text_of(row, alarms)) << std::endl;
        if (!std::cout) throw std::runtime_error("standard output: cannot be written");
    }
    if (number < settings.window) {
        throw std::runtime_error("--live: " + std::to_string(number) +
                                 " samples came, a window of --dynamic needs " +
                                 std::to_string(settings.window));
    }
    return alarmed;
}

}  // namespace vibrig::tool
