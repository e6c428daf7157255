// A proof as the journal keeps it.
#include <spdlog/fmt/fmt.h>

#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>

#include "daemon/campaign/safety_proof.hpp"

namespace vibrig::campaign {

namespace {

using Json = nlohmann::ordered_json;

/// Its numbers beside the frequency: none is below 0.
constexpr std::array<std::pair<const char*, double estimator::InStep::*>, 6> kInStep{
    {{"platform_g", &estimator::InStep::platform_g},
     {"motion_arcsec_g", &estimator::InStep::motion_arcsec_g},
     {"motion_sigma", &estimator::InStep::motion_sigma},
     {"cross_share", &estimator::InStep::cross_share},
     {"cross_sigma", &estimator::InStep::cross_sigma},
     {"distortion", &estimator::InStep::distortion}}};

struct Damaged {
    std::string why;
};

/// Throws Damaged.
double number_of(const Json& row, std::size_t at, const char* key, bool zero) {
    const auto found = row.is_object() ? row.find(key) : row.end();
    const bool there = row.is_object() && found != row.end();
    const double value = there && found->is_number() ? found->get<double>() : std::nan("");
    if (std::isfinite(value) && (zero ? value >= 0 : value > 0)) return value;
    throw Damaged{fmt::format("in_step[{}].{}: found {}, expected a number {} 0", at, key,
                              there ? found->dump() : "nothing", zero ? "from" : "above")};
}

std::vector<FoundInStep> in_step_of(const Json& list) {
    if (!list.is_array())
        throw Damaged{fmt::format("in_step: found {}, expected a list", list.dump())};
    std::vector<FoundInStep> out;
    for (const Json& row : list) {
        FoundInStep& one = out.emplace_back();
        one.hz = number_of(row, out.size() - 1, "hz", false);
        for (const auto& [key, member] : kInStep)
            one.found.*member = number_of(row, out.size() - 1, key, true);
    }
    return out;
}

Json in_step_json(const std::vector<FoundInStep>& list) {
    Json rows = Json::array();
    for (const FoundInStep& one : list) {
        Json& row = rows.emplace_back(Json{{"hz", one.hz}});
        for (const auto& [key, member] : kInStep) row[key] = one.found.*member;
    }
    return rows;
}

}  // namespace

std::string to_json(const ProofRecord& r) {
    Json rows = Json::array();
    for (const CheckRow& row : r.rows) {
        rows.push_back({{"name", row.name},
                        {"unit", row.unit},
                        {"value", row.value},
                        {"low", row.low},
                        {"high", row.high},
                        {"passed", row.passed()}});
    }
    return Json{{"by", r.by},
                {"utc_ns", r.utc_ns},
                {"table_g", r.table_g},
                {"passed", r.passed},
                {"emergency_stop", r.emergency_stop},
                {"button", r.button},
                {"message", r.message},
                {"rows", rows},
                {"pads",
                 {{"level_g", r.pads.level_g},
                  {"time_s", r.pads.time_s},
                  {"rate_per_s", r.pads.rate_per_s},
                  {"frequency_hz", r.pads_hz},
                  {"damping", r.pads_damping}}},
                {"transmission", r.transmission},
                {"transmissions", r.transmissions},
                {"in_step", in_step_json(r.in_step)},
                {"keys", r.keys},
                {"keys_sha256", r.keys_sha256},
                {"device", r.device}}
        .dump();
}

std::optional<ProofRecord> proof_from_json(const std::string& text, std::string* why) {
    try {
        const Json json = Json::parse(text);
        ProofRecord r;
        r.by = json.at("by");
        r.utc_ns = json.at("utc_ns");
        r.table_g = json.at("table_g");
        r.passed = json.at("passed");
        r.emergency_stop = json.at("emergency_stop");
        r.button = json.value("button", "");  // earlier records have none
        r.message = json.at("message");
        for (const Json& row : json.at("rows"))
            r.rows.push_back(
                {row.at("name"), row.at("unit"), row.at("value"), row.at("low"), row.at("high")});
        const Json& pads = json.at("pads");
        r.pads = {pads.at("level_g"), pads.at("time_s"), pads.at("rate_per_s")};
        r.pads_hz = pads.at("frequency_hz");
        r.pads_damping = pads.at("damping");
        r.transmission = json.value("transmission", 0.0);  // earlier records have none
        if (const auto further = json.find("transmissions"); further != json.end())
            r.transmissions = further->get<decltype(r.transmissions)>();
        if (const auto in_step = json.find("in_step"); in_step != json.end())
            r.in_step = in_step_of(*in_step);
        r.keys = json.at("keys");
        r.keys_sha256 = json.at("keys_sha256");
        r.device = json.value("device", "");
        return r;
    } catch (const nlohmann::json::exception& error) {
        if (why != nullptr) *why = error.what();
    } catch (const Damaged& damaged) {
        if (why != nullptr) *why = damaged.why;
    }
    return std::nullopt;
}

}  // namespace vibrig::campaign
