#include "daemon/record/shaken.hpp"

#include <utility>

#include "daemon/configuration/random_profiles.hpp"
#include "daemon/record/replay.hpp"

namespace vibrig::record {

estimator::spectrum::Shaken shaken_of(const Campaign& campaign,
                                      const configuration::Configuration& rig) {
    estimator::spectrum::Shaken out;
    out.profiles = configuration::numbered_kinds(rig);
    for (const Order& order : campaign.orders) {
        if (!order.played || order.played->place == 0) continue;
        out.psds.push_back(configuration::reported_bands(rig, order.random.profile,
                                                         order.random.level_db, order.psd));
    }
    for (const RecordedDwell& dwell : recorded_dwells(campaign)) {
        if (!dwell.order->sweep.any() || dwell.cut_short) continue;
        auto sweep = sweep_of(campaign, rig.estimator, dwell).finish();
        if (!sweep.blocks.empty()) out.sweeps.push_back(std::move(sweep));
    }
    return out;
}

}  // namespace vibrig::record
