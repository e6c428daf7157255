#include "daemon/configuration/key.hpp"

#include <algorithm>
#include <cmath>

#include "daemon/configuration/value.hpp"

namespace vibrig::configuration {

namespace {

std::string bounds_of(Range range) { return plain(range.low) + " to " + plain(range.high); }

std::string list_of(const std::vector<std::string>& words) {
    std::string list;
    for (const std::string& word : words) {
        list += (list.empty() ? "\"" : " | \"") + word + "\"";
    }
    return list;
}

}  // namespace

Key converted(std::string name, std::string unit, Range range, std::string doc,
              std::function<double(Configuration&)> get,
              std::function<void(Configuration&, double)> set) {
    auto read = [name, unit, range, set = std::move(set)](const toml::node& node, Configuration& c,
                                                          Problems& problems) {
        if (const auto value = read_number(node, name, range, unit, problems)) {
            set(c, *value);
        }
    };
    auto write = [get = std::move(get)](Configuration& c) { return write_number(get(c)); };
    return {std::move(name), "number", std::move(unit),  bounds_of(range),
            std::move(doc),  read,     std::move(write), schema_of(range)};
}

Key number(std::string name, std::string unit, Range range, std::string doc, At<double> at) {
    return converted(
        std::move(name), std::move(unit), range, std::move(doc),
        [at](Configuration& c) { return at(c); },
        [at](Configuration& c, double value) { at(c) = value; });
}

Key milliseconds(std::string name, Range range, std::string doc, At<drivers::Time> at) {
    return converted(
        std::move(name), "ms", range, std::move(doc),
        [at](Configuration& c) { return static_cast<double>(at(c)) / 1e6; },
        [at](Configuration& c, double value) { at(c) = drivers::from_seconds(value / 1e3); });
}

Key seconds(std::string name, Range range, std::string doc, At<drivers::Time> at) {
    return converted(
        std::move(name), "s", range, std::move(doc),
        [at](Configuration& c) { return static_cast<double>(at(c)) / 1e9; },
        [at](Configuration& c, double value) { at(c) = drivers::from_seconds(value); });
}

Key integer(std::string name, std::string unit, int low, int high, std::string doc,
            std::function<int(Configuration&)> get, std::function<void(Configuration&, int)> set) {
    const std::string bounds = std::to_string(low) + " to " + std::to_string(high);
    auto read = [name, unit, low, high, bounds, set = std::move(set)](
                    const toml::node& node, Configuration& c, Problems& problems) {
        const auto* whole = node.as_integer();
        if (whole == nullptr || whole->get() < low || whole->get() > high) {
            problems.add(place_of(node.source()), name, describe(node),
                         "an integer from " + bounds + (unit.empty() ? "" : " " + unit));
            return;
        }
        set(c, static_cast<int>(whole->get()));
    };
    auto write = [get = std::move(get)](Configuration& c) { return std::to_string(get(c)); };
    const std::string json = R"({"type":"integer","minimum":)" + std::to_string(low) +
                             R"(,"maximum":)" + std::to_string(high) + '}';
    return {std::move(name), "integer", std::move(unit),  bounds,
            std::move(doc),  read,      std::move(write), json};
}

Key integer(std::string name, std::string unit, int low, int high, std::string doc, At<int> at) {
    return integer(
        std::move(name), std::move(unit), low, high, std::move(doc),
        [at](Configuration& c) { return at(c); },
        [at](Configuration& c, int value) { at(c) = value; });
}

Key boolean(std::string name, std::string doc, At<bool> at) {
    auto read = [name, at](const toml::node& node, Configuration& c, Problems& problems) {
        if (const auto* value = node.as_boolean()) {
            at(c) = value->get();
        } else {
            problems.add(place_of(node.source()), name, describe(node), "true or false");
        }
    };
    auto write = [at](Configuration& c) { return std::string(at(c) ? "true" : "false"); };
    return {std::move(name), "boolean", "", "", std::move(doc), read, std::move(write)};
}

Key text(std::string name, std::string bounds, std::string doc, TextRule rule, At<std::string> at) {
    auto read = [name, at, rule = std::move(rule), bounds](const toml::node& node, Configuration& c,
                                                           Problems& problems) {
        const auto* value = node.as_string();
        const std::string expected = value == nullptr ? "a string, " + bounds : rule(value->get());
        if (!expected.empty()) {
            problems.add(place_of(node.source()), name,
                         value == nullptr ? describe(node) : "\"" + printable(value->get()) + "\"",
                         expected);
            return;
        }
        at(c) = value->get();
    };
    auto write = [at](Configuration& c) { return write_text(at(c)); };
    return {std::move(name), "string", "", bounds, std::move(doc), read, std::move(write)};
}

Key choice(std::string name, std::vector<std::string> words, std::string doc,
           std::function<std::size_t(Configuration&)> get,
           std::function<void(Configuration&, std::size_t)> set) {
    const std::string bounds = list_of(words);
    auto read = [name, words, bounds, set = std::move(set)](const toml::node& node,
                                                            Configuration& c, Problems& problems) {
        const auto* value = node.as_string();
        const auto word =
            value == nullptr ? words.end() : std::find(words.begin(), words.end(), value->get());
        if (word == words.end()) {
            problems.add(place_of(node.source()), name,
                         value == nullptr ? describe(node) : "\"" + printable(value->get()) + "\"",
                         bounds);
            return;
        }
        set(c, static_cast<std::size_t>(word - words.begin()));
    };
    auto write = [get = std::move(get), words](Configuration& c) {
        return write_text(words.at(get(c)));
    };
    std::string json;
    for (const std::string& word : words) json += (json.empty() ? "\"" : ",\"") + word + '"';
    return {std::move(name),
            "choice",
            "",
            bounds,
            std::move(doc),
            read,
            std::move(write),
            R"({"enum":[)" + json + "]}"};
}

Key sign(std::string name, std::string doc, At<int> at) {
    auto read = [name, at](const toml::node& node, Configuration& c, Problems& problems) {
        const auto* whole = node.as_integer();
        if (whole == nullptr || (whole->get() != 1 && whole->get() != -1)) {
            problems.add(place_of(node.source()), name, describe(node), "1 or -1");
            return;
        }
        at(c) = static_cast<int>(whole->get());
    };
    auto write = [at](Configuration& c) { return std::to_string(at(c)); };
    return {std::move(name),  "integer",           "", "1 or -1", std::move(doc), read,
            std::move(write), R"({"enum":[1,-1]})"};
}

}  // namespace vibrig::configuration
