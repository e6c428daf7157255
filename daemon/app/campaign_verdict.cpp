// What can be believed of a campaign, while it runs and in the end.
#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <span>

#include "daemon/app/campaign_dwells.hpp"
#include "daemon/app/judged.hpp"
#include "daemon/configuration/random_profiles.hpp"
#include "estimator/uncertainty/verdict.hpp"

namespace vibrig {

namespace uncertainty = estimator::uncertainty;

namespace {

constexpr std::size_t kShownResiduals = 128;

/// Beyond so many dwells the verdict comes with every tenth of them.
constexpr std::size_t kEveryDwell = 60, kAmongMany = 10;

/// Run and position of the dwell that the strongest reason with one names; 0: none does.
std::pair<int, int> dwell_named(const uncertainty::Assessment& assessed,
                                const estimator::Result& result) {
    for (const auto& reason : assessed.verdict.reasons) {
        if (reason.code == "configuration") return {};  // measured again it contradicts again
        if (reason.dwell < 1) continue;
        const auto at = static_cast<std::size_t>(reason.dwell) - 1;
        // That of the filter counts all dwells, a pattern those that are kept.
        if (reason.code == "dwell") {
            if (at < result.dwells.size())
                return {result.dwells[at].run, result.dwells[at].position};
        } else if (at < assessed.rates.size()) {
            return {assessed.rates[at].run, assessed.rates[at].position};
        }
    }
    return {};
}

}  // namespace

/// Of the dwells so far, of all of them when the result is to be written. Where there is none yet,
/// as after a restart, whatever their number.
bool CampaignDwells::verdict_wanted() {
    if (to_write_ != ToWrite::nothing) return !std::exchange(concluding_, true);
    if (!std::exchange(verdict_due_, false)) return false;
    const std::size_t dwells = with_.book.identification().rows().size();
    return dwells <= kEveryDwell || dwells % kAmongMany == 0 || verdict_.dwells == 0;
}

std::optional<Again> CampaignDwells::again() const {
    const auto found = with_.book.noise().found();
    if (!found) return {};
    return Again{*found, with_.journal ? with_.journal->status().path : std::string(),
                 journal::configuration_hash(result_configuration(with_.loaded))};
}

/// The result becomes what was identified anew.
void CampaignDwells::take_anew(const Judged& judged, campaign::Campaign& campaign) {
    if (!judged.not_anew.empty()) {
        const auto words =
            "the noise found is not the configured one, and the campaign could not be identified "
            "anew with it: " +
            judged.not_anew;
        with_.events.log(Severity::warning, "campaign", words);
        const std::lock_guard lock(mutex_);
        result_.warnings.push_back(words);
    }
    if (!judged.anew) return;
    estimator::Result result = *judged.anew;
    with_.events.log(Severity::warning, "campaign", result.warnings.back());
    campaign.qualify(result);
    keep(std::move(result));
}

/// Without the rows, which the identification has: they are most of what a long campaign holds.
void CampaignDwells::keep(estimator::Result result) {
    std::vector<estimator::DwellRow>().swap(result.rows);  // = {} would keep the memory
    const std::lock_guard lock(mutex_);
    result_ = std::move(result);
}

/// While no dwell is with the estimator. Only this thread changes result_.
estimator::Result CampaignDwells::whole_result() const {
    auto result = result_;
    result.rows = estimator::without_apart(with_.book.identification().rows());
    return result;
}

void CampaignDwells::take_verdict(campaign::Campaign& campaign) {
    if (!with_.book.free()) return;
    std::shared_ptr<const Judged> judged;
    if (verdict_wanted()) {
        // In a thread of its own also where one may wait: what it has of memory, more with each
        // dwell, is in nobody's way.
        const auto work =
            [settings = configuration_.estimator, result = whole_result(),
             rows = with_.book.identification().rows(), means = with_.book.identification().means(),
             shaken = concluding_ ? this->shaken() : estimator::spectrum::Shaken{},
             anew = concluding_ ? again() : std::nullopt,
             stage = concluding_ ? uncertainty::Stage::ended : uncertainty::Stage::under_way,
             trim = !with_.memory_locked] {
                auto found = std::make_shared<const Judged>(
                    judge(settings, result, anew, stage, rows, means, shaken));
                // Locked memory is not given back; asking for it would only disturb.
                if (trim) rt::give_free_memory_back();
                return found;
            };
        // The rig's clock waits for this thread: there a verdict takes no time.
        if (with_.at_once) {
            judged = assessing_.compute(work);
        } else {
            assessing_.ask(work);
        }
    }
    if (!with_.at_once) judged = assessing_.take().value_or(nullptr);
    if (!judged) return;
    tell_verdict(*judged, campaign);
    if (std::exchange(concluding_, false)) write_result(*judged, campaign);
}

void CampaignDwells::tell_verdict(const Judged& judged, campaign::Campaign& campaign) {
    const auto& assessed = judged.assessed;
    const bool enough = assessed.done && assessed.degrees >= uncertainty::kFewestDegrees;
    if (!enough && !concluding_) return;
    const auto& verdict = assessed.verdict;
    const std::string first = verdict.reasons.empty() ? "" : verdict.reasons.front().code;
    const std::string newest = uncertainty::word_of(verdict.level) + (" " + first);
    if (enough && std::exchange(verdict_logged_, newest) != newest) {
        const auto said =
            fmt::format("after {} dwells {}", assessed.rates.size(), verdict.sentence);
        with_.events.log(severity_of(verdict.level), "fit", said);
        if (!judged.contradictions.empty())
            with_.events.log(Severity::warning, "fit", judged.contradictions.back());
        if (verdict.level == uncertainty::Level::not_valid) {
            const auto [run, position] = dwell_named(assessed, result_);
            campaign.doubted(said, run, position);
        }
    }
    auto residuals = std::make_shared<std::vector<VerdictStatus::Residual>>();
    // The newest: a status is made for each who asks, and stays as small however long a campaign
    // is.
    const std::size_t past =
        assessed.rates.size() - std::min(assessed.rates.size(), kShownResiduals);
    for (const auto& r : std::span(assessed.rates).subspan(past)) {
        const auto known = [](double x) { return std::isfinite(x); };
        if (std::ranges::all_of(r.residual, known) && std::ranges::all_of(r.residual_sigma, known))
            residuals->push_back({r.run, r.position, r.time_h, r.residual, r.residual_sigma});
    }
    auto coefficients =
        std::make_shared<std::array<VerdictStatus::Coefficient, estimator::kParameters>>();
    for (std::size_t i = 0; i < coefficients->size(); ++i)
        (*coefficients)[i] = {assessed.coefficients[i].value, assessed.coefficients[i].u};
    const std::lock_guard lock(mutex_);
    verdict_ = {static_cast<std::uint32_t>(assessed.rates.size()),
                static_cast<int>(verdict.level),
                uncertainty::word_of(verdict.level),
                verdict.sentence,
                assessed.widening,
                concluding_,
                std::move(residuals),
                std::move(coefficients),
                judged.combinations};
}

}  // namespace vibrig
