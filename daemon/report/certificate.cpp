#include "daemon/report/certificate.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>
#include <vector>

#include "daemon/record/digest.hpp"
#include "daemon/report/paperwork.hpp"
#include "daemon/version.hpp"
#include "estimator/identification/identification.hpp"

namespace vibrig::report {

using Json = nlohmann::ordered_json;
using record::Campaign;

namespace {

/// Peak, at kappa = 1.001, which the drift does not feel.
constexpr double kTremble_g = 0.045;

/// With what the dwells shook that the coefficients rest on: "sinusoidal, random and swept-sine".
std::string kinds_of_vibration(const Json& result) {
    const auto found = result.find("spectrum");
    const Json spectrum = found != result.end() && found->is_object() ? *found : Json::object();
    const Json frequencies = spectrum.value("frequencies", Json::array()),
               sweeps = spectrum.value("sweeps", Json::array());
    const auto at_random = [](const Json& of) { return of.value("profile", Json()).is_string(); };
    std::vector<std::string> kinds;
    if (frequencies.empty() || !std::ranges::all_of(frequencies, at_random))
        kinds.emplace_back("sinusoidal");
    if (std::ranges::any_of(frequencies, at_random)) kinds.emplace_back("random");
    if (std::ranges::any_of(sweeps, [](const Json& of) { return of.value("used", 0.0) > 0; }))
        kinds.emplace_back("swept-sine");
    std::string text = kinds.front();
    for (std::size_t i = 1; i < kinds.size(); ++i)
        text += (i + 1 < kinds.size() ? ", " : " and ") + kinds[i];
    return text;
}

std::string method_of(const Json& result) {
    // Results of earlier versions have no rates of the dwells.
    const Json rates = result.value("dwell_rates", Json::array());
    const bool rested =
        rates.empty() || std::ranges::any_of(rates, [](const Json& rate) {
            // Floors tremble; kappa stays below 1.001.
            const auto level = rate.find("level");
            return level != rate.end() && level->is_number() && level->get<double>() < kTremble_g;
        });
    return fmt::format(
        "Identification under linear vibration (Tang et al. 2009): 30 coefficients from the "
        "platform's drift {}under {} vibration along the vertical, estimated jointly.",
        rested ? "at rest and " : "", kinds_of_vibration(result));
}

/// Refuses what no customer may be given; else "valid" or "doubtful".
std::string word_of(const Campaign& campaign, const Json& result,
                    const record::ReplayResult& replayed) {
    if (campaign.state != "finished")
        throw Refused(campaign.path + ": found a campaign that is " + campaign.state +
                      ", expected a finished one");
    if (!campaign.head.simulated && paperwork_of(campaign).unit_serial.empty())
        throw Refused(campaign.path +
                      ": found no serial number ([unit] serial) in its configuration, expected "
                      "one: a certificate is of one item");
    const auto verdict = result.find("verdict");
    if (verdict == result.end() || !verdict->is_object())
        throw Refused(campaign.path +
                      ": found a result without a verdict, expected one; `vibrig replay --json` "
                      "of this version gives it");
    const std::string word = verdict->value("word", "");
    if (word != "valid" && word != "doubtful") {
        std::string why;
        for (const auto& reason : verdict->value("reasons", Json::array()))
            why += (why.empty() ? ": " : "; ") + reason.value("text", "");
        throw Refused(campaign.path + ": found a result that is " +
                      (word.empty() ? "not judged" : word) + why + ", expected a valid one");
    }
    if (replayed.compared == 0 || !replayed.as_recorded())
        throw Refused(campaign.path +
                      ": found estimates that do not come out of the recording again, expected "
                      "every bit: " +
                      replayed.first_difference);
    return word;
}

double finite(const Json& of, const char* name, const std::string& who) {
    const auto found = of.find(name);
    if (found == of.end() || !found->is_number() || !std::isfinite(found->get<double>()))
        throw Refused(who + ": found no " + name + ", expected one of every coefficient");
    return found->get<double>();
}

Json coefficients_of(const Campaign& campaign, const Json& result) {
    Json rows = Json::array();
    const auto parameters = result.value("parameters", Json::array());
    if (parameters.size() != estimator::kParameters)
        throw Refused(fmt::format("{}: found {} coefficients in the result, expected {}",
                                  campaign.path, parameters.size(), estimator::kParameters));
    for (const auto& p : parameters) {
        const std::string who = campaign.path + ": " + p.value("name", "?");
        const double expanded = finite(p, "expanded", who);
        if (!(expanded > 0)) throw Refused(who + ": found U = 0, expected an uncertainty");
        rows.push_back({{"name", p.value("name", "")},
                        {"value", finite(p, "value", who)},
                        {"u", finite(p, "u", who)},
                        {"k", finite(p, "k", who)},
                        {"expanded", expanded},
                        {"unit", p.value("unit", "")},
                        {"at_hz", p.value("at_hz", Json())}});
    }
    return rows;
}

/// What the vibration was besides one frequency; null: nothing.
Json frequencies_of(const Json& result) {
    const auto found = result.find("spectrum");
    if (found == result.end() || !found->is_object()) return nullptr;
    const bool same = found->value("model", "") == "flat" &&
                      found->value("refusal", Json()).is_null() &&
                      !(found->value("flat", Json::object()).is_object() &&
                        found->value("flat", Json::object()).value("alarm", false));
    return {
        {"words", same ? "The dwells shook with several frequencies; quadratic coefficients that "
                         "depend on them were not found."
                       : "The dwells shook with several frequencies, and quadratic coefficients "
                         "depend on them: those given are static, or of the frequency named. They "
                         "alone do not give the drift under a vibration."},
        {"model", found->value("model", Json())},
        {"highest_hz", found->value("highest_hz", Json())}};
}

Json statements_of(const Json& coefficients, const Issue& issue) {
    Json rows = Json::array();
    for (const Limit& limit : issue.limits) {
        const auto row = std::ranges::find_if(
            coefficients, [&](const Json& c) { return c["name"] == limit.coefficient; });
        if (row == coefficients.end())
            throw std::runtime_error("limit: found coefficient " + limit.coefficient +
                                     ", expected one such as D_Fx");
        const auto side = [](const std::optional<double>& x) { return x ? Json(*x) : Json(); };
        rows.push_back({{"coefficient", limit.coefficient},
                        {"low", side(limit.low)},
                        {"high", side(limit.high)},
                        {"unit", (*row)["unit"]},
                        {"statement", statement_of(limit, (*row)["value"], (*row)["expanded"],
                                                   issue.guard_band)}});
    }
    return rows;
}

/// Least, mean and greatest of what was known.
Json range_of(const Campaign& campaign, const char* what, const char* unit, const auto& value) {
    double least = std::numeric_limits<double>::infinity(), greatest = -least, sum = 0;
    std::size_t count = 0;
    for (const auto& row : campaign.conditions) {
        const double v = value(row);
        if (!std::isfinite(v)) continue;
        least = std::min(least, v);
        greatest = std::max(greatest, v);
        sum += v;
        ++count;
    }
    if (count == 0) return nullptr;
    return {{"what", what},
            {"least", least},
            {"mean", sum / static_cast<double>(count)},
            {"greatest", greatest},
            {"unit", unit}};
}

Json conditions_of(const Campaign& campaign) {
    Json rows = Json::array();
    const auto add = [&rows](Json row) {
        if (!row.is_null()) rows.push_back(std::move(row));
    };
    add(range_of(campaign, "temperature of the inner element", "degC",
                 [](const auto& row) { return row.temperature_c; }));
    for (std::size_t k = 0; k < drivers::kTemperatureSensors.size(); ++k)
        add(range_of(campaign,
                     (std::string("temperature, ") + drivers::kTemperatureSensors[k]).c_str(),
                     "degC", [k](const auto& row) { return row.sensor_c[k]; }));
    return rows;
}

Json annex_of(const Campaign& campaign, const Json& result, const record::ReplayResult& replayed) {
    Json budget = Json::object(), correlation = Json::object();
    for (const auto& p : result.value("parameters", Json::array())) {
        const std::string name = p.value("name", "?");
        if (p.contains("budget")) budget[name] = p["budget"];
        const Json variance = p.value("correlation_variance", Json());
        if (variance.is_number() && variance != 0) correlation[name] = variance;
    }
    Json files = Json::array();
    for (const auto& part : campaign.parts)
        files.push_back({{"file", std::filesystem::path(part.path).filename().string()},
                         {"sha256", record::sha256_of_file(part.path)}});
    return {{"budget", std::move(budget)},
            {"correlation_variance", std::move(correlation)},
            {"recording", std::move(files)},
            {"configuration_sha256", record::sha256_of_text(campaign.head.configuration)},
            {"result_sha256", record::sha256_of_text(campaign.result_json)},
            {"replay", fmt::format("result, and estimates after each of {} dwells, as recorded, to "
                                   "the last bit",
                                   replayed.compared)},
            {"recorded_by", "vibrigd " + campaign.head.version},
            {"issued_with", std::string("vibrig ") + kVersion}};
}

std::string printed_number(const Json& of, const char* name, const char* format) {
    const auto found = of.find(name);
    return found != of.end() && found->is_number()
               ? fmt::format(fmt::runtime(format), found->get<double>())
               : "?";
}

/// What was estimated besides the 30, and what the laboratory says of motion that the data cannot
/// tell.
void add_assumed(const Campaign& campaign, const Json& result, Json& rows) {
    for (const auto& one : result.value("freed", Json::array())) {
        const Json element = one.value("element", Json()), unit = one.value("unit", Json());
        rows.push_back(fmt::format(
            "estimated beside the coefficients (estimator.free): {}{}, {} +- {}{} (1 sigma)",
            one.value("class", "?"), element.is_string() ? " " + element.get<std::string>() : "",
            printed_number(one, "value", "{:.3g}"), printed_number(one, "sigma", "{:.2g}"),
            unit.is_string() ? " " + unit.get<std::string>() : ""));
    }
    if (configuration_of(campaign).estimator.uncertainty.sync_motion ==
        estimator::uncertainty::SyncMotionOf::base)
        rows.push_back(fmt::format(
            "declared by the laboratory (uncertainty.sync_motion = \"base\"): the angles' motion "
            "in step with the vibration, up to {} arcsec, is rocking of the base; U has nothing of "
            "it",
            printed_number(result, "sync_motion_arcsec", "{:.2g}")));
}

/// What was not as the method has it.
Json deviations_of(const Campaign& campaign, const Json& result,
                   const record::ReplayResult& replayed) {
    Json rows = Json::array();
    add_assumed(campaign, result, rows);
    for (const auto& dwell : replayed.dwells) {
        const auto& s = dwell.summary;
        if (s.flagged || s.left_out)
            rows.push_back(fmt::format("run {} position {} {}: {}", s.run, s.position,
                                       s.left_out ? "left out" : "flagged", dwell.reason));
    }
    return rows;
}

Json instruments_of(const Campaign& campaign) {
    const auto paperwork = paperwork_of(campaign);
    const std::string day = utc_text(campaign.head.utc_ns).substr(0, 10);
    Json rows = Json::array();
    for (const auto& i : paperwork.instruments)
        rows.push_back({{"name", i.name},
                        {"serial", i.serial},
                        {"certificate", i.certificate},
                        {"uncertainty", i.uncertainty},
                        {"due", i.due},
                        {"overdue", i.overdue(day)}});
    return rows;
}

}  // namespace

std::string statement_of(const Limit& limit, double value, double expanded, double guard) {
    const double w = guard * expanded;
    const double low = limit.low.value_or(-std::numeric_limits<double>::infinity());
    const double high = limit.high.value_or(std::numeric_limits<double>::infinity());
    if (value >= low + w && value <= high - w) return "passes";
    if (value < low - w || value > high + w) return "fails";
    return "inconclusive";
}

Json certificate_of(const Campaign& campaign, const Json& result,
                    const record::ReplayResult& replayed, const Issue& issue) {
    const std::string word = word_of(campaign, result, replayed);
    const auto paperwork = paperwork_of(campaign);
    Json coefficients = coefficients_of(campaign, result);
    Json statements = statements_of(coefficients, issue);
    Json root;
    root["title"] = "Calibration certificate";
    root["number"] = issue.number;
    root["simulated"] = campaign.head.simulated;
    root["laboratory"] = {{"name", issue.laboratory},
                          {"address", issue.laboratory_address},
                          {"accreditation", issue.accreditation},
                          {"location", issue.location}};
    root["customer"] = {{"name", issue.customer}, {"address", issue.customer_address}};
    root["item"] = {{"what", "gyros of an inertial platform"},
                    {"type", paperwork.unit_type},
                    {"serial", paperwork.unit_serial},
                    {"condition", issue.condition},
                    {"received", issue.received}};
    root["dates"] = {{"begun", utc_text(campaign.head.utc_ns)},
                     {"ended", utc_text(campaign.ended_utc_ns)},
                     {"issued", utc_text(issue.utc_ns)}};
    root["campaign"] = campaign.head.campaign;
    root["performed_by"] = campaign.head.started_by;
    root["issued_by"] = issue.by;
    root["method"] = method_of(result);
    root["frequencies"] = frequencies_of(result);
    root["deviations"] = deviations_of(campaign, result, replayed);
    root["equation"] = kDriftModel;
    root["conditions"] = conditions_of(campaign);
    root["traceability"] = instruments_of(campaign);
    root["verdict"] = {{"word", word},
                       {"reasons", result["verdict"].value("reasons", Json::array())}};
    root["mark"] = campaign.mark;
    root["results"] = std::move(coefficients);
    root["coverage"] = fmt::format(
        "U = k u is the expanded uncertainty; for the k given the interval value +- U has a "
        "coverage probability of about {:g} % (JCGM 100).",
        100 * coverage_of(campaign));
    root["decision_rule"] = {
        {"guard_band", issue.guard_band},
        {"words",
         fmt::format("A value passes within limits drawn in by {:g} U, fails beyond limits "
                     "moved out by it, and is inconclusive between (ISO 14253-1).",
                     issue.guard_band)}};
    root["statements"] = std::move(statements);
    root["remarks"] = {"The item was not adjusted: the results are those as found.",
                       "The results apply to the item as tested, and to it alone.",
                       "This certificate may be reproduced only in full, unless the laboratory "
                       "agrees in writing."};
    root["annex"] = annex_of(campaign, result, replayed);
    return root;
}

}  // namespace vibrig::report
