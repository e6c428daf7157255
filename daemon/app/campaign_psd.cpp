// What the controller reports as played in a random dwell.
#include <spdlog/fmt/fmt.h>

#include <utility>

#include "daemon/app/campaign_dwells.hpp"
#include "daemon/configuration/random_profiles.hpp"
#include "estimator/spectrum/controller_psd.hpp"

namespace vibrig {

using Word = estimator::PlayedRandom::Word;

/// The Identification is this thread's: the dwell is over, and no other is ordered.
campaign::Played CampaignDwells::played(const campaign::ReportedPsd& reported) {
    campaign::Played out;
    const auto& dwell = ordered_.dwell;
    const std::string why = take_psd(reported, out.random);
    if (!why.empty())
        with_.events.log(Severity::warning, "campaign",
                         fmt::format("run {} position {}: the controller's PSD {}: {}", dwell.run,
                                     dwell.position,
                                     out.random.word == Word::refused
                                         ? "is refused"
                                         : "was not read, its profile's stands in its place",
                                     why));
    if (!reported.pairs.empty()) with_.book.spectrum().psd_before = reported.pairs;
    with_.book.played(out.random, out.summary);
    revised_ = true;
    if (with_.recorder)
        with_.recorder->played(
            {ordered_.from, dwell.run, dwell.position, out.random, reported.pairs});
    record_dwell(out.summary);
    return out;
}

/// Why it is not taken, else empty.
std::string CampaignDwells::take_psd(const campaign::ReportedPsd& reported,
                                     estimator::PlayedRandom& played) {
    namespace spectrum = estimator::spectrum;
    const auto& asked = ordered_.dwell.random;
    played.word = Word::not_read;
    if (reported.pairs.empty()) return reported.why_not;
    played.word = Word::refused;
    const auto nominal = configuration::stated_at(configuration_, asked.profile, asked.level_db);
    if (!nominal) return fmt::format("found no [[profile]] of number {}", asked.profile);
    const auto taken = spectrum::take_controller_psd(
        reported.pairs,
        {*nominal, reported.measured_g_rms, drivers::to_seconds(ordered_.to - ordered_.from),
         configuration_.spectrum.controller_gain, with_.book.spectrum().psd_before});
    if (!taken.wrong.empty()) return taken.wrong;
    auto there = configuration::at_platform(configuration_, taken.psd);
    if (!there)
        return "psd_block: found frequencies that spectrum.transmission or the accelerometers do "
               "not reach, expected those of the profile";
    played.word = Word::good;
    played.random = there->random;
    played.random.mean_square_g2 *= reported.power_ratio;
    played.random.profile = asked.profile;
    played.random.level_db = asked.level_db;
    played.seen = there->seen;
    auto& psds = with_.book.spectrum().psds;
    psds.push_back(std::move(there->bands));
    played.place = static_cast<std::uint32_t>(psds.size());
    return {};
}

/// What was played has come after the result of its dwell.
void CampaignDwells::keep_revised(campaign::Campaign& campaign) {
    if (!revised_ || !with_.book.free()) return;
    revised_ = false;
    auto result = with_.book.identification().result();
    campaign.qualify(result);
    keep(std::move(result));
    verdict_due_ = true;
}

}  // namespace vibrig
