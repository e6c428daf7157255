#include "daemon/commission/record.hpp"

#include <spdlog/fmt/fmt.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <stdexcept>

#include "daemon/commission/person_signature.hpp"
#include "daemon/journal/latches.hpp"
#include "daemon/journal/signing_key.hpp"
#include "daemon/record/digest.hpp"
#include "proto/durable_file.hpp"

namespace vibrig::commission {

namespace {

constexpr std::int64_t kDay_ns = 86'400'000'000'000;
constexpr int kMeaning = 1;
constexpr double kZeroMoved_g = 10e-3;  // `vibrig zero` may find so much anew
constexpr const char* kDbc = "contents of can.dbc";
constexpr const char* kDevice = "identity of the shaker's controller";
constexpr const char* kLimits = "shaker.limits.";  // of the excitation alone
constexpr const char* kZero = "accelerometer.zero_g";
constexpr const char* kAlgorithm = "Ed25519";

std::string dbc_of(const std::string& path) {
    try {
        return record::sha256_of_file(path);
    } catch (const std::runtime_error&) {
        return "unknown";
    }
}

std::string host_name() {
    std::array<char, 256> host{};
    return ::gethostname(host.data(), host.size() - 1) == 0 ? host.data() : "";
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

/// The command that proves it.
std::string remedy_of(Part part) {
    if (of_the_shaker(part)) return "vibrig commission watchdog stop units excitation";
    return part == Part::gyros ? "vibrig commission gyros" : "vibrig commission";
}

std::string text_of(const Keys& keys) {
    std::string text;
    for (const auto& [key, value] : keys) text += key + "=" + value + "\n";
    return text;
}

/// Three zeros within what they may have moved.
bool only_moved(const std::string& before, const std::string& after) {
    const Json was = Json::parse(before, nullptr, false), is = Json::parse(after, nullptr, false);
    if (!was.is_array() || !is.is_array() || was.size() != is.size()) return false;
    for (std::size_t i = 0; i < was.size(); ++i) {
        if (!was[i].is_number() || !is[i].is_number()) return false;
        if (!(std::abs(was[i].get<double>() - is[i].get<double>()) <= kZeroMoved_g)) return false;
    }
    return true;
}

/// "platform.up is "+z", was proven as "+y""; empty: they are the same. `told`: it may differ.
std::string change(const Keys& proven, const Keys& now, std::string& told) {
    for (const auto& [key, value] : now) {
        const auto it = proven.find(key);
        if (it == proven.end()) return fmt::format("{} is {}, was not known then", key, value);
        if (it->second == value) continue;
        const auto words = fmt::format("{} is {}, was proven as {}", key, value, it->second);
        if (key != kZero || !only_moved(it->second, value)) return words;
        told = words;
    }
    for (const auto& [key, value] : proven)
        if (!now.contains(key)) return fmt::format("{} is gone, was proven as {}", key, value);
    return {};
}

std::string joined(const std::vector<std::string>& words) {
    std::string text;
    for (const auto& word : words) text += (text.empty() ? "" : ", ") + word;
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

std::string read_text(const std::string& path) {
    std::error_code error;
    if (!std::filesystem::is_regular_file(path, error)) return {};  // nobody waits at a pipe
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
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
    const auto seconds = static_cast<std::time_t>(utc_ns / 1'000'000'000);
    std::tm time{};
    gmtime_r(&seconds, &time);
    std::array<char, 32> text{};
    std::strftime(text.data(), text.size(), "%Y-%m-%dT%H:%M:%SZ", &time);
    return text.data();
}

std::string date_of(std::int64_t utc_ns) { return instant_of(utc_ns).substr(0, 10); }

namespace {

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

/// Of parts that are proven anew, or no more.
void drop_signatures_of(Record& record, const std::vector<Part>& parts) {
    std::erase_if(record.persons, [&parts](const PersonSignature& one) {
        return std::ranges::find_first_of(one.parts, parts) != one.parts.end();
    });
}

}  // namespace

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

Book::Book(const configuration::Loaded& loaded) : loaded_(loaded) {
    for (const Part part : kParts) keys_[part] = keys_of(part, loaded);
    std::error_code error;
    if (!std::filesystem::exists(path(), error)) return;
    try {
        text_ = read_text(path());
        record_ = record_from_json(text_);
        if (const auto why = doubt(); !why.empty()) {
            trouble_ = path() + ": " + why;
            record_.reset();
        }
    } catch (const std::invalid_argument& wrong) {
        trouble_ = path() + ": " + wrong.what();
    }
}

/// Why a record that is as it was written is not this rig's; empty: it is.
std::string Book::doubt() const {
    const bool simulated = loaded_.configuration.simulated();
    if (record_->simulated && !simulated)
        return "the record of a simulated rig, which does not count on a real one";
    if (record_->rig != host_name())
        return fmt::format("found the record of rig \"{}\", expected that of \"{}\"", record_->rig,
                           host_name());
    if (record_->signed_with.empty())
        return simulated ? "" : "it carries no signature, expected that of " + key_path();
    std::error_code error;
    if (!std::filesystem::exists(key_path(), error))
        return key_path() + ", which has signed it, is gone";
    try {
        if (journal::SigningKey(key_path()).public_key() == record_->signed_with) return {};
    } catch (const std::runtime_error& wrong) {
        return wrong.what();
    }
    return "it is signed with another key than " + key_path();
}

/// Why a person's signature is not what it is said to be; empty: it is.
std::string Book::doubt_of(const PersonSignature& one) const {
    const std::string& authority = loaded_.configuration.server.clients_ca;
    if (authority.empty()) return "server.clients_ca, its authority, is not stated";
    std::map<Part, std::string> digests;
    std::int64_t utc_ns = 0;
    for (const Part part : one.parts) {
        if (!record_->parts.contains(part)) return fmt::format("{} is gone", name_of(part));
        digests[part] = digest_of(record_->parts.at(part));
        utc_ns = std::max(utc_ns, record_->parts.at(part).utc_ns);
    }
    try {
        const auto name =
            signer_of_detached(statement_of(record_->rig, digests), one.cms, authority, utc_ns);
        return journal::same_person(name, one.by) ? "" : "it is that of " + name;
    } catch (const std::invalid_argument& wrong) {
        return wrong.what();
    }
}

void Book::sign(const std::vector<Part>& parts, const std::string& by, const std::string& cms) {
    if (!record_ || parts.empty()) throw std::invalid_argument("there is nothing to sign");
    PersonSignature one{by, parts, cms};
    if (const auto why = doubt_of(one); !why.empty()) throw std::invalid_argument(why);
    Record fresh = *record_;
    fresh.persons.push_back(std::move(one));
    write(std::move(fresh));
    for (const Part part : parts) signed_by_[part].push_back(by);
}

std::string Book::key_path() const {
    return (std::filesystem::path(loaded_.configuration.commission.folder) / "record.key").string();
}

std::string Book::path() const {
    return (std::filesystem::path(loaded_.configuration.commission.folder) / "record.json")
        .string();
}

std::vector<Standing> Book::standing(std::int64_t utc_ns) const {
    std::vector<Standing> all;
    for (const Part part : kParts) {
        Standing s{part, false, "no record", {}, {}, std::nullopt};
        if (record_ && record_->parts.contains(part)) {
            const PartRecord& r = record_->parts.at(part);
            s.record = r;
            const auto age_days = static_cast<double>(utc_ns - r.utc_ns) / kDay_ns;
            const double valid = loaded_.configuration.commission.valid_days;
            Keys proven = r.keys;
            if (device_.empty()) proven.erase(kDevice);
            s.why = change(proven, keys_.at(part), s.told);
            if (!s.why.empty())
                s.why += fmt::format(" by {} on {}", joined(r.by), date_of(r.utc_ns));
            else if (r.meaning != kMeaning)
                s.why = fmt::format("version {} counts its keys otherwise", r.version);
            else if (!of_the_shaker(part) &&
                     (r.by.size() < 2 || journal::same_person(r.by[0], r.by[1])))
                s.why = fmt::format("proven by {}, two persons are asked", joined(r.by));
            else if (age_days < 0)
                s.why = fmt::format("proven on {}, which is yet to come: look at the clock",
                                    instant_of(r.utc_ns));
            else if (age_days > valid)
                s.why = fmt::format("proven on {}, {:.0f} days ago, {:g} at most",
                                    date_of(r.utc_ns), age_days, valid);
            for (const auto& one : record_->persons) {
                if (std::ranges::find(one.parts, part) == one.parts.end()) continue;
                if (const auto why = doubt_of(one); !why.empty())
                    s.why = fmt::format(
                        "the signature of {} is not that of what the record says "
                        "({})",
                        one.by, why);
                else
                    s.signed_by += (s.signed_by.empty() ? "" : ", ") + one.by;
            }
            if (const auto gone = signature_gone(part); !gone.empty()) s.why = gone;
            s.proven = s.why.empty();
        }
        all.push_back(std::move(s));
    }
    return all;
}

void Book::expect_signed(const std::vector<std::pair<std::string, std::string>>& by_part) {
    for (const auto& [name, by] : by_part)
        if (const auto part = part_named(name)) signed_by_[*part].push_back(by);
}

/// Why a part is not what was signed; empty: all who have signed it still do, or nobody has.
std::string Book::signature_gone(Part part) const {
    const auto expected = signed_by_.find(part);
    if (expected == signed_by_.end()) return {};
    for (const auto& by : expected->second) {
        const auto stands = [&](const PersonSignature& one) {
            return journal::same_person(one.by, by) &&
                   std::ranges::find(one.parts, part) != one.parts.end();
        };
        if (std::ranges::none_of(record_->persons, stands))
            return fmt::format(
                "the signature of {}, which the journal has, is gone from the record", by);
    }
    return {};
}

void Book::shaker_is(const std::string& device) {
    device_ = device;
    for (const Part part : kShakerParts) keys_[part][kDevice] = Json(device).dump();
}

Json Book::evidence(Part part) const {
    if (!record_ || !record_->parts.contains(part)) return Json::object();
    const Json& all = record_->parts.at(part).evidence;
    return all.is_object() ? all : Json::object();
}

std::string Book::refusal(std::int64_t utc_ns, Part last) const {
    if (!loaded_.configuration.record_demanded()) return {};
    if (!trouble_.empty()) return "not commissioned: " + trouble_ + ": vibrig commission";
    std::string missing, command;
    for (const auto& s : standing(utc_ns)) {
        if (s.proven || s.part > last) continue;
        if (s.record)  // the first that somebody has changed says most
            return fmt::format("not commissioned: {} ({}): {}", s.why, name_of(s.part),
                               remedy_of(s.part));
        if (missing.empty()) command = remedy_of(s.part);
        missing += (missing.empty() ? "" : ", ") + std::string(name_of(s.part));
    }
    if (missing.empty()) return {};
    return fmt::format("not commissioned: no record of {}: {}", missing, command);
}

void Book::prove(const std::vector<Part>& parts, const PartRecord& what,
                 const configuration::Loaded& as) {
    Record fresh = record_.value_or(Record{});
    fresh.simulated = loaded_.configuration.simulated();
    fresh.rig = host_name();
    drop_signatures_of(fresh, parts);
    for (const Part part : parts) {
        PartRecord one = what;
        one.keys = keys_of(part, as);
        if (of_the_shaker(part) && !device_.empty()) one.keys[kDevice] = Json(device_).dump();
        one.meaning = kMeaning;
        fresh.parts[part] = std::move(one);
    }
    write(std::move(fresh));
    for (const Part part : parts) signed_by_.erase(part);
}

void Book::withdraw(Part part) {
    if (!record_ || !record_->parts.contains(part)) return;
    Record fresh = *record_;
    drop_signatures_of(fresh, {part});
    fresh.parts.erase(part);
    write(std::move(fresh));
}

void Book::write(Record fresh) {
    std::error_code error;  // whatever it is, the file then says it
    std::filesystem::create_directories(loaded_.configuration.commission.folder, error);
    journal::SigningKey key(key_path());
    key.keep();
    text_ = to_json(fresh, &key);
    proto::write_durably(path(), text_, 0640);
    fresh.signed_with = key.public_key();
    record_ = std::move(fresh);
    trouble_.clear();
}

std::string Book::not_proven_below_shaker(std::int64_t utc_ns) const {
    for (const auto& s : standing(utc_ns))
        if (!of_the_shaker(s.part) && !s.proven)
            return fmt::format("{} first: {}", name_of(s.part), s.why);
    return {};
}

Json Book::status(std::int64_t utc_ns) const {
    Json parts = Json::object();
    for (const auto& s : standing(utc_ns)) {
        Json one{{"proven", s.proven}, {"why", s.why}, {"told", s.told}};
        if (s.record) {
            one["by"] = s.record->by;
            one["utc"] = instant_of(s.record->utc_ns);
            const double valid = loaded_.configuration.commission.valid_days;
            one["age"] = {{"days", static_cast<double>(utc_ns - s.record->utc_ns) / kDay_ns},
                          {"valid_days", valid},
                          {"expires",
                           date_of(s.record->utc_ns + static_cast<std::int64_t>(valid * kDay_ns))}};
            one["evidence"] = s.record->evidence;
            one["signed_by"] = s.signed_by;
            one["digest"] = digest_of(*s.record);
        }
        parts[name_of(s.part)] = one;
    }
    const auto& c = loaded_.configuration;
    return {{"demanded", c.record_demanded()},
            {"simulated", c.simulated()},
            {"refusal", refusal(utc_ns)},
            {"trouble", trouble_},
            {"rig", record_ ? record_->rig : host_name()},
            {"file", path()},
            {"sha256", sha256()},
            {"signed_with", signed_with()},
            {"parts", parts}};
}

std::string Book::sha256() const { return record_ ? record::sha256_of_text(text_) : ""; }

}  // namespace vibrig::commission
