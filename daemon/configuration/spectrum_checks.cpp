// Frequencies, levels and profiles against the samples, the shaker's limits and the accelerometers.
#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include "daemon/configuration/cross_checks.hpp"
#include "daemon/configuration/value.hpp"
#include "estimator/spectrum/sampling.hpp"

namespace vibrig::configuration {

namespace spectrum = estimator::spectrum;

namespace {

std::string another_frequency(double hz, double sample_hz, double window_s) {
    return "another frequency: at " + rounded(sample_hz) +
           " samples/s a harmonic of it falls on a multiple of the rate; " +
           spectrum::nearest_free_words(hz, sample_hz, window_s);
}

/// A peak that a random vibration reaches 1 time in 400, and one that it hardly ever does.
constexpr double kPeaks = 3, kHardlyEver = 5;
/// Beyond it the interlock stops a random vibration.
constexpr double kBands_db = 3;
constexpr double kTwoPi = 2 * std::numbers::pi;

double rate_of(const Configuration& c) {
    return 1e9 / static_cast<double>(c.assembler.sample_period);
}

/// rms of acceleration in g, velocity in m/s and displacement in mm at the table, and of the
/// acceleration at the platform; none where the transmission is not known.
struct Motion {
    double table_g = 0, velocity_mps = 0, displacement_mm = 0, platform_g = 0;
};
std::optional<Motion> motion_of(const Configuration& c, const Configuration::NamedProfile& of) {
    const double all = spectrum::mean_square(of.profile), g = c.estimator.gravity_mps2;
    Motion out;
    for (const spectrum::Band& band : spectrum::bands_of(of.profile)) {
        const auto ratio = c.spectrum.mount.transmission(band.hz);
        if (!ratio) return std::nullopt;
        const double power = all * band.share, over = *ratio * *ratio;
        const double table = of.at_table ? power : power / over;
        const double omega = kTwoPi * band.hz, still = g * g * table / (omega * omega);
        out.table_g += table;
        out.platform_g += of.at_table ? power * over : power;
        out.velocity_mps += still;
        out.displacement_mm += 1e6 * still / (omega * omega);
    }
    for (double* value : {&out.table_g, &out.velocity_mps, &out.displacement_mm, &out.platform_g})
        *value = std::sqrt(*value);
    return out;
}

}  // namespace

void CrossCheck::frequency() {
    if (!sound({"vibration.frequency_hz"}) || !sound({"campaign.table_g"})) {
        return;
    }
    const bool vibrating = std::any_of(c_.campaign.table_g.begin(), c_.campaign.table_g.end(),
                                       [](double g) { return g > 0; });
    if (!vibrating) {
        return;
    }
    const double f = c_.estimator.frequency_hz;
    if (sound({"can.sample_rate_hz", "vibration.level_window_s"})) {
        const double rate = 1e9 / static_cast<double>(c_.assembler.sample_period);
        // No test on the data can tell there.
        if (estimator::spectrum::forbidden(f, rate, c_.estimator.level_window_s))
            refuse({"vibration.frequency_hz", "can.sample_rate_hz"}, plain(f) + " Hz",
                   another_frequency(f, rate, c_.estimator.level_window_s));
    }
    if (!sound({"vibration.transmission", "campaign.resonance_hz"})) {
        return;
    }
    const double transmission = c_.estimator.transmission;
    if (c_.campaign.resonance_hz > 0) {
        const double lowest = std::numbers::sqrt2 * c_.campaign.resonance_hz;
        if (f < lowest) {
            refuse({"vibration.frequency_hz", "campaign.resonance_hz"}, plain(f) + " Hz",
                   rounded(lowest) + " Hz at least, sqrt(2) times the isolators' resonance at " +
                       plain(c_.campaign.resonance_hz) + " Hz, below which they amplify");
        }
    } else if (transmission > 1) {
        // Above sqrt(2) f_n isolators attenuate; more than 1 means the resonance is near. Exactly
        // 1: a rigid mount.
        refuse({"vibration.transmission"}, plain(transmission) + " at " + plain(f) + " Hz",
               "1 at most: isolators that amplify are near their resonance, and f must be above "
               "sqrt(2) f_n");
    }
}

void CrossCheck::mount() {
    const auto& s = c_.spectrum;
    if (!s.hard) return;
    if (places_.contains("vibration.transmission") && c_.estimator.transmission != 1)
        refuse({"vibration.transmission", "spectrum.mount"},
               plain(c_.estimator.transmission) + " with a hard mount",
               "1, or spectrum.mount \"isolated\"");
    if (places_.contains("spectrum.transmission") && !s.transmission.empty())
        refuse({"spectrum.transmission", "spectrum.mount"}, "ratios with a hard mount",
               "\"pads\" (ignored), or spectrum.mount \"isolated\"");
}

void CrossCheck::response() {
    const auto& response = c_.estimator.accelerometer_response;
    if (response.order != 1 && !(response.bandwidth_hz > 0))
        refuse({"accelerometer.order"}, plain(response.order) + " without a bandwidth",
               "accelerometer.bandwidth_hz");
    if (response.flat() || !sound({"accelerometer.bandwidth_hz", "accelerometer.response"})) return;
    if (response.bandwidth_hz > 0 && !response.table.empty())
        refuse({"accelerometer.response", "accelerometer.bandwidth_hz"},
               "a table beside accelerometer.bandwidth_hz", "one of them");
    if (c_.estimator.method != estimator::Method::joint)
        refuse({"accelerometer.bandwidth_hz", "accelerometer.response"},
               "accelerometers that do not see all",
               "estimator.method = \"joint\": the two-step route takes readings as they are");
    const double hz = c_.estimator.frequency_hz, seen = response.power(hz);
    if (sound({"vibration.frequency_hz"}) && seen < estimator::kLeastSeen)
        refuse({"vibration.frequency_hz", "accelerometer.bandwidth_hz"},
               plain(hz) + " Hz, of which the accelerometers see " + rounded(seen),
               "a frequency of which they see half of the power at least");
}

void CrossCheck::profiles() {
    if (!sound({"profile", "spectrum.transmission", "accelerometer.range_g"})) return;
    for (std::size_t i = 0; i < c_.profiles.size(); ++i) {
        const auto& profile = c_.profiles[i];
        const std::string key = "profile[" + std::to_string(i) + "]";
        const auto blame = [&](const std::string& found, const std::string& expected) {
            problems_.add(places_.contains("profile") ? places_.at("profile") : Place{},
                          key + " (" + profile.profile.name + ")", found, expected);
        };
        if (!profile.controller_psd.empty()) {
            const double stated = std::sqrt(spectrum::mean_square(profile.profile));
            const double played =
                std::sqrt(spectrum::mean_square({"", profile.controller_psd, {}, {0, 1, 0}, 0}));
            if (profile.at_table && !(std::abs(20 * std::log10(played / stated)) < kBands_db))
                blame("controller_psd of " + rounded(played) + " g rms",
                      "that of the profile within 3 dB: " + rounded(stated));
        }
        // Where a plan plays it, as loud as it does at most.
        std::optional<double> highest_db;
        for (const auto& stop : c_.campaign.stops) {
            if (stop.random && stop.random->set_point.profile == profile.number)
                highest_db = std::max(highest_db.value_or(-1e3), stop.random->set_point.level_db);
        }
        const double level = std::pow(10, highest_db.value_or(0) / 20);
        const auto motion = motion_of(c_, profile);
        if (!motion) {
            blame("frequencies that spectrum.transmission does not reach",
                  plain(c_.spectrum.transmission.front().first) + " to " +
                      plain(c_.spectrum.transmission.back().first) + " Hz");
            continue;
        }
        const auto check = [&](double rms, double limit, const char* unit, const char* limit_key) {
            const double peak = kPeaks * rms * level;
            if (peak <= limit) return;
            blame("peaks of 3 sigma of " + rounded(peak) + " " + unit + " at the table",
                  rounded(limit) + " " + unit + " at most (" + limit_key +
                      "): " + rounded(20 * std::log10(limit / (kPeaks * rms))) + " dB");
        };
        check(motion->table_g, c_.campaign.max_acceleration_g, "g", "shaker.limits.acceleration_g");
        check(motion->velocity_mps, c_.campaign.max_velocity_mps, "m/s",
              "shaker.limits.velocity_mps");
        check(motion->displacement_mm, c_.campaign.max_displacement_mm, "mm",
              "shaker.limits.displacement_mm");
        const auto seen = std::ranges::find(c_.estimator.seen_profiles, profile.number,
                                            [](const auto& one) { return int{one.first}; });
        if (highest_db && seen != c_.estimator.seen_profiles.end() &&
            seen->second.share < estimator::kLeastSeen)
            blame("a vibration of which the accelerometers see " + rounded(seen->second.share),
                  "one of which they see half of its power at least "
                  "(accelerometer.bandwidth_hz, accelerometer.response)");
        const double needed = 1 + kHardlyEver * motion->platform_g * level;
        if (c_.estimator.accelerometer_range_g > 0 && needed > c_.estimator.accelerometer_range_g)
            blame("peaks of 1 g + 5 sigma of " + rounded(needed) + " g at the platform",
                  rounded(c_.estimator.accelerometer_range_g) +
                      " g at most (accelerometer.range_g), where readings are cut off");
    }
}

void CrossCheck::mode() {
    if (!sound({"spectrum.mode", "shaker.registers"})) return;
    if (c_.spectrum.mixed && !c_.shaker.registers.random && !c_.shaker.registers.sweep)
        refuse({"spectrum.mode"}, "\"mixed\" without registers of mode and profile",
               "shaker.registers.mode and its five companions, or \"sine\"");
    if (c_.spectrum.controller_psd == "registers" &&
        !(c_.shaker.registers.random && c_.shaker.registers.random->psd_block))
        refuse({"spectrum.controller_psd", "shaker.registers"},
               "\"registers\" without shaker.registers.psd_block",
               "its address, pairs and word order, or \"nominal\"");
    if (!sound({"campaign.plan"})) return;
    sweeps_of_plan();
    const auto random = std::ranges::find_if(
        c_.campaign.stops, [](const auto& one) { return one.random.has_value(); });
    if (random == c_.campaign.stops.end()) return;
    if (!c_.shaker.registers.random)
        refuse({"campaign.plan", "shaker.registers"}, "a dwell under a profile without registers",
               "shaker.registers.mode and its five companions");
    const std::string found = "a dwell under profile '" + random->random->name + "'";
    if (!c_.spectrum.mixed)
        refuse({"campaign.plan", "spectrum.mode"}, found,
               "spectrum.mode \"mixed\" for random vibration");
    if (c_.estimator.method != estimator::Method::joint)
        refuse({"campaign.plan", "estimator.method"}, found,
               "estimator.method = \"joint\": the two-step route has coefficients at one "
               "frequency only");
}

/// Registers, and limits, isolators and accelerometers all along them.
void CrossCheck::sweeps_of_plan() {
    constexpr double kLeastRate_hz = 100;  // slower samples have too few seconds of them
    constexpr int kSteps = 64;
    for (std::size_t i = 0; i < c_.campaign.stops.size(); ++i) {
        const auto& stop = c_.campaign.stops[i];
        if (!stop.sweep.any()) continue;
        const auto& sweep = stop.sweep;
        const std::string found = "dwell " + std::to_string(i + 1) + ", a sweep from " +
                                  plain(sweep.from_hz) + " to " + plain(sweep.to_hz) + " Hz";
        const auto blame = [&](const char* other, const std::string& what,
                               const std::string& expected) {
            refuse({"campaign.plan", other}, found + what, expected);
        };
        if (!c_.shaker.registers.sweep)
            return blame("shaker.registers", " without registers for it",
                         "shaker.registers.mode, sweep_from, sweep_to, sweep_rate and "
                         "actual_frequency");
        if (!c_.spectrum.mixed)
            return blame("spectrum.mode", "", "spectrum.mode \"mixed\" for sweeps");
        const double octaves_per_minute =
            60 * std::abs(std::log2(sweep.to_hz / sweep.from_hz)) / sweep.seconds;
        if (std::round(octaves_per_minute / c_.shaker.registers.sweep->rate.scale) < 1)
            return blame("shaker.registers",
                         " in " + plain(sweep.seconds) + " s, " + rounded(octaves_per_minute) +
                             " octaves a minute",
                         plain(c_.shaker.registers.sweep->rate.scale) +
                             " at least, the step of shaker.registers.sweep_rate");
        if (!(stop.table_g > 0)) return blame("campaign.plan", " at 0 g", "a level");
        if (stop.verify)
            return blame("campaign.plan", " with role \"verify\"",
                         "\"identify\": a sweep is no row to be predicted");
        if (c_.estimator.method != estimator::Method::joint)
            return blame("estimator.method", "",
                         "estimator.method = \"joint\": the two-step route has coefficients at one "
                         "frequency only");
        if (sound({"can.sample_rate_hz"}) && rate_of(c_) < kLeastRate_hz)
            return blame("can.sample_rate_hz", " at " + rounded(rate_of(c_)) + " samples/s",
                         plain(kLeastRate_hz) +
                             " at least: slower ones have too few seconds that can be used");
        // The controller stays there until the dwell ends: the accelerometers show it as standing,
        // and a stop that is not obeyed there as rest.
        for (const double end : {sweep.from_hz, sweep.to_hz})
            if (sound({"can.sample_rate_hz", "vibration.level_window_s"}) &&
                spectrum::forbidden(end, rate_of(c_), c_.estimator.level_window_s, 2))
                return blame("can.sample_rate_hz", "",
                             "ends at other frequencies: at " + rounded(rate_of(c_)) +
                                 " samples/s " + plain(end) +
                                 " Hz, where the controller stays until the dwell "
                                 "ends, shows as a standing table does");
        const double slowest = std::min(sweep.from_hz, sweep.to_hz);
        if (slowest < c_.spectrum.mount.lowest_hz())
            return blame("vibration.transmission", "",
                         rounded(c_.spectrum.mount.lowest_hz()) +
                             " Hz at least: below it the isolators amplify");
        const spectrum::TableLimits limits{
            c_.campaign.max_acceleration_g, c_.campaign.max_velocity_mps,
            c_.campaign.max_displacement_mm, c_.estimator.gravity_mps2};
        for (int k = 0; k <= kSteps; ++k) {
            const double hz = sweep.from_hz * std::pow(sweep.to_hz / sweep.from_hz,
                                                       static_cast<double>(k) / kSteps);
            if (!c_.spectrum.mount.transmission(hz))
                return blame("spectrum.transmission", "",
                             "frequencies that spectrum.transmission reaches");
            if (stop.table_g > limits.table_g(hz))
                return blame("shaker.limits", " at " + plain(stop.table_g) + " g",
                             rounded(limits.table_g(hz)) + " g at most, at " + rounded(hz) + " Hz");
            if (c_.estimator.accelerometer_response.power(hz) < estimator::kLeastSeen)
                return blame("accelerometer.bandwidth_hz",
                             ", of which the accelerometers see " +
                                 rounded(c_.estimator.accelerometer_response.power(hz)) + " at " +
                                 rounded(hz) + " Hz",
                             "frequencies of which they see half of the power at least");
        }
    }
}

void CrossCheck::frequencies_of_plan() {
    if (!sound({"campaign.plan", "can.sample_rate_hz", "vibration.level_window_s",
                "vibration.frequency_hz", "spectrum.transmission"}))
        return;
    const double window_s = c_.estimator.level_window_s, rate = rate_of(c_);
    bool surveyed = false, reference = false;
    for (std::size_t i = 0; i < c_.campaign.stops.size(); ++i) {
        const auto& stop = c_.campaign.stops[i];
        surveyed = surveyed || stop.random || stop.sweep.any();
        if (!stop.random && !stop.sweep.any() && stop.frequency_hz <= 0 && stop.table_g > 0)
            reference = true;
        if (stop.frequency_hz <= 0 || stop.table_g <= 0) continue;
        const auto blame = [&](const char* other, const std::string& expected) {
            refuse({"campaign.plan", other},
                   "dwell " + std::to_string(i + 1) + " at " + plain(stop.frequency_hz) + " Hz",
                   expected);
        };
        if (spectrum::forbidden(stop.frequency_hz, rate, window_s))
            return blame("can.sample_rate_hz",
                         another_frequency(stop.frequency_hz, rate, window_s));
        if (stop.frequency_hz < c_.spectrum.mount.lowest_hz())
            return blame("vibration.transmission", rounded(c_.spectrum.mount.lowest_hz()) +
                                                       " Hz at least: below it the isolators "
                                                       "amplify");
        const double seen = c_.estimator.accelerometer_response.power(stop.frequency_hz);
        if (seen < estimator::kLeastSeen)
            return refuse({"campaign.plan", "accelerometer.bandwidth_hz"},
                          "dwell " + std::to_string(i + 1) + " at " + plain(stop.frequency_hz) +
                              " Hz, of which the accelerometers see " + rounded(seen),
                          "a frequency of which they see half of the power at least");
        const bool apart = stop.verify || !estimator::at_reference(c_.estimator, stop.frequency_hz);
        if (!apart) reference = true;
        if (apart && c_.estimator.method != estimator::Method::joint)
            return blame("estimator.method",
                         "estimator.method = \"joint\": the two-step route has "
                         "coefficients at one frequency only");
        surveyed = true;
    }
    if (surveyed && !reference)
        refuse({"campaign.plan", "vibration.frequency_hz"},
               "no dwell to identify at " + plain(c_.estimator.frequency_hz) + " Hz within 2 %",
               "the plan's lowest frequency as vibration.frequency_hz: its dwells give the 30 "
               "coefficients");
}

}  // namespace vibrig::configuration
