#include "daemon/app/judged.hpp"

#include <spdlog/fmt/fmt.h>

#include <utility>

#include "daemon/dwells/anew.hpp"
#include "daemon/journal/reread.hpp"
#include "estimator/commissioning/contradiction.hpp"
#include "estimator/uncertainty/verdict.hpp"

namespace vibrig {

namespace uncertainty = estimator::uncertainty;

namespace {

struct TakenAnew {
    estimator::Result result;
    std::vector<estimator::DwellRow> rows;  ///< of all dwells
    std::vector<estimator::DwellMeans> means;
};

/// From the journal, with the noise that was found; nothing: `why_not` says why.
std::optional<TakenAnew> take_anew(const estimator::Settings& settings, const Again& again,
                                   const estimator::Result& result, std::string& why_not) {
    dwells::Anew anew(settings, again.found, result.dwells.size());
    auto& identification = anew.identification();
    why_not = again.journal.empty()
                  ? "no journal is kept"
                  : journal::reread(again.journal, again.configuration_hash, result.dwells.back(),
                                    [&](const journal::DwellCheckpoint& dwell) {
                                        const auto& all = dwell.measurements;
                                        dwells::feed(
                                            identification, dwell.info, all.size(),
                                            [&all](std::size_t n) { return all[n]; }, false,
                                            [](std::size_t, const estimator::StepResult&) {});
                                    });
    auto found = anew.result();
    if (why_not.empty() && found.dwells.size() != result.dwells.size())
        why_not = fmt::format("{} of {} dwells are in {}", found.dwells.size(),
                              result.dwells.size(), again.journal);
    if (!why_not.empty()) return {};
    return TakenAnew{std::move(found), identification.rows(), identification.means()};
}

/// While it runs, too: a night with a wrong key shows after its first dwells.
void hold_against_configuration(const estimator::Settings& settings,
                                const std::vector<estimator::DwellSummary>& dwells,
                                const std::vector<estimator::DwellMeans>& means, Judged& out) {
    auto contradiction = estimator::commissioning::contradiction_of(settings, dwells, means);
    out.contradictions = std::move(contradiction.warnings);
    uncertainty::contradict(out.assessed.verdict, contradiction.first);
}

std::shared_ptr<const std::vector<VerdictStatus::Combination>> combinations(
    const estimator::Result& result, const uncertainty::Assessment& assessed) {
    auto found = std::make_shared<std::vector<VerdictStatus::Combination>>();
    for (std::size_t i = 0; i < assessed.combinations.size(); ++i)
        found->push_back({result.combinations[i].weights, assessed.combinations[i].value,
                          assessed.combinations[i].u});
    return found;
}

}  // namespace

Judged judge(const estimator::Settings& settings, const estimator::Result& result,
             const std::optional<Again>& again, uncertainty::Stage stage,
             const std::vector<estimator::DwellRow>& all_rows,
             const std::vector<estimator::DwellMeans>& means, estimator::spectrum::Shaken shaken) {
    Judged out;
    if (stage != uncertainty::Stage::ended) {
        out.assessed = uncertainty::assess(settings, result, stage);
        out.combinations = combinations(result, out.assessed);
        hold_against_configuration(settings, result.dwells, means, out);
        return out;
    }
    std::optional<TakenAnew> anew;
    if (again && !result.dwells.empty()) anew = take_anew(settings, *again, result, out.not_anew);
    auto found =
        anew ? tool::assess(settings, again->found, anew->result, anew->rows, std::move(shaken))
             : tool::assess(settings, {}, result, all_rows, std::move(shaken));
    out.assessed = std::move(found.assessed);
    out.spectrum = std::move(found.spectrum);
    out.combinations = combinations(anew ? anew->result : result, out.assessed);
    // With the campaign's own noise, as a replay of the recording has it, whatever noise was found.
    hold_against_configuration(settings, anew ? anew->result.dwells : result.dwells,
                               anew ? anew->means : means, out);
    if (!anew) return out;
    out.live = std::make_shared<const dwells::Live>(
        dwells::Live{again->found, result, uncertainty::assess(settings, result)});
    out.anew = std::move(anew->result);
    return out;
}

Severity severity_of(uncertainty::Level level) {
    return level == uncertainty::Level::not_valid  ? Severity::alarm
           : level == uncertainty::Level::doubtful ? Severity::warning
                                                   : Severity::info;
}

}  // namespace vibrig
