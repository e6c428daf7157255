#include "daemon/tool/reproduce_tang2009_plot.hpp"

#include <filesystem>

#include "daemon/tool/plot/chart.hpp"
#include "daemon/tool/reproduce_text.hpp"

namespace vibrig::tool::tang2009 {

namespace {

void write(const Study& study, const std::vector<Coefficients>& values, const char* route,
           std::size_t gyro, const std::string& folder) {
    plot::Chart chart;
    const char axis = static_cast<char>('x' + gyro);
    const std::string level = formatted("%.4g", study.platform_g(9));
    chart.title = std::string("Coefficients of gyro ") + axis + ", " + route + ", over truth, " +
                  level + " g in the first run";
    chart.x.label = "time in dwells, min";
    chart.y.label = "estimate / truth";
    // The first positions alone determine little: that would hide how the rest closes in on 1.
    chart.y.low = -1;
    chart.y.high = 3;
    chart.y.exact = true;
    for (std::size_t term = 0; term < 10; ++term) {
        const std::size_t i = 10 * gyro + term;
        plot::Curve curve;
        curve.name = estimator::parameter_names()[i];
        curve.x = study.convergence.minutes;
        for (const Coefficients& value : values) curve.y.push_back(value[i] / truth()[i]);
        chart.curves.push_back(curve);
    }
    chart.notes.emplace_back(
        "Every 10 s of 28 dwells of 100 s; the second level begins at 23.3 min.");
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
