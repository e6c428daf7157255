#include "daemon/tool/analysis/swept_dwells.hpp"

#include <stdexcept>

#include "daemon/results/text_line.hpp"
#include "estimator/filter/angles.hpp"
#include "estimator/spectrum/sweep_blocks.hpp"

namespace vibrig::tool {
namespace {

using Rows = std::vector<const proto::RecordingRow*>;
namespace spectrum = estimator::spectrum;

// Below it the frequency of a sine wanders, which is no sweep.
constexpr double kGoesThrough = 1.1;
// Fewer seconds tell nothing of a resonance: two of its sides, and what is between.
constexpr std::size_t kFewestBlocks = 10;

std::string place(const std::string& file, const proto::RecordingRow& row) {
    return file + ":" + std::to_string(row.line) + ": column frequency_hz: ";
}

void expect_one_way(const Rows& dwell, const std::string& file) {
    const double first = dwell.front()->frequency_hz;
    const bool rises = dwell.back()->frequency_hz > first;
    double before = first;
    for (const auto* row : dwell) {
        const double hz = row->frequency_hz;
        if (!(hz > 0) || (rises ? hz < before : hz > before))
            throw std::runtime_error(place(file, *row) +
                                     printed("found %g after %g, expected a sweep that %s all the "
                                             "time, or one frequency in a dwell",
                                             hz, before, rises ? "rises" : "falls"));
        before = hz;
    }
}

}  // namespace

estimator::Measurement measurement_of(const proto::RecordingRow& row) noexcept {
    estimator::Measurement measurement;
    measurement.time_s = row.time_s;
    for (std::size_t i = 0; i < 3; ++i) {
        measurement.angle_rad[i] = row.angle_deg[i] * estimator::kRadPerDeg;
        measurement.force_g[i] = row.force_g[i];
    }
    return measurement;
}

bool is_sweep(const Rows& dwell) noexcept {
    const double first = dwell.front()->frequency_hz, last = dwell.back()->frequency_hz;
    return first > 0 && last > 0 && (last / first > kGoesThrough || first / last > kGoesThrough);
}

spectrum::Sweep sweep_of(const estimator::Settings& settings, const Rows& dwell,
                         const std::string& file) {
    expect_one_way(dwell, file);
    spectrum::SweepBlocks blocks(settings, dwell.front()->run, dwell.front()->position);
    for (const auto* row : dwell) blocks.add(measurement_of(*row), row->frequency_hz);
    spectrum::Sweep sweep = blocks.finish();
    if (const double shown = blocks.shown(); shown < spectrum::SweepBlocks::kShown)
        throw std::runtime_error(
            place(file, *dwell.front()) +
            printed("found a sweep of which the accelerometers show %.2f of their power, expected "
                    "%g at least: they vibrate at other frequencies",
                    shown, spectrum::SweepBlocks::kShown));
    if (sweep.known() < kFewestBlocks)
        throw std::runtime_error(
            place(file, *dwell.front()) +
            printed(
                "found a sweep with %zu seconds of %zu that can be used, expected %zu at least: "
                "in others a harmonic falls on a multiple of the sampling rate, or "
                "accelerometers or angles are missing",
                sweep.known(), sweep.blocks.size(), kFewestBlocks));
    return sweep;
}

}  // namespace vibrig::tool
