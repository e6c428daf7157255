#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "daemon/configuration/schema.hpp"

namespace vibrig::configuration {

/// Where a key's value lives in the configuration.
template <class T>
using At = std::function<T&(Configuration&)>;

/// At the end of a path of members, from the configuration on.
template <class... Members>
[[nodiscard]] constexpr auto at(Members... path) {
    return [path...](Configuration & c) -> auto& { return (c.*....*path); };
}

/// at() for the members of one part of the configuration.
template <class... Members>
[[nodiscard]] constexpr auto part(Members... path) {
    return [path...](auto... members) { return at(path..., members...); };
}

/// Both ends included.
struct Range {
    double low;
    double high;
};

/// Empty: the text is fine; else what was expected.
using TextRule = std::function<std::string(const std::string&)>;

[[nodiscard]] Key number(std::string name, At<double> at, std::string unit, Range range,
                         std::string doc);
/// A time that a person writes as a number: `shown` makes it one, `kept` a time of it.
[[nodiscard]] Key converted(std::string name, At<drivers::Time> at, std::string unit, Range range,
                            std::string doc, double (*shown)(drivers::Time),
                            drivers::Time (*kept)(double));
[[nodiscard]] Key milliseconds(std::string name, At<drivers::Time> at, Range range,
                               std::string doc);
[[nodiscard]] Key seconds(std::string name, At<drivers::Time> at, Range range, std::string doc);
[[nodiscard]] Key integer(std::string name, At<int> at, std::string unit, int low, int high,
                          std::string doc);
[[nodiscard]] Key integer(std::string name, At<std::uint16_t> at, std::string unit, int low,
                          int high, std::string doc);
[[nodiscard]] Key boolean(std::string name, At<bool> at, std::string doc);
[[nodiscard]] Key text(std::string name, At<std::string> at, std::string bounds, std::string doc,
                       TextRule rule);
/// One of some words, by its place among them.
[[nodiscard]] Key choice(std::string name, std::vector<std::string> words, std::string doc,
                         std::function<std::size_t(Configuration&)> get,
                         std::function<void(Configuration&, std::size_t)> set);
[[nodiscard]] Key sign(std::string name, At<int> at, std::string doc);

[[nodiscard]] Key triple(std::string name, At<std::array<double, 3>> at, std::string unit,
                         Range range, std::string doc);
[[nodiscard]] Key signs(std::string name, At<std::array<int, 3>> at, std::string doc);
[[nodiscard]] Key matrix(std::string name, At<std::array<std::array<double, 3>, 3>> at,
                         std::string doc);
[[nodiscard]] Key axis(std::string name, At<estimator::SignedAxis> at, std::string doc);
[[nodiscard]] Key axes(std::string name, At<std::array<estimator::SignedAxis, 3>> at,
                       std::string doc);
[[nodiscard]] Key numbers(std::string name, At<std::vector<double>> at, std::string unit,
                          Range range, std::size_t at_most, std::string doc);
/// Names that differ, each of 1 to 40 printable characters.
[[nodiscard]] Key names(std::string name, At<std::vector<std::string>> at, std::size_t at_most,
                        std::string doc);
/// [lowest, highest] each of outer, inner and azimuth.
[[nodiscard]] Key travels(std::string name, At<std::array<std::array<double, 2>, 3>> at,
                          std::string doc);
[[nodiscard]] Key positions(std::string name, At<std::vector<std::array<double, 3>>> at,
                            std::size_t at_most, std::string doc);

/// choice() over an enumeration; the words stand in the order of `values`.
template <class E>
[[nodiscard]] Key choice(std::string name, At<E> at, std::vector<std::pair<std::string, E>> values,
                         std::string doc) {
    std::vector<std::string> words;
    for (const auto& [word, value] : values) {
        words.push_back(word);
    }
    return choice(
        std::move(name), std::move(words), std::move(doc),
        [values, at](Configuration& c) -> std::size_t {
            for (std::size_t i = 0; i < values.size(); ++i) {
                if (values[i].second == at(c)) {
                    return i;
                }
            }
            return 0;
        },
        [values, at](Configuration& c, std::size_t i) { at(c) = values[i].second; });
}

}  // namespace vibrig::configuration
