#include "daemon/tool/reproduce_tang2009_plot.hpp"

#include <filesystem>

#include "daemon/tool/plot/chart.hpp"

namespace vibrig::tool::tang2009 {

namespace {

void write(const Convergence& of, const std::vector<Coefficients>& values, const char* route,
           std::size_t gyro, const std::string& folder) {
    plot::Chart chart;
    const char axis = static_cast<char>('x' + gyro);
    chart.title = std::string("Coefficients of gyro ") + axis + ", " + route + ", over truth";
    chart.x.label = "time in dwells, min";
    chart.y.label = "estimate / truth";
    for (std::size_t term = 0; term < 10; ++term) {
        const std::size_t i = 10 * gyro + term;
        plot::Curve curve;
        curve.name = estimator::parameter_names()[i];
        curve.x = of.minutes;
        for (const Coefficients& value : values) curve.y.push_back(value[i] / truth()[i]);
        chart.curves.push_back(curve);
    }
    chart.notes.emplace_back("After each dwell of 100 s; the second level begins at 23.3 min.");
    const std::string name = std::string("tang2009-figure3-") + route + "-" + axis + ".svg";
    plot::write_file((std::filesystem::path(folder) / name).string(), chart.svg());
}

}  // namespace

void plot_convergence(const Convergence& convergence, const std::string& folder) {
    plot::make_folder(folder);
    for (std::size_t gyro = 0; gyro < 3; ++gyro) {
        write(convergence, convergence.joint, "joint", gyro, folder);
        write(convergence, convergence.two_step, "two-step", gyro, folder);
    }
}

}  // namespace vibrig::tool::tang2009
