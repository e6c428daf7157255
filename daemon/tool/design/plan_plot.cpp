#include <cmath>
#include <map>

#include "daemon/tool/design/plan_study.hpp"

namespace vibrig::tool::planner {

namespace {

constexpr double kRadius = 180;
constexpr double kLeft = 220, kRight = 620, kMiddle = 250;
/// Area of a dot goes with the number of runs.
constexpr double kDot = 7;
constexpr std::size_t kColours = 6;

// Colours after Okabe and Ito, which stay apart for colour-blind readers.
constexpr const char* kStyle =
    "<style>\ntext{font-family:system-ui,sans-serif;font-size:13px;fill:#1b1b1b}"
    ".title{font-size:16px;font-weight:600}.paper{fill:#ffffff}"
    ".globe{fill:none;stroke:#1b1b1b}.grid{fill:none;stroke:#d9d9d9}.dot{fill-opacity:.75}"
    ".c0{fill:#0072b2}.c1{fill:#d55e00}.c2{fill:#009e73}.c3{fill:#b15d92}.c4{fill:#8a6d00}"
    ".c5{fill:#56b4e9}\n@media (prefers-color-scheme:dark){text{fill:#e6e6e6}"
    ".paper{fill:#16181c}.globe{stroke:#e6e6e6}.grid{stroke:#3a3d44}.c0{fill:#56b4e9}"
    ".c1{fill:#ff8c42}.c2{fill:#2fd0a0}.c3{fill:#e59ac6}.c4{fill:#f0e442}}\n</style>\n";

/// Lambert's equal-area projection of the hemisphere around +z (seen from outside) or -z.
struct Spot {
    double x = 0, y = 0;
    bool front = true;
};
Spot project(const planning::Vec3& u) {
    Spot spot;
    spot.front = u[2] >= -1e-9;
    const double z = spot.front ? u[2] : -u[2];
    const double k = kRadius / std::sqrt(1 + z);
    const double side = spot.front ? 1 : -1;
    spot.x = (spot.front ? kLeft : kRight) + side * k * u[0];
    spot.y = kMiddle - k * u[1];
    return spot;
}

std::string globes() {
    std::string svg;
    for (const double x : {kLeft, kRight}) {
        svg += printed("<circle class='globe' cx='%g' cy='%g' r='%g'/>\n", x, kMiddle, kRadius);
        svg += printed("<path class='grid' d='M%g %gH%gM%g %gV%g'/>\n", x - kRadius, kMiddle,
                       x + kRadius, x, kMiddle - kRadius, kMiddle + kRadius);
        svg += printed("<text x='%g' y='%g' text-anchor='middle'>+y</text>\n", x,
                       kMiddle - kRadius - 6);
    }
    svg += printed("<text x='%g' y='%g'>+x</text>\n", kLeft + kRadius + 5, kMiddle + 4);
    svg += printed("<text x='%g' y='%g' text-anchor='end'>+x</text>\n", kRight - kRadius - 5,
                   kMiddle + 22);
    svg += printed("<text x='%g' y='%g' text-anchor='middle'>from +z</text>\n", kLeft,
                   kMiddle + kRadius + 20);
    svg += printed("<text x='%g' y='%g' text-anchor='middle'>from -z</text>\n", kRight,
                   kMiddle + kRadius + 20);
    return svg;
}

}  // namespace

std::string plan_picture(const PlanStudy& study, const estimator::Settings& frame) {
    // Runs at one direction and level are one dot; levels at one direction stand side by side.
    std::map<double, std::size_t> colour;
    for (const PlanRun& run : study.runs) colour.emplace(run.visit.level_g, 0);
    std::size_t next = 0;
    for (auto& [level, c] : colour) c = next++;
    std::map<std::pair<std::array<long, 3>, double>, std::size_t> dots;
    for (const PlanRun& run : study.runs) {
        const auto u = planning::up_at(frame, run.visit.position_deg);
        dots[{{std::lround(u[0] * 1e6), std::lround(u[1] * 1e6), std::lround(u[2] * 1e6)},
              run.visit.level_g}] += run.count;
    }
    std::string svg =
        "<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 860 500' font-size='13'>\n";
    svg += kStyle;
    svg += "<rect class='paper' width='860' height='500'/>\n";
    svg += "<text class='title' x='20' y='28'>Directions of the vertical in platform axes</text>\n";
    svg += globes();
    for (const auto& [key, count] : dots) {
        const auto& [direction, level] = key;
        const Spot spot = project({1e-6 * static_cast<double>(direction[0]),
                                   1e-6 * static_cast<double>(direction[1]),
                                   1e-6 * static_cast<double>(direction[2])});
        const std::size_t c = colour[level];
        const double shift = 9 * (static_cast<double>(c) - 0.5 * static_cast<double>(next - 1));
        svg += printed(
            "<circle class='dot c%zu' cx='%.1f' cy='%.1f' r='%.2f'><title>%zu at %g "
            "g</title></circle>\n",
            c % kColours, spot.x + shift, spot.y, kDot * std::sqrt(static_cast<double>(count)),
            count, level);
    }
    double y = 60;
    for (const auto& [level, c] : colour) {
        svg += printed(
            "<circle class='c%zu' cx='408' cy='%g' r='6'/><text x='420' y='%g'>%.4g "
            "g</text>\n",
            c % kColours, y, y + 4, level);
        y += 20;
    }
    svg += printed("<text x='20' y='490'>Area: runs. D-efficiency %.3f, rank %zu of %zu.</text>\n",
                   study.d_efficiency, study.evaluation.rank, study.evaluation.coefficients);
    return svg + "</svg>\n";
}

}  // namespace vibrig::tool::planner
