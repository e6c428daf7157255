#pragma once

#include <string>
#include <utility>
#include <vector>

#include "daemon/plot/axis.hpp"

namespace vibrig::tool::plot {

enum class Look : unsigned char { line, dashed, dots };

/// Points that are not finite (or not positive on a log axis) interrupt a curve.
struct Curve {
    std::string name = {};  ///< in the legend, if not empty
    std::vector<double> x = {}, y = {};
    std::vector<double> low = {}, high = {};  ///< a band or error bars, if as long as x
    Look look = Look::line;

    void add(double at, double value) {
        x.push_back(at);
        y.push_back(value);
    }
    /// A point with its band, or error bar.
    void add(double at, double value, double from, double to) {
        add(at, value);
        low.push_back(from);
        high.push_back(to);
    }
};

/// Dashed, from `first` to `last`.
[[nodiscard]] inline Curve level_line(const std::string& name, double first, double last,
                                      double y) {
    return {.name = name, .x = {first, last}, .y = {y, y}, .look = Look::dashed};
}

/// Cells between x[i] and x[i + 1], y[j] and y[j + 1]; value[i][j], NaN leaves a hole.
struct HeatMap {
    std::vector<double> x;
    std::vector<double> y;
    std::vector<std::vector<double>> value;
    std::string label;  ///< of the colour scale, with unit
    bool log = false;
};

/// One SVG file that follows the reader's light or dark theme.
struct Chart {
    std::string title = {};
    Axis x = {}, y = {};
    std::vector<Curve> curves = {};
    std::vector<HeatMap> maps = {};       ///< at most one is drawn
    std::vector<std::string> notes = {};  ///< small print below

    [[nodiscard]] std::string svg() const;
};

/// A folder for charts, made if there is none. Throws std::runtime_error naming the path.
void make_folder(const std::string& path);

/// Names, and SVG.
using Pictures = std::vector<std::pair<std::string, std::string>>;
/// The first one as `path`, if that ends in ".svg"; else all in this folder as NAME.svg. Throws as
/// above.
void write_pictures(const std::string& path, const Pictures& pictures);

}  // namespace vibrig::tool::plot
