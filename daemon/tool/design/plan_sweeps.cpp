#include "daemon/tool/design/plan_sweeps.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "estimator/spectrum/sweep_plan.hpp"

namespace vibrig::tool::planner {

namespace {

namespace spectrum = estimator::spectrum;
using planning::Vec3;

/// Below it vibrigd --check refuses a sweep.
constexpr double kLeastRate_hz = 100;
/// Where fewer of its seconds can be used, dwells beside the forbidden frequencies tell more in the
/// same time.
constexpr double kLeastUsable = 0.5;
constexpr double kLeastRatio = 1.1;  ///< of a plan file's ends
constexpr double kLeast_g = 0.1;     ///< less is hardly a vibration

/// 65 frequencies as vibrigd --check has them, and those at which the transmission was measured.
std::vector<double> along(const std::array<double, 2>& ends, const spectrum::Mount& mount) {
    constexpr int kSteps = 64;
    const auto [low, high] = ends;
    std::vector<double> hz;
    for (int k = 0; k <= kSteps; ++k) hz.push_back(low * std::pow(high / low, k / double{kSteps}));
    for (const auto& [at, ratio] : mount.measured) {
        if (at > low && at < high) hz.push_back(at);
    }
    return hz;
}

}  // namespace

PlannedSweeps::PlannedSweeps(const PlanRequest& request, const configuration::Configuration& c,
                             const spectrum::Mount& mount, double level_g,
                             const std::vector<Vec3>& positions_deg)
    : asked_(request.survey), c_(c), mount_(mount) {
    check_range();
    choose_level(level_g);
    const auto [low, high] = std::array{asked_.sweeps[0], asked_.sweeps[1]};
    std::vector<Vec3> ups;
    for (const Vec3& position : positions_deg)
        ups.push_back(planning::up_at(c.estimator, position));
    const auto places = spectrum::sweep_places(ups);
    planned_.seen = spectrum::products_seen(ups, places);
    for (const std::size_t place : places) {
        for (const auto& ends : {std::pair{low, high}, std::pair{high, low}}) {
            PlanRun run;
            run.sweep = {ends.first, ends.second, asked_.sweep_s};
            run.table_g = planned_.table_g;
            run.visit = {positions_deg[place],
                         planned_.table_g * mount_.transmission(ends.first).value_or(1)};
            runs_.push_back(run);
        }
    }
    if (!request.config.empty() && !(c.shaker.registers.sweep && c.spectrum.mixed))
        warnings_.emplace_back(
            "sweeps: the configuration has not the registers for them (shaker.registers.mode, "
            "sweep_from, sweep_to, sweep_rate, actual_frequency) with spectrum.mode \"mixed\": "
            "vibrigd --check will refuse this plan");
}

void PlannedSweeps::check_range() const {
    const auto refuse = [](const std::string& found, const std::string& expected) {
        throw std::runtime_error("--sweeps: found " + found + ", expected " + expected);
    };
    const double low = asked_.sweeps[0], high = asked_.sweeps[1];
    const std::string range = printed("%.6g to %.6g Hz", low, high);
    if (!(high >= kLeastRatio * low))
        refuse(range, "LOW,HIGH in Hz, the second 10 % above the first at least");
    if (low < mount_.lowest_hz())
        refuse(range,
               printed("%.6g Hz at least: below it the isolators amplify", mount_.lowest_hz()));
    for (const double hz : along({low, high}, mount_)) {
        if (!mount_.transmission(hz))
            refuse(range, printed("frequencies within %.6g to %.6g Hz, where spectrum.transmission "
                                  "is known",
                                  mount_.measured.front().first, mount_.measured.back().first));
        const double seen = c_.estimator.accelerometer_response.power(hz);
        if (seen < estimator::kLeastSeen)
            refuse(range, printed("frequencies of which the accelerometers see half of the power: "
                                  "at %.6g Hz they see %.6g",
                                  hz, seen));
    }
    const double octaves_per_minute = 60 * std::log2(high / low) / asked_.sweep_s;
    if (const auto& registers = c_.shaker.registers.sweep;
        registers && std::round(octaves_per_minute / registers->rate.scale) < 1)
        refuse(range +
                   printed(" in %.6g s, %.6g octaves a minute", asked_.sweep_s, octaves_per_minute),
               printed("%.6g at least, the step of shaker.registers.sweep_rate: a shorter sweep",
                       registers->rate.scale));
    const double rate = 1e9 / static_cast<double>(c_.assembler.sample_period);
    for (const auto& ends : {std::pair{low, high}, std::pair{high, low}}) {
        const auto usable =
            spectrum::usable_blocks({ends.first, ends.second, asked_.sweep_s}, rate);
        const std::string of = printed(
            "%s at %.6g samples/s: with %zu of %zu s harmonics up to the 5th are off "
            "multiples of the rate, and %zu rates between neighbours (%.3g %%)",
            range.c_str(), rate, usable.known, usable.blocks, usable.rates, 100 * usable.share());
        if (rate < kLeastRate_hz)
            refuse(of, printed("%.6g samples/s at least (can.sample_rate_hz)", kLeastRate_hz));
        if (usable.share() < kLeastUsable)
            refuse(of, "half of them at least: more samples/s, a longer sweep, or another range");
    }
}

/// What no frequency of the sweep forbids; the table keeps its amplitude all along.
void PlannedSweeps::choose_level(double level_g) {
    const std::array<double, 2> ends{asked_.sweeps[0], asked_.sweeps[1]};
    const spectrum::TableLimits limits{c_.campaign.max_acceleration_g, c_.campaign.max_velocity_mps,
                                       c_.campaign.max_displacement_mm, c_.estimator.gravity_mps2};
    const double range_g = c_.estimator.accelerometer_range_g;
    const double at_platform = range_g > 0 ? std::min(level_g, range_g - 1) : level_g;
    double table_g = 1e9, tightest_hz = ends[0];
    bool by_table = false;
    const auto all = along(ends, mount_);
    for (const double hz : all) {
        const double ratio = mount_.transmission(hz).value_or(1);
        if (at_platform / ratio < table_g) {
            table_g = at_platform / ratio;
            tightest_hz = hz;
            by_table = false;
        }
        if (limits.table_g(hz) < table_g) {
            table_g = limits.table_g(hz);
            tightest_hz = hz;
            by_table = true;
        }
    }
    // Three decimals, rounded down: what is written out stays within the limit.
    if (by_table || at_platform < level_g) table_g = std::floor(table_g * 1e3) / 1e3;
    if (!(table_g >= kLeast_g))
        throw std::runtime_error(printed(
            "--sweeps: found %.6g g at the table left by the limits at %.6g Hz, expected %.6g g at "
            "least",
            table_g, tightest_hz, kLeast_g));
    planned_.table_g = table_g;
    planned_.from_hz = ends[0];
    planned_.to_hz = ends[1];
    planned_.seconds = asked_.sweep_s;
    planned_.lowest_g = 1e9;
    for (const double hz : all) {
        const double there = table_g * mount_.transmission(hz).value_or(1);
        planned_.lowest_g = std::min(planned_.lowest_g, there);
        planned_.highest_g = std::max(planned_.highest_g, there);
    }
    const double rate = 1e9 / static_cast<double>(c_.assembler.sample_period);
    planned_.up = spectrum::usable_blocks({ends[0], ends[1], asked_.sweep_s}, rate);
    planned_.down = spectrum::usable_blocks({ends[1], ends[0], asked_.sweep_s}, rate);
    if (by_table)
        warnings_.push_back(
            printed("sweeps: the shaker's limits leave %.6g g at the table, at "
                    "%.6g Hz",
                    table_g, tightest_hz));
    else if (at_platform < level_g)
        warnings_.push_back(
            printed("sweeps: accelerometer.range_g leaves %.6g g of %.6g g at the platform",
                    at_platform, level_g));
}

void PlannedSweeps::put_before(PlanStudy& study, const planning::Timing& timing) const {
    put_sweeps_before(study, runs_, timing, c_.campaign.swept_by);
    study.warnings.insert(study.warnings.end(), warnings_.begin(), warnings_.end());
    study.sweeps = planned_;
}

void put_sweeps_before(PlanStudy& study, const std::vector<PlanRun>& sweeps,
                       const planning::Timing& timing, const spectrum::SweptBy& by) {
    Vec3 here{};
    const Vec3 first = study.runs.empty() ? here : study.runs.front().visit.position_deg;
    planning::Duration& all = study.duration;
    all.slewing_s -= planning::slew_s(here, first, timing);
    all.total_s -= planning::slew_s(here, first, timing);
    const auto slew = [&](const Vec3& to) {
        all.slewing_s += planning::slew_s(here, to, timing);
        all.total_s += planning::slew_s(here, to, timing);
        here = to;
    };
    for (const PlanRun& run : sweeps) {
        slew(run.visit.position_deg);
        const double shaking_s =
            spectrum::SweepBounds(run.sweep, by).dwell_s() + timing.settle_s + 2 * timing.ramp_s;
        all.total_s += timing.look_s + shaking_s;
        all.vibrating_s += shaking_s;
    }
    slew(first);
    study.runs.insert(study.runs.begin(), sweeps.begin(), sweeps.end());
}

}  // namespace vibrig::tool::planner
