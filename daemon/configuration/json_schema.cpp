#include <nlohmann/json.hpp>
#include <string>
#include <utility>

#include "daemon/configuration/configuration.hpp"
#include "daemon/configuration/forms.hpp"
#include "daemon/configuration/schema.hpp"

namespace vibrig::configuration {

namespace {

using Json = nlohmann::ordered_json;

Json value_schema(const Key& key) {
    if (!key.json.empty()) return Json::parse(key.json);
    if (key.type == "string") return {{"type", "string"}};
    if (key.type == "boolean") return {{"type", "boolean"}};
    if (key.type == "tables") return {{"type", "array"}, {"items", {{"type", "object"}}}};
    return Json::object();
}

Json described(const Key& key, Configuration& defaults) {
    Json schema = value_schema(key);
    std::string text = key.doc;
    if (!key.unit.empty()) text += " [" + key.unit + "]";
    if (!key.bounds.empty()) text += "; " + key.bounds;
    schema["description"] = text;
    if (const std::string value = key.write(defaults); !value.empty()) {
        // Numbers, words and arrays are written as in TOML; inline tables are not.
        if (Json json = Json::parse(value, nullptr, false); !json.is_discarded())
            schema["default"] = std::move(json);
    }
    schema["x-type"] = key.type;
    schema["x-unit"] = key.unit;
    schema["x-bounds"] = key.bounds;
    schema["x-meaning"] = key.doc;
    return schema;
}

Json table() {
    return {{"type", "object"}, {"additionalProperties", false}, {"properties", Json::object()}};
}

/// Puts the key's schema below the tables that its name goes through.
void put(Json& root, const std::string& name, Json schema) {
    Json* at = &root;
    std::size_t begin = 0;
    for (std::size_t dot = name.find('.'); dot != std::string::npos; dot = name.find('.', begin)) {
        Json& next = (*at)["properties"][name.substr(begin, dot - begin)];
        if (next.is_null()) next = table();
        // A word that stands for "no table": false, or the table.
        if (next.contains("const")) {
            Json word = std::move(next);
            next = Json{{"anyOf", Json::array({std::move(word), table()})}};
        }
        at = next.contains("anyOf") ? &next["anyOf"][1] : &next;
        begin = dot + 1;
    }
    (*at)["properties"][name.substr(begin)] = std::move(schema);
}

Json conditions() {
    static constexpr std::array kFrom{"always", "armed", "excitation"};
    Json rows = Json::array();
    for (const rt::Condition& c : rt::kConditions) {
        if (c.trip == rt::Trip::none) continue;
        Json row{{"name", c.name},
                 {"text", c.text},
                 {"from", kFrom[static_cast<std::size_t>(c.from)]},
                 {"fixed", c.fixed},
                 {"unit", c.unit}};
        if (c.has_limit()) row["limits"] = {c.low, c.high};
        rows.push_back(std::move(row));
    }
    return rows;
}

Json default_rows() {
    static constexpr std::array kReactions{"off", "alarm", "abort"};
    Json rows = Json::array();
    for (const rt::Rule& rule : rt::default_interlock()) {
        Json row{{"name", rule.name},
                 {"condition", rt::condition_of(rule.condition).name},
                 {"reaction", kReactions[static_cast<std::size_t>(rule.reaction)]},
                 {"dwell_s", rule.dwell_s},
                 {"latched", rule.latched}};
        if (rt::condition_of(rule.condition).has_limit()) row["limit"] = rule.limit;
        rows.push_back(std::move(row));
    }
    return rows;
}

}  // namespace

std::string format_json_schema() {
    Json root = table();
    Configuration defaults;
    for (const Key& key : schema()) put(root, key.name, described(key, defaults));
    Json out{{"$schema", "https://json-schema.org/draft/2020-12/schema"},
             {"title", "Configuration of vibrigd"}};
    out.update(root);
    out["x-conditions"] = conditions();
    out["x-rows"] = default_rows();
    return out.dump(1) + "\n";
}

}  // namespace vibrig::configuration
