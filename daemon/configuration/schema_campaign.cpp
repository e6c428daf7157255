#include "daemon/configuration/key.hpp"
#include "daemon/configuration/rules.hpp"

namespace vibrig::configuration {

namespace {

using C = Configuration;

constexpr std::size_t kMostPositions = 10'000;
constexpr std::size_t kMostRuns = 100;

void add_levelling_keys(std::vector<Key>& keys) {
    const auto level = [&keys](const char* name, const char* unit, Range range, const char* doc,
                               double campaign::LevellingSettings::*member) {
        keys.push_back(number(std::string("levelling.") + name, unit, range, doc,
                              [member](C& c) -> double& { return c.campaign.level.*member; }));
    };
    using L = campaign::LevellingSettings;
    level("settling_s", "s", {5, 10'000}, "settling time that the gains are designed for",
          &L::settling_s);
    level("residual", "", {1e-5, 0.5}, "fraction of the initial tilt left then", &L::residual);
    level("damping", "", {0.1, 0.99}, "damping ratio of the loop", &L::damping);
    level("slow_settling_s", "s", {0, 100'000},
          "of the quieter gains to go over to once settled; 0: stay fast", &L::slow_settling_s);
    level("slow_ramp_s", "s", {1, 3600}, "that it takes to go over", &L::slow_ramp_s);
    level("window_s", "s", {1, 3600}, "of the means that the verdict rests on", &L::window_s);
    level("tolerance_arcmin", "arcmin", {0.001, 60}, "of mean specific force and rate of z",
          &L::tolerance_arcmin);
    level("torquer_limit_deg_h", "deg/h", {0.1, 1e6}, "largest rate commanded",
          &L::torquer_limit_deg_h);
    level("velocity_noise_mps", "m/s", {0, 10}, "of one reading of the base's velocity, 1 sigma",
          &L::velocity_noise_mps);
    keys.push_back(text(
        "levelling.velocity_north", "\"Message.Signal\" or empty",
        "velocity of a moving base along the rig's north axis, m/s; empty: it stands", binding_rule,
        [](C & c) -> auto& { return c.campaign.level.velocity_north; }));
    keys.push_back(text(
        "levelling.velocity_east", "\"Message.Signal\" or empty",
        "velocity of a moving base along the rig's east axis, m/s; with velocity_north only",
        binding_rule, [](C & c) -> auto& { return c.campaign.level.velocity_east; }));
    keys.push_back(text(
        "levelling.torque_message", "a message name",
        "command with signals X, Y, Z in deg/h, Counter", identifier_rule,
        [](C & c) -> auto& { return c.campaign.level.torquer.message; }));
    keys.push_back(signs(
        "levelling.torque_sign", "of the platform's rate over the rate commanded, per axis",
        [](C & c) -> auto& { return c.campaign.level.torquer.sign; }));
}

void add_zeroing_keys(std::vector<Key>& keys) {
    const auto zero = [&keys](const char* name, const char* unit, Range range, const char* doc,
                              double campaign::ZeroingSettings::*member) {
        keys.push_back(number(std::string("zeroing.") + name, unit, range, doc,
                              [member](C& c) -> double& { return c.campaign.zero.*member; }));
    };
    using Z = campaign::ZeroingSettings;
    zero("duration_s", "s", {60, 7200}, "of the azimuth slews 0, 88, -88, 88 deg and so on",
         &Z::duration_s);
    zero("slew_deg_per_s", "deg/s", {0.1, 25}, "rate of the azimuth gimbal, checked",
         &Z::slew_deg_per_s);
    keys.push_back(boolean("zeroing.both_ways",
                           "platform z down too: zeros apart from misalignment and scale error; "
                           "default: where gimbal.travel_deg lets it",
                           [](C& c) -> bool& { return c.campaign.zero.both_ways; }));
    keys.push_back(boolean("zeroing.second_axis",
                           "platform y up and down too, slewed by the inner gimbal 0, 60, -60, 60 "
                           "deg; default: where z cannot be down and gimbal.travel_deg lets it",
                           [](C& c) -> bool& { return c.campaign.zero.second_axis; }));
    zero("scale_factor", "", {0, 0.1}, "of the accelerometers, not known better, 1 sigma",
         &Z::scale_factor);
    zero("velocity_reference_mps", "m/s", {1e-6, 1}, "how still the platform stands, 1 sigma",
         &Z::velocity_reference_mps);
    zero("position_reference_m", "m", {1e-6, 1}, "how still the platform stands, 1 sigma",
         &Z::position_reference_m);
    zero("angle_random_walk_deg_per_rt_h", "deg/sqrt(h)", {1e-6, 10},
         "of the gyros while they turn", &Z::angle_random_walk);
    keys.push_back(triple(
        "zeroing.target_mg", "mg", {1e-6, 10}, "standard deviations and movement to be reached",
        [](C & c) -> auto& { return c.campaign.zero.target_mg; }));
    keys.push_back(text(
        "zeroing.gyro_message", "a message name",
        "angle increments at 100 Hz: signals X, Y, Z in arcsec, Counter", identifier_rule,
        [](C & c) -> auto& { return c.campaign.zero.gyro_message; }));
    keys.push_back(text(
        "zeroing.accelerometer_message", "a message name",
        "velocity increments at 100 Hz: signals X, Y, Z in m/s, Counter", identifier_rule,
        [](C & c) -> auto& { return c.campaign.zero.accelerometer_message; }));
}

void add_loop_check_keys(std::vector<Key>& keys) {
    const auto loop = [&keys](const char* name, const char* unit, Range range, const char* doc,
                              double campaign::LoopCheckSettings::*member) {
        keys.push_back(number(std::string("selftest.") + name, unit, range, doc,
                              [member](C& c) -> double& { return c.campaign.loop.*member; }));
    };
    using S = campaign::LoopCheckSettings;
    loop("table_g", "g", {0.05, 0.5}, "peak acceleration at the table during the loop check",
         &S::table_g);
    loop("measure_s", "s", {2, 20}, "that the loop check measures at its level", &S::measure_s);
    loop("transmission_tolerance", "", {0.001, 0.2}, "about vibration.transmission, relative",
         &S::transmission_tolerance);
    loop("frequency_tolerance_hz", "Hz", {0.001, 0.5}, "about vibration.frequency_hz",
         &S::frequency_tolerance_hz);
    loop("distortion", "", {0.0001, 1}, "rms of all but the fundamental, over the fundamental's",
         &S::distortion);
    loop("cross_share", "", {0.0001, 1}, "motion across the vertical over the motion along it",
         &S::cross_share);
    loop("phase_deg", "deg", {-180, 180}, "platform after table; needs a table accelerometer",
         &S::phase_deg);
    loop("phase_tolerance_deg", "deg", {1, 180}, "about phase_deg", &S::phase_tolerance_deg);
    keys.push_back(number("selftest.proof_valid_h", "h", {1, 8760},
                          "a proof that everything stops allows arming for so long",
                          [](C& c) -> double& { return c.campaign.proof.valid_h; }));
    keys.push_back(number("selftest.emergency_stop_days", "days", {1, 3660},
                          "after so long a proof of the emergency stop's button is asked for",
                          [](C& c) -> double& { return c.campaign.proof.emergency_stop_days; }));
    keys.push_back(boolean("selftest.required",
                           "a campaign is armed only after a loop check in band since the start",
                           [](C& c) -> bool& { return c.campaign.loop.required; }));
}

}  // namespace

void add_campaign_keys(std::vector<Key>& keys) {
    keys.push_back(text(
        "campaign.name", "1 to 64 characters", "names the results", campaign_name_rule,
        [](C & c) -> auto& { return c.campaign.name; }));
    keys.push_back(positions(
        "campaign.positions_deg", kMostPositions,
        "gimbal angles of every run, converted by platform.encoder_sign and encoder_zero_deg "
        "(default: Tang et al. 2009, table 1)",
        [](C & c) -> auto& { return c.campaign.positions_deg; }));
    keys.push_back(numbers(
        "campaign.table_g", "g", {0, 1000}, kMostRuns,
        "peak acceleration at the table, one run each; 0: at rest",
        [](C & c) -> auto& { return c.campaign.table_g; }));
    using campaign::VisitOrder;
    keys.push_back(choice<VisitOrder>(
        "campaign.order",
        {{"balanced", VisitOrder::balanced},
         {"sequential", VisitOrder::sequential},
         {"pairs", VisitOrder::pairs},
         {"random", VisitOrder::random}},
        "of the positions at the levels: so that no slow change of a bias looks like a coefficient "
        "(from 12 dwells on), level by level, all levels of a position at once, or by chance; a "
        "plan's dwells stay in its order unless balanced or random is stated",
        [](C & c) -> auto& { return c.campaign.order; }));
    keys.push_back(text(
        "campaign.plan", "a file",
        "plan of `vibrig plan -o`, in place of positions_deg and table_g; empty: none", path_rule,
        [](C & c) -> auto& { return c.campaign.plan; }));
    keys.push_back(choice<bool>(
        "campaign.identify", {{"all", true}, {"what-it-can", false}},
        "all: a campaign that cannot determine all 30 coefficients is refused",
        [](C & c) -> auto& { return c.campaign.identify_all; }));
    keys.push_back(boolean(
        "campaign.adaptive",
        "dwells chosen one by one, at the levels table_g, until the standard "
        "errors are down to targets",
        [](C & c) -> auto& { return c.campaign.adaptive; }));
    keys.push_back(number("campaign.targets.bias", "deg/h", {0, 1000},
                          "standard error to reach; 0: any",
                          [](C& c) -> double& { return c.campaign.target_bias; }));
    keys.push_back(number("campaign.targets.linear", "deg/h/g", {0, 1000},
                          "standard error to reach; 0: any",
                          [](C& c) -> double& { return c.campaign.target_linear; }));
    keys.push_back(number("campaign.targets.quadratic", "deg/h/g^2", {0, 1000},
                          "standard error to reach; 0: any",
                          [](C& c) -> double& { return c.campaign.target_quadratic; }));
    keys.push_back(number("campaign.time_limit_s", "s", {0, 1e7},
                          "an adaptive campaign ends before it; 0: none",
                          [](C& c) -> double& { return c.campaign.time_limit_s; }));
    keys.push_back(choice<bool>(
        "campaign.prior", {{"none", false}, {"type", true}},
        "type: an adaptive campaign starts from what the archive knows of the unit's type, while "
        "the unit passes for one of it; results are given without and with it",
        [](C & c) -> auto& { return c.campaign.type_prior; }));
    keys.push_back(boolean("campaign.levelling",
                           "the platform is levelled before each position; see [levelling]",
                           [](C& c) -> bool& { return c.campaign.levelling; }));
    keys.push_back(boolean("campaign.zeroing",
                           "the accelerometers' zeros are taken at start and end; see [zeroing]",
                           [](C& c) -> bool& { return c.campaign.zeroing; }));
    keys.push_back(number("campaign.dwell_s", "s", {2, 86'400}, "recorded at each position",
                          [](C& c) -> double& { return c.campaign.dwell_s; }));
    keys.push_back(number("campaign.settle_s", "s", {2, 3600},
                          "waited after the ramp before recording",
                          [](C& c) -> double& { return c.campaign.settle_s; }));
    keys.push_back(number("campaign.ramp_s", "s", {0.1, 600}, "from rest to amplitude, and back",
                          [](C& c) -> double& { return c.campaign.ramp_s; }));
    keys.push_back(number("campaign.ready_timeout_s", "s", {1, 86'400},
                          "for the platform to be ready and its temperature steady",
                          [](C& c) -> double& { return c.campaign.ready_timeout_s; }));
    keys.push_back(number("campaign.temperature_window_s", "s", {0, 86'400},
                          "over which the temperature must be steady; 0: not asked",
                          [](C& c) -> double& { return c.campaign.temperature_window_s; }));
    keys.push_back(number("campaign.temperature_band_c", "degC", {0.001, 100},
                          "largest spread of the temperature within the window",
                          [](C& c) -> double& { return c.campaign.temperature_band_c; }));
    keys.push_back(number("campaign.amplitude_tolerance", "", {0.001, 1},
                          "measured against commanded amplitude after the ramp, relative",
                          [](C& c) -> double& { return c.campaign.amplitude_tolerance; }));
    keys.push_back(integer("campaign.rejected_in_a_row", "", 1, 1000,
                           "rejected dwells, after which it pauses at rest and says why",
                           [](C& c) -> int& { return c.campaign.rejected_in_a_row; }));
    using campaign::OnNotValid;
    keys.push_back(choice<OnNotValid>(
        "campaign.on_not_valid",
        {{"go-on", OnNotValid::go_on},
         {"pause", OnNotValid::pause},
         {"repeat", OnNotValid::repeat}},
        "when the verdict on the dwells so far becomes \"not valid\": nothing; a pause at rest, "
        "before the next position; the dwell that it names once more, next",
        [](C & c) -> auto& { return c.campaign.on_not_valid; }));
    keys.push_back(number("campaign.arming_valid_s", "s", {10, 86'400},
                          "an arming ends after so long without a start",
                          [](C& c) -> double& { return c.campaign.arming_valid_s; }));
    keys.push_back(boolean("campaign.second_person",
                           "after an emergency stop another person than who armed, or "
                           "acknowledged first, acknowledges it too",
                           [](C& c) -> bool& { return c.campaign.second_person; }));
    keys.push_back(number("campaign.resonance_hz", "Hz", {0, 2000},
                          "of the isolators; 0: from frequency and transmission",
                          [](C& c) -> double& { return c.campaign.resonance_hz; }));
    keys.push_back(text(
        "campaign.results", "a folder", "for result.json; empty: none written", path_rule,
        [](C & c) -> auto& { return c.results; }));
    add_levelling_keys(keys);
    add_zeroing_keys(keys);
    add_loop_check_keys(keys);
}

}  // namespace vibrig::configuration
