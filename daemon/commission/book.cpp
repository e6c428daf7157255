#include "daemon/commission/book.hpp"

#include <spdlog/fmt/fmt.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <stdexcept>

#include "daemon/commission/person_signature.hpp"
#include "daemon/journal/latches.hpp"
#include "daemon/journal/signing_key.hpp"
#include "daemon/record/digest.hpp"
#include "proto/durable_file.hpp"
#include "proto/person_name.hpp"

namespace vibrig::commission {

namespace {

constexpr std::int64_t kDay_ns = 86'400'000'000'000;
/// Of a part's keys, in records of this release. 1 of what gravity and the earth have named could
/// be another naming than the bus has, an axis reversed or two exchanged, and say that it was
/// decided.
constexpr int meaning_of(Part part) {
    return part == Part::gimbals || part == Part::accelerometers || part == Part::earth ? 2 : 1;
}
constexpr double kZeroMoved_g = 10e-3;  // `vibrig zero` may find so much anew
constexpr const char* kDevice = "identity of the shaker's controller";
constexpr const char* kZero = "accelerometer.zero_g";

std::string host_name() {
    std::array<char, 256> host{};
    return ::gethostname(host.data(), host.size() - 1) == 0 ? host.data() : "";
}

/// The command that proves it. What the dialogue measures together has one.
std::string remedy_of(Part part) {
    if (of_the_shaker(part)) return "vibrig commission watchdog stop units excitation";
    return part == Part::gyros ? "vibrig commission gyros" : "vibrig commission";
}

/// The one for a part that was proven and has changed.
std::string renewal_of(Part part) {
    // `vibrig commission bus` lists what is on a bus.
    if (part == Part::bus || of_the_shaker(part)) return remedy_of(part);
    return fmt::format("vibrig commission {}", name_of(part));
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

/// "platform.up is "+z", was proven as "+y""; empty: they are the same. `moved`: it may differ.
std::string change(const Keys& proven, const Keys& now, std::string& moved) {
    for (const auto& [key, value] : now) {
        const auto it = proven.find(key);
        if (it == proven.end()) return fmt::format("{} is {}, was not known then", key, value);
        if (it->second == value) continue;
        const auto words = fmt::format("{} is {}, was proven as {}", key, value, it->second);
        if (key != kZero || !only_moved(it->second, value)) return words;
        moved = words;
    }
    for (const auto& [key, value] : proven)
        if (!now.contains(key)) return fmt::format("{} is gone, was proven as {}", key, value);
    return {};
}

std::string read_text(const std::string& path) {
    std::error_code error;
    if (!std::filesystem::is_regular_file(path, error)) return {};  // nobody waits at a pipe
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
}

/// Of parts that are proven anew, or no more.
void drop_signatures_of(Record& record, const std::vector<Part>& parts) {
    std::erase_if(record.persons, [&parts](const PersonSignature& one) {
        return std::ranges::find_first_of(one.parts, parts) != one.parts.end();
    });
}

}  // namespace

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
        return proto::same_person(name, one.by) ? "" : "it is that of " + name;
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
            s.why = change(proven, keys_.at(part), s.moved);
            if (!s.why.empty())
                s.why += fmt::format(" by {} on {}", fmt::join(r.by, ", "), date_of(r.utc_ns));
            else if (r.meaning != meaning_of(part))
                s.why = fmt::format("proven on {} with a version {} that names axes otherwise",
                                    date_of(r.utc_ns), r.version);
            else if (!of_the_shaker(part) &&
                     (r.by.size() < 2 || proto::same_person(r.by[0], r.by[1])))
                s.why = fmt::format("proven by {}, two persons are asked", fmt::join(r.by, ", "));
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
            return proto::same_person(one.by, by) &&
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
                               renewal_of(s.part));
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
        one.meaning = meaning_of(part);
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
        Json one{{"proven", s.proven}, {"why", s.why}, {"told", s.moved}};
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
