#include <spdlog/fmt/fmt.h>

#include <cmath>
#include <filesystem>

#include "daemon/record/shaken.hpp"
#include "daemon/report/paperwork.hpp"
#include "daemon/report/report.hpp"
#include "daemon/report/sections.hpp"
#include "estimator/filter/parameters.hpp"

namespace vibrig::report {

using estimator::kParameters;
using record::Campaign;

namespace {

/// A coefficient in both results, of the same vibration where it depends on that.
struct Compared {
    Rows rows{{"coefficient", "now", "earlier", "difference", "unit", "E_n"}};
    std::size_t count = 0, beyond = 0, of_another = 0;
    double square = 0;  ///< sum of squared differences, in their standard uncertainties

    void add(std::size_t i, const estimator::uncertainty::Coefficient& now,
             const estimator::uncertainty::Coefficient& then) {
        const double difference = now.value - then.value;
        const double score = difference / std::hypot(now.expanded, then.expanded);
        const bool far = std::abs(score) > 1;
        ++count;
        if (far) ++beyond;
        square += std::pow(difference / std::hypot(now.u, then.u), 2);
        rows.push_back({estimator::parameter_names()[i], fmt::format("{:.6f}", now.value),
                        fmt::format("{:.6f}", then.value), fmt::format("{:.6f}", difference),
                        estimator::parameter_unit(i),
                        fmt::format("{}{:.2f}", far ? "!" : "", score)});
    }
};

Compared compared(const Analysis& a, const Earlier& earlier) {
    Compared all;
    for (std::size_t i = 0; i < kParameters; ++i) {
        const auto &now = a.assessed.coefficients[i], &then = earlier.assessed.coefficients[i];
        if (!(now.expanded > 0) || !(then.expanded > 0)) continue;
        if (!estimator::is_quadratic(i) || estimator::same_vibration(earlier.at_hz[i], a.at_hz[i]))
            all.add(i, now, then);
        else
            ++all.of_another;
    }
    return all;
}

void add_scores(Page& page, const Compared& all, double coverage) {
    if (all.of_another > 0)
        page.paragraph(
            fmt::format("Left out: {} quadratic coefficients that the earlier campaign "
                        "has of another vibration.",
                        all.of_another));
    if (all.count == 0)
        return page.paragraph("Nothing is comparable: no coefficient is determined by both.");
    page.table(all.rows);
    page.paragraph(
        fmt::format("Repeatability: differences are {:.2f} of their expected standard deviations, "
                    "root mean square; {} of {} beyond E_n = 1, where about {:.2g} % are expected, "
                    "fewer where U has errors that both campaigns share.",
                    std::sqrt(all.square / static_cast<double>(all.count)), all.beyond, all.count,
                    100 * (1 - coverage)));
}

}  // namespace

Earlier earlier_of(const Campaign& earlier, const Campaign& now, bool same_unit) {
    std::error_code error;
    if (std::filesystem::equivalent(earlier.path, now.path, error) ||
        (earlier.head.campaign == now.head.campaign && earlier.head.utc_ns == now.head.utc_ns))
        throw std::runtime_error(earlier.path +
                                 ": found the campaign itself, expected another one to compare");
    for (const Campaign* campaign : {&earlier, &now}) {
        if (!same_unit && paperwork_of(*campaign).unit_serial.empty())
            throw std::runtime_error(
                campaign->path +
                ": found no serial number ([unit] serial) in its configuration, expected one to "
                "compare a unit with itself (--same-unit: it is the same)");
    }
    const auto rig = rig_of(earlier);
    const auto replayed = record::replay(earlier, rig.estimator, {});
    auto found = tool::assess(rig.estimator, replayed.found, replayed.result, replayed.rows,
                              record::shaken_of(earlier, rig));
    const auto at_hz = frequencies_of(found, rig.estimator);
    return {earlier.path,          earlier.head.name,         utc_text(earlier.head.utc_ns),
            paperwork_of(earlier), std::move(found.assessed), at_hz};
}

void add_comparison(Page& page, const Campaign& campaign, const Analysis& a,
                    const std::optional<Earlier>& earlier) {
    page.section("comparison", "Comparison with an earlier campaign");
    if (!earlier) return page.paragraph("None was given (--compare CAMPAIGN).");
    page.paragraph(
        fmt::format("{} of {}, unit {}. E_n is the difference over the root of the sum of both U "
                    "squared (ISO 13528); up to 1 agrees.",
                    earlier->name, earlier->when, unit_text(earlier->paperwork)));
    if (const auto unit = paperwork_of(campaign);
        unit.unit_type != earlier->paperwork.unit_type ||
        unit.unit_serial != earlier->paperwork.unit_serial)
        page.paragraph("Warning: this is another unit than that of this campaign, " +
                       unit_text(unit) + ".");
    if (!a.assessed.done || !earlier->assessed.done)
        return page.paragraph(fmt::format(
            "E_n cannot be had: the uncertainty of {} was not assessed, and noise alone is too "
            "little.",
            a.assessed.done ? "the earlier campaign" : "this campaign"));
    add_scores(page, compared(a, *earlier), a.settings.uncertainty.coverage);
}

}  // namespace vibrig::report
