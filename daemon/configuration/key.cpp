#include "daemon/configuration/key.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <optional>
#include <utility>

#include "daemon/configuration/problems.hpp"
#include "daemon/configuration/value.hpp"
#include "estimator/filter/settings_check.hpp"
#include "proto/text.hpp"

namespace vibrig::configuration {

namespace {

/// Near beta = +-90 deg outer gimbal and azimuth turn about one axis (Tang et al. 2009, eq. 9
/// divides by cos beta).
constexpr Range kInner{-80, 80};
constexpr Range kFullTurn{-360, 360};
constexpr Range kMatrix{-10, 10};
constexpr const char* kAxisSchema = R"({"enum":["+x","-x","+y","-y","+z","-z"]})";
constexpr const char* kSignSchema = R"({"enum":[1,-1]})";

using Ends = std::array<double, 2>;
using Matrix = std::array<std::array<double, 3>, 3>;

/// What a person reads of a key.
struct Said {
    std::string name, type, unit, bounds, doc;
    std::string json{};
};

/// A key whose value `read` gives of an Entry, or adds a problem, and whose TOML `write` makes of
/// it.
template <class T, class Read, class Write>
Key key_of(Said said, At<T> at, Read read, Write write) {
    auto take = [at, read](const Entry& entry, Configuration& c) {
        if (auto value = read(entry)) at(c) = std::move(*value);
    };
    auto show = [at, write](Configuration& c) -> std::string { return write(at(c)); };
    return {said.name, said.type, said.unit, said.bounds, said.doc, take, show, said.json};
}

std::string bounds_of(Range range) { return plain(range.low) + " to " + plain(range.high); }

/// A number: `kept` makes a value of it, `shown` a number of the value.
template <class T, class Shown, class Kept>
Key number_of(std::string name, At<T> at, std::string unit, Range range, std::string doc,
              Shown shown, Kept kept) {
    return key_of(
        {name, "number", unit, bounds_of(range), doc, schema_of(range)}, std::move(at),
        [=](const Entry& entry) {
            const auto value = entry.number(range, unit);
            return value ? std::optional<T>(kept(*value)) : std::nullopt;
        },
        [shown](T value) { return write_number(shown(value)); });
}

template <class T>
Key integer_of(std::string name, At<T> at, std::string unit, int low, int high, std::string doc) {
    const std::string bounds = std::to_string(low) + " to " + std::to_string(high);
    const std::string json = R"({"type":"integer","minimum":)" + std::to_string(low) +
                             R"(,"maximum":)" + std::to_string(high) + '}';
    return key_of(
        {name, "integer", unit, bounds, doc, json}, std::move(at),
        [=](const Entry& entry) -> std::optional<T> {
            const auto* whole = entry.node.as_integer();
            if (whole != nullptr && whole->get() >= low && whole->get() <= high)
                return static_cast<T>(whole->get());
            entry.refuse("an integer from " + bounds + (unit.empty() ? "" : " " + unit));
            return std::nullopt;
        },
        [](int value) { return std::to_string(value); });
}

std::optional<int> read_sign(const Entry& entry) {
    const auto* whole = entry.node.as_integer();
    if (whole != nullptr && (whole->get() == 1 || whole->get() == -1))
        return static_cast<int>(whole->get());
    entry.refuse("1 or -1");
    return std::nullopt;
}

std::string write_sign(int sign) { return std::to_string(sign); }

std::optional<estimator::SignedAxis> read_axis(const Entry& entry) {
    const auto* value = entry.node.as_string();
    const std::string text = value == nullptr ? "" : value->get();
    if (text.size() != 2 || (text[0] != '+' && text[0] != '-') || text[1] < 'x' || text[1] > 'z') {
        entry.refuse(R"("+x", "-x", "+y", "-y", "+z" or "-z")");
        return std::nullopt;
    }
    return estimator::SignedAxis{text[1] - 'x', text[0] == '-' ? -1 : 1};
}

std::string write_axis(const estimator::SignedAxis& axis) {
    return std::string("\"") + (axis.sign < 0 ? '-' : '+') + static_cast<char>('x' + axis.axis) +
           '"';
}

/// The three elements of an array.
template <class Read>
auto read_three(const Entry& entry, const std::string& what, Read read) {
    const auto list = entry.elements(3, 3, what, read);
    std::optional<std::array<typename decltype(read(entry))::value_type, 3>> three;
    if (list) three = {(*list)[0], (*list)[1], (*list)[2]};
    return three;
}

std::optional<Matrix> read_matrix(const Entry& entry) {
    constexpr double kSingular = 1e-3;
    auto value = read_three(entry, "rows of 3 numbers", [](const Entry& row) {
        return row.triple({kMatrix, kMatrix, kMatrix}, "");
    });
    if (value && std::abs(estimator::determinant(*value)) < kSingular) {
        entry.refuse("a matrix with determinant " + plain(estimator::determinant(*value)),
                     "one that can be inverted (determinant " + plain(kSingular) + " at least)");
        value.reset();
    }
    return value;
}

std::optional<std::array<estimator::SignedAxis, 3>> read_axes(const Entry& entry) {
    std::array<bool, 3> taken{};
    return read_three(entry, "axes", [&taken](const Entry& one) {
        auto value = read_axis(one);
        if (value && std::exchange(taken[static_cast<std::size_t>(value->axis)], true)) {
            one.refuse(write_axis(*value) + " a second time",
                       "input, output and spin along x, y and z in some order");
            value.reset();
        }
        return value;
    });
}

std::optional<std::vector<std::string>> read_names(const Entry& entry, std::size_t at_most) {
    const toml::array* array = entry.array(1, at_most, "names");
    if (array == nullptr) return std::nullopt;
    std::vector<std::string> value;
    for (std::size_t i = 0; i < array->size(); ++i) {
        const auto* one = array->get(i)->as_string();
        const bool fits = one != nullptr && !one->get().empty() && one->get().size() <= 40 &&
                          proto::printable(one->get(), kQuotedValue) == one->get();
        if (!fits || std::ranges::find(value, one->get()) != value.end()) {
            entry.element(i).refuse("a name of 1 to 40 printable characters, each once");
            return std::nullopt;
        }
        value.push_back(one->get());
    }
    return value;
}

/// [lowest, highest]
std::optional<Ends> read_ends(const Entry& entry) {
    const auto ends = entry.elements(2, 2, "numbers, lowest and highest",
                                     [](const Entry& one) { return one.number(kFullTurn, "deg"); });
    if (!ends) return std::nullopt;
    const double low = (*ends)[0], high = (*ends)[1];
    if (low < high) return Ends{low, high};
    entry.refuse("[" + plain(low) + ", " + plain(high) + "]", "the lowest angle below the highest");
    return std::nullopt;
}

std::string write_ends(const Ends& ends) { return write_list(ends, write_number); }

}  // namespace

Key number(std::string name, At<double> at, std::string unit, Range range, std::string doc) {
    return number_of(name, at, unit, range, doc, std::identity{}, std::identity{});
}

Key converted(std::string name, At<drivers::Time> at, std::string unit, Range range,
              std::string doc, double (*shown)(drivers::Time), drivers::Time (*kept)(double)) {
    return number_of(name, at, unit, range, doc, shown, kept);
}

Key milliseconds(std::string name, At<drivers::Time> at, Range range, std::string doc) {
    return converted(
        name, at, "ms", range, doc,
        [](drivers::Time time) { return static_cast<double>(time) / 1e6; },
        [](double value) { return drivers::from_seconds(value / 1e3); });
}

Key seconds(std::string name, At<drivers::Time> at, Range range, std::string doc) {
    return converted(
        name, at, "s", range, doc,
        [](drivers::Time time) { return static_cast<double>(time) / 1e9; },
        [](double value) { return drivers::from_seconds(value); });
}

Key integer(std::string name, At<int> at, std::string unit, int low, int high, std::string doc) {
    return integer_of(name, at, unit, low, high, doc);
}

Key integer(std::string name, At<std::uint16_t> at, std::string unit, int low, int high,
            std::string doc) {
    return integer_of(name, at, unit, low, high, doc);
}

Key boolean(std::string name, At<bool> at, std::string doc) {
    return key_of(
        {name, "boolean", "", "", doc}, at,
        [](const Entry& entry) {
            const auto value = entry.node.value_exact<bool>();
            if (!value) entry.refuse("true or false");
            return value;
        },
        [](bool value) { return value ? "true" : "false"; });
}

Key text(std::string name, At<std::string> at, std::string bounds, std::string doc, TextRule rule) {
    return key_of(
        {name, "string", "", bounds, doc}, at,
        [=](const Entry& entry) { return entry.text("a string, " + bounds, rule); }, write_text);
}

Key choice(std::string name, std::vector<std::string> words, std::string doc,
           std::function<std::size_t(Configuration&)> get,
           std::function<void(Configuration&, std::size_t)> set) {
    std::string bounds, json;
    for (const std::string& word : words) {
        bounds += (bounds.empty() ? "\"" : " | \"") + word + "\"";
        json += (json.empty() ? "\"" : ",\"") + word + '"';
    }
    auto read = [=](const Entry& entry, Configuration& c) {
        auto found = words.end();
        const auto known = [&](const std::string& word) {
            found = std::ranges::find(words, word);
            return found == words.end() ? bounds : std::string();
        };
        if (entry.text(bounds, known)) set(c, static_cast<std::size_t>(found - words.begin()));
    };
    auto write = [=](Configuration& c) { return write_text(words.at(get(c))); };
    return {name, "choice", "", bounds, doc, read, write, R"({"enum":[)" + json + "]}"};
}

Key sign(std::string name, At<int> at, std::string doc) {
    return key_of({name, "integer", "", "1 or -1", doc, kSignSchema}, at, read_sign, write_sign);
}

Key triple(std::string name, At<std::array<double, 3>> at, std::string unit, Range range,
           std::string doc) {
    return key_of(
        {name, "numbers", unit, "3 x " + bounds_of(range), doc,
         schema_of_array(schema_of(range), 3, 3)},
        at,
        [=](const Entry& entry) {
            return entry.triple({range, range, range}, unit);
        },
        write_triple);
}

Key signs(std::string name, At<std::array<int, 3>> at, std::string doc) {
    return key_of(
        {name, "integers", "", "3 x 1 or -1", doc, schema_of_array(kSignSchema, 3, 3)}, at,
        [](const Entry& entry) { return read_three(entry, "signs, 1 or -1", read_sign); },
        [](const auto& value) { return write_list(value, write_sign); });
}

Key matrix(std::string name, At<Matrix> at, std::string doc) {
    return key_of({name, "matrix", "", "3 x 3, invertible", doc,
                   schema_of_array(schema_of_array(schema_of(kMatrix), 3, 3), 3, 3)},
                  at, read_matrix,
                  [](const Matrix& value) { return write_list(value, write_triple); });
}

Key axis(std::string name, At<estimator::SignedAxis> at, std::string doc) {
    return key_of({name, "axis", "", R"("+x" ... "-z")", doc, kAxisSchema}, at, read_axis,
                  write_axis);
}

Key axes(std::string name, At<std::array<estimator::SignedAxis, 3>> at, std::string doc) {
    return key_of(
        {name, "axes", "", "x, y and z once each", doc, schema_of_array(kAxisSchema, 3, 3)}, at,
        read_axes, [](const auto& value) { return write_list(value, write_axis); });
}

Key numbers(std::string name, At<std::vector<double>> at, std::string unit, Range range,
            std::size_t at_most, std::string doc) {
    const std::string bounds = "1 to " + std::to_string(at_most) + " numbers from ";
    return key_of(
        {name, "numbers", unit, bounds + bounds_of(range), doc,
         schema_of_array(schema_of(range), 1, at_most)},
        at,
        [=](const Entry& entry) {
            const auto read = [&](const Entry& one) { return one.number(range, unit); };
            return entry.elements(1, at_most, "numbers", read);
        },
        [](const auto& value) { return write_list(value, write_number); });
}

Key names(std::string name, At<std::vector<std::string>> at, std::size_t at_most, std::string doc) {
    return key_of(
        {name, "names", "", "1 to " + std::to_string(at_most) + " names", doc,
         schema_of_array(R"({"type":"string","minLength":1,"maxLength":40})", 1, at_most)},
        at, [=](const Entry& entry) { return read_names(entry, at_most); },
        [](const auto& value) { return write_list(value, write_text); });
}

Key travels(std::string name, At<std::array<std::array<double, 2>, 3>> at, std::string doc) {
    return key_of(
        {name, "ranges", "deg", "3 x [lowest, highest], -360 to 360", doc}, at,
        [](const Entry& entry) {
            return read_three(entry, "ranges [lowest, highest] of outer, inner, azimuth",
                              read_ends);
        },
        [](const auto& value) { return write_list(value, write_ends); });
}

Key positions(std::string name, At<std::vector<std::array<double, 3>>> at, std::size_t at_most,
              std::string doc) {
    const std::string bounds = "1 to " + std::to_string(at_most) +
                               " x [outer, inner, azimuth], |inner| <= " + plain(kInner.high);
    const auto read = [](const Entry& one) {
        return one.triple({kFullTurn, kInner, kFullTurn}, "deg");
    };
    return key_of(
        {name, "positions", "deg", bounds, doc,
         schema_of_array(schema_of_array(schema_of(kFullTurn), 3, 3), 1, at_most)},
        at,
        [=](const Entry& entry) {
            return entry.elements(1, at_most, "positions [outer, inner, azimuth]", read);
        },
        [](const auto& value) { return write_list(value, write_triple); });
}

}  // namespace vibrig::configuration
