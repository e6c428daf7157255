#include "daemon/papers/reproduce_tang2009.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "daemon/results/text_line.hpp"
#include "estimator/allan/edf.hpp"
#include "estimator/filter/parameters.hpp"

namespace vibrig::tool {

namespace {

using estimator::kParameters;
using tang2009::Coefficients;
using tang2009::Outcome;
using tang2009::Study;
using tang2009::truth;

constexpr std::size_t kRigs = 16;

// Table 2, trials 1 to 3, in the order of parameter_names().
constexpr std::array<Coefficients, 3> kTable2{
    {{0.9336,  -1.0099, -0.9832, 1.0016,  0.0308,  0.0306,  -0.0292, 0.0306,  -0.0298, -0.0299,
      -0.9649, 1.0009,  1.0163,  -1.0014, -0.0306, -0.0303, 0.0296,  -0.0297, 0.0301,  0.0300,
      0.9800,  -1.0174, -1.0062, 0.9944,  0.0302,  0.0297,  -0.0295, 0.0297,  -0.0299, -0.0300},
     {0.9954,  -0.9995, -0.9972, 1.0025,  0.0325,  0.0219,  -0.0201, 0.0182,  -0.0040, -0.0174,
      -0.9908, 0.9984,  1.0044,  -0.9958, -0.0341, -0.0260, 0.0279,  -0.0225, 0.0123,  0.0102,
      0.9880,  -1.0047, -1.0113, 0.9973,  0.0345,  0.0243,  -0.0169, 0.0107,  -0.0278, -0.0187},
     {0.9692,  -1.0099, -0.9832, 1.0016,  0.0304,  0.0303,  -0.0296, 0.0306,  -0.0298, -0.0299,
      -1.2350, 1.0009,  1.0163,  -1.0014, -0.0269, -0.0268, 0.0333,  -0.0297, 0.0301,  0.0300,
      1.2200,  -1.0174, -1.0062, 0.9944,  0.0269,  0.0270,  -0.0331, 0.0297,  -0.0299, -0.0300}}};

/// Places within one gyro's ten coefficients.
struct Group {
    const char* name;
    std::size_t first, last;
};
constexpr Group kAll{"all 30", 0, 9}, kBias{"bias", 0, 0}, kLinear{"linear", 1, 3},
    kSquares{"squares", 4, 6}, kProducts{"products", 7, 9}, kSecondOrder{"second order", 4, 9};

double square_sum(const Coefficients& value, const Group& group) {
    double sum = 0;
    for (std::size_t i = 0; i < kParameters; ++i) {
        if (i % 10 < group.first || i % 10 > group.last) continue;
        sum += std::pow((value[i] - truth()[i]) / truth()[i], 2);
    }
    return sum / static_cast<double>(3 * (group.last - group.first + 1));
}

/// rms of some sigma relative to the coefficients.
double relative_rms(Coefficients sigma, const Group& group) {
    for (std::size_t i = 0; i < kParameters; ++i) sigma[i] += truth()[i];
    return std::sqrt(square_sum(sigma, group));
}

/// rms relative error in % of one set of coefficients, and over all seeds of a route.
double rms(const Coefficients& value, const Group& group) {
    return 100 * std::sqrt(square_sum(value, group));
}
double rms(const Study& study, tang2009::Route route, const Group& group) {
    double sum = 0;
    for (const auto& seed : study.seeds) sum += square_sum(seed[route].value, group);
    return 100 * std::sqrt(sum / static_cast<double>(study.seeds.size()));
}

/// A number, and if it is from some seeds the standard deviation that chance gives it.
struct Drawn {
    double value = 0;
    std::optional<double> chance = {};
    [[nodiscard]] std::string text() const {
        return chance ? printed("%.4g +- %.2g", value, *chance) : printed("%.4g", value);
    }
};

Drawn drawn_rms(const Study& study, tang2009::Route route, const Group& group) {
    const auto n = static_cast<double>(study.seeds.size());
    const double mean = std::pow(rms(study, route, group), 2);
    double variance = 0;
    for (const auto& seed : study.seeds) {
        variance += std::pow(std::pow(rms(seed[route].value, group), 2) - mean, 2) / (n * (n - 1));
    }
    const double value = std::sqrt(mean);
    return {value, std::sqrt(variance) / (2 * value)};
}

/// Ratio of two rms errors over the same seeds.
Drawn drawn_ratio(const Study& study, tang2009::Route above, tang2009::Route below,
                  const Group& group) {
    const auto n = static_cast<double>(study.seeds.size());
    const double a = std::pow(rms(study, above, group), 2);
    const double b = std::pow(rms(study, below, group), 2);
    double variance = 0;  // of the logarithm of the squared ratio
    for (const auto& seed : study.seeds) {
        variance += std::pow(std::pow(rms(seed[above].value, group), 2) / a -
                                 std::pow(rms(seed[below].value, group), 2) / b,
                             2) /
                    (n * (n - 1));
    }
    const double value = std::sqrt(a / b);
    return {value, value * std::sqrt(variance) / 2};
}

std::string levels(const Study& study) { return printed("%.4g g", study.platform_g(9)); }
/// The same as the end of a key.
std::string at_level(const Study& study) { return printed("_%.4gg", study.platform_g(9)); }

void add_coefficients(const std::vector<Study>& studies, Reproduction& table) {
    using enum tang2009::Route;
    const std::array<std::array<tang2009::Route, 2>, 3> routes{
        {{kTwoStep1, kJoint1}, {kTwoStep2, kJoint2}, {kOneLevel3, kOneLevel3}}};
    for (std::size_t trial = 0; trial < 3; ++trial) {
        for (std::size_t i = 0; i < kParameters; ++i) {
            const char* text = i % 10 >= 4 ? "%s %.5f +- %.5f" : "%s %.4f +- %.4f";
            ReproducedRow row{printed("Table 2, trial %zu, %s (truth %g)", trial + 1,
                                      estimator::parameter_names()[i], truth()[i]),
                              printed("%.4f", kTable2[trial][i]),
                              "",
                              {},
                              "",
                              {{"published", kTable2[trial][i]}, {"truth", truth()[i]}}};
            for (const Study& study : studies) {
                const auto& seed = study.seeds.front();
                row.computed += (row.computed.empty() ? "" : "; ") + levels(study) + ": ";
                const auto add = [&](const char* name, const char* key, const Outcome& outcome) {
                    row.computed += printed(text, name, outcome.value[i], outcome.sigma[i]);
                    row.values.emplace_back(key + at_level(study), outcome.value[i]);
                    row.values.emplace_back(key + ("_sigma" + at_level(study)), outcome.sigma[i]);
                };
                if (trial < 2) {
                    add("two-step", "two_step", seed[routes[trial][0]]);
                    row.computed += ", ";
                    add("joint", "joint", seed[routes[trial][1]]);
                } else {
                    add("one level", "one_level", seed[routes[trial][0]]);
                }
            }
            table.rows.push_back(std::move(row));
        }
    }
}

void add_errors(const std::vector<Study>& studies, Reproduction& table) {
    using enum tang2009::Route;
    struct Line {
        const char* name;
        tang2009::Route route;
        int trial;  ///< of Table 2; -1: not in it
    };
    constexpr std::array<Line, 6> kLines{{{"trial 1 (9/7 g) two-step", kTwoStep1, 0},
                                          {"trial 1 (9/7 g) joint", kJoint1, 0},
                                          {"trial 2 (0/2 g) two-step", kTwoStep2, 1},
                                          {"trial 2 (0/2 g) joint", kJoint2, 1},
                                          {"trial 3 (9 g, all 30)", kOneLevel3, 2},
                                          {"9/0 g joint", kJointRest, -1}}};
    for (const Study& study : studies) {
        for (const Line& line : kLines) {
            for (const Group& group : {kAll, kBias, kLinear, kSquares, kProducts}) {
                const double published =
                    line.trial < 0 ? 0.0
                                   : rms(kTable2[static_cast<std::size_t>(line.trial)], group);
                const double computed = rms(study, line.route, group);
                table.add("rms relative error, %, " + levels(study) + ", " + line.name + ", " +
                              group.name,
                          line.trial < 0 ? "-" : printed("%.2f", published),
                          printed("%.3f", computed), {}, {}, {{"computed", computed}});
                if (line.trial >= 0) table.rows.back().values.emplace_back("published", published);
            }
        }
    }
}

enum class Side : unsigned char { at_most, at_least };

/// A demand on one number, or on what was drawn over the seeds that were run; chance is shown and
/// excuses nothing.
void demand(Reproduction& table, const std::string& item, const Drawn& of, Side side,
            double limit) {
    const bool most = side == Side::at_most;
    std::vector<std::pair<std::string, double>> values{{"computed", of.value}};
    if (of.chance) values.emplace_back("sigma", *of.chance);
    values.emplace_back(most ? "at_most" : "at_least", limit);
    table.add(item, "-", of.text(), most ? of.value <= limit : of.value >= limit,
              printed("at %s %.4g", most ? "most" : "least", limit), std::move(values));
}

/// Degrees of freedom of the chi-square that square_sum() has from seed to seed, by its mean and
/// variance (Welch, Satterthwaite): the coefficients correlate, and weigh differently.
double degrees_of(const Outcome& outcome, const Group& group) {
    double mean = 0, square = 0;
    for (std::size_t i = 0; i < kParameters; ++i) {
        for (std::size_t j = 0; j < kParameters; ++j) {
            if (std::min(i % 10, j % 10) < group.first || std::max(i % 10, j % 10) > group.last)
                continue;
            const double relative = outcome.covariance[i][j] / (truth()[i] * truth()[j]);
            if (i == j) mean += relative;
            square += relative * relative;
        }
    }
    return mean * mean / square;
}

/// What theory foretells of the joint filter: the mean square of its errors is the bound's, and
/// strays from it as a chi-square of `degrees`, those of all seeds together.
void demand_theory(Reproduction& table, const std::string& item, const Drawn& drawn, double theory,
                   double degrees) {
    const auto end = [&](double probability) {
        return theory *
               std::sqrt(estimator::allan::chi_square_quantile(probability, degrees) / degrees);
    };
    const double least = end(0.0005), most = end(0.9995);
    table.add(item + ", rms relative error, %, against theory", "-",
              printed("%.4g +- %.2g", drawn.value, *drawn.chance),
              least <= drawn.value && drawn.value <= most,
              printed("%.4g: %.3g to %.3g (99.9 %%)", theory, least, most),
              {{"computed", drawn.value},
               {"sigma", *drawn.chance},
               {"theory", theory},
               {"at_least", least},
               {"at_most", most}});
}

/// The paper's table is one draw, and may be as far from the mean of ours as one of them (99.7 % of
/// Student's t, whose square is F with one degree of freedom above).
void demand_published(Reproduction& table, const Study& study, tang2009::Route route,
                      std::size_t trial, const Group& group) {
    const auto n = static_cast<double>(study.seeds.size());
    double mean = 0, square = 0;
    for (const auto& seed : study.seeds) {
        const double one = rms(seed[route].value, group);
        mean += one / n;
        square += one * one / n;
    }
    const double spread = std::sqrt(std::max(0.0, square - mean * mean) * n / std::max(1.0, n - 1));
    const double published = rms(kTable2[trial], group);
    const double t = std::sqrt(estimator::allan::f_quantile(0.997, 1, n - 1));
    const double band = t * spread * std::sqrt(1 + 1 / n);
    table.add(levels(study) + printed(": trial %zu, two-step, %s, rms relative error, %%, "
                                      "against the paper's one draw",
                                      trial + 1, group.name),
              printed("%.4g", published), printed("%.4g, one seed +- %.2g", mean, spread),
              std::abs(published - mean) <= band, printed("within %.2g (99.7 %%)", band),
              {{"published", published}, {"computed", mean}, {"sigma", spread}});
}

void add_two_sided(const Study& stated, const Study& doubled, Reproduction& table) {
    using enum tang2009::Route;
    const auto n = static_cast<double>(stated.seeds.size());
    for (const Study* study : {&stated, &doubled}) {
        for (const auto& [what, route, bound] :
             {std::tuple{": trial 1, joint, ", kJoint1, &study->bound},
              std::tuple{": trial 2, joint, ", kJoint2, &study->bound_trial_2}}) {
            for (const Group& group : {kAll, kBias, kLinear, kSquares, kProducts}) {
                demand_theory(table, levels(*study) + what + group.name,
                              drawn_rms(*study, route, group), 100 * relative_rms(*bound, group),
                              n * degrees_of(study->seeds.front()[route], group));
            }
        }
    }
    // The numbers of the table themselves imply the doubled levels.
    for (const Group& group : {kAll, kBias, kLinear, kSquares, kProducts})
        demand_published(table, doubled, kTwoStep1, 0, group);
}

void add_findings(const Study& study, Reproduction& table) {
    using enum tang2009::Route;
    using enum Side;
    const std::string at = levels(study) + ": ";
    // At 6 g the bounds themselves are a little less than an order apart.
    const double bounds =
        relative_rms(study.bound_trial_2, kSecondOrder) / relative_rms(study.bound, kSecondOrder);
    const double published = rms(kTable2[1], kSecondOrder) / rms(kTable2[0], kSecondOrder);
    const double two_step =
        rms(study, kTwoStep2, kSecondOrder) / rms(study, kTwoStep1, kSecondOrder);
    const Drawn joint = drawn_ratio(study, kJoint2, kJoint1, kSecondOrder);
    const double least = std::min(10.0, bounds - 2 * *joint.chance);
    table.add(at + "error of second-order terms, trial 2 over trial 1", printed("%.1f", published),
              printed("joint %.2f +- %.2f, two-step %.2f, bounds %.2f", joint.value, *joint.chance,
                      two_step, bounds),
              joint.value >= least, printed("joint at least %.2f (2 sigma)", least),
              {{"published", published},
               {"bounds", bounds},
               {"joint", joint.value},
               {"sigma", *joint.chance},
               {"two_step", two_step},
               {"at_least", least}});
    double separable = 0;
    for (const auto& seed : study.seeds) separable += std::isfinite(seed[kJointLevel].nees) ? 1 : 0;
    demand(table, at + "one level with the joint filter, seeds in which it passed for two",
           {separable}, at_most, 0);
    demand(table, at + "trial 3, error of bias over that of the joint filter with 9/7 g",
           {rms(study, kOneLevel3, kBias) / rms(study, kJoint1, kBias)}, at_least, 10);
    demand(table, at + "trial 3, error of squares over that of the joint filter with 9/7 g",
           {rms(study, kOneLevel3, kSquares) / rms(study, kJoint1, kSquares)}, at_least, 10);
    // Table 2 prints the same linear terms and products for trials 1 and 3: both come from the run
    // with 9 g.
    for (const Group& group : {kLinear, kProducts}) {
        double square = 0, sigma = 0, in_print = 0;
        for (const auto& seed : study.seeds) {
            for (std::size_t i = 0; i < kParameters; ++i) {
                if (i % 10 < group.first || i % 10 > group.last) continue;
                square += std::pow(seed[kOneLevel3].value[i] - seed[kTwoStep1].value[i], 2);
                sigma += std::pow(seed[kTwoStep1].sigma[i], 2);
                in_print = std::max(in_print, std::abs(kTable2[2][i] - kTable2[0][i]));
            }
        }
        const double ratio = std::sqrt(square / sigma);
        table.add(at + "trial 3, " + group.name + " less those of trial 1, rms over sigma",
                  printed("%.4f", in_print), printed("%.4f", ratio), {}, "0 at one kappa",
                  {{"published", in_print}, {"computed", ratio}});
    }
}

/// What Table 2 prints for trial 3 less what it prints for trial 1, one gyro. A kappa that is one
/// for the whole run leaves (-kappa, 1, 1, 1) of bias and squares free, and nothing else: D_II -
/// D_OO and D_SS - D_OO would stay as they are, as the linear terms and products do in print.
void add_printed_trial_3(Reproduction& table) {
    constexpr double kRounding = 2e-4;  // four numbers, half a unit of the last place each
    constexpr std::size_t kSquaresAt[] = {4, 5, 6};
    for (std::size_t gyro = 0; gyro < 3; ++gyro) {
        const auto change = [&](std::size_t i) {
            return kTable2[2][10 * gyro + i] - kTable2[0][10 * gyro + i];
        };
        double squares = 0;
        for (const std::size_t i : kSquaresAt) squares += change(i) / 3;
        const double moved =
            std::max(std::abs(change(4) - change(5)), std::abs(change(6) - change(5)));
        const double ratio = change(0) / squares;
        table.add(printed("Table 2, gyro %c: trial 3 less trial 1, bias over the mean of "
                          "the squares; D_II - D_OO or D_SS - D_OO",
                          "xyz"[gyro]),
                  printed("%.0f; %.4f", ratio, moved), "-", {},
                  printed("-73 at 12 g; 0 within %.4f at one kappa", kRounding),
                  {{"published", ratio}, {"published_moved", moved}, {"theory", -73}});
    }
}

void add_statistics(const Study& study, Reproduction& table) {
    using tang2009::kJoint1;
    const auto n = static_cast<double>(study.seeds.size());
    double nees = 0, nis = 0, ratio = 0, off = 0;
    for (const auto& seed : study.seeds) {
        const Outcome& joint = seed[kJoint1];
        nees += joint.nees / n;
        nis += joint.nis / n;
        for (std::size_t i = 0; i < kParameters; ++i) {
            ratio += std::pow((joint.value[i] - truth()[i]) / study.bound[i], 2) /
                     (n * static_cast<double>(kParameters));
            off = std::max(off, std::abs(joint.sigma[i] / study.bound[i] - 1));
        }
    }
    const std::string at = levels(study) + ", joint, trial 1: ";
    const auto within = [&](const char* what, double value, double centre, double band,
                            const char* format) {
        table.add(
            at + what, "-", printed(format, value), std::abs(value - centre) <= band,
            printed(format, centre - band) + " to " + printed(format, centre + band) + " (95 %)",
            {{"computed", value}, {"at_least", centre - band}, {"at_most", centre + band}});
    };
    // 112 000 samples of three axes in each seed.
    within("mean NEES of 30", nees, 30, 1.96 * std::sqrt(60 / n), "%.2f");
    within("mean NIS per degree of freedom", nis, 1, 1.96 * std::sqrt(2 / (336e3 * n)), "%.5f");
    demand(table, at + "largest difference of sigma from the Cramer-Rao bound", {off},
           Side::at_most, 0.01);
    // Few seeds may exceed 1.05 by chance. The mean square has as many degrees of freedom as a
    // chi-square of its variance: 30 per seed, fewer since the coefficients of a seed correlate.
    const double degrees =
        n * std::pow(kParameters, 2) / study.seeds.front()[kJoint1].correlation_square;
    const double chance = std::sqrt(estimator::allan::chi_square_quantile(0.95, degrees) / degrees);
    const double limit = std::max(1.05, chance);
    demand(table,
           at + "rms of error over Cramer-Rao bound (1.05, or the 95 % chi-square limit of " +
               printed("%zu seeds)", study.seeds.size()),
           {std::sqrt(ratio)}, Side::at_most, limit);
}

void add_acceptance(const Study& stated, const Study& doubled, Reproduction& table) {
    using enum tang2009::Route;
    using enum Side;
    demand(table, levels(doubled) + ": joint, rms relative error, %",
           drawn_rms(doubled, kJoint1, kAll), at_most, 0.5);
    demand(table, levels(stated) + ": joint, rms relative error, %",
           drawn_rms(stated, kJoint1, kAll), at_most, 1.4);
    demand(table, levels(stated) + ": two-step over joint, all 30",
           drawn_ratio(stated, kTwoStep1, kJoint1, kAll), at_least, 2);
    demand(table, levels(stated) + ": two-step over joint, bias",
           drawn_ratio(stated, kTwoStep1, kJoint1, kBias), at_least, 3);
    const std::array<std::pair<Group, double>, 4> kRest{
        {{kBias, 0.3}, {kLinear, 0.35}, {kSquares, 1.0}, {kProducts, 2.2}}};
    for (const auto& [group, limit] : kRest) {
        demand(table, levels(stated) + " with rest: joint, " + group.name + ", %",
               drawn_rms(stated, kJointRest, group), at_most, limit);
    }
    for (const Study* study : {&stated, &doubled}) {
        for (const auto& [two_step, joint, trial] :
             {std::tuple{kTwoStep1, kJoint1, 1}, std::tuple{kTwoStep2, kJoint2, 2}}) {
            for (const Group& group : {kAll, kBias, kLinear, kSquares, kProducts}) {
                demand(table,
                       levels(*study) +
                           printed(": trial %d, joint over two-step, %s", trial, group.name),
                       drawn_ratio(*study, joint, two_step, group), at_most, 1);
            }
        }
    }
}

}  // namespace

Reproduction reproduce_tang2009(const ReproduceOptions& options) {
    const std::size_t seeds = options.seeds > 0 ? options.seeds : kRigs;
    const std::vector<Study> studies = tang2009::run_studies({1.0, 2.0}, seeds);
    Reproduction result{
        "tang2009",
        "Tang, Fu, Yu, Deng 2009: 30 gyro error coefficients, 14 positions of 100 s, 15 Hz"};
    add_coefficients(studies, result);
    add_errors(studies, result);
    for (const Study& study : studies) add_findings(study, result);
    add_printed_trial_3(result);
    tang2009::add_transmission(result);
    tang2009::add_level_errors(result);
    add_acceptance(studies[0], studies[1], result);
    if (seeds > 1) add_two_sided(studies[0], studies[1], result);
    for (const Study& study : studies) add_statistics(study, result);
    result.notes.emplace_back(
        "Trial 2 over trial 1, an order worse: at least 10, or the ratio of the Cramer-Rao bounds "
        "less 2 sigma where that is smaller. Section 3.5: an error dk of all three axes gives 2 "
        "dk, "
        "so that the three numbers sum to 14 and z has 6, not 8.");
    result.notes.push_back(printed(
        "%zu simulated rigs (seeds 1 to %zu); single coefficients are those of seed 1. +- is one "
        "standard deviation everywhere: of a coefficient what its filter claims, of an rms error "
        "or "
        "a ratio what chance gives it over these seeds.",
        seeds, seeds));
    result.notes.emplace_back(
        "A demand is judged by the rms over the seeds that were run: few seeds may miss it without "
        "meaning anything. Chance is allowed for where a row says so, and nowhere else.");
    result.notes.emplace_back(
        "Rows that say \"at most\" or \"at least\" can fail on one side only; all others on both.");
    result.notes.emplace_back(
        "Levels are peak accelerations of the platform in the first run; the numbers of Table 2 "
        "themselves imply the doubled ones, so it is compared with those.");
    result.notes.emplace_back(
        "The two-step route takes plain eq. 13 in the first run and eqs 17-18 in the second, where "
        "the same position was finished before. Eq. 13 over the first samples of a dwell is wrong, "
        "and the filter learns from it: at 12 g the error depends on the phase of the vibration "
        "there.");
    result.notes.emplace_back(
        "Trial 3: at one level bias and squares are not separable (identify reports the "
        "combinations instead); what is shown is what a filter of all 30 with eq. 13's amplitude "
        "is left with. Table 2 prints trial 1's linear terms and products for it, to the last "
        "digit. One kappa for the whole run would do that, with (-kappa, 1, 1, 1) of bias and "
        "squares free, and bias over squares is about -73 in print, the -kappa of 12 g; but then "
        "D_II - D_OO and D_SS - D_OO would be the same too, and in print those of gyro z are apart "
        "by 0.0006 and 0.0009. So no filter gives all of these numbers. Eq. 13 over the first "
        "samples of each dwell gives other kappas, which the errors of trial 1 show.");
    if (!options.plot.empty()) {
        for (const Study& study : studies) tang2009::add_convergence(study, result);
        result.notes.push_back("charts like Figure 3 are in " + options.plot);
    }
    return result;
}

}  // namespace vibrig::tool
