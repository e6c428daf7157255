#include "daemon/commission/record.hpp"

#include <spdlog/fmt/chrono.h>
#include <spdlog/fmt/fmt.h>

#include <array>
#include <ctime>
#include <stdexcept>

#include "daemon/journal/signing_key.hpp"
#include "daemon/record/digest.hpp"

namespace vibrig::commission {

namespace {

constexpr const char* kDbc = "contents of can.dbc";
constexpr const char* kLimits = "shaker.limits.";  // of the excitation alone
constexpr const char* kAlgorithm = "Ed25519";

std::string dbc_of(const std::string& path) {
    try {
        return record::sha256_of_file(path);
    } catch (const std::runtime_error&) {
        return "unknown";
    }
}

/// Beginnings of the keys that are a part's own.
std::vector<std::string_view> own_keys(Part part) {
    switch (part) {
        case Part::bus:
            return {"can.", "gimbal.message"};
        case Part::gimbals:
            return {"platform.encoder_", "platform.up", "gimbal.travel_deg"};
        case Part::accelerometers:
            return {"accelerometer."};
        case Part::earth:
            return {"site.", "clock.source"};
        case Part::gyros:
            return {"platform.gyro_", "platform.drift_sign", "levelling.torque_"};
        case Part::registers:
        case Part::watchdog:
        case Part::units:
            return {"shaker."};
        case Part::stop:
            return {"shaker.", "commission.buttons", "commission.stop_s"};
        case Part::excitation:
            return {"shaker.", kLimits, "vibration.frequency_hz", "vibration.transmission"};
    }
    return {};
}

/// The parts that it stands on.
std::vector<Part> below(Part part) {
    switch (part) {
        case Part::bus:
            return {};
        case Part::gimbals:
        case Part::accelerometers:
            return {Part::bus};
        case Part::earth:
        case Part::gyros:
            return {Part::gimbals, Part::bus};
        default:  // the shaker's keys are its own
            return {};
    }
}

std::string text_of(const Keys& keys) {
    std::string text;
    for (const auto& [key, value] : keys) text += key + "=" + value + "\n";
    return text;
}

/// Public key of the signature; empty: there is none. Throws std::invalid_argument.
std::string signer_of(const Json& signature, const std::string& hash) {
    if (signature.is_null()) return {};
    const std::string key = signature.at("public_key");
    if (signature.at("algorithm") != kAlgorithm ||
        !journal::signature_holds(key, hash, signature.at("value").get<std::string>()))
        throw std::invalid_argument("its signature is not that of what it says");
    return key;
}

Json json_of(const PartRecord& r) {
    Json keys = Json::object();
    for (const auto& [name, value] : r.keys) keys[name] = value;
    return {{"keys", keys},
            {"meaning", r.meaning},
            {"sha256", record::sha256_of_text(text_of(r.keys))},
            {"evidence", r.evidence},
            {"by", r.by},
            {"utc", instant_of(r.utc_ns)},
            {"utc_ns", r.utc_ns},
            {"vibrig", r.version}};
}

}  // namespace

const char* name_of(Part part) noexcept {
    constexpr std::array kNames{"bus",       "gimbals",  "accelerometers", "earth", "gyros",
                                "registers", "watchdog", "stop",           "units", "excitation"};
    return kNames[static_cast<std::size_t>(part)];
}

std::optional<Part> part_named(std::string_view name) {
    for (const Part part : kParts)
        if (name == name_of(part)) return part;
    return std::nullopt;
}

Keys keys_of(Part part, const configuration::Loaded& loaded) {
    std::vector<Part> parts = below(part);
    parts.push_back(part);
    Keys keys;
    for (const Part one : parts) {
        for (const auto& value : loaded.effective)
            for (const auto beginning : own_keys(one))
                if (value.key.starts_with(beginning) &&
                    (part == Part::excitation || !value.key.starts_with(kLimits)))
                    keys[value.key] = value.value;
    }
    if (of_the_shaker(part)) return keys;
    if (const auto& dbc = loaded.configuration.dbc; !dbc.empty()) keys[kDbc] = dbc_of(dbc);
    return keys;
}

std::string instant_of(std::int64_t utc_ns) {
    return fmt::format("{:%Y-%m-%dT%H:%M:%SZ}",
                       fmt::gmtime(static_cast<std::time_t>(utc_ns / 1'000'000'000)));
}

std::string date_of(std::int64_t utc_ns) { return instant_of(utc_ns).substr(0, 10); }

std::string digest_of(const PartRecord& part) {
    return record::sha256_of_text(json_of(part).dump());
}

std::string statement_of(const std::string& rig, const std::map<Part, std::string>& digests) {
    std::string text = "commissioning of rig " + rig + "\n";
    for (const auto& [part, digest] : digests)
        text += std::string(name_of(part)) + " " + digest + "\n";
    return text;
}

std::string to_json(const Record& record, const journal::SigningKey* key) {
    Json parts = Json::object();
    for (const auto& [part, r] : record.parts) parts[name_of(part)] = json_of(r);
    Json whole{
        {"version", 1}, {"rig", record.rig}, {"simulated", record.simulated}, {"parts", parts}};
    for (const auto& one : record.persons) {
        Json names = Json::array();
        for (const Part part : one.parts) names.push_back(name_of(part));
        whole["persons"].push_back({{"by", one.by}, {"parts", names}, {"cms", one.cms}});
    }
    const std::string hash = record::sha256_of_text(whole.dump());
    whole["sha256"] = hash;
    whole["signature"] = nullptr;
    if (key != nullptr)
        whole["signature"] = {{"algorithm", kAlgorithm},
                              {"public_key", key->public_key()},
                              {"value", key->sign(hash)}};
    return whole.dump(1) + "\n";
}

Record record_from_json(const std::string& text) {
    try {
        Json whole = Json::parse(text);
        if (const int version = whole.at("version"); version != 1)
            throw std::invalid_argument(fmt::format("version: found {}, expected 1", version));
        const std::string hash = whole.at("sha256");
        const Json signature = whole.value("signature", Json());
        whole.erase("sha256");
        whole.erase("signature");
        if (record::sha256_of_text(whole.dump()) != hash)
            throw std::invalid_argument("its SHA-256 is not that of what it says");
        Record record;
        record.signed_with = signer_of(signature, hash);
        record.rig = whole.at("rig");
        record.simulated = whole.at("simulated");
        for (const auto& [name, json] : whole.at("parts").items()) {
            const auto part = part_named(name);
            if (!part) continue;  // of a later version
            PartRecord& r = record.parts[*part];
            for (const auto& [key, value] : json.at("keys").items()) r.keys[key] = value;
            r.meaning = json.at("meaning");
            r.evidence = json.at("evidence");
            r.by = json.at("by").get<std::vector<std::string>>();
            r.utc_ns = json.at("utc_ns");
            r.version = json.at("vibrig");
            if (json.at("sha256") != record::sha256_of_text(text_of(r.keys)))
                throw std::invalid_argument(name + ": its SHA-256 is not that of its keys");
        }
        for (const auto& json : whole.value("persons", Json::array())) {
            PersonSignature one{json.at("by"), {}, json.at("cms")};
            for (const std::string name : json.at("parts"))
                if (const auto part = part_named(name)) one.parts.push_back(*part);
            record.persons.push_back(std::move(one));
        }
        return record;
    } catch (const nlohmann::json::exception& error) {
        throw std::invalid_argument(std::string("not a commissioning record: ") + error.what());
    }
}

}  // namespace vibrig::commission
