#include <array>
#include <cstdio>

#include "daemon/configuration/key.hpp"
#include "daemon/configuration/rules.hpp"
#include "daemon/configuration/value.hpp"

namespace vibrig::configuration {

namespace {

using C = Configuration;

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

void read_instrument(const Entry& entry, const toml::table& table, C& c) {
    Instrument to;
    const std::size_t problems = entry.problems.count();
    for (const auto& [name, node] : table) {
        const std::string part(name.str());
        const Entry of = entry.part(node, part);
        std::string* text = part == "name"          ? &to.name
                            : part == "serial"      ? &to.serial
                            : part == "certificate" ? &to.certificate
                            : part == "uncertainty" ? &to.uncertainty
                                                    : nullptr;
        if (part == "due") {
            if (const auto* date = node.as_date()) {
                to.due = date_text(date->get());
            } else {
                of.refuse("a date such as 2027-03-31");
            }
        } else if (text == nullptr) {
            of.refuse("an unknown key", "name, serial, certificate, uncertainty or due");
        } else if (const auto* value = node.as_string(); value == nullptr) {
            of.refuse("a string");
        } else if (const auto wrong = short_text_rule(value->get()); !wrong.empty()) {
            of.refuse(wrong);
        } else {
            *text = value->get();
        }
    }
    if (entry.problems.count() > problems) return;
    if (to.name.empty())
        return entry.part(table, "name").refuse("nothing", "what the instrument is");
    c.paperwork.instruments.push_back(std::move(to));
}

void read_instruments(const Entry& entry, C& c) {
    c.paperwork.instruments.clear();
    entry.tables(
        "[[instrument]] tables, at most 50",
        [&c](const Entry& row, const toml::table& table) { read_instrument(row, table, c); },
        kMostInstruments);
}

std::string write_instruments(C& c) {
    return write_list(c.paperwork.instruments, [](const Instrument& i) {
        return "{ name = " + write_text(i.name) + ", serial = " + write_text(i.serial) +
               ", certificate = " + write_text(i.certificate) +
               (i.uncertainty.empty() ? "" : ", uncertainty = " + write_text(i.uncertainty)) +
               (i.due.empty() ? "" : ", due = " + i.due) + " }";
    });
}

}  // namespace

std::vector<Key> paperwork_keys() {
    const auto paperwork = part(&C::paperwork);
    return {
        text("unit.type", paperwork(&Paperwork::unit_type), "at most 120 bytes",
             "unit under test, for the report", short_text_rule),
        text("unit.serial", paperwork(&Paperwork::unit_serial), "at most 120 bytes",
             "its serial number", short_text_rule),
        {"instrument", "tables", "", "rows: name, serial, certificate, uncertainty, due (a date)",
         "what it is measured with, for the report; an overdue one warns before arming",
         read_instruments, write_instruments, kInstrumentSchema},
    };
}

}  // namespace vibrig::configuration
