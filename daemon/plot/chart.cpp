#include "daemon/plot/chart.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <iterator>
#include <stdexcept>
#include <system_error>

#include "daemon/plot/xml_text.hpp"
#include "proto/durable_file.hpp"

namespace vibrig::tool::plot {

namespace {

constexpr double kWidth = 860;
constexpr double kLeft = 84;
constexpr double kTop = 44;
constexpr double kPlotHeight = 420;
constexpr double kRight = 190;              // legend or colour scale
constexpr std::size_t kLegendLetters = 20;  // that surely fit beside it
constexpr double kNoteHeight = 16;
constexpr double kNameHeight = 30;  // of a tick's name, upright, beyond a number's
constexpr std::size_t kColours = 8;

struct Palette {
    const char* ink;
    const char* paper;
    const char* grid;
    const char* fine;
    std::array<const char*, kColours> curves;
};
// Colours after Okabe and Ito, which stay apart for colour-blind readers.
constexpr Palette kLight{
    "#1b1b1b",
    "#ffffff",
    "#d9d9d9",
    "#efefef",
    {"#0072b2", "#d55e00", "#009e73", "#b15d92", "#8a6d00", "#56b4e9", "#e69f00", "#777777"}};
constexpr Palette kDark{
    "#e6e6e6",
    "#16181c",
    "#3a3d44",
    "#26292f",
    {"#56b4e9", "#ff8c42", "#2fd0a0", "#e59ac6", "#f0e442", "#9cd3ff", "#e69f00", "#aaaaaa"}};

// Plain rules: many viewers know no CSS variables.
std::string rules(const Palette& palette) {
    std::string css = fmt::format(
        ".paper{{fill:{}}}text{{fill:{}}}.grid{{stroke:{}}}.fine{{stroke:{}}}.frame{{stroke:{}}}\n",
        palette.paper, palette.ink, palette.grid, palette.fine, palette.ink);
    for (std::size_t i = 0; i < kColours; ++i)
        css += fmt::format(
            ".c{0} .line,.c{0} .dashed,.c{0} .bar{{stroke:{1}}}.c{0} .dot,.c{0} "
            ".band{{fill:{1}}}\n",
            i, palette.curves[i]);
    return css;
}

std::string style() {
    return "<style>\ntext{font-family:system-ui,sans-serif;font-size:13px}"
           ".title{font-size:16px;font-weight:600}.note{font-size:11px}"
           ".frame{fill:none}.line,.dashed{fill:none;stroke-width:1.8}"
           ".dashed{stroke-width:1.4;stroke-dasharray:6 4}.band{fill-opacity:.16}\n" +
           rules(kLight) + "@media (prefers-color-scheme:dark){\n" + rules(kDark) + "}\n</style>\n";
}

/// Viridis, sampled; interpolated in between.
std::string colour(double part) {
    constexpr std::array<std::array<double, 3>, 6> kScale{{{68, 1, 84},
                                                           {65, 68, 135},
                                                           {42, 120, 142},
                                                           {34, 168, 132},
                                                           {122, 209, 81},
                                                           {253, 231, 37}}};
    const double at = std::clamp(part, 0.0, 1.0) * (kScale.size() - 1);
    const auto i = std::min(static_cast<std::size_t>(at), kScale.size() - 2);
    std::string text = "#";
    for (std::size_t k = 0; k < 3; ++k)
        text += fmt::format("{:02x}",
                            std::lround(kScale[i][k] + (at - static_cast<double>(i)) *
                                                           (kScale[i + 1][k] - kScale[i][k])));
    return text;
}

class Drawing {
  public:
    explicit Drawing(const Chart& chart) : x_(chart.x), y_(chart.y) {
        for (const Curve& curve : chart.curves) {
            for (std::size_t i = 0; i < curve.x.size(); ++i) {
                x_.include(curve.x[i]);
                y_.include(curve.y[i]);
                if (curve.low.size() == curve.x.size()) {
                    y_.include(curve.low[i]);
                    y_.include(curve.high[i]);
                }
            }
        }
        for (const HeatMap& map : chart.maps) {
            std::for_each(map.x.begin(), map.x.end(), [&](double v) { x_.include(v); });
            std::for_each(map.y.begin(), map.y.end(), [&](double v) { y_.include(v); });
        }
        x_.settle();
        y_.settle();
    }

    void grid() {
        for (const double t : x_.minor()) {
            line("fine", px(t), kTop, px(t), bottom());
        }
        for (const double t : y_.minor()) {
            line("fine", kLeft, py(t), right(), py(t));
        }
        for (const double t : x_.ticks()) {
            line("grid", px(t), kTop, px(t), bottom());
            if (x_.named.empty()) {
                text(px(t), bottom() + 18, x_.text_of(t), "middle");
            } else {
                // Names side by side would run into each other.
                upright(px(t) + 4, bottom() + 8, x_.text_of(t), "end");
            }
        }
        for (const double t : y_.ticks()) {
            line("grid", kLeft, py(t), right(), py(t));
            text(kLeft - 8, py(t) + 4, y_.text_of(t), "end");
        }
    }

    void frame(const std::string& title) {
        add("<rect class=\"frame\" x=\"{:.2f}\" y=\"{:.2f}\" width=\"{:.2f}\" "
            "height=\"{:.2f}\"/>\n",
            kLeft, kTop, right() - kLeft, kPlotHeight);
        text(kLeft, kTop - 16, title, "start", " class=\"title\"");
        text((kLeft + right()) / 2, bottom() + below() - 18, x_.label, "middle");
        const double middle = kTop + kPlotHeight / 2;
        text(22, middle, y_.label, "middle",
             fmt::format(" transform=\"rotate(-90 22 {:.2f})\"", middle));
    }

    /// A name of the legend that would not end within the picture is drawn in.
    static std::string fitted(const std::string& name) {
        if (name.size() <= kLegendLetters) return "";
        return fmt::format(R"( lengthAdjust="spacingAndGlyphs" textLength="{:.2f}")",
                           kRight - 14 - 28 - 2);
    }

    void curve(const Curve& curve, std::size_t index) {
        out_ += "<g class=\"c" + std::to_string(index % kColours) + "\">";
        if (curve.low.size() == curve.x.size() && curve.look != Look::dots) {
            band(curve);
        }
        if (curve.look == Look::dots) {
            dots(curve);
        } else {
            path(curve);
        }
        if (!curve.name.empty()) {
            const double y = kTop + 10 + 20 * static_cast<double>(legend_++);
            const double x = right() + 14;
            if (curve.look == Look::dots) {
                dot(x + 11, y);
            } else {
                line(class_of(curve.look), x, y, x + 22, y);
            }
            text(x + 28, y + 4, curve.name, "start", fitted(curve.name));
        }
        out_ += "</g>\n";
    }

    void map(const HeatMap& map) {
        Axis scale;
        scale.log = map.log;
        scale.label = map.label;
        for (const auto& column : map.value) {
            std::for_each(column.begin(), column.end(), [&](double v) { scale.include(v); });
        }
        scale.settle();
        for (std::size_t i = 0; i + 1 < map.x.size(); ++i) {
            for (std::size_t j = 0; j + 1 < map.y.size(); ++j) {
                const double value = map.value[i][j];
                if (std::isfinite(value) && (!map.log || value > 0)) {
                    cell(px(map.x[i]), py(map.y[j + 1]), px(map.x[i + 1]), py(map.y[j]),
                         colour(scale.place(value)));
                }
            }
        }
        const double x = right() + 20;
        constexpr int kSteps = 60;
        for (int k = 0; k < kSteps; ++k) {
            const double y = bottom() - kPlotHeight * (k + 1) / kSteps;
            cell(x, y, x + 18, y + kPlotHeight / kSteps, colour((k + 0.5) / kSteps));
        }
        for (const double t : scale.ticks()) {
            text(x + 24, bottom() - kPlotHeight * scale.place(t) + 4, scale.text_of(t), "start");
        }
        upright(x + 90, kTop + kPlotHeight / 2, map.label, "middle");
    }

    void text(double x, double y, const std::string& words, const char* anchor,
              const std::string& more = "") {
        add("<text x=\"{:.2f}\" y=\"{:.2f}\" text-anchor=\"{}\"{}>{}</text>\n", x, y, anchor, more,
            xml_text(words));
    }

    [[nodiscard]] static double bottom() { return kTop + kPlotHeight; }
    /// Height of the ticks' texts and the label.
    [[nodiscard]] double below() const { return x_.named.empty() ? 56 : 56 + kNameHeight; }
    [[nodiscard]] const std::string& out() const { return out_; }

  private:
    [[nodiscard]] static double right() { return kWidth - kRight; }
    [[nodiscard]] double px(double v) const { return kLeft + (right() - kLeft) * x_.place(v); }
    [[nodiscard]] double py(double v) const { return bottom() - kPlotHeight * y_.place(v); }
    [[nodiscard]] static const char* class_of(Look look) {
        return look == Look::dashed ? "dashed" : "line";
    }
    [[nodiscard]] bool drawable(double x, double y) const {
        return std::isfinite(x) && std::isfinite(y) && !(x_.log && x <= 0) && !(y_.log && y <= 0);
    }
    [[nodiscard]] std::string at(double x, double y) const {
        return fmt::format("{:.2f} {:.2f}", px(x), py(y));
    }

    template <class... Values>
    void add(fmt::format_string<Values...> format, Values&&... values) {
        fmt::format_to(std::back_inserter(out_), format, std::forward<Values>(values)...);
    }
    void line(const char* style, double x1, double y1, double x2, double y2) {
        add("<line class=\"{}\" x1=\"{:.2f}\" y1=\"{:.2f}\" x2=\"{:.2f}\" y2=\"{:.2f}\"/>\n", style,
            x1, y1, x2, y2);
    }
    void upright(double x, double y, const std::string& words, const char* anchor) {
        text(x, y, words, anchor, fmt::format(" transform=\"rotate(-90 {:.2f} {:.2f})\"", x, y));
    }
    void dot(double x, double y) {
        add(R"(<circle class="dot" cx="{:.2f}" cy="{:.2f}" r="3"/>)", x, y);
    }
    void cell(double x1, double y1, double x2, double y2, const std::string& fill) {
        // A little wider than the cell, or the paper shines through between neighbours.
        add("<rect x=\"{:.2f}\" y=\"{:.2f}\" width=\"{:.2f}\" height=\"{:.2f}\" fill=\"{}\"/>\n",
            x1, y1, x2 - x1 + 0.3, y2 - y1 + 0.3, fill);
    }
    void path(const Curve& curve) {
        std::string d;
        bool pen_down = false;
        for (std::size_t i = 0; i < curve.x.size(); ++i) {
            const bool draw = drawable(curve.x[i], curve.y[i]);
            if (draw) d += (pen_down ? "L" : "M") + at(curve.x[i], curve.y[i]);
            pen_down = draw;
        }
        add("<path clip-path=\"url(#plot)\" class=\"{}\" d=\"{}\"/>", class_of(curve.look), d);
    }
    void band(const Curve& curve) {
        std::string there;
        std::string back;
        for (std::size_t i = 0; i < curve.x.size(); ++i) {
            if (drawable(curve.x[i], curve.low[i]) && drawable(curve.x[i], curve.high[i])) {
                there += (there.empty() ? "M" : "L") + at(curve.x[i], curve.high[i]);
                back = "L" + at(curve.x[i], curve.low[i]) + back;
            }
        }
        out_ += "<path clip-path=\"url(#plot)\" class=\"band\" d=\"" + there + back + "Z\"/>";
    }
    void dots(const Curve& curve) {
        for (std::size_t i = 0; i < curve.x.size(); ++i) {
            if (!drawable(curve.x[i], curve.y[i])) {
                continue;
            }
            dot(px(curve.x[i]), py(curve.y[i]));
            if (curve.low.size() == curve.x.size() && drawable(curve.x[i], curve.low[i])) {
                line("bar", px(curve.x[i]), py(curve.low[i]), px(curve.x[i]), py(curve.high[i]));
            }
        }
    }

    Axis x_;
    Axis y_;
    std::string out_;
    std::size_t legend_ = 0;
};

}  // namespace

std::string Chart::svg() const {
    Drawing drawing(*this);
    const double foot = Drawing::bottom() + drawing.below();
    const double height = foot + kNoteHeight * static_cast<double>(notes.size());
    drawing.grid();
    if (!maps.empty()) drawing.map(maps.front());
    for (std::size_t i = 0; i < curves.size(); ++i) {
        drawing.curve(curves[i], i);
    }
    drawing.frame(title);
    for (std::size_t i = 0; i < notes.size(); ++i) {
        drawing.text(kLeft, foot + 2 + kNoteHeight * static_cast<double>(i), notes[i], "start",
                     " class=\"note\"");
    }
    return fmt::format(
        R"(<svg xmlns="http://www.w3.org/2000/svg" width="{0:.2f}" height="{1:.2f}" viewBox="0 0 {0:.2f} {1:.2f}" role="img">
<title>{2}</title>
{3}<clipPath id="plot"><rect x="{4:.2f}" y="{5:.2f}" width="{6:.2f}" height="{7:.2f}"/></clipPath>
<rect class="paper" width="100%" height="100%"/>
{8}</svg>
)",
        kWidth, height, xml_text(title), style(), kLeft, kTop, kWidth - kRight - kLeft, kPlotHeight,
        drawing.out());
}

void make_folder(const std::string& path) {
    std::error_code error;
    std::filesystem::create_directories(path, error);
    if (error || !std::filesystem::is_directory(path)) {
        throw std::runtime_error(path + ": cannot be a folder for charts: " +
                                 (error ? error.message() : "it is something else") +
                                 "; expected a folder or a name that ends in .svg");
    }
}

void write_pictures(const std::string& path, const Pictures& pictures) {
    const std::filesystem::path where(path);
    if (where.extension() == ".svg") return proto::write_output(path, pictures.front().second);
    make_folder(path);
    for (const auto& [name, svg] : pictures)
        proto::write_output((where / (name + ".svg")).string(), svg);
}

}  // namespace vibrig::tool::plot
