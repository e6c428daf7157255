#include "daemon/papers/reproduce_tang2009.hpp"

#include <array>
#include <cmath>
#include <string>
#include <utility>

#include "daemon/results/text_line.hpp"
#include "estimator/filter/parameters.hpp"

namespace vibrig::tool::tang2009 {

namespace {

// The first positions alone determine little: what is farther off would hide how the rest closes in
// on 1.
constexpr double kLow = -1, kHigh = 3;

struct Line {
    Route route;
    int trial;
    const char* name;
};
constexpr std::array<Line, 5> kLines{{{kTwoStep1, 1, "two-step"},
                                      {kJoint1, 1, "joint"},
                                      {kTwoStep2, 2, "two-step"},
                                      {kJoint2, 2, "joint"},
                                      {kOneLevel3, 3, "one-level"}}};

void add(const Study& study, const Line& line, std::size_t gyro, Reproduction& table) {
    const Convergence& convergence = study.convergence[line.route];
    const char axis = static_cast<char>('x' + gyro);
    const std::string level = printed("%.4g", study.platform_g(9));
    plot::Chart chart{printed("Trial %d, gyro %c, %s, over truth; %s g in the first run of trial 1",
                              line.trial, axis, line.name, level.c_str()),
                      plot::Axis("time in dwells, min"), plot::Axis("estimate / truth")};
    chart.y.low = kLow;
    chart.y.high = kHigh;
    chart.y.exact = true;
    for (std::size_t term = 0; term < 10; ++term) {
        const std::size_t i = 10 * gyro + term;
        // There are more coefficients than colours.
        plot::Curve curve{.name = estimator::parameter_names()[i],
                          .x = convergence.minutes,
                          .look = term >= 4 ? plot::Look::dashed : plot::Look::line};
        for (const Coefficients& value : convergence.value) {
            const double ratio = value[i] / truth()[i];
            curve.y.push_back(ratio >= kLow && ratio <= kHigh ? ratio : NAN);
        }
        chart.curves.push_back(curve);
    }
    chart.notes.emplace_back(
        line.trial == 3 ? "Every 10 s of 14 dwells of 100 s. What is beyond -1 to 3 is left out."
                        : "Every 10 s of 28 dwells of 100 s; the second level begins at 23.3 min. "
                          "What is beyond -1 to 3 is left out.");
    table.charts.emplace_back(
        printed("figure3-%sg-trial%d-%s-%c", level.c_str(), line.trial, line.name, axis),
        std::move(chart));
}

}  // namespace

void add_convergence(const Study& study, Reproduction& table) {
    for (const Line& line : kLines) {
        for (std::size_t gyro = 0; gyro < 3; ++gyro) add(study, line, gyro, table);
    }
}

}  // namespace vibrig::tool::tang2009
