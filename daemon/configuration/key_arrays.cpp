#include <algorithm>
#include <cmath>
#include <optional>

#include "daemon/configuration/key.hpp"
#include "daemon/configuration/problems.hpp"
#include "daemon/configuration/value.hpp"

namespace vibrig::configuration {

namespace {

/// Near beta = +-90 deg outer gimbal and azimuth turn about one axis (Tang et al. 2009, eq. 9
/// divides by cos beta).
constexpr Range kInner{-80, 80};
constexpr Range kFullTurn{-360, 360};
constexpr const char* kAxisSchema = R"({"enum":["+x","-x","+y","-y","+z","-z"]})";

std::string element(const std::string& key, std::size_t i) {
    return key + "[" + std::to_string(i) + "]";
}

std::optional<estimator::SignedAxis> read_axis(const toml::node& node, const std::string& key,
                                               Problems& problems) {
    const auto* value = node.as_string();
    const std::string text = value == nullptr ? "" : value->get();
    if (text.size() != 2 || (text[0] != '+' && text[0] != '-') || text[1] < 'x' || text[1] > 'z') {
        problems.add(place_of(node.source()), key, describe(node),
                     R"("+x", "-x", "+y", "-y", "+z" or "-z")");
        return std::nullopt;
    }
    return estimator::SignedAxis{text[1] - 'x', text[0] == '-' ? -1 : 1};
}

std::string write_axis(const estimator::SignedAxis& axis) {
    return std::string("\"") + (axis.sign < 0 ? '-' : '+') + static_cast<char>('x' + axis.axis) +
           '"';
}

double determinant(const std::array<std::array<double, 3>, 3>& m) {
    return m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) -
           m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0]) +
           m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0]);
}

}  // namespace

Key triple(std::string name, std::string unit, Range range, std::string doc,
           At<std::array<double, 3>> at) {
    auto read = [name, unit, range, at](const toml::node& node, Configuration& c,
                                        Problems& problems) {
        if (const auto value = read_triple(node, name, {range, range, range}, unit, problems)) {
            at(c) = *value;
        }
    };
    auto write = [at](Configuration& c) { return write_triple(at(c)); };
    const std::string bounds = "3 x " + plain(range.low) + " to " + plain(range.high);
    return {std::move(name), "numbers", std::move(unit), bounds,
            std::move(doc),  read,      write,           schema_of_array(schema_of(range), 3, 3)};
}

Key signs(std::string name, std::string doc, At<std::array<int, 3>> at) {
    auto read = [name, at](const toml::node& node, Configuration& c, Problems& problems) {
        const toml::array* array = read_array(node, name, 3, 3, "signs, 1 or -1", problems);
        for (std::size_t i = 0; array != nullptr && i < 3; ++i) {
            const auto* whole = array->get(i)->as_integer();
            if (whole == nullptr || (whole->get() != 1 && whole->get() != -1)) {
                problems.add(place_of(array->get(i)->source()), element(name, i),
                             describe(*array->get(i)), "1 or -1");
                continue;
            }
            at(c)[i] = static_cast<int>(whole->get());
        }
    };
    auto write = [at](Configuration& c) {
        const std::array<int, 3>& value = at(c);
        return "[" + std::to_string(value[0]) + ", " + std::to_string(value[1]) + ", " +
               std::to_string(value[2]) + "]";
    };
    return {std::move(name), "integers", "",    "3 x 1 or -1",
            std::move(doc),  read,       write, schema_of_array(R"({"enum":[1,-1]})", 3, 3)};
}

Key matrix(std::string name, std::string doc, At<std::array<std::array<double, 3>, 3>> at) {
    constexpr double kSingular = 1e-3;
    auto read = [name, at](const toml::node& node, Configuration& c, Problems& problems) {
        const toml::array* rows = read_array(node, name, 3, 3, "rows of 3 numbers", problems);
        std::array<std::array<double, 3>, 3> value{};
        bool good = rows != nullptr;
        for (std::size_t i = 0; rows != nullptr && i < 3; ++i) {
            constexpr Range kRange{-10, 10};
            const auto row = read_triple(*rows->get(i), element(name, i), {kRange, kRange, kRange},
                                         "", problems);
            good = good && row.has_value();
            value[i] = row.value_or(std::array<double, 3>{});
        }
        if (good && std::abs(determinant(value)) < kSingular) {
            problems.add(
                place_of(node.source()), name,
                "a matrix with determinant " + plain(determinant(value)),
                "one that can be inverted (determinant " + plain(kSingular) + " at least)");
            good = false;
        }
        if (good) {
            at(c) = value;
        }
    };
    auto write = [at](Configuration& c) {
        const auto& m = at(c);
        return "[" + write_triple(m[0]) + ", " + write_triple(m[1]) + ", " + write_triple(m[2]) +
               "]";
    };
    return {std::move(name),
            "matrix",
            "",
            "3 x 3, invertible",
            std::move(doc),
            read,
            write,
            schema_of_array(schema_of_array(schema_of({-10, 10}), 3, 3), 3, 3)};
}

Key axis(std::string name, std::string doc, At<estimator::SignedAxis> at) {
    auto read = [name, at](const toml::node& node, Configuration& c, Problems& problems) {
        if (const auto value = read_axis(node, name, problems)) {
            at(c) = *value;
        }
    };
    auto write = [at](Configuration& c) { return write_axis(at(c)); };
    return {std::move(name), "axis", "",    R"("+x" ... "-z")",
            std::move(doc),  read,   write, kAxisSchema};
}

Key axes(std::string name, std::string doc, At<std::array<estimator::SignedAxis, 3>> at) {
    auto read = [name, at](const toml::node& node, Configuration& c, Problems& problems) {
        const toml::array* array = read_array(node, name, 3, 3, "axes", problems);
        std::array<estimator::SignedAxis, 3> value{};
        std::array<bool, 3> taken{};
        bool good = array != nullptr;
        for (std::size_t i = 0; array != nullptr && i < 3; ++i) {
            const auto one = read_axis(*array->get(i), element(name, i), problems);
            if (!one) {
                good = false;
                continue;
            }
            value[i] = *one;
            const auto index = static_cast<std::size_t>(one->axis);
            if (taken[index]) {
                problems.add(place_of(array->get(i)->source()), element(name, i),
                             write_axis(*one) + " a second time",
                             "input, output and spin along x, y and z in some order");
                good = false;
            }
            taken[index] = true;
        }
        if (good) {
            at(c) = value;
        }
    };
    auto write = [at](Configuration& c) {
        const auto& value = at(c);
        return "[" + write_axis(value[0]) + ", " + write_axis(value[1]) + ", " +
               write_axis(value[2]) + "]";
    };
    return {std::move(name), "axes", "",    "x, y and z once each",
            std::move(doc),  read,   write, schema_of_array(kAxisSchema, 3, 3)};
}

Key numbers(std::string name, std::string unit, Range range, std::size_t at_most, std::string doc,
            At<std::vector<double>> at) {
    auto read = [name, unit, range, at_most, at](const toml::node& node, Configuration& c,
                                                 Problems& problems) {
        const toml::array* array = read_array(node, name, 1, at_most, "numbers", problems);
        if (array == nullptr) {
            return;
        }
        std::vector<double> value;
        for (std::size_t i = 0; i < array->size(); ++i) {
            if (const auto one =
                    read_number(*array->get(i), element(name, i), range, unit, problems)) {
                value.push_back(*one);
            }
        }
        if (value.size() == array->size()) {
            at(c) = std::move(value);
        }
    };
    auto write = [at](Configuration& c) {
        std::string text;
        for (const double value : at(c)) {
            text += (text.empty() ? "" : ", ") + write_number(value);
        }
        return "[" + text + "]";
    };
    const std::string bounds = "1 to " + std::to_string(at_most) + " numbers from " +
                               plain(range.low) + " to " + plain(range.high);
    return {
        std::move(name), "numbers", std::move(unit), bounds,
        std::move(doc),  read,      write,           schema_of_array(schema_of(range), 1, at_most)};
}

Key names(std::string name, std::size_t at_most, std::string doc, At<std::vector<std::string>> at) {
    auto read = [name, at_most, at](const toml::node& node, Configuration& c, Problems& problems) {
        const toml::array* array = read_array(node, name, 1, at_most, "names", problems);
        std::vector<std::string> value;
        for (std::size_t i = 0; array != nullptr && i < array->size(); ++i) {
            const auto* one = array->get(i)->as_string();
            const bool fits = one != nullptr && !one->get().empty() && one->get().size() <= 40 &&
                              printable(one->get()) == one->get();
            if (!fits || std::ranges::find(value, one->get()) != value.end()) {
                problems.add(place_of(array->get(i)->source()), element(name, i),
                             describe(*array->get(i)),
                             "a name of 1 to 40 printable characters, each once");
                return;
            }
            value.push_back(one->get());
        }
        if (array != nullptr) at(c) = std::move(value);
    };
    auto write = [at](Configuration& c) {
        std::string text;
        for (const auto& one : at(c)) text += (text.empty() ? "" : ", ") + write_text(one);
        return "[" + text + "]";
    };
    return {std::move(name),
            "names",
            "",
            "1 to " + std::to_string(at_most) + " names",
            std::move(doc),
            read,
            write,
            schema_of_array(R"({"type":"string","minLength":1,"maxLength":40})", 1, at_most)};
}

Key travels(std::string name, std::string doc, At<std::array<std::array<double, 2>, 3>> at) {
    auto read = [name, at](const toml::node& node, Configuration& c, Problems& problems) {
        const toml::array* rows = read_array(
            node, name, 3, 3, "ranges [lowest, highest] of outer, inner, azimuth", problems);
        for (std::size_t i = 0; rows != nullptr && i < 3; ++i) {
            const std::string place = element(name, i);
            const toml::array* ends =
                read_array(*rows->get(i), place, 2, 2, "numbers, lowest and highest", problems);
            if (ends == nullptr) continue;
            const auto low =
                read_number(*ends->get(0), element(place, 0), kFullTurn, "deg", problems);
            const auto high =
                read_number(*ends->get(1), element(place, 1), kFullTurn, "deg", problems);
            if (!low || !high) continue;
            if (!(*low < *high)) {
                problems.add(place_of(ends->source()), place,
                             "[" + plain(*low) + ", " + plain(*high) + "]",
                             "the lowest angle below the highest");
                continue;
            }
            at(c)[i] = {*low, *high};
        }
    };
    auto write = [at](Configuration& c) {
        std::string text;
        for (const auto& ends : at(c))
            text += (text.empty() ? "[" : ", [") + write_number(ends[0]) + ", " +
                    write_number(ends[1]) + "]";
        return "[" + text + "]";
    };
    return {std::move(name), "ranges", "deg", "3 x [lowest, highest], -360 to 360",
            std::move(doc),  read,     write};
}

Key positions(std::string name, std::size_t at_most, std::string doc,
              At<std::vector<std::array<double, 3>>> at) {
    auto read = [name, at_most, at](const toml::node& node, Configuration& c, Problems& problems) {
        const toml::array* array =
            read_array(node, name, 1, at_most, "positions [outer, inner, azimuth]", problems);
        if (array == nullptr) {
            return;
        }
        std::vector<std::array<double, 3>> value;
        for (std::size_t i = 0; i < array->size(); ++i) {
            if (const auto one = read_triple(*array->get(i), element(name, i),
                                             {kFullTurn, kInner, kFullTurn}, "deg", problems)) {
                value.push_back(*one);
            }
        }
        if (value.size() == array->size()) {
            at(c) = std::move(value);
        }
    };
    auto write = [at](Configuration& c) {
        std::string text;
        for (const auto& position : at(c)) {
            text += (text.empty() ? "" : ", ") + write_triple(position);
        }
        return "[" + text + "]";
    };
    const std::string bounds = "1 to " + std::to_string(at_most) +
                               " x [outer, inner, azimuth], |inner| <= " + plain(kInner.high);
    return {
        std::move(name), "positions",
        "deg",           bounds,
        std::move(doc),  read,
        write,           schema_of_array(schema_of_array(schema_of(kFullTurn), 3, 3), 1, at_most)};
}

}  // namespace vibrig::configuration
