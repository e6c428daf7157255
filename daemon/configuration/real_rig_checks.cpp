// What a rig that can hurt somebody must state, Vibrig's defaults being those of its simulated rig;
// and what is too late for a stop.
#include <algorithm>
#include <string>
#include <vector>

#include "daemon/configuration/cross_checks.hpp"
#include "daemon/configuration/register_roles.hpp"
#include "daemon/configuration/value.hpp"
#include "daemon/configuration/warnings.hpp"
#include "daemon/interlock/mean_motion.hpp"
#include "estimator/filter/settings_check.hpp"

namespace vibrig::configuration {

void CrossCheck::real_rig() {
    registers_stated();
    seen_in_time();
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

/// A stop whose window of rest leaves no time for stopping would never be obeyed.
void CrossCheck::stops_in_time() {
    if (sound({"shaker.backoff_min_ms"}) && c_.shaker.backoff_min > drivers::kSecond) {
        refuse({"shaker.backoff_min_ms"},
               plain(static_cast<double>(c_.shaker.backoff_min) / 1e6) + " ms",
               "1000 ms at most: a link that was lost is to be there again in time for a stop");
    }
    if (!sound({"shaker.rest_window_s", "shaker.stop_deadline_s", "can.sample_rate_hz"})) return;
    constexpr double kFewest = 8, kToStop_s = 1;  // samples of a window; s
    const double deadline_s = c_.campaign.stop.deadline_s;
    const double window_s = std::max(c_.campaign.rest.window_s,
                                     kFewest * drivers::to_seconds(c_.assembler.sample_period));
    const double most_s = deadline_s - std::min(kToStop_s, deadline_s / 2);
    if (window_s <= most_s) return;
    refuse(
        {"shaker.rest_window_s", "shaker.stop_deadline_s", "can.sample_rate_hz"},
        "a window of rest of " + rounded(window_s) + " s with stop_deadline_s " + plain(deadline_s),
        rounded(most_s) + " s at most: the table has to stop before it can be seen to rest; a " +
            "window is of rest_window_s, and of 8 samples at least");
}

/// Before each ramp a second has to show gravity.
void CrossCheck::seconds_of_samples() {
    const double rate_hz = 1 / drivers::to_seconds(c_.assembler.sample_period);
    if (!sound({"can.sample_rate_hz"}) || rate_hz >= rt::kFewestOfSecond) return;
    refuse({"can.sample_rate_hz"}, plain(rate_hz),
           plain(rt::kFewestOfSecond) +
               " at least: no table is ramped before a second of samples has shown gravity where "
               "the encoders say");
}

/// What is noticed after minutes is not noticed. A program on a busy machine may be late.
void CrossCheck::seen_in_time() {
    using drivers::kSecond;
    const auto at_most = [this](const char* key, drivers::Time found, drivers::Time most,
                                const std::string& why) {
        if (!sound({key}) || found <= most) return;
        refuse({key}, plain(static_cast<double>(found) / 1e6) + " ms",
               rounded(static_cast<double>(most) / 1e6) + " ms at most: " + why);
    };
    // A slow bus may have two periods.
    at_most("can.stale_deadline_ms", c_.assembler.stale_deadline,
            std::max(kSecond, 2 * c_.assembler.sample_period),
            "so long the table would shake on with nobody measuring it");
    at_most("gimbal.status_deadline_ms", c_.gimbal.status_deadline, kSecond,
            "so long the table would shake on under a platform that has failed");
    const bool serial = c_.shaker.transport == drivers::ShakerSettings::Transport::rtu;
    at_most("shaker.response_timeout_ms", c_.shaker.response_timeout,
            serial ? kSecond / 2 : kSecond,
            serial ? "so long a stop waits for the request before it, which no serial line cuts off"
                   : "so long a stop that is not answered waits before it is written again");
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
        all.push_back((stated == loaded.effective.end() ? "" : stated->origin + ": ") +
                      doubt.words());
    }
    return all;
}

}  // namespace vibrig::configuration
