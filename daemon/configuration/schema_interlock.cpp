#include <algorithm>
#include <optional>
#include <set>

#include "daemon/configuration/key.hpp"
#include "daemon/configuration/rules.hpp"
#include "daemon/configuration/value.hpp"

namespace vibrig::configuration {

namespace {

constexpr const char* kInterlock = "interlock";
constexpr std::array kReactionWords{"off", "alarm", "abort"};
// A condition that must stop the shaker may be lived with for this long at most.
constexpr double kLongestFixedDwell_s = 1;

std::string condition_names() {
    std::string names;
    for (const rt::Condition& condition : rt::kConditions) {
        if (condition.trip != rt::Trip::none)
            names += (names.empty() ? "" : ", ") + std::string(condition.name);
    }
    return names;
}

/// Takes one row over what the table has under that name, or adds it.
class InterlockRow {
  public:
    InterlockRow(const toml::table& table, const std::string& key, Problems& problems)
        : table_(table), key_(key), problems_(problems) {}

    [[nodiscard]] std::optional<rt::Rule> read(const std::vector<rt::Rule>& present) {
        for (const auto& [name, node] : table_) {
            static const std::set<std::string_view> known{"name",  "condition", "reaction",
                                                          "limit", "dwell_s",   "latched"};
            if (!known.contains(name.str())) {
                refuse(node, std::string(name.str()), "an unknown key",
                       "name, condition, reaction, limit, dwell_s or latched");
            }
        }
        rt::Rule rule;
        const std::string name = text("name", identifier_rule);
        const auto same = std::ranges::find(present, name, &rt::Rule::name);
        if (name.empty()) {
            if (table_.get("name") == nullptr)
                refuse(table_, "name", "nothing", "a name under which it is acknowledged");
            return std::nullopt;
        }
        if (same != present.end()) rule = *same;
        rule.name = name;
        if (const auto* node = table_.get("condition")) {
            const auto* word = node->as_string();
            const auto found = std::ranges::find_if(rt::kConditions, [word](const auto& c) {
                return word != nullptr && c.trip != rt::Trip::none && word->get() == c.name;
            });
            if (found == rt::kConditions.end()) {
                refuse(*node, "condition", describe(*node), "one of " + condition_names());
                return std::nullopt;
            }
            if (same != present.end() && same->condition != found->trip) {
                refuse(*node, "condition", describe(*node),
                       std::string(rt::condition_of(same->condition).name) +
                           ", which the row of this name watches, or another name");
                return std::nullopt;
            }
            rule.condition = found->trip;
        } else if (same == present.end()) {
            refuse(table_, "condition", "nothing", "one of " + condition_names());
            return std::nullopt;
        }
        reaction(rule);
        limits(rule, same != present.end());
        return good_ ? std::optional(rule) : std::nullopt;
    }

  private:
    void refuse(const toml::node& node, const std::string& part, const std::string& found,
                const std::string& expected) {
        good_ = false;
        problems_.add(place_of(node.source()), key_ + "." + part, found, expected);
    }

    [[nodiscard]] std::string text(const char* part, const TextRule& rule) {
        const auto* node = table_.get(part);
        if (node == nullptr) return {};
        const auto* value = node->as_string();
        const std::string wrong = value == nullptr ? "a string" : rule(value->get());
        if (!wrong.empty()) {
            refuse(*node, part, describe(*node), wrong);
            return {};
        }
        return value->get();
    }

    void reaction(rt::Rule& rule) {
        const rt::Condition& condition = rt::condition_of(rule.condition);
        if (const auto* node = table_.get("reaction")) {
            const auto* word = node->as_string();
            const auto found = std::ranges::find_if(kReactionWords, [word](const char* reaction) {
                return word != nullptr && word->get() == reaction;
            });
            if (found == kReactionWords.end()) {
                refuse(*node, "reaction", describe(*node), "\"off\", \"alarm\" or \"abort\"");
                return;
            }
            rule.reaction = static_cast<rt::Reaction>(found - kReactionWords.begin());
            if (condition.fixed && rule.name == condition.name &&
                rule.reaction != rt::Reaction::abort) {
                refuse(*node, "reaction", describe(*node),
                       std::string("\"abort\": ") + condition.text + " always stops the shaker");
            }
        }
        if (const auto* node = table_.get("latched")) {
            const auto* value = node->as_boolean();
            if (value == nullptr) {
                refuse(*node, "latched", describe(*node), "true or false");
            } else if (!value->get() && rule.reaction == rt::Reaction::abort) {
                refuse(*node, "latched", "false", "true: an abort latches until acknowledged");
            } else {
                rule.latched = value->get();
            }
        }
        if (rule.reaction == rt::Reaction::abort) rule.latched = true;
    }

    void limits(rt::Rule& rule, bool known) {
        const rt::Condition& condition = rt::condition_of(rule.condition);
        if (const auto* node = table_.get("limit")) {
            if (!condition.has_limit()) {
                refuse(*node, "limit", describe(*node),
                       std::string("none: ") + condition.name + " has no limit of its own");
            } else if (const auto value =
                           read_number(*node, key_ + ".limit", {condition.low, condition.high},
                                       condition.unit, problems_)) {
                rule.limit = *value;
            } else {
                good_ = false;
            }
        } else if (!known && condition.has_limit()) {
            refuse(table_, "limit", "nothing",
                   expected_number({condition.low, condition.high}, condition.unit));
        }
        if (const auto* node = table_.get("dwell_s")) {
            const bool edge = rule.condition == rt::Trip::can_lost ||
                              rule.condition == rt::Trip::read_back ||
                              rule.condition == rt::Trip::stop_disobeyed;
            const double longest = edge ? 0 : condition.fixed ? kLongestFixedDwell_s : 3600;
            if (const auto value =
                    read_number(*node, key_ + ".dwell_s", {0, longest}, "s", problems_)) {
                rule.dwell_s = *value;
            } else {
                good_ = false;
            }
        }
    }

    const toml::table& table_;
    std::string key_;
    Problems& problems_;
    bool good_ = true;
};

void read_interlock(const toml::node& node, Configuration& c, Problems& problems) {
    const auto* rows = node.as_array();
    if (rows == nullptr) {
        problems.add(place_of(node.source()), kInterlock, describe(node), "[[interlock]] tables");
        return;
    }
    std::set<std::string> names;
    for (std::size_t i = 0; i < rows->size(); ++i) {
        const std::string key = std::string(kInterlock) + "[" + std::to_string(i) + "]";
        const auto* table = rows->get(i)->as_table();
        if (table == nullptr) {
            problems.add(place_of(rows->get(i)->source()), key, describe(*rows->get(i)), "a table");
            continue;
        }
        const auto rule = InterlockRow(*table, key, problems).read(c.interlock);
        if (!rule) continue;
        if (!names.insert(rule->name).second) {
            problems.add(place_of(table->source()), key + ".name", "\"" + rule->name + "\" again",
                         "each name once");
            continue;
        }
        const auto same = std::ranges::find(c.interlock, rule->name, &rt::Rule::name);
        if (same != c.interlock.end()) {
            *same = *rule;
        } else if (c.interlock.size() == rt::kMostRules) {
            problems.add(place_of(table->source()), key,
                         "more than " + std::to_string(rt::kMostRules) + " rows", "fewer");
            return;
        } else {
            c.interlock.push_back(*rule);
        }
    }
}

std::string write_interlock(Configuration& c) {
    std::string text;
    for (const rt::Rule& rule : c.interlock) {
        const rt::Condition& condition = rt::condition_of(rule.condition);
        text += (text.empty() ? "" : ", ") + std::string("{ name = ") + write_text(rule.name) +
                ", condition = " + write_text(condition.name) + ", reaction = " +
                write_text(kReactionWords[static_cast<std::size_t>(rule.reaction)]);
        if (condition.has_limit()) text += ", limit = " + write_number(rule.limit);
        text += ", dwell_s = " + write_number(rule.dwell_s) +
                ", latched = " + (rule.latched ? "true" : "false") + " }";
    }
    return "[" + text + "]";
}

/// JSON Schema of the rows; what limit a condition takes is read_interlock's to say.
std::string interlock_schema() {
    std::string names;
    for (const rt::Condition& condition : rt::kConditions) {
        if (condition.trip == rt::Trip::none) continue;
        names += (names.empty() ? "\"" : ",\"") + std::string(condition.name) + '"';
    }
    return R"({"type":"array","items":{"type":"object","required":["name"],)"
           R"("additionalProperties":false,"properties":{"name":{"type":"string"},)"
           R"("condition":{"enum":[)" +
           names +
           R"(]},"reaction":{"enum":["off","alarm","abort"]},"limit":{"type":"number"},)"
           R"("dwell_s":{"type":"number","minimum":0,"maximum":3600},)"
           R"("latched":{"type":"boolean"}}}})";
}

}  // namespace

void add_interlock_keys(std::vector<Key>& keys) {
    keys.push_back({kInterlock, "tables", "", "rows by name: conditions " + condition_names(),
                    "what is watched: over its limit for dwell_s, it alarms or aborts; a row takes "
                    "the place of the one of its name",
                    read_interlock, write_interlock, interlock_schema()});
}

}  // namespace vibrig::configuration
