// What can be believed of a campaign, while it runs and in the end.
#include "daemon/daemon.hpp"

namespace vibrig {

namespace uncertainty = estimator::uncertainty;

namespace {

/// With fewer rates than that to spare there is nothing to tell.
constexpr int kFewestDegrees = 9;
/// Beyond so many dwells the verdict comes with every tenth of them.
constexpr std::size_t kEveryDwell = 60, kAmongMany = 10;

}  // namespace

Severity Daemon::severity_of(uncertainty::Level level) {
    return level == uncertainty::Level::not_valid  ? Severity::alarm
           : level == uncertainty::Level::doubtful ? Severity::warning
                                                   : Severity::info;
}

/// Of the dwells so far, of all of them when the result is to be written.
bool Daemon::verdict_wanted() {
    if (to_write_ != ToWrite::nothing) return !std::exchange(concluding_, true);
    if (!std::exchange(verdict_due_, false)) return false;
    const std::size_t dwells = result_.rows.size();
    return dwells <= kEveryDwell || dwells % kAmongMany == 0;
}

void Daemon::take_verdict() {
    if (dwells_with_estimator_ != 0) return;
    std::optional<uncertainty::Assessment> assessed;
    // Only this thread changes result_.
    if (verdict_wanted()) {
        // The rig's clock waits for this thread: there a verdict takes no time.
        if (rig_clock_) {
            assessed = uncertainty::assess(configuration_.estimator, result_);
        } else {
            assessing_.ask([settings = configuration_.estimator, result = result_] {
                return uncertainty::assess(settings, result);
            });
        }
    }
    if (!rig_clock_) assessed = assessing_.take();
    if (!assessed) return;
    tell_verdict(*assessed);
    if (std::exchange(concluding_, false)) write_result(*assessed);
}

void Daemon::tell_verdict(const uncertainty::Assessment& assessed) {
    const bool enough = assessed.done && assessed.degrees >= kFewestDegrees;
    if (!enough && !concluding_) return;
    const auto& verdict = assessed.verdict;
    const std::string first = verdict.reasons.empty() ? "" : verdict.reasons.front().code;
    const std::string told = uncertainty::word_of(verdict.level) + (" " + first);
    if (enough && std::exchange(verdict_told_, told) != told) {
        const auto said =
            fmt::format("after {} dwells {}", assessed.rates.size(), verdict.sentence);
        log(severity_of(verdict.level), "fit", said);
        if (verdict.level == uncertainty::Level::not_valid) campaign_.doubted(said);
    }
    const std::lock_guard lock(mutex_);
    campaign_status_.verdict = {static_cast<std::uint32_t>(assessed.rates.size()),
                                static_cast<int>(verdict.level),
                                uncertainty::word_of(verdict.level),
                                verdict.sentence,
                                assessed.widening,
                                concluding_};
}

}  // namespace vibrig
