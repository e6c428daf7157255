// Valid bits, loop_closed, ready, fault: a bit that never changes proves nothing.
#include "daemon/commission/bus_bits.hpp"

#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <utility>

#include "daemon/commission/record.hpp"
#include "daemon/record/digest.hpp"
#include "proto/durable_file.hpp"
#include "proto/person_name.hpp"

namespace vibrig::commission {

namespace {

std::string digest_of_dbc(const std::string& path) {
    return path.empty() ? record::sha256_of_text(std::string(proto::rig_dbc_text()))
                        : record::sha256_of_file(path);
}

bool says_a_state(const std::string& key) {
    constexpr std::array<const char*, 4> kStates{"can.signals.loop_closed",
                                                 "can.signals.gyros_at_speed", "can.signals.ready",
                                                 "can.signals.fault"};
    return key.starts_with("can.signals.") &&
           (key.ends_with("_valid") || std::ranges::find(kStates, key) != kStates.end());
}

}  // namespace

int length_of(const proto::Dbc& dbc, const std::string& name) {
    const auto dot = name.find('.');
    const auto* const message = dbc.find(std::string_view(name).substr(0, dot));
    const auto* const signal = message == nullptr || dot == std::string::npos
                                   ? nullptr
                                   : message->find(std::string_view(name).substr(dot + 1));
    return signal == nullptr ? 0 : static_cast<int>(signal->length);
}

BitWatch::BitWatch(const proto::Dbc& dbc, const std::string& name) {
    for (const auto& message : dbc.messages)
        for (const auto& signal : message.signals)
            if (message.name + "." + signal.name == name) {
                message_ = &message;
                signal_ = &signal;
            }
    if (signal_ == nullptr) throw std::invalid_argument("the DBC has no signal " + name);
}

void BitWatch::add(std::uint32_t id, bool extended, std::span<const std::uint8_t> data) {
    if (id != message_->id || extended != message_->extended ||
        !proto::present(*message_, *signal_, data))
        return;
    const auto raw = proto::decode_raw(*signal_, data);
    if (!raw) return;
    const int value = *raw != 0 ? 1 : 0;
    if (!heard_) before_ = value;
    heard_ = true;
    came_back_ = changed_ && (came_back_ || value == before_);
    changed_ = changed_ || value != before_;
}

std::vector<std::string> two_names(const std::string& text) {
    const auto comma = text.find(',');
    if (comma == std::string::npos) return {};
    const auto trimmed = [](std::string name) {
        const auto first = name.find_first_not_of(" \t"), last = name.find_last_not_of(" \t");
        return first == std::string::npos ? std::string() : name.substr(first, last - first + 1);
    };
    std::vector<std::string> names{trimmed(text.substr(0, comma)), trimmed(text.substr(comma + 1))};
    if (proto::plain_name(names[0]).empty() || proto::plain_name(names[1]).empty() ||
        proto::same_person(names[0], names[1]))
        return {};
    return names;
}

BitBook::BitBook(const std::string& folder, std::string dbc_sha256)
    : path_((std::filesystem::path(folder) / "bus_bits.json").string()),
      dbc_sha256_(std::move(dbc_sha256)) {}

BitBook::BitBook(const configuration::Configuration& c)
    : BitBook(c.commission.folder, digest_of_dbc(c.dbc)) {}

BitBook::Json BitBook::bits() const {
    std::ifstream file(path_);
    const Json all = file ? Json::parse(file, nullptr, false) : Json();
    if (!all.is_object() || !all.contains("dbc_sha256") || all["dbc_sha256"] != dbc_sha256_)
        return Json::object();
    return all.contains("bits") && all["bits"].is_object() ? all["bits"] : Json::object();
}

void BitBook::keep(const std::vector<BitProof>& bits, std::int64_t utc_ns) {
    Json all = this->bits();
    for (const auto& bit : bits)
        all[bit.name] = {{"proven", bit.by_hand ? "changed once and back" : "confirmed"},
                         {"by", bit.by},
                         {"rests_at", bit.rests_at},
                         {"utc", instant_of(utc_ns)}};
    std::error_code error;  // whatever it is, the file then says it
    std::filesystem::create_directories(std::filesystem::path(path_).parent_path(), error);
    proto::write_durably(
        path_, Json{{"version", 1}, {"dbc_sha256", dbc_sha256_}, {"bits", all}}.dump(1) + "\n",
        0644);
}

std::vector<std::string> unproven_bits(const configuration::Loaded& loaded, const proto::Dbc& dbc) {
    const auto proven = BitBook(loaded.configuration).bits();
    std::vector<std::string> names;
    for (const auto& value : loaded.effective) {
        if (!says_a_state(value.key)) continue;
        const auto text = BitBook::Json::parse(value.value, nullptr, false);
        const std::string name = text.is_string() ? text.get<std::string>() : std::string();
        if (length_of(dbc, name) == 1 && !proven.contains(name) &&
            std::ranges::find(names, name) == names.end())
            names.push_back(name);
    }
    return names;
}

BitBook::Json with_confirmed(BitBook::Json bits, const BitBook::Json& names,
                             const std::vector<std::string>& by, std::int64_t utc_ns) {
    for (const auto& name : names)
        if (name.is_string() && !bits.contains(name.get<std::string>()))
            bits[name.get<std::string>()] = {
                {"proven", "confirmed"}, {"by", by}, {"utc", instant_of(utc_ns)}};
    return bits;
}

}  // namespace vibrig::commission
