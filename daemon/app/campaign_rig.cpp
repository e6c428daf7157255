#include "daemon/app/campaign_rig.hpp"

namespace vibrig {

void CampaignRig::guard(rt::Guard level) {
    excitation_.store(level == rt::Guard::excitation);
    interlock_.guard(level);
}

void CampaignRig::disobeyed(bool now_so) {
    interlock_.stop_disobeyed(now_so);
    disobeyed_ = now_so;
    if (now_so)
        events_.announce(drivers::HornPattern::disobeyed, rt::text_of(rt::Trip::stop_disobeyed));
}

void CampaignRig::proving(campaign::Proving what) {
    const bool unlinked = what == campaign::Proving::unlinked;
    starving_.store(unlinked || what == campaign::Proving::watchdog);
    interlock_.proving(what != campaign::Proving::nothing, unlinked);
}

}  // namespace vibrig
