#include <set>

#include "daemon/configuration/key.hpp"
#include "daemon/configuration/rules.hpp"
#include "daemon/configuration/value.hpp"

namespace vibrig::configuration {

namespace {

constexpr std::size_t kMostInstruments = 50;
// A date has no type of its own in JSON.
constexpr const char* kInstrumentSchema =
    R"({"type":"array","maxItems":50,"items":{"type":"object","required":["name"],)"
    R"("additionalProperties":false,"properties":{"name":{"type":"string"},)"
    R"("serial":{"type":"string"},"certificate":{"type":"string"},"uncertainty":{"type":"string"},"due":{}}}})";

std::string date_text(const toml::date& date) {
    std::array<char, 24> text{};
    std::snprintf(text.data(), text.size(), "%04d-%02d-%02d", static_cast<int>(date.year),
                  static_cast<int>(date.month), static_cast<int>(date.day));
    return text.data();
}

bool read_instrument(const toml::table& table, const std::string& key, record::Instrument& to,
                     Problems& problems) {
    bool good = true;
    const auto refuse = [&](const toml::node& node, const std::string& part,
                            const std::string& found, const std::string& expected) {
        problems.add(place_of(node.source()), key + "." + part, found, expected);
        good = false;
    };
    for (const auto& [name, node] : table) {
        const std::string part(name.str());
        std::string* text = part == "name"          ? &to.name
                            : part == "serial"      ? &to.serial
                            : part == "certificate" ? &to.certificate
                            : part == "uncertainty" ? &to.uncertainty
                                                    : nullptr;
        if (part == "due") {
            if (const auto* date = node.as_date()) {
                to.due = date_text(date->get());
            } else {
                refuse(node, part, describe(node), "a date such as 2027-03-31");
            }
        } else if (text == nullptr) {
            refuse(node, part, "an unknown key", "name, serial, certificate, uncertainty or due");
        } else if (const auto* value = node.as_string(); value == nullptr) {
            refuse(node, part, describe(node), "a string");
        } else if (const auto wrong = short_text_rule(value->get()); !wrong.empty()) {
            refuse(node, part, describe(node), wrong);
        } else {
            *text = value->get();
        }
    }
    if (to.name.empty() && good) refuse(table, "name", "nothing", "what the instrument is");
    return good;
}

void read_instruments(const toml::node& node, Configuration& c, Problems& problems) {
    const auto* rows = node.as_array();
    if (rows == nullptr || rows->size() > kMostInstruments) {
        problems.add(place_of(node.source()), "instrument", describe(node),
                     "[[instrument]] tables, at most 50");
        return;
    }
    c.paperwork.instruments.clear();
    for (std::size_t i = 0; i < rows->size(); ++i) {
        const std::string key = "instrument[" + std::to_string(i) + "]";
        const auto* table = rows->get(i)->as_table();
        record::Instrument instrument;
        if (table == nullptr) {
            problems.add(place_of(rows->get(i)->source()), key, describe(*rows->get(i)), "a table");
        } else if (read_instrument(*table, key, instrument, problems)) {
            c.paperwork.instruments.push_back(std::move(instrument));
        }
    }
}

std::string write_instruments(Configuration& c) {
    std::string text;
    for (const auto& i : c.paperwork.instruments) {
        text += (text.empty() ? "" : ", ") + std::string("{ name = ") + write_text(i.name) +
                ", serial = " + write_text(i.serial) +
                ", certificate = " + write_text(i.certificate) +
                (i.uncertainty.empty() ? "" : ", uncertainty = " + write_text(i.uncertainty)) +
                (i.due.empty() ? "" : ", due = " + i.due) + " }";
    }
    return "[" + text + "]";
}

}  // namespace

void add_paperwork_keys(std::vector<Key>& keys) {
    keys.push_back(text(
        "unit.type", "at most 120 bytes", "unit under test, for the report", short_text_rule,
        [](Configuration & c) -> auto& { return c.paperwork.unit_type; }));
    keys.push_back(text(
        "unit.serial", "at most 120 bytes", "its serial number", short_text_rule,
        [](Configuration & c) -> auto& { return c.paperwork.unit_serial; }));
    keys.push_back({"instrument", "tables", "",
                    "rows: name, serial, certificate, uncertainty, due (a date)",
                    "what it is measured with, for the report; an overdue one warns before arming",
                    read_instruments, write_instruments, kInstrumentSchema});
}

}  // namespace vibrig::configuration
