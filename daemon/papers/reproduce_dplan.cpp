#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>

#include "daemon/papers/reproduce.hpp"
#include "daemon/results/text_line.hpp"
#include "estimator/plan/evaluation.hpp"
#include "estimator/plan/exact.hpp"
#include "estimator/plan/optimum.hpp"
#include "estimator/plan/positions.hpp"
#include "estimator/plan/spheres.hpp"
#include "estimator/plan/vertical_axes.hpp"

namespace vibrig::tool::dplan {

namespace {

namespace planning = estimator::plan;
using planning::Effort;
using planning::Problem;
using planning::Vec3;

/// What the paper states without a number of its own, our derivation's number, and ours computed;
/// compares as printed.
void add(Reproduction& table, const std::string& item, const std::string& published,
         const std::string& theory, const std::string& computed) {
    table.add(item, published, computed, theory == computed, theory);
}

constexpr std::size_t kFaces = 6, kEdges = 12, kAll = 26;

/// Both spheres: points 0 to 25 inside, 26 to 51 outside.
Problem two_spheres(double r) { return planning::spheres_problem({1, r}); }

/// Runs per point of the inner and outer sphere's faces and corners.
Effort double_sphere(double inner_faces, double inner_corners, double outer_faces,
                     double outer_corners) {
    Effort effort(2 * kAll, 0.0);
    for (std::size_t i = 0; i < kAll; ++i) {
        const bool face = i < kFaces, corner = i >= kFaces + kEdges;
        effort[i] = face ? inner_faces : corner ? inner_corners : 0;
        effort[kAll + i] = face ? outer_faces : corner ? outer_corners : 0;
    }
    return effort;
}

enum class Allocation : unsigned char { both, split_68, split_86 };
constexpr std::array kAllocations{Allocation::both, Allocation::split_68, Allocation::split_86};
constexpr std::array<const char*, 3> kAllocationNames{"both", "split-68", "split-86"};

/// [6] with `six` and [8] with `eight` runs per point.
Effort allocated(Allocation allocation, double six, double eight) {
    switch (allocation) {
        case Allocation::split_68:
            return double_sphere(six, 0, 0, eight);
        case Allocation::split_86:
            return double_sphere(0, eight, six, 0);
        default:
            return double_sphere(six, eight, six, eight);
    }
}

void add_ranks(Reproduction& table) {
    struct Set {
        const char* name;
        bool faces, edges, corners;
        const char* rank;
    };
    constexpr std::array<Set, 5> kSets{{{"[6]", true, false, false, "6"},
                                        {"[8]", false, false, true, "7"},
                                        {"[12]", false, true, false, "9"},
                                        {"[6]+[8]", true, false, true, "9"},
                                        {"all 26", true, true, true, "9"}}};
    const Problem one = planning::spheres_problem({1});
    for (const Set& set : kSets) {
        Effort effort;
        for (std::size_t i = 0; i < kAll; ++i) {
            const bool in = i < kFaces ? set.faces : i < kFaces + kEdges ? set.edges : set.corners;
            effort.push_back(in ? 1 : 0);
        }
        add(table, printed("one sphere, %s: rank of 10", set.name), "not full", set.rank,
            printed("%zu", planning::evaluate(one, effort).rank));
    }
    add(table, "two spheres, r = 1.1: rank", "full", "10",
        printed("%zu", planning::evaluate(two_spheres(1.1), Effort(2 * kAll, 1)).rank));
    add(table, "two spheres, r = 1: rank", "-", "9",
        printed("%zu", planning::evaluate(two_spheres(1), Effort(2 * kAll, 1)).rank));
}

/// [6] with 4a runs per point and [8] with 12 - 3a: the a with the largest determinant.
void add_allocation(Reproduction& table) {
    for (std::size_t k = 0; k < kAllocations.size(); ++k) {
        std::string best;
        for (const double r : {1.1, 1.5, 2.0, 3.0, 10.0}) {
            const Problem problem = two_spheres(r);
            int largest = -1;
            double log_det = -1e300;
            for (int a = 0; a <= 4; ++a) {
                const auto e =
                    planning::evaluate(problem, allocated(kAllocations[k], 4 * a, 12 - 3 * a));
                const double value = e.log_det + 10 * std::log(e.effort);
                if (e.identifies_all() && value > log_det) {
                    log_det = value;
                    largest = a;
                }
            }
            best += printed("%s%d", best.empty() ? "" : " ", largest);
        }
        const bool six_inside = kAllocations[k] == Allocation::split_68;
        add(table, printed("largest det at a =, r = 1.1 1.5 2 3 10, %s", kAllocationNames[k]),
            "a = 2", six_inside ? "2 1 1 1 1" : "2 2 2 2 2", best);
    }
}

/// Exponent of det M in r between 1000 and 2000.
void add_growth(Reproduction& table) {
    constexpr std::array<const char*, 3> kDerived{"30", "22", "18"};
    for (std::size_t k = 0; k < kAllocations.size(); ++k) {
        const Effort effort = allocated(kAllocations[k], 8, 6);
        const double growth = (planning::evaluate(two_spheres(2000), effort).log_det -
                               planning::evaluate(two_spheres(1000), effort).log_det) /
                              std::log(2.0);
        add(table, printed("det M grows with r to the power, %s", kAllocationNames[k]), "grows",
            kDerived[k], printed("%.0f", growth));
    }
}

void add_double_sphere_efficiencies(Reproduction& table) {
    struct Row {
        double r;
        const char* outer;
        std::array<const char*, 3> efficiency;
    };
    constexpr std::array<Row, 4> kRows{{{1.5, "0.8658", {"0.813", "0.759", "0.646"}},
                                        {2, "0.8868", {"0.746", "0.588", "0.445"}},
                                        {3, "0.8954", {"0.708", "0.413", "0.266"}},
                                        {10, "0.8997", {"0.687", "0.154", "0.061"}}}};
    for (const Row& row : kRows) {
        const Problem problem = two_spheres(row.r);
        const planning::Optimum best = planning::d_optimum(problem);
        double outer = 0;
        for (std::size_t i = kAll; i < 2 * kAll; ++i) outer += best.share[i];
        add(table, printed("r = %g: optimal mass on the outer sphere", row.r), "-", row.outer,
            printed("%.4f", outer));
        std::string bounds;
        for (std::size_t k = 0; k < kAllocations.size(); ++k) {
            const Effort effort = allocated(kAllocations[k], 8, 6);
            const auto e = planning::evaluate(problem, effort);
            add(table,
                printed("r = %g: D-efficiency of [6]8 + [8]6, %s", row.r, kAllocationNames[k]),
                "D-optimal", row.efficiency[k],
                printed("%.3f", planning::d_efficiency(e, best.log_det)));
            bounds +=
                printed("%s%.2f", k == 0 ? "" : " ", planning::equivalence_bound(problem, effort));
        }
        table.add(printed("r = %g: equivalence bounds p / max d, in that order", row.r), "-",
                  bounds, {}, row.r == 2 ? "0.10 to 0.55" : "-");
    }
}

/// 26 directions at these levels on the platform.
Problem rig(const std::vector<double>& levels) {
    Problem problem;
    for (const double level : levels) {
        for (const Vec3& direction : planning::cube_directions())
            problem.points.push_back({planning::vibration_row(direction, level)});
    }
    return problem;
}

/// Rotatable directions: counts 8 : 9 per face and corner (fourth moments of the uniform one).
Effort rotatable(double mass_first, double mass_second) {
    Effort effort = double_sphere(8, 9, 8, 9);
    double sum = 0;
    for (std::size_t i = 0; i < kAll; ++i) sum += effort[i];
    for (std::size_t i = 0; i < 2 * kAll; ++i)
        effort[i] *= (i < kAll ? mass_first : mass_second) / sum;
    return effort;
}

/// Mass on the second of two levels, directions rotatable, with the largest determinant.
double best_mass(const Problem& two) {
    double low = 0.01, high = 0.99;
    const auto log_det = [&](double mass) {
        return planning::evaluate(two, rotatable(1 - mass, mass)).log_det;
    };
    while (high - low > 1e-6) {  // concave in the mass
        const double third = (high - low) / 3;
        if (log_det(low + third) < log_det(high - third)) {
            low += third;
        } else {
            high -= third;
        }
    }
    return (low + high) / 2;
}

std::string number(bool three_decimals, const char* before, double value) {
    return three_decimals ? printed("%s%.3f", before, value) : printed("%s%.2f", before, value);
}

void add_rig_optimum(Reproduction& table) {
    const Problem all = rig({0, 2, 4, 4.667, 6});
    const planning::Optimum best = planning::d_optimum(all);
    double rest = 0, six = 0;
    for (std::size_t i = 0; i < kAll; ++i) {
        rest += best.share[i];
        six += best.share[4 * kAll + i];
    }
    add(table, "optimum over 0, 2, 4, 4.667, 6 g: mass at rest", "-", "0.1432",
        printed("%.4f", rest));
    add(table, "optimum over 0, 2, 4, 4.667, 6 g: mass at 6 g", "-", "0.8568",
        printed("%.4f", six));
    table.add("general equivalence theorem: max d - 10", "-", printed("%.0e", best.gap),
              best.gap < 1e-6, "below 1e-6");

    struct Row {
        double high, low, mass;         ///< on the larger level; 0: the best
        std::array<double, 5> derived;  ///< D-efficiency, std of D0, linear, square, cross
    };
    constexpr std::array<Row, 5> kRows{{{6, 4.667, 0.5, {0.803, 4.46, 1.73, 0.315, 0.244}},
                                        {6, 4.667, 0, {0.863, 6.12, 1.73, 0.367, 0.218}},
                                        {6, 0, 0.5, {0.821, 1.50, 1.73, 0.200, 0.288}},
                                        {6, 0, 0, {1.000, 2.79, 1.73, 0.203, 0.220}},
                                        {4.0 / 3.0, 0, 0.5, {0.051, 3.40, 1.73, 2.69, 2.56}}}};
    for (const Row& row : kRows) {
        const Problem two = rig({row.low, row.high});
        const double mass = row.mass > 0 ? row.mass : best_mass(two);
        const auto e = planning::evaluate(two, rotatable(1 - mass, mass));
        const std::array<double, 5> computed{planning::d_efficiency(e, best.log_det), e.sigma[0],
                                             e.sigma[1], e.sigma[4], e.sigma[7]};
        ReproducedRow line{
            printed("%.4g and %.4g g, %.3f on the larger: D-eff., std D0, Di, Dii, Dij", row.high,
                    row.low, mass),
            "-", "", true};
        for (std::size_t k = 0; k < computed.size(); ++k) {
            // Numbers above 1 have two decimals in the derived table, but for the efficiencies.
            const bool three = k == 0 || row.derived[k] < 1;
            const char* blank = k == 0 ? "" : " ";
            line.theory += number(three, blank, row.derived[k]);
            line.computed += number(three, blank, computed[k]);
            line.agrees =
                *line.agrees && std::abs(computed[k] - row.derived[k]) <= (three ? 1e-3 : 1e-2);
        }
        table.rows.push_back(line);
    }
    table.notes.emplace_back(
        "rows of two levels agree when every number does to one unit of theory's last digit");

    struct Exact {
        std::size_t runs;
        double derived;
    };
    constexpr std::array<Exact, 6> kExact{
        {{10, 0.864}, {12, 0.927}, {14, 0.968}, {20, 0.985}, {28, 0.991}, {40, 0.997}}};
    const auto begin = std::chrono::steady_clock::now();
    for (const Exact& exact : kExact) {
        const auto counts = planning::exact_design(all, exact.runs, {});
        const double efficiency = planning::d_efficiency(
            planning::evaluate(all, planning::effort_of(counts)), best.log_det);
        std::size_t at_rest = 0;
        for (std::size_t i = 0; i < kAll; ++i) at_rest += counts[i];
        // Not worse than derived, to the digits given.
        table.add(printed("exact plan of %zu runs: D-efficiency (at rest)", exact.runs), "-",
                  printed("%.4f (%zu)", efficiency, at_rest),
                  std::round(1e3 * efficiency) >= 1e3 * exact.derived - 1e-6,
                  printed("%.3f", exact.derived));
    }
    const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begin;
    table.notes.push_back(printed(
        "the six exact plans are the best of random starts, 20 at least, seed %d; they took "
        "%.2f s. Nothing else here is drawn",
        static_cast<int>(planning::ExactSearch{}.seed), took.count()));
}

void add_position_table(Reproduction& table) {
    const std::vector<Vec3> positions{{0, 0, 0},    {0, 0, 45},    {0, 0, 90},  {0, 0, 180},
                                      {180, 0, 45}, {45, 0, 0},    {45, 0, 90}, {90, 0, 90},
                                      {90, 0, 180}, {180, 0, 270}, {270, 0, 0}, {270, 0, 90},
                                      {-45, 0, 0},  {-45, 0, 90}};
    constexpr std::array<const char*, 3> kDerived{"5 directions, rank 5 / 6, 0.000, 0.000",
                                                  "11 directions, rank 9 / 10, 0.581, 0.648",
                                                  "9 directions, rank 8 / 9, 0.000, 0.000"};
    const auto strong = planning::vertical_axes({}, positions, {4.667, 6});
    const auto weak = planning::vertical_axes({}, positions, {0, 6});
    for (std::size_t k = 0; k < kDerived.size(); ++k) {
        add(table, printed("14 positions, %c vertical: D-eff. at 6 + 4.667 and 6 + 0 g", "xyz"[k]),
            "-", kDerived[k],
            printed("%zu directions, rank %zu / %zu, %.3f, %.3f", strong[k].directions,
                    strong[k].rank_one_level, strong[k].rank, strong[k].d_efficiency,
                    weak[k].d_efficiency));
    }
}

/// The determinant of [6]8 + [8]6 over r, in decades, for each allocation.
plot::Chart growth_chart() {
    plot::Chart chart{"Determinant of [6]8 + [8]6 over the ratio of the spheres",
                      plot::Axis("r", true), plot::Axis("det M", true)};
    for (std::size_t k = 0; k < kAllocations.size(); ++k) {
        plot::Curve curve{kAllocationNames[k]};
        for (double r = 1.05; r < 10.01; r *= 1.05) {
            const auto e = planning::evaluate(two_spheres(r), allocated(kAllocations[k], 8, 6));
            curve.add(r, std::exp(e.log_det + 10 * std::log(e.effort)));
        }
        chart.curves.push_back(curve);
    }
    return chart;
}

/// The determinant over a at r = 2, each over its largest.
plot::Chart allocation_chart() {
    plot::Chart chart{"Determinant over the allocation a at r = 2",
                      plot::Axis("a: [6] with 4a, [8] with 12 - 3a runs per point"),
                      plot::Axis("det M over its largest")};
    for (std::size_t k = 0; k < kAllocations.size(); ++k) {
        plot::Curve curve{kAllocationNames[k]};
        double largest = 0;
        for (double a = 0.1; a < 3.95; a += 0.1) {
            const auto e =
                planning::evaluate(two_spheres(2), allocated(kAllocations[k], 4 * a, 12 - 3 * a));
            curve.add(a, std::exp(e.log_det + 10 * std::log(e.effort)));
            largest = std::max(largest, curve.y.back());
        }
        for (double& y : curve.y) y /= largest;
        chart.curves.push_back(curve);
    }
    chart.notes.emplace_back("a as reconstructed here; the paper's definition is lost.");
    return chart;
}

}  // namespace

}  // namespace vibrig::tool::dplan

namespace vibrig::tool {

Reproduction reproduce_dplan(const ReproduceOptions& options) {
    using namespace dplan;
    Reproduction table{"dplan", "D-optimal test plans"};
    add_ranks(table);
    add_allocation(table);
    add_growth(table);
    add_double_sphere_efficiencies(table);
    add_rig_optimum(table);
    add_position_table(table);
    if (!options.plot.empty())
        table.charts = {{"growth", growth_chart()}, {"allocation", allocation_chart()}};
    table.notes.emplace_back(
        "Li et al. 2017 state: one sphere does not identify all ten, two spheres (r > 1) do, the "
        "determinant is largest at a = 2 and grows with r. Their equations are lost: a is "
        "reconstructed here ([6] with 4a runs per point, [8] with 12 - 3a), not their definition; "
        "the numbers under theory are those of the reconstruction");
    table.notes.emplace_back(
        "split-68: [6]8 on the inner and [8]6 on the outer sphere; split-86 the reverse; both: "
        "each on both");
    table.notes.emplace_back("the paper's identified gyro coefficients are not available");
    return table;
}

}  // namespace vibrig::tool
