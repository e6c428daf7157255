// What the controller played in a random dwell: asked at rest, before anything moves again.
#include <utility>

#include "daemon/campaign/campaign.hpp"
#include "daemon/campaign/stages/dwelling.hpp"

namespace vibrig::campaign {

using drivers::Time;

namespace {

// More than attempts and reconnects take; whoever has not answered by then does not.
constexpr Time kPsdPatience = 15 * drivers::kSecond;

}  // namespace

/// Of one that was cut short nobody asks: its campaign is over.
bool Campaign::asks_for_psd(const estimator::DwellSummary& summary) const {
    return settings_.read_psd && stage_ == dwelling_.get() && at_ < stops_.size() &&
           here().stop.random && summary.samples > 0;
}

/// At rest. True: it is known, or is not to be had.
bool Campaign::psd_settled(Time now) {
    if (!unread_) return true;
    drivers::Shaker& shaker = ports_.rig.shaker;
    ReportedPsd reported{{}, {}, unread_->measured_g_rms, unread_->power_ratio};
    if (unread_->request == 0) {
        unread_->request = shaker.read_psd();
        unread_->until = now + kPsdPatience;
        if (unread_->request == 0) reported.why_not = "there are no registers of it";
    } else if (auto psd = shaker.psd(); psd.request == unread_->request) {
        reported.pairs = std::move(psd.pairs);
        reported.why_not = std::move(psd.why_not);
    } else if (now > unread_->until) {
        reported.why_not = "no answer within 15 s";
    }
    if (reported.pairs.empty() && reported.why_not.empty()) return false;
    close_psd(std::move(reported));
    return true;
}

void Campaign::close_psd(ReportedPsd reported) {
    psd_due_ = false;
    const Played played = ports_.dwells.played(reported);
    if (played.summary.samples > 0) dwells_.back() = played.summary;
    count_rejected(dwells_.back());
    if (!unread_) return;
    unread_->info.played = played.random;
    unread_->stop.psd = std::move(reported.pairs);
    ports_.log.position_done(unread_->info, dwells_.back(), unread_->stop);
    unread_.reset();
}

}  // namespace vibrig::campaign
