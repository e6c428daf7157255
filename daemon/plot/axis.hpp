#pragma once

#include <string>
#include <utility>
#include <vector>

namespace vibrig::tool::plot {

/// One axis of a chart. Without a range (low == high) it takes the data's.
class Axis {
  public:
    Axis() = default;
    explicit Axis(std::string name, bool logarithmic = false)
        : label(std::move(name)), log(logarithmic) {}

    std::string label;  ///< with unit
    bool log = false;
    double low = 0;
    double high = 0;
    bool exact = false;  ///< keeps its range; else it is rounded to ticks
    /// Ticks with words, upright, instead of numbers, from left to right; empty: numbers.
    std::vector<std::pair<double, std::string>> named;

    void include(double value);                       ///< widens the range; log: only if > 0
    void settle();                                    ///< makes the range one to be drawn
    [[nodiscard]] double place(double value) const;   ///< 0 at low, 1 at high
    [[nodiscard]] std::vector<double> ticks() const;  ///< labelled
    [[nodiscard]] std::vector<double> minor() const;  ///< not labelled, log axes only
    [[nodiscard]] std::string text_of(double tick) const;

  private:
    [[nodiscard]] double step() const;
    bool empty_ = true;
};

}  // namespace vibrig::tool::plot
