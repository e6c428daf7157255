#pragma once

#include <array>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "daemon/configuration/schema.hpp"

namespace vibrig::configuration {

/// Where a key's value lives in the configuration.
template <class T>
using At = std::function<T&(Configuration&)>;

/// Both ends included.
struct Range {
    double low;
    double high;
};

/// Empty: the text is fine; else what was expected.
using TextRule = std::function<std::string(const std::string&)>;

[[nodiscard]] Key number(std::string name, std::string unit, Range range, std::string doc,
                         At<double> at);
/// A number that is kept in another form than a person writes.
[[nodiscard]] Key converted(std::string name, std::string unit, Range range, std::string doc,
                            std::function<double(Configuration&)> get,
                            std::function<void(Configuration&, double)> set);
[[nodiscard]] Key milliseconds(std::string name, Range range, std::string doc,
                               At<drivers::Time> at);
[[nodiscard]] Key seconds(std::string name, Range range, std::string doc, At<drivers::Time> at);
[[nodiscard]] Key integer(std::string name, std::string unit, int low, int high, std::string doc,
                          std::function<int(Configuration&)> get,
                          std::function<void(Configuration&, int)> set);
[[nodiscard]] Key integer(std::string name, std::string unit, int low, int high, std::string doc,
                          At<int> at);
[[nodiscard]] Key boolean(std::string name, std::string doc, At<bool> at);
[[nodiscard]] Key text(std::string name, std::string bounds, std::string doc, TextRule rule,
                       At<std::string> at);
/// One of some words, or one of some whole numbers.
[[nodiscard]] Key choice(std::string name, std::vector<std::string> words, std::string doc,
                         std::function<std::size_t(Configuration&)> get,
                         std::function<void(Configuration&, std::size_t)> set);
[[nodiscard]] Key sign(std::string name, std::string doc, At<int> at);

[[nodiscard]] Key triple(std::string name, std::string unit, Range range, std::string doc,
                         At<std::array<double, 3>> at);
[[nodiscard]] Key signs(std::string name, std::string doc, At<std::array<int, 3>> at);
[[nodiscard]] Key matrix(std::string name, std::string doc,
                         At<std::array<std::array<double, 3>, 3>> at);
[[nodiscard]] Key axis(std::string name, std::string doc, At<estimator::SignedAxis> at);
[[nodiscard]] Key axes(std::string name, std::string doc,
                       At<std::array<estimator::SignedAxis, 3>> at);
[[nodiscard]] Key numbers(std::string name, std::string unit, Range range, std::size_t at_most,
                          std::string doc, At<std::vector<double>> at);
/// Names that differ, each of 1 to 40 printable characters.
[[nodiscard]] Key names(std::string name, std::size_t at_most, std::string doc,
                        At<std::vector<std::string>> at);
/// [lowest, highest] each of outer, inner and azimuth.
[[nodiscard]] Key travels(std::string name, std::string doc,
                          At<std::array<std::array<double, 2>, 3>> at);
[[nodiscard]] Key positions(std::string name, std::size_t at_most, std::string doc,
                            At<std::vector<std::array<double, 3>>> at);

/// choice() over an enumeration; the words stand in the order of `values`.
template <class E>
[[nodiscard]] Key choice(std::string name, std::vector<std::pair<std::string, E>> values,
                         std::string doc, At<E> at) {
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
