#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "daemon/archive/trend.hpp"

namespace vibrig::tool {

[[nodiscard]] nlohmann::ordered_json trend_json(const std::string& serial,
                                                const archive::Trend& trend,
                                                double shutdown_after_h);
[[nodiscard]] std::string trend_table(const std::string& serial, const archive::Trend& trend,
                                      double shutdown_after_h);
/// One coefficient over the campaigns, as SVG.
[[nodiscard]] std::string trend_chart(const archive::Trend& trend,
                                      const archive::CoefficientTrend& of);
/// An SVG file with all coefficients in units of their u, or a folder with it and one for each.
/// Throws std::runtime_error naming the path.
void plot_trend(const std::string& serial, const archive::Trend& trend, const std::string& path);

}  // namespace vibrig::tool
