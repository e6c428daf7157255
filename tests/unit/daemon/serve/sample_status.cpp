#include "daemon/serve/status_message.hpp"
#include "estimator/identification/result.hpp"
#include "proto/vibrig.pb.h"
#include "tests/unit/daemon/serve/fake_source.hpp"

namespace vibrig::serve {

v1::Status message_of(const StatusData& data) {
    v1::Status status;
    fill(status, data);
    return status;
}

StatusData full_status() {
    StatusData s;
    s.version = "0.1.0";
    s.campaign_name = "rehearsal";
    s.clock = "rig";
    s.time = 1'234'500'000'000;
    s.utc_ns = 1'700'000'000'250'000'000;
    s.uptime = 1'300 * drivers::kSecond;
    s.state = CampaignState::recording;
    s.reason = "why not";
    s.armed_by = "Ada";
    s.armed_for = "IMU 0042, up to 9 g at the table";
    s.arming_left_s = 590;
    s.started_by = "Grace";
    s.run = 1;
    s.runs = 2;
    s.position = 3;
    s.positions = 14;
    s.position_deg = {180, 5, 45};
    s.progress = 0.375;
    s.remaining_s = 750;
    s.command_table_g = 9;
    s.command_frequency_hz = 15;
    s.shaker = {1'234'400'000'000, true, true, 15, 9, 8.9987, 2, 4, true, true};
    s.shaker_link = drivers::LinkState::degraded;
    s.shaker_counters = {11, 12, 13, 14, 15, 16, 17, 18, 19};
    s.can = drivers::PortState::running;
    s.can_counters = {21, 22, 23, 24, 25, 26, 27, 28, 29};
    s.assembler = {31, 32, 33, 34, 35, 36, 37, 38, 231, 232, 233, 39, 40};
    s.estimator_ring = {41, 42, 43};
    s.estimator_in_dwell = 30;
    s.estimator_idle = 12;
    s.rig_ticks = 44;
    s.increment_frames = 47;
    s.levelling = {true, "settled", "fast", 122.5, {0.25, -0.125}, {0.5, -0.5}, {-2.5, 10.5},
                   0.2,  0.0125,    0.025,  3,     "torque limit"};
    s.zeros.running = s.zeros.known = s.zeros.repeated = true;
    s.zeros.time_s = 90;
    s.zeros.zero_mg = {5, -5, 0.5};
    s.zeros.sigma_mg = {0.004, 0.005, 0.1};
    s.zeros.scale_z = 5e-5;
    s.zeros.scale_z_sigma = 1e-6;
    s.zeros.change_mg = {0.001, -0.002, 0.003};
    s.zeros.change_sigma_mg = {0.006, 0.007, 0.008};
    s.zeros.mark = "zero of accelerometer x moved";
    s.zeros.message = "y has not converged";
    s.vibration = {"random",
                   65.1,
                   "broad",
                   4,
                   -1.5,
                   "at level",
                   1.19,
                   1.2,
                   1.21,
                   1.18,
                   0.84,
                   1.68,
                   {{20, 0.01}, {120, 0.02}},
                   "table",
                   20,
                   120,
                   "random, profile broad at -1.5 dB"};
    s.stop_pending = true;
    s.rest = {"stopping",
              {{rt::RestVerdict::moving, 0.25, 1, 2}, {rt::RestVerdict::moving, 0.375, 1, 2}},
              false,
              "table 0.375 g rms"};
    s.shaker.watchdog = drivers::WatchdogTimeout::kept;
    s.shaker.watchdog_timeout_s = 1.5;
    s.shaker_counters.wrong_replies = 45;
    s.shaker_counters.lost = 46;
    s.sample.time = 1'234'475'000'000;
    s.sample.sequence = 51;
    s.sample.dropped_before = 52;
    s.sample.angle = {3.141592653589793, 1, 2};
    s.sample.force = {0.1, 1.2, -0.3};
    s.sample.table_accel = 8.5;
    s.channel_deadline_s = s.platform_deadline_s = 5;
    s.sample_rate_hz = 40.01;
    s.clock_misfit = "no time in common";
    s.simulated = true;
    s.proof = {true,
               "it is old",
               "press it",
               "Ada",
               1'800'000'000'000'000'000,
               true,
               "stop too slow",
               {{"stop, table", "s", 0.4, 0.1, 3}},
               "press the emergency stop now",
               {{1'700'000'000'000'000'000, true, 0.5, 1.7, 0.4}},
               "0af1",
               0.5,
               "stop, table takes longer"};
    s.archive = {"/mnt/archive",
                 true,
                 "the server was gone",
                 "2026-11-24_10-00-00",
                 2,
                 4096,
                 7,
                 3,
                 1,
                 1,
                 "unit-1: was changed"};
    s.guard = {"/run/vibrig/guard.sock",
               true,
               "late",
               "over_armed",
               "5 g for 2 g",
               true,
               true,
               true,
               true,
               true,
               5.0,
               "0.0.9"};
    s.annunciator = {true, true, "no answer", drivers::HornPattern::abort, true, 3, 1,
                     1,    1,    "it hung"};
    s.witness_g = {8.9, 9.1};
    s.channel_age_s = {0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7};
    s.platform = {1'234'000'000'000, true, true, true, 31.25, true, false, false, 1'234'000'000'000,
                  1'234'100'000'000, true, true, 61};
    for (std::size_t i = 0; i < estimator::kParameters; ++i) {
        s.estimate.value[i] = -0.5 - static_cast<double>(i);
        s.estimate.sigma[i] = 0.01 * static_cast<double>(i + 1);
        s.estimate.observable[i] = true;
    }
    s.resume_offer = "5 of 28 positions done";
    s.journal = {"/var/lib/vibrig/journal.sqlite3",
                 true,
                 "disk full",
                 80,
                 81,
                 82,
                 "5eed",
                 "vibrig-journal-head/1",
                 "vibrig-journal-head/1 proof",
                 83,
                 true,
                 0.5,
                 "locked"};
    s.recorder = {"/var/lib/vibrig",
                  "/var/lib/vibrig/a/campaign.h5",
                  true,
                  true,
                  "disk full",
                  91,
                  92,
                  93,
                  94,
                  95,
                  96,
                  97,
                  98,
                  99,
                  100};
    s.frame = {
        {2, -1}, {1, -1, 1}, {1, 2, 3}, {0.1, 0.2, 0.3}, {{{2, 1, 1}, {1, 2, 1}, {1, 1, 2}}}};
    s.loop_check = {"out of band", "Ada", "transmission", {{"transmission", "1", 0.65, 0.6, 0.7}}};
    s.rest_check = {"refused", "Ada", 141, "mean force 33 deg off", {"platform.encoder_sign"}};
    s.latency.add(150'000);
    s.mqtt = {"broker.lab:8883", true, "no route to host", 101, 102, 103, 104};
    s.server = {{{"control", "/run/vibrig/vibrigd.sock", true, "gone", 131}},
                {{"server", 1'800'000'000, true}}};
    s.log = {121, 122, 123, 124, true};
    s.real_time = {
        {{"acquisition", 60, "0-1", 111, 112, 113, 1.5}, {"estimator", 0, "1", 114, 115, 116, 2.5}},
        true,
        25,
        {"estimator: SCHED_FIFO 50: Operation not permitted"}};
    s.interlock.tripped = "amplitude_abort";
    s.interlock.latches = {
        {"emergency_stop", "chain open", "Ada", "Grace", true, 1'700'000'000'000'000'000}};
    s.interlock.rows = {{"amplitude_abort", "amplitude_off_command", "abort", "dB", 1, 0.5, true,
                         true, true, 1.25, 2, true}};
    s.interlock.reaction_bounds_ms = {0.1, 1};
    s.interlock.reaction_counts = {1, 2, 3};
    s.interlock.reaction_largest_ms = 0.75;
    s.interlock.reaction_sum_ms = 4.5;
    s.estimate.amplitude_g = 5.99;
    s.estimate.frequency_hz = 15.001;
    s.estimate.kappa = 18.94;
    s.estimate.samples = 71;
    s.estimate.used = 72;
    s.estimate.rejected = 73;
    s.estimate.nis_per_dof = 1.02;
    s.estimate.innovation_arcsec = {1.5, -2.5, 3.5};
    s.estimate.dwells = 2;
    for (NoiseStatus::Gyro& gyro : s.noise.gyros) {
        gyro.in_force = 0.001;
        gyro.smallest_change = 3.5;
        gyro.points = {{2, 0.25, 0.3}};
        gyro.terms[0] = {true, 5.1, 0.1, 0.2};
        gyro.terms[1] = {true, 0.0011, 0.0002, 0.0012};
        for (std::size_t t = 2; t < gyro.terms.size(); ++t) gyro.terms[t] = {false, 0, 0, 0.03};
    }
    s.noise.gyros[0].terms.fill({true, 0.01, 0.002, 0.014});
    s.verdict = {28, 1, "doubtful", "doubtful, because the drift walked", 3.5, true};
    s.verdict.residuals = std::make_shared<const std::vector<VerdictStatus::Residual>>(
        1, VerdictStatus::Residual{2, 3, 0.75, {0.001, -0.002, 0.003}, {0.01, 0.02, 0.03}});
    std::array<VerdictStatus::Coefficient, estimator::kParameters> coefficients{};
    for (std::size_t i = 0; i < coefficients.size(); ++i)
        coefficients[i] = {0.5 + static_cast<double>(i), 0.02};
    s.verdict.coefficients = std::make_shared<const decltype(coefficients)>(coefficients);
    s.verdict.combinations = std::make_shared<const std::vector<VerdictStatus::Combination>>(
        1, VerdictStatus::Combination{{{"D_Fx", 1}, {"D_OOx", 19}}, 0.75, 0.04});
    s.noise.angle_in_force_arcsec = 5;
    s.noise.block_s = 1;
    s.noise.dwells = 81;
    s.noise.dwells_left_out = 82;
    s.noise.alarms_total = 83;
    s.noise.alarms.push_back({1, 2, 1, 4, 2.5, 1.9, "short averaging times"});
    s.noise.level = {7, 1.1, 1, 2, {0.05, -0.06}, {0.1, 0.11}};
    s.dwells.push_back({1,
                        2,
                        4000,
                        3990,
                        10,
                        1,
                        18.9,
                        estimator::kVertical,
                        5.98,
                        15.0,
                        0.03,
                        1.001,
                        0.99,
                        0.05,
                        true,
                        "rejected",
                        {5.01, {0.0011, 0.0012, 0.0013}}});
    return s;
}

estimator::Result full_result() {
    estimator::Result r;
    for (std::size_t i = 0; i < estimator::kParameters; ++i) {
        r.value[i] = 1 + static_cast<double>(i);
        r.sigma[i] = 0.5;
        r.observable[i] = true;
        r.covariance[i][i] = 1;
    }
    r.amplitudes.push_back({1, 5.99, 18.9, 0.002, 15.0});
    r.combinations.push_back({{{"D_Fx", 1.0}, {"D_OOx", 19.0}}, 2.5, 0.1});
    r.nis_per_dof = 1.01;
    r.samples = 112'000;
    r.rejected = 5;
    r.warnings.emplace_back("one run only");
    return r;
}

}  // namespace vibrig::serve
