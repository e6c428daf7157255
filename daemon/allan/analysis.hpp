#pragma once

#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "daemon/plot/chart.hpp"
#include "estimator/allan/deviation.hpp"
#include "estimator/allan/monitor.hpp"

namespace vibrig::tool {

namespace allan = estimator::allan;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();  ///< no value
constexpr double kShortestStep = 1e-9;                             ///< s
constexpr double kLongestStep = 1e9;                               ///< s
constexpr double kLargestValue = 1e60;  ///< its square times those of steps and counts is finite

/// What the user asked `vibrig allan` for.
struct AllanRequest {
    std::string file;
    std::string column;
    std::string time;
    double tau0 = 0;  ///< s, 0: from the time column
    bool phase = false;
    allan::Statistic statistic = allan::Statistic::oadev;
    std::string taus = "octave";
    double confidence = allan::kOneSigma;
    bool fit = false;
    double window_s = 0;  ///< 0: not dynamic
    double overlap = 0.5;
    allan::WindowShape shape = allan::WindowShape::rectangular;
    allan::MeanMode mode = allan::MeanMode::corrected;
    double known_mean = 0;  ///< deg/h
    double alpha = 1e-3;
    std::optional<allan::Terms> reference;
    bool drop_outliers = false;
    std::string unit;  ///< of the rate or phase; empty: deg/h or arcsec
};

struct AllanWindow {
    allan::WindowRow row;
    std::vector<allan::Alarm> alarms;
};

/// Variances and coefficients of the dynamic part and the fit are in deg/h whatever the unit.
struct AllanAnalysis {
    AllanRequest request;
    std::string column;
    std::size_t samples = 0;
    std::size_t missing = 0;
    std::size_t longest_gap = 0;
    double to_deg_h = 1;  ///< input unit (phase: per second) to deg/h
    std::vector<allan::Point> points;
    std::optional<allan::Fit> fit;
    std::vector<std::string> warnings;
    std::vector<std::size_t> factors;  ///< of the dynamic surface
    std::vector<AllanWindow> windows;
    std::optional<allan::DynamicSummary> summary;
    double smallest_change = 0;  ///< of N, relative, that one window shows; 0: no reference
};

/// Reads and analyses. Throws std::exception with what to tell the user.
[[nodiscard]] AllanAnalysis analyse(const AllanRequest& request);
/// 1 arcsec/s is 1 deg/h. Throws for a unit that is none.
[[nodiscard]] double to_deg_per_hour(const std::string& unit, bool phase);
[[nodiscard]] allan::DynamicSettings dynamic_settings(const AllanRequest& request);

[[nodiscard]] std::string allan_table(const AllanAnalysis& analysis);
/// A line below the window that raised it.
[[nodiscard]] std::string alarm_text(const allan::Alarm& alarm);
[[nodiscard]] std::string allan_json(const AllanAnalysis& analysis);
/// One window of the dynamic part, on one line.
[[nodiscard]] std::string allan_window_json(const allan::WindowRow& row,
                                            const std::vector<allan::Alarm>& alarms,
                                            const allan::DynamicAllan& dynamic, double to_deg_h);
[[nodiscard]] plot::Chart deviation_chart(const AllanAnalysis& analysis);
/// Time, tau, deviation of the windows.
[[nodiscard]] plot::Chart surface_chart(const AllanAnalysis& analysis);
[[nodiscard]] plot::Chart traces_chart(const AllanAnalysis& analysis);
/// An SVG file, or every chart in a folder when `path` does not end in ".svg".
void allan_plot(const AllanAnalysis& analysis, const std::string& path);

}  // namespace vibrig::tool
