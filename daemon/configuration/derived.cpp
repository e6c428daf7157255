#include "daemon/configuration/derived.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>
#include <set>
#include <utility>

#include "daemon/configuration/cross_checks.hpp"
#include "daemon/configuration/random_profiles.hpp"
#include "daemon/configuration/value.hpp"
#include "daemon/plan/plan_file.hpp"
#include "daemon/plan/profile_file.hpp"
#include "estimator/commissioning/opening.hpp"
#include "estimator/filter/encoder_angles.hpp"

namespace vibrig::configuration {

namespace {

/// From the controller's unit to g peak, the unit inside.
double to_g_peak(Configuration::AmplitudeUnit unit, double gravity_mps2) {
    switch (unit) {
        case Configuration::AmplitudeUnit::g_peak:
            return 1;
        case Configuration::AmplitudeUnit::g_rms:
            return std::numbers::sqrt2;
        case Configuration::AmplitudeUnit::mps2_peak:
            return 1 / gravity_mps2;
    }
    return 1;
}

/// The witnesses look through the accelerometers.
void see(const estimator::Settings& rig, campaign::Stop& stop) {
    if (rig.accelerometer_response.flat()) return;
    const double hz = stop.frequency_hz > 0 ? stop.frequency_hz : rig.frequency_hz;
    if (!(stop.transmission > 0)) stop.transmission = rig.transmission;
    stop.transmission *= std::sqrt(rig.accelerometer_response.power(hz));
}

/// The witnesses follow it.
void take_sweep(const Configuration& c, const plan::PlannedRun& run, campaign::Stop& stop) {
    stop.sweep = {run.sweep_from_hz, run.sweep_to_hz, run.sweep_s};
    for (std::size_t i = 0; i < stop.along.size(); ++i) {
        const double share = static_cast<double>(i) / static_cast<double>(stop.along.size() - 1);
        const double hz =
            stop.sweep.from_hz * std::pow(stop.sweep.to_hz / stop.sweep.from_hz, share);
        stop.along[i] = c.spectrum.mount.transmission(hz).value_or(0) *
                        std::sqrt(c.estimator.accelerometer_response.power(hz));
    }
    stop.transmission = stop.along.front();
}

/// The plan's dwells, one by one; its levels stand in for table_g and are checked like them.
void take_plan(Configuration& c) {
    c.campaign.table_g.clear();
    const auto transmission = [&c](std::optional<double> hz) {
        return hz ? c.spectrum.mount.transmission(*hz) : std::optional(c.estimator.transmission);
    };
    const auto plan = plan::read_plan_file(c.campaign.plan, transmission, c.estimator.frequency_hz);
    c.campaign.planned_dwell_s = plan.dwell_s.value_or(0);
    c.campaign.plan_warning = plan.warning;
    for (const auto& run : plan.runs) {
        if (!run.profile.empty()) {
            c.campaign.stops.insert(c.campaign.stops.end(), run.count, random_stop(c, run));
            continue;
        }
        campaign::Stop stop{run.position_deg, run.table_g, run.table_g > 0 ? run.frequency_hz : 0,
                            run.verify};
        // At the reference frequency the loop check measures it.
        if (stop.frequency_hz > 0 && !estimator::at_reference(c.estimator, stop.frequency_hz))
            stop.transmission = *transmission(stop.frequency_hz);
        see(c.estimator, stop);
        if (run.sweep_to_hz > 0) take_sweep(c, run, stop);
        c.campaign.stops.insert(c.campaign.stops.end(), run.count, stop);
        auto& levels = c.campaign.table_g;
        if (std::find(levels.begin(), levels.end(), run.table_g) == levels.end())
            levels.push_back(run.table_g);
    }
}

/// The loop check that a proof begins with looks at each of them.
void cover_frequencies(Configuration& c) {
    std::set<double> all;
    for (const auto& stop : c.campaign.stops) {
        if (stop.frequency_hz > 0 && stop.table_g > 0 &&
            !estimator::at_reference(c.estimator, stop.frequency_hz))
            all.insert(stop.frequency_hz);
    }
    std::string text;
    for (const double hz : all) text += (text.empty() ? "" : ", ") + plain(hz);
    if (!text.empty()) c.campaign.proof.keys += "frequencies of campaign.plan=" + text + " Hz\n";
}

/// What stands between table and platform, from what is stated of it.
void take_mount(Configuration& c, const Places& places) {
    auto& s = c.spectrum;
    s.mount_stated = places.contains("spectrum.mount") || places.contains("spectrum.transmission");
    if (s.hard && !places.contains("vibration.transmission")) c.estimator.transmission = 1;
    if (s.hard) c.campaign.resonance_hz = 0;
    // Nothing between them lets the platform lag.
    if (s.hard && !places.contains("selftest.phase_deg")) c.campaign.loop.phase_deg = 0;
    s.mount = {s.hard || (!s.mount_stated && c.estimator.transmission >= 1), {}, s.transmission};
    c.campaign.hard_mount = s.mount.hard;
    if (!s.mount.hard)
        s.mount.pads = estimator::spectrum::pads_with(
            c.estimator.frequency_hz, std::min(c.estimator.transmission, 0.999), s.pads_damping);
}

/// What a [[profile]] and its file both say has to be the same.
void refuse_two_words(const Configuration::NamedProfile& one, const plan::StatedProfile& of_file,
                      Place place, Problems& problems) {
    const auto blame = [&](const char* key, const std::string& found, const std::string& there) {
        problems.add(place, "profile (" + one.profile.name + ")." + key, found,
                     "that of " + one.file + ", " + there);
    };
    const auto word = [](bool at_table) { return at_table ? "table" : "platform"; };
    if (one.states_at && !of_file.at.empty() && of_file.at != word(one.at_table))
        blame("at", word(one.at_table), of_file.at);
    const auto &here = one.profile.direction, &there = of_file.profile.direction;
    constexpr double kSame = 1e-6;
    if (one.states_direction && !std::ranges::equal(here, there, [](double a, double b) {
            return std::abs(a - b) < kSame;
        }))
        blame("direction", write_triple(here), write_triple(there));
}

/// Profiles that stand in files of their own.
void take_profiles(Configuration& c, const std::filesystem::path& folder, Place place,
                   Problems& problems) {
    for (auto& one : c.profiles) {
        if (one.file.empty()) continue;
        resolve(one.file, folder);
        try {
            auto stated = plan::read_profile(one.file);
            stated.profile.name = one.profile.name;
            if (one.profile.g_rms > 0) stated.profile.g_rms = one.profile.g_rms;
            estimator::spectrum::check(stated.profile, one.file + ": ");
            refuse_two_words(one, stated, place, problems);
            one.profile = stated.profile;
            if (!stated.at.empty()) one.at_table = stated.at == "table";
        } catch (const std::exception& error) {
            problems.add(place, "profile (" + one.profile.name + ").file", error.what(),
                         "a profile as vibrig predict takes it");
        }
    }
}

/// What the controller reports as played becomes the profiles' own: a recording is read without
/// the file.
void take_controller_psd(Configuration& c, const std::filesystem::path& folder,
                         const Places& places, Problems& problems) {
    auto& said = c.spectrum.controller_psd;
    const auto place = places.find("spectrum.controller_psd");
    if (said == "nominal" || said == "registers" || place == places.end()) {
        for (auto& one : c.profiles) one.controller_psd.clear();
        return;
    }
    if (said == "profile") return;
    std::string path = std::exchange(said, "profile");
    resolve(path, folder);
    try {
        std::size_t i = 0;
        for (auto& one : plan::read_controller_psd(path)) {
            const auto of = std::ranges::find_if(c.profiles, [&one](const auto& profile) {
                return profile.profile.name == one.name;
            });
            if (of == c.profiles.end())
                throw std::runtime_error(path + ": [" + std::to_string(i) + "].profile: found " +
                                         write_text(one.name) +
                                         ", expected the name of a [[profile]]");
            of->controller_psd = std::move(one.psd);
            ++i;
        }
    } catch (const std::exception& error) {
        problems.add(place->second, "spectrum.controller_psd", error.what(),
                     "what the controller played under each profile");
    }
}

/// What the encoder of a gimbal shows of it, within the travel where there is one; none: the travel
/// does not reach it.
std::optional<double> reading_of(const Configuration& c, std::size_t gimbal, double reading) {
    const auto& travel = c.gimbal.travel_deg[gimbal];
    const bool free = travel[1] - travel[0] >= 360;
    return drivers::within_travel(reading, free ? std::array{-180.0, 180.0} : travel);
}

/// From gimbal angles, which files state, to what the encoders show, within the travel where there
/// is one that reaches it.
void to_readings(Configuration& c) {
    const auto convert = [&](std::array<double, 3>& position) {
        for (std::size_t i = 0; i < 3; ++i) {
            const auto& travel = c.gimbal.travel_deg[i];
            const int sign = c.estimator.encoder_sign[i];
            const double zero = c.estimator.encoder_zero_deg[i];
            const bool free = travel[1] - travel[0] >= 360;
            if (free && sign == 1 && zero == 0) continue;
            const double reading = sign * position[i] + zero;
            position[i] = reading_of(c, i, reading).value_or(reading);
        }
    };
    for (auto& position : c.campaign.positions_deg) convert(position);
    for (auto& stop : c.campaign.stops) convert(stop.position_deg);
}

/// Defaults that depend on another key: zeros both ways where the outer gimbal turns that far, else
/// about a second axis where inner and azimuth gimbal do.
void take_the_ways_of_zeroing(Configuration& c, bool second_axis_stated) {
    if (!c.campaign.zeroing || c.estimator.up.axis == 0) return;  // refused elsewhere
    const auto within = [&c](const std::array<double, 3>& angles, std::size_t gimbals) {
        for (std::size_t i = 0; i < gimbals; ++i) {
            if (!reading_of(c, i, angles[i])) return false;
        }
        return true;
    };
    auto& zero = c.campaign.zero;
    zero.both_ways = within(estimator::azimuth_upright_deg(c.estimator, 0, true), 1);
    if (second_axis_stated || zero.both_ways) return;
    const auto y = [&](double inner_deg, bool down) {
        return within(estimator::inner_upright_deg(c.estimator, inner_deg, down), 3);
    };
    zero.second_axis = y(60, false) && y(-60, false) && y(60, true) && y(-60, true);
}

/// Where the opening check looks, as far as the travel allows it: the azimuth axis upright this way
/// or that, and all gimbals turned.
std::vector<campaign::OpeningStop> opening_stops(const Configuration& c) {
    namespace room = estimator::commissioning;
    const auto reach = [&c](std::array<double, 3> angle, bool drifts,
                            std::vector<campaign::OpeningStop>& into) {
        angle = estimator::encoder_deg(c.estimator, angle);
        for (std::size_t i = 0; i < 3; ++i) {
            const auto reading = reading_of(c, i, angle[i]);
            if (!reading) return false;
            angle[i] = *reading;
        }
        into.push_back({angle, drifts});
        return true;
    };
    std::vector<campaign::OpeningStop> best;
    for (const double way : {1.0, -1.0}) {
        std::vector<campaign::OpeningStop> stops;
        for (auto angle : room::kOpeningDrifts_deg) {
            angle[0] *= way;
            static_cast<void>(reach(angle, true, stops));
        }
        if (stops.size() > best.size()) best = std::move(stops);
    }
    const auto& turned = room::kOpeningGravity_deg;
    for (unsigned signs = 0; signs < 8; ++signs) {
        const auto way = [signs](unsigned bit) { return (signs >> bit) % 2 == 0 ? 1.0 : -1.0; };
        if (reach({way(0) * turned[0], way(1) * turned[1], way(2) * turned[2]}, false, best)) break;
    }
    return best;
}

}  // namespace

void resolve(std::string& path, const std::filesystem::path& folder) {
    if (!path.empty() && !folder.empty()) {
        path = (folder / path).lexically_normal().string();
    }
}

void derive_defaults(Configuration& c, const std::filesystem::path& folder, const Places& places,
                     Problems& problems) {
    if (!places.contains("zeroing.both_ways"))
        take_the_ways_of_zeroing(c, places.contains("zeroing.second_axis"));
    take_mount(c, places);
    if (!c.profiles.empty()) take_profiles(c, folder, places.at("profile"), problems);
    take_controller_psd(c, folder, places, problems);
}

void derive_campaign(Configuration& c, const std::filesystem::path& folder, const Places& places,
                     Problems& problems) {
    const double factor = to_g_peak(c.amplitude_unit, c.estimator.gravity_mps2);
    c.shaker.registers.amplitude.scale *= factor;
    c.shaker.registers.measured_amplitude.scale *= factor;
    c.campaign.frequency_hz = c.estimator.frequency_hz;
    c.campaign.read_psd = c.spectrum.controller_psd == "registers";
    c.campaign.rig = c.estimator;
    c.campaign.proof.demanded = c.proofs_demanded();
    c.campaign.watchdog_timeout_s = 3 * drivers::to_seconds(c.shaker.watchdog_period);
    c.campaign.sample_s = drivers::to_seconds(c.assembler.sample_period);
    take_seen(c);
    c.campaign.swept_by.poll_s = drivers::to_seconds(c.shaker.poll_period);
    if (const auto& sweep = c.shaker.registers.sweep) {
        c.campaign.swept_by.frequency_step_hz = sweep->actual_frequency.scale;
        c.campaign.swept_by.rate_step = sweep->rate.scale;
    }
    resolve(c.campaign.plan, folder);
    if (!c.campaign.plan.empty()) {
        try {
            take_plan(c);
            cover_frequencies(c);
        } catch (const plan::PlanFileError& error) {
            problems.add(places.at("campaign.plan"), "campaign.plan", error.what(), "");
        }
    }
    to_readings(c);
    // A simulated rig is not commissioned.
    c.campaign.open_first = c.record_demanded() && c.commission.opening_check;
    if (c.simulated()) c.campaign.gravity_refused_deg = 2;
    c.campaign.unit = c.paperwork.unit_type;
    if (!c.paperwork.unit_serial.empty())
        c.campaign.unit += (c.campaign.unit.empty() ? "" : " ") + c.paperwork.unit_serial;
}

void derive_opening(Configuration& c) {
    c.campaign.opening = opening_stops(c);
    if (c.campaign.resonance_hz <= 0) {
        c.campaign.resonance_hz =
            isolator_resonance_hz(c.estimator.frequency_hz, c.estimator.transmission);
    }
}

}  // namespace vibrig::configuration
