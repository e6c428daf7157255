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
    InterlockRow(const Entry& entry, const toml::table& table) : entry_(entry), table_(table) {}

    [[nodiscard]] std::optional<rt::Rule> read(const std::vector<rt::Rule>& present) {
        const std::size_t problems = entry_.problems.count();
        for (const auto& [name, node] : table_) {
            static const std::set<std::string_view> known{"name",  "condition", "reaction",
                                                          "limit", "dwell_s",   "latched"};
            if (!known.contains(name.str())) {
                entry_.part(node, std::string(name.str()))
                    .refuse("an unknown key",
                            "name, condition, reaction, limit, dwell_s or latched");
            }
        }
        rt::Rule rule;
        const std::string name = this->name();
        const auto same = std::ranges::find(present, name, &rt::Rule::name);
        if (name.empty()) return std::nullopt;
        if (same != present.end()) rule = *same;
        rule.name = name;
        if (const auto condition = part("condition")) {
            const auto* word = condition->node.as_string();
            const auto found = std::ranges::find_if(rt::kConditions, [word](const auto& c) {
                return word != nullptr && c.trip != rt::Trip::none && word->get() == c.name;
            });
            if (found == rt::kConditions.end()) {
                condition->refuse("one of " + condition_names());
                return std::nullopt;
            }
            if (same != present.end() && same->condition != found->trip) {
                condition->refuse(std::string(rt::condition_of(same->condition).name) +
                                  ", which the row of this name watches, or another name");
                return std::nullopt;
            }
            rule.condition = found->trip;
        } else if (same == present.end()) {
            missing("condition", "one of " + condition_names());
            return std::nullopt;
        }
        reaction(rule);
        limits(rule, same != present.end());
        return entry_.problems.count() == problems ? std::optional(rule) : std::nullopt;
    }

  private:
    [[nodiscard]] std::optional<Entry> part(const char* name) const {
        const auto* node = table_.get(name);
        return node == nullptr ? std::nullopt : std::optional<Entry>(entry_.part(*node, name));
    }
    void missing(const char* name, const std::string& expected) const {
        entry_.part(table_, name).refuse("nothing", expected);
    }

    /// Empty: it has none.
    [[nodiscard]] std::string name() const {
        const auto entry = part("name");
        if (!entry) {
            missing("name", "a name under which it is acknowledged");
            return {};
        }
        const auto* value = entry->node.as_string();
        const std::string wrong = value == nullptr ? "a string" : identifier_rule(value->get());
        if (wrong.empty()) return value->get();
        entry->refuse(wrong);
        return {};
    }

    void reaction(rt::Rule& rule) const {
        const rt::Condition& condition = rt::condition_of(rule.condition);
        if (const auto entry = part("reaction")) {
            const auto* word = entry->node.as_string();
            const auto found = std::ranges::find_if(kReactionWords, [word](const char* reaction) {
                return word != nullptr && word->get() == reaction;
            });
            if (found == kReactionWords.end())
                return entry->refuse("\"off\", \"alarm\" or \"abort\"");
            rule.reaction = static_cast<rt::Reaction>(found - kReactionWords.begin());
            if (condition.fixed && rule.name == condition.name &&
                rule.reaction != rt::Reaction::abort) {
                entry->refuse(std::string("\"abort\": ") + condition.text +
                              " always stops the shaker");
            }
        }
        if (const auto entry = part("latched")) {
            const auto* value = entry->node.as_boolean();
            if (value == nullptr) {
                entry->refuse("true or false");
            } else if (!value->get() && rule.reaction == rt::Reaction::abort) {
                entry->refuse("true: an abort latches until acknowledged");
            } else {
                rule.latched = value->get();
            }
        }
        if (rule.reaction == rt::Reaction::abort) rule.latched = true;
    }

    void limits(rt::Rule& rule, bool known) const {
        const rt::Condition& condition = rt::condition_of(rule.condition);
        if (const auto entry = part("limit")) {
            if (!condition.has_limit()) {
                entry->refuse(std::string("none: ") + condition.name + " has no limit of its own");
            } else {
                rule.limit = entry->number({condition.low, condition.high}, condition.unit)
                                 .value_or(rule.limit);
            }
        } else if (!known && condition.has_limit()) {
            missing("limit", expected_number({condition.low, condition.high}, condition.unit));
        }
        if (const auto entry = part("dwell_s")) {
            const bool edge = rule.condition == rt::Trip::can_lost ||
                              rule.condition == rt::Trip::read_back ||
                              rule.condition == rt::Trip::wrong_vibration ||
                              rule.condition == rt::Trip::stop_disobeyed;
            const double longest = edge ? 0 : condition.fixed ? kLongestFixedDwell_s : 3600;
            rule.dwell_s = entry->number({0, longest}, "s").value_or(rule.dwell_s);
        }
    }

    const Entry& entry_;
    const toml::table& table_;
};

void read_interlock(const Entry& entry, Configuration& c) {
    std::set<std::string> names;
    bool full = false;
    entry.tables("[[interlock]] tables", [&](const Entry& row, const toml::table& table) {
        if (full) return;
        const auto rule = InterlockRow(row, table).read(c.interlock);
        if (!rule) return;
        if (!names.insert(rule->name).second)
            return row.part(table, "name").refuse("\"" + rule->name + "\" again", "each name once");
        const auto same = std::ranges::find(c.interlock, rule->name, &rt::Rule::name);
        if (same != c.interlock.end()) {
            *same = *rule;
        } else if (c.interlock.size() == rt::kMostRules) {
            row.refuse("more than " + std::to_string(rt::kMostRules) + " rows", "fewer");
            full = true;
        } else {
            c.interlock.push_back(*rule);
        }
    });
}

std::string write_interlock(Configuration& c) {
    return write_list(c.interlock, [](const rt::Rule& rule) {
        const rt::Condition& condition = rt::condition_of(rule.condition);
        return "{ name = " + write_text(rule.name) + ", condition = " + write_text(condition.name) +
               ", reaction = " +
               write_text(kReactionWords[static_cast<std::size_t>(rule.reaction)]) +
               (condition.has_limit() ? ", limit = " + write_number(rule.limit) : "") +
               ", dwell_s = " + write_number(rule.dwell_s) +
               ", latched = " + (rule.latched ? "true" : "false") + " }";
    });
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

std::vector<Key> interlock_keys() {
    return {
        {kInterlock, "tables", "", "rows by name: conditions " + condition_names(),
         "what is watched: over its limit for dwell_s, it alarms or aborts; a row takes the place "
         "of the one of its name",
         read_interlock, write_interlock, interlock_schema()},
    };
}

}  // namespace vibrig::configuration
