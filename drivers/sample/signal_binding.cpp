#include "drivers/sample/signal_binding.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <cstddef>
#include <utility>
#include <vector>

#include "drivers/sample/assembler.hpp"
#include "proto/edits.hpp"
#include "proto/text.hpp"

namespace vibrig::drivers {
namespace {

constexpr std::size_t kOffers = 4;

std::string lower(std::string_view text) {
    std::string out(text);
    std::ranges::transform(out, out.begin(), [](unsigned char c) { return std::tolower(c); });
    return out;
}

/// The names nearest to `wanted`, upper and lower case alike, nearest first.
std::string nearest(const std::vector<std::string>& names, std::string_view wanted) {
    std::vector<std::pair<std::size_t, std::string>> ranked;
    ranked.reserve(names.size());
    for (const std::string& name : names)
        ranked.emplace_back(proto::edits(lower(name), lower(wanted)), name);
    std::stable_sort(ranked.begin(), ranked.end(),
                     [](const auto& a, const auto& b) { return a.first < b.first; });
    std::string list;
    for (std::size_t i = 0; i < std::min(kOffers, ranked.size()); ++i) {
        list += (i == 0 ? "" : ", ") + ranked[i].second;
    }
    return list.empty() ? "nothing" : list + (ranked.size() > kOffers ? ", ..." : "");
}

}  // namespace

BindingError::BindingError(std::string key, std::string value, const std::string& offer)
    : std::runtime_error(key + ": found \"" + value + "\", expected " + offer),
      key_(std::move(key)),
      value_(std::move(value)) {}

namespace {

std::string lines_of(const std::vector<BindingError>& all) {
    std::string text;
    for (const BindingError& one : all)
        text += (text.empty() ? "" : "\n") + std::string(one.what());
    return text;
}

}  // namespace

BindingError::BindingError(std::vector<BindingError> all)
    : std::runtime_error(lines_of(all)), key_(all.front().key()), value_(all.front().value()) {
    if (all.size() > 1) all_ = std::move(all);
}

void expect_unit(const BoundSignal& bound, const std::string& key, const std::string& name,
                 std::string_view unit) {
    // What a file is likely to state in place of deg, g, degC, m/s, arcsec and deg/h.
    static constexpr std::array<std::string_view, 38> kUnits{
        "rad",    "mrad",    "urad",        "turn",   "turns",    "rev",  "revs", "gon",
        "arcmin", "arcsec",  "mdeg",        "deg",    "g",        "mg",   "ug",   "m/s^2",
        "m/s2",   "m/s\xb2", "m/s\xc2\xb2", "cm/s^2", "k",        "degf", "degc", "m/s",
        "mm/s",   "cm/s",    "km/h",        "kn",     "knots",    "mph",  "ft/s", "rad/s",
        "mrad/s", "deg/s",   "deg/min",     "rad/h",  "arcsec/s", "deg/h"};
    if (!bound || unit.empty()) return;
    const std::string stated = lower(proto::trimmed(bound.signal->unit));
    if (stated == lower(unit) || std::ranges::find(kUnits, stated) == kUnits.end()) return;
    throw BindingError(key, name,
                       "a signal in " + std::string(unit) + "; in the DBC it is in " +
                           proto::printable(bound.signal->unit) +
                           " (scale, offset, range and unit there: those of " + std::string(unit) +
                           ")");
}

BoundSignal bind_signal(const proto::Dbc& dbc, const std::string& key, const std::string& name) {
    if (name.empty()) return {};
    const std::size_t dot = name.find('.');
    const std::string_view message_name = std::string_view(name).substr(0, dot);
    if (dot != std::string::npos) {
        if (const proto::Message* message = dbc.find(message_name)) {
            if (const proto::Signal* signal =
                    message->find(std::string_view(name).substr(dot + 1))) {
                return {message, signal};
            }
            std::vector<std::string> signals;
            for (const proto::Signal& signal : message->signals)
                signals.push_back(message->name + "." + signal.name);
            throw BindingError(key, name,
                               "a signal of message " + message->name + "; the DBC offers " +
                                   nearest(signals, name));
        }
    }
    std::vector<std::string> all;
    for (const proto::Message& message : dbc.messages) {
        for (const proto::Signal& signal : message.signals)
            all.push_back(message.name + "." + signal.name);
    }
    throw BindingError(key, name, "Message.Signal of the DBC, which offers " + nearest(all, name));
}

BoundSignal bind_signal(const proto::Dbc& dbc, const std::string& key, const std::string& name,
                        std::string_view unit) {
    const BoundSignal bound = bind_signal(dbc, key, name);
    expect_unit(bound, key, name, unit);
    return bound;
}

}  // namespace vibrig::drivers
