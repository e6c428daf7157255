#include "daemon/papers/reproduce_tang2009_plot.hpp"

#include <cmath>
#include <filesystem>

#include "daemon/papers/reproduce_text.hpp"
#include "daemon/plot/chart.hpp"

namespace vibrig::tool::tang2009 {

namespace {

// The first positions alone determine little: what is farther off would hide how the rest closes in
// on 1.
constexpr double kLow = -1, kHigh = 3;

void write(const Study& study, const std::vector<Coefficients>& values, const char* route,
           std::size_t gyro, const std::string& folder) {
    plot::Chart chart;
    const char axis = static_cast<char>('x' + gyro);
    const std::string level = formatted("%.4g", study.platform_g(9));
    chart.title = std::string("Coefficients of gyro ") + axis + ", " + route + ", over truth, " +
                  level + " g in the first run";
    chart.x.label = "time in dwells, min";
    chart.y.label = "estimate / truth";
    chart.y.low = kLow;
    chart.y.high = kHigh;
    chart.y.exact = true;
    for (std::size_t term = 0; term < 10; ++term) {
        const std::size_t i = 10 * gyro + term;
        plot::Curve curve;
        curve.name = estimator::parameter_names()[i];
        curve.x = study.convergence.minutes;
        // There are more coefficients than colours.
        if (term >= 4) curve.look = plot::Look::dashed;
        for (const Coefficients& value : values) {
            const double ratio = value[i] / truth()[i];
            curve.y.push_back(ratio >= kLow && ratio <= kHigh ? ratio : NAN);
        }
        chart.curves.push_back(curve);
    }
    chart.notes.emplace_back(
        "Every 10 s of 28 dwells of 100 s; the second level begins at 23.3 min. What is beyond -1 "
        "to 3 is left out.");
    const std::string name = "tang2009-figure3-" + level + "g-" + route + "-" + axis + ".svg";
    plot::write_file((std::filesystem::path(folder) / name).string(), chart.svg());
}

}  // namespace

void plot_convergence(const Study& study, const std::string& folder) {
    plot::make_folder(folder);
    for (std::size_t gyro = 0; gyro < 3; ++gyro) {
        write(study, study.convergence.joint, "joint", gyro, folder);
        write(study, study.convergence.two_step, "two-step", gyro, folder);
    }
}

}  // namespace vibrig::tool::tang2009
