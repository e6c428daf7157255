#include "daemon/configuration/key.hpp"
#include "daemon/configuration/rules.hpp"

namespace vibrig::configuration {

namespace {

using C = Configuration;

constexpr std::size_t kMostPositions = 10'000;
constexpr std::size_t kMostRuns = 100;

std::vector<Key> levelling_keys() {
    using L = campaign::LevellingSettings;
    using T = drivers::TorquerSettings;
    const auto level = part(&C::campaign, &campaign::Settings::level);
    const auto torquer = part(&C::campaign, &campaign::Settings::level, &L::torquer);
    return {
        number("levelling.settling_s", level(&L::settling_s), "s", {5, 10'000},
               "settling time that the gains are designed for"),
        number("levelling.residual", level(&L::residual), "", {1e-5, 0.5},
               "fraction of the initial tilt left then"),
        number("levelling.damping", level(&L::damping), "", {0.1, 0.99},
               "damping ratio of the loop"),
        number("levelling.slow_settling_s", level(&L::slow_settling_s), "s", {0, 100'000},
               "of the quieter gains to go over to once settled; 0: stay fast"),
        number("levelling.slow_ramp_s", level(&L::slow_ramp_s), "s", {1, 3600},
               "that it takes to go over"),
        number("levelling.window_s", level(&L::window_s), "s", {1, 3600},
               "of the means that the verdict rests on"),
        number("levelling.tolerance_arcmin", level(&L::tolerance_arcmin), "arcmin", {0.001, 60},
               "of mean specific force and rate of z"),
        number("levelling.torquer_limit_deg_h", level(&L::torquer_limit_deg_h), "deg/h", {0.1, 1e6},
               "largest rate commanded"),
        number("levelling.velocity_noise_mps", level(&L::velocity_noise_mps), "m/s", {0, 10},
               "of one reading of the base's velocity, 1 sigma"),
        text("levelling.velocity_north", level(&L::velocity_north), "\"Message.Signal\" or empty",
             "velocity of a moving base along the rig's north axis, m/s; empty: it stands",
             binding_rule),
        text("levelling.velocity_east", level(&L::velocity_east), "\"Message.Signal\" or empty",
             "velocity of a moving base along the rig's east axis, m/s; with velocity_north only",
             binding_rule),
        text("levelling.torque_message", torquer(&T::message), "a message name",
             "command with signals X, Y, Z in deg/h, Counter", identifier_rule),
        signs("levelling.torque_sign", torquer(&T::sign),
              "of the platform's rate over the rate commanded, per axis"),
    };
}

std::vector<Key> zeroing_keys() {
    using Z = campaign::ZeroingSettings;
    const auto zero = part(&C::campaign, &campaign::Settings::zero);
    return {
        number("zeroing.duration_s", zero(&Z::duration_s), "s", {60, 7200},
               "of the azimuth slews 0, 88, -88, 88 deg and so on"),
        number("zeroing.slew_deg_per_s", zero(&Z::slew_deg_per_s), "deg/s", {0.1, 25},
               "rate of the azimuth gimbal, checked"),
        boolean("zeroing.both_ways", zero(&Z::both_ways),
                "platform z down too: zeros apart from misalignment and scale error; default: "
                "where gimbal.travel_deg lets it"),
        boolean("zeroing.second_axis", zero(&Z::second_axis),
                "platform y up and down too, slewed by the inner gimbal 0, 60, -60, 60 deg; "
                "default: where z cannot be down and gimbal.travel_deg lets it"),
        number("zeroing.scale_factor", zero(&Z::scale_factor), "", {0, 0.1},
               "of the accelerometers, not known better, 1 sigma"),
        number("zeroing.velocity_reference_mps", zero(&Z::velocity_reference_mps), "m/s", {1e-6, 1},
               "how still the platform stands, 1 sigma"),
        number("zeroing.position_reference_m", zero(&Z::position_reference_m), "m", {1e-6, 1},
               "how still the platform stands, 1 sigma"),
        number("zeroing.angle_random_walk_deg_per_rt_h", zero(&Z::angle_random_walk), "deg/sqrt(h)",
               {1e-6, 10}, "of the gyros while they turn"),
        triple("zeroing.target_mg", zero(&Z::target_mg), "mg", {1e-6, 10},
               "standard deviations and movement to be reached"),
        text("zeroing.gyro_message", zero(&Z::gyro_message), "a message name",
             "angle increments at 100 Hz: signals X, Y, Z in arcsec, Counter", identifier_rule),
        text("zeroing.accelerometer_message", zero(&Z::accelerometer_message), "a message name",
             "velocity increments at 100 Hz: signals X, Y, Z in m/s, Counter", identifier_rule),
    };
}

std::vector<Key> loop_check_keys() {
    using L = campaign::LoopCheckSettings;
    using P = campaign::ProofSettings;
    const auto loop = part(&C::campaign, &campaign::Settings::loop);
    const auto proof = part(&C::campaign, &campaign::Settings::proof);
    return {
        number("selftest.table_g", loop(&L::table_g), "g", {0.05, 0.5},
               "peak acceleration at the table during the loop check"),
        number("selftest.measure_s", loop(&L::measure_s), "s", {2, 20},
               "that the loop check measures at its level"),
        number("selftest.transmission_tolerance", loop(&L::transmission_tolerance), "",
               {0.001, 0.2}, "about vibration.transmission, relative"),
        number("selftest.frequency_tolerance_hz", loop(&L::frequency_tolerance_hz), "Hz",
               {0.001, 0.5}, "about vibration.frequency_hz"),
        number("selftest.distortion", loop(&L::distortion), "", {0.0001, 1},
               "rms of all but the fundamental, over the fundamental's"),
        number("selftest.cross_share", loop(&L::cross_share), "", {0.0001, 1},
               "motion across the vertical over the motion along it"),
        number("selftest.phase_deg", loop(&L::phase_deg), "deg", {-180, 180},
               "platform after table; needs a table accelerometer"),
        number("selftest.phase_tolerance_deg", loop(&L::phase_tolerance_deg), "deg", {1, 180},
               "about phase_deg"),
        number("selftest.proof_valid_h", proof(&P::valid_h), "h", {1, 8760},
               "a proof that everything stops allows arming for so long"),
        number("selftest.emergency_stop_days", proof(&P::emergency_stop_days), "days", {1, 3660},
               "after so long a proof of the emergency stop's button is asked for"),
        boolean("selftest.required", loop(&L::required),
                "a campaign is armed only after a loop check in band since the start"),
    };
}

std::vector<Key> dwell_keys() {
    using campaign::OnNotValid;
    using campaign::VisitOrder;
    using S = campaign::Settings;
    const auto campaign = part(&C::campaign);
    return {
        text("campaign.name", campaign(&S::name), "1 to 64 characters", "names the results",
             campaign_name_rule),
        positions("campaign.positions_deg", campaign(&S::positions_deg), kMostPositions,
                  "gimbal angles of every run, converted by platform.encoder_sign and "
                  "encoder_zero_deg (default: Tang et al. 2009, table 1)"),
        numbers("campaign.table_g", campaign(&S::table_g), "g", {0, 1000}, kMostRuns,
                "peak acceleration at the table, one run each; 0: at rest"),
        choice<VisitOrder>(
            "campaign.order", campaign(&S::order),
            {{"balanced", VisitOrder::balanced},
             {"sequential", VisitOrder::sequential},
             {"pairs", VisitOrder::pairs},
             {"random", VisitOrder::random}},
            "of the positions at the levels: so that no slow change of a bias looks like a "
            "coefficient (from 12 dwells on), level by level, all levels of a position at once, or "
            "by chance; a plan's dwells stay in its order unless balanced or random is stated"),
        text("campaign.plan", campaign(&S::plan), "a file",
             "plan of `vibrig plan -o`, in place of positions_deg and table_g; empty: none",
             path_rule),
        choice<bool>("campaign.identify", campaign(&S::identify_all),
                     {{"all", true}, {"what-it-can", false}},
                     "all: a campaign that cannot determine all 30 coefficients is refused"),
        boolean("campaign.adaptive", campaign(&S::adaptive),
                "dwells chosen one by one, at the levels table_g, until the standard errors are "
                "down to targets"),
        number("campaign.targets.bias", campaign(&S::target_bias), "deg/h", {0, 1000},
               "standard error to reach; 0: any"),
        number("campaign.targets.linear", campaign(&S::target_linear), "deg/h/g", {0, 1000},
               "standard error to reach; 0: any"),
        number("campaign.targets.quadratic", campaign(&S::target_quadratic), "deg/h/g^2", {0, 1000},
               "standard error to reach; 0: any"),
        number("campaign.time_limit_s", campaign(&S::time_limit_s), "s", {0, 1e7},
               "an adaptive campaign ends before it; 0: none"),
        choice<bool>(
            "campaign.prior", campaign(&S::type_prior), {{"none", false}, {"type", true}},
            "type: an adaptive campaign starts from what the archive knows of the unit's type, "
            "while the unit passes for one of it; results are given without and with it"),
        boolean("campaign.levelling", campaign(&S::levelling),
                "the platform is levelled before each position; see [levelling]"),
        boolean("campaign.zeroing", campaign(&S::zeroing),
                "the accelerometers' zeros are taken at start and end; see [zeroing]"),
        number("campaign.dwell_s", campaign(&S::dwell_s), "s", {2, 86'400},
               "recorded at each position"),
        number("campaign.settle_s", campaign(&S::settle_s), "s", {2, 3600},
               "waited after the ramp before recording"),
        number("campaign.ramp_s", campaign(&S::ramp_s), "s", {0.1, 600},
               "from rest to amplitude, and back"),
        number("campaign.ready_timeout_s", campaign(&S::ready_timeout_s), "s", {1, 86'400},
               "for the platform to be ready and its temperature steady"),
        number("campaign.temperature_window_s", campaign(&S::temperature_window_s), "s",
               {0, 86'400}, "over which the temperature must be steady; 0: not asked"),
        number("campaign.temperature_band_c", campaign(&S::temperature_band_c), "degC",
               {0.001, 100}, "largest spread of the temperature within the window"),
        number("campaign.amplitude_tolerance", campaign(&S::amplitude_tolerance), "", {0.001, 1},
               "measured against commanded amplitude after the ramp, relative"),
        integer("campaign.rejected_in_a_row", campaign(&S::rejected_in_a_row), "", 1, 1000,
                "rejected dwells, after which it pauses at rest and says why"),
        choice<OnNotValid>(
            "campaign.on_not_valid", campaign(&S::on_not_valid),
            {{"go-on", OnNotValid::go_on},
             {"pause", OnNotValid::pause},
             {"repeat", OnNotValid::repeat}},
            "when the verdict on the dwells so far becomes \"not valid\": nothing; a pause at "
            "rest, before the next position; the dwell that it names once more, next"),
        number("campaign.arming_valid_s", campaign(&S::arming_valid_s), "s", {10, 86'400},
               "an arming ends after so long without a start"),
        boolean("campaign.second_person", campaign(&S::second_person),
                "after an emergency stop another person than who armed, or acknowledged first, "
                "acknowledges it too"),
        number("campaign.resonance_hz", campaign(&S::resonance_hz), "Hz", {0, 2000},
               "of the isolators; 0: from frequency and transmission"),
        text("campaign.results", at(&C::results), "a folder",
             "for result.json; empty: none written", path_rule),
    };
}

}  // namespace

std::vector<Key> campaign_keys() {
    return joined({dwell_keys(), levelling_keys(), zeroing_keys(), loop_check_keys()});
}

}  // namespace vibrig::configuration
