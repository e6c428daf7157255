// What a rig that can hurt somebody must state: Vibrig's defaults are those of its simulated rig.
#include <algorithm>
#include <array>
#include <string>
#include <vector>

#include "daemon/configuration/cross_checks.hpp"
#include "daemon/configuration/register_roles.hpp"
#include "daemon/configuration/value.hpp"
#include "daemon/configuration/warnings.hpp"
#include "estimator/filter/settings_check.hpp"

namespace vibrig::configuration {

void CrossCheck::real_rig() {
    registers_stated();
    if (sound({"platform", "uncertainty"})) {
        for (const auto& doubt : estimator::doubtful_keys(c_.estimator)) {
            const auto place = places_.find(doubt.key.substr(0, doubt.key.find('[')));
            problems_.add(place == places_.end() ? Place{} : place->second, doubt.key, doubt.found,
                          doubt.expected);
        }
    }
    const auto& table_g = c_.campaign.table_g;
    const double range = c_.estimator.accelerometer_range_g;
    if (range > 0 && !table_g.empty() &&
        sound({"accelerometer.range_g", "campaign.table_g", "vibration.transmission"})) {
        const double most = 1 + c_.estimator.transmission * *std::ranges::max_element(table_g);
        if (range < most)
            refuse({"accelerometer.range_g"}, plain(range) + " g",
                   rounded(most) + " g at least: 1 g and transmission x the highest table_g");
    }
}

void CrossCheck::registers_stated() {
    if (!sound({"shaker.registers"}) || !c_.shaker.registers.watchdog) return;
    const proto::ShakerRegisters& r = c_.shaker.registers;
    for (const RegisterRole& role : roles_of(r)) {
        const std::string key = std::string("shaker.registers.") + role.name;
        const auto stated = [&](const char* part) { return places_.contains(key + "." + part); };
        const auto miss = [&](const std::string& what) {
            problems_.add({}, what, "nothing",
                          "it stated: Vibrig's own map is for the simulated rig only");
        };
        const auto first = places_.lower_bound(key + ".");
        if (first == places_.end() || !first->first.starts_with(key + ".")) {
            miss(key);
            continue;
        }
        using proto::RegisterType;
        const RegisterType type = role.reg->type;
        const bool words = role.reg->words() == 2;
        const bool own_table = role.reg->table == proto::RegisterTable::holding;
        for (const auto& [part, needed] : {std::pair{"address", true},
                                           {"type", true},
                                           {"word_order", words},
                                           {"scale", role.quantity},
                                           {"mask", type == RegisterType::bits},
                                           {"table", !own_table}})
            if (needed && !stated(part)) miss(key + "." + part);
        const bool block =
            r.random && r.random->psd_block && role.reg == &r.random->psd_block->first;
        if (block && !stated("pairs")) miss(key + ".pairs");
    }
}

std::vector<std::string> warnings(const Loaded& loaded) {
    std::vector<std::string> all;
    for (const auto& doubt : estimator::doubtful_keys(loaded.configuration.estimator)) {
        const auto key = doubt.key.substr(0, doubt.key.find('['));
        const auto stated = std::ranges::find(loaded.effective, key, &EffectiveValue::key);
        all.push_back((stated == loaded.effective.end() ? "" : stated->origin + ": ") + doubt.key +
                      ": found " + doubt.found + ", expected " + doubt.expected);
    }
    return all;
}

}  // namespace vibrig::configuration
