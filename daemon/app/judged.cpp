#include "daemon/app/judged.hpp"

#include <spdlog/fmt/fmt.h>

#include <utility>

#include "daemon/dwells/anew.hpp"
#include "daemon/journal/reread.hpp"

namespace vibrig {

namespace uncertainty = estimator::uncertainty;

namespace {

/// Without what other frequencies say. Returns all rows of what was identified anew; none: nothing
/// was.
std::vector<estimator::DwellRow> assess(Judged& out, const estimator::Settings& settings,
                                        const estimator::Result& result,
                                        const std::optional<Again>& again,
                                        uncertainty::Stage stage) {
    if (again && !result.dwells.empty()) {
        dwells::Anew anew(settings, again->found, result.dwells.size());
        auto& identification = anew.identification();
        out.not_anew =
            again->journal.empty()
                ? "no journal is kept"
                : journal::reread(again->journal, again->configuration_hash, result.dwells.back(),
                                  [&](const journal::DwellCheckpoint& dwell) {
                                      const auto& all = dwell.measurements;
                                      dwells::feed(
                                          identification, dwell.info, all.size(),
                                          [&all](std::size_t n) { return all[n]; }, false,
                                          [](std::size_t, const estimator::StepResult&) {});
                                  });
        auto found = anew.result();
        if (out.not_anew.empty() && found.dwells.size() != result.dwells.size())
            out.not_anew = fmt::format("{} of {} dwells are in {}", found.dwells.size(),
                                       result.dwells.size(), again->journal);
        if (out.not_anew.empty()) {
            out.live = std::make_shared<const dwells::Live>(
                dwells::Live{again->found, result, uncertainty::assess(settings, result)});
            out.assessed = dwells::assess(settings, again->found, found);
            out.anew = std::move(found);
            return identification.rows();
        }
    }
    out.assessed = uncertainty::assess(settings, result, stage);
    return {};
}

}  // namespace

Judged judge(const estimator::Settings& settings, const estimator::Result& result,
             const std::optional<Again>& again, uncertainty::Stage stage,
             const std::vector<estimator::DwellRow>& all_rows, const tool::NumberedKinds& profiles,
             std::vector<estimator::spectrum::Sweep> sweeps, const tool::PlayedBands& psds) {
    Judged out;
    const auto anew = assess(out, settings, result, again, stage);
    if (stage != uncertainty::Stage::ended || !out.assessed.done) return out;
    const auto in_force = out.anew ? dwells::Anew::settings_of(settings, again->found) : settings;
    out.spectrum =
        tool::spectrum_of(in_force, out.anew ? anew : all_rows,
                          estimator::spectrum::Form::automatic, profiles, std::move(sweeps), psds);
    if (out.spectrum) tool::adopt(*out.spectrum, in_force, out.assessed);
    return out;
}

Severity severity_of(uncertainty::Level level) {
    return level == uncertainty::Level::not_valid  ? Severity::alarm
           : level == uncertainty::Level::doubtful ? Severity::warning
                                                   : Severity::info;
}

}  // namespace vibrig
