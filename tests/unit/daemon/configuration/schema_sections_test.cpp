#include "tests/unit/daemon/configuration/support.hpp"

namespace vibrig::configuration {
namespace {

using drivers::kMillisecond;
using drivers::kSecond;

TEST(Sections, AnEmptyFileGivesTheDefaultsOfTheStructs) {
    // GIVEN nothing configured
    const Configuration c = accepted("");
    // THEN every section has what the design documents
    EXPECT_EQ(c.estimator.latitude_deg, 45.75);
    EXPECT_EQ(c.estimator.azimuth_deg, 0.0);
    EXPECT_EQ(c.estimator.gravity_mps2, 9.80665);
    EXPECT_EQ(c.estimator.frequency_hz, 15.0);
    EXPECT_EQ(c.estimator.transmission, 0.6667);
    EXPECT_EQ(c.estimator.level_window_s, 10.0);
    EXPECT_EQ(c.estimator.up.axis, 1);
    EXPECT_EQ(c.estimator.up.sign, 1);
    EXPECT_EQ(c.estimator.drift_sign, -1);
    EXPECT_EQ(c.estimator.resolver_arcsec, 5.0);
    EXPECT_EQ(c.estimator.resolver_bits, 20);
    EXPECT_EQ(c.estimator.gyro_random_walk_deg_per_rt_h, 0.001);
    EXPECT_EQ(c.estimator.accelerometer_g, 1e-4);
    EXPECT_EQ(c.estimator.method, estimator::Method::joint);
    EXPECT_EQ(c.estimator.prior_quadratic, 1.0);
    EXPECT_EQ(c.estimator.forgetting, 0.95);
    EXPECT_EQ(c.estimator.gate_nis, 25.0);
    EXPECT_EQ(c.campaign.positions_deg, campaign::kTable1Positions);
    EXPECT_EQ(c.campaign.table_g, (std::vector<double>{9, 7}));
    EXPECT_EQ(c.assembler.sample_period, 25 * kMillisecond);
    EXPECT_TRUE(c.shaker.registers.watchdog.has_value());
    EXPECT_EQ(c.clock, Configuration::ClockKind::real);
}

TEST(Sections, TheDefaultsPassTheChecksOfTheDaemon) { EXPECT_EQ(complaint("", true), ""); }

TEST(Sections, IdentificationKeysReachTheEstimator) {
    const auto s = accepted(R"(
        [site]
        latitude_deg = -33
        azimuth_deg = 12.5
        gravity_mps2 = 9.79
        [vibration]
        frequency_hz = 17.5
        transmission = 0.5
        level_window_s = 4
        [platform]
        up = "-z"
        gyro_x_axes = ["-y", "+z", "+x"]
        gyro_y_axes = ["+z", "-x", "+y"]
        gyro_z_axes = ["+x", "+y", "-z"]
        drift_sign = 1
        encoder_sign = [-1, 1, -1]
        encoder_zero_deg = [1.5, -2, 0]
        [accelerometer]
        zero_g = [0.001, -0.002, 0]
        matrix = [[1, 0.1, 0], [0, 1, 0], [0, 0, 1.01]]
        [noise]
        resolver_arcsec = 2
        resolver_bits = 16
        gyro_random_walk_deg_per_rt_h = 0.01
        accelerometer_g = 2e-5
        [estimator]
        method = "two-step"
        prior_sigma = { bias = 5, linear = 6.5, quadratic = 0.5 }
        forgetting = 0.9
        gate_nis = 16)")
                       .estimator;
    EXPECT_EQ(s.latitude_deg, -33);
    EXPECT_EQ(s.azimuth_deg, 12.5);
    EXPECT_EQ(s.gravity_mps2, 9.79);
    EXPECT_EQ(s.frequency_hz, 17.5);
    EXPECT_EQ(s.transmission, 0.5);
    EXPECT_EQ(s.level_window_s, 4);
    EXPECT_EQ(s.up.axis, 2);
    EXPECT_EQ(s.up.sign, -1);
    EXPECT_EQ(s.gyro_axes[0][0].axis, 1);
    EXPECT_EQ(s.gyro_axes[0][0].sign, -1);
    EXPECT_EQ(s.gyro_axes[1][1].axis, 0);
    EXPECT_EQ(s.gyro_axes[2][2].sign, -1);
    EXPECT_EQ(s.drift_sign, 1);
    EXPECT_EQ(s.encoder_sign, (std::array{-1, 1, -1}));
    EXPECT_EQ(s.encoder_zero_deg, (std::array{1.5, -2.0, 0.0}));
    EXPECT_EQ(s.accelerometer_zero_g, (std::array{0.001, -0.002, 0.0}));
    EXPECT_EQ(s.accelerometer_matrix[0][1], 0.1);
    EXPECT_EQ(s.accelerometer_matrix[2][2], 1.01);
    EXPECT_EQ(s.resolver_bits, 16);
    EXPECT_EQ(s.method, estimator::Method::two_step);
    EXPECT_EQ(s.prior_bias, 5);
    EXPECT_EQ(s.prior_linear, 6.5);
    EXPECT_EQ(s.prior_quadratic, 0.5);
    EXPECT_EQ(s.gate_nis, 16);
}

TEST(Sections, CampaignKeysReachTheCampaign) {
    const Configuration c = accepted(R"(
        [vibration]
        frequency_hz = 17
        [campaign]
        name = "Rig 2"
        positions_deg = [[0, 0, 0], [90, -10.5, 45]]
        table_g = [5, 0]
        dwell_s = 20
        settle_s = 2
        ramp_s = 1.5
        ready_timeout_s = 30
        temperature_window_s = 5
        temperature_band_c = 0.2
        amplitude_tolerance = 0.02
        results = "out"
        [shaker.limits]
        acceleration_g = 6
        velocity_mps = 0.7
        displacement_mm = 8)");
    EXPECT_EQ(c.campaign.name, "Rig 2");
    ASSERT_EQ(c.campaign.positions_deg.size(), 2U);
    EXPECT_EQ(c.campaign.positions_deg[1], (std::array{90.0, -10.5, 45.0}));
    EXPECT_EQ(c.campaign.table_g, (std::vector<double>{5, 0}));
    EXPECT_EQ(c.campaign.frequency_hz, 17) << "copied from [vibration]";
    EXPECT_EQ(c.campaign.dwell_s, 20);
    EXPECT_EQ(c.campaign.ramp_s, 1.5);
    EXPECT_EQ(c.campaign.max_acceleration_g, 6);
    EXPECT_EQ(c.campaign.max_velocity_mps, 0.7);
    EXPECT_EQ(c.campaign.max_displacement_mm, 8);
    EXPECT_EQ(c.results, "out");
}

TEST(Sections, ShakerKeysReachTheDriver) {
    const auto s = accepted(R"(
        [shaker]
        transport = "rtu"
        host = "shaker.local"
        port = 5020
        device = "/dev/ttyUSB0"
        baud = 115200
        unit = 17
        response_timeout_ms = 250
        poll_period_ms = 100.5
        watchdog_period_ms = 300
        backoff_min_ms = 50
        backoff_max_ms = 2000
        [shaker.registers.frequency]
        address = 100
        type = "f32"
        word_order = "little"
        scale = 1
        [shaker.registers.emergency_stop]
        table = "holding"
        address = 300
        mask = 0x0100)")
                       .shaker;
    EXPECT_EQ(s.transport, drivers::ShakerSettings::Transport::rtu);
    EXPECT_EQ(s.host, "shaker.local");
    EXPECT_EQ(s.port, 5020);
    EXPECT_EQ(s.device, "/dev/ttyUSB0");
    EXPECT_EQ(s.baud, 115200);
    EXPECT_EQ(s.unit, 17);
    EXPECT_EQ(s.response_timeout, 250 * kMillisecond);
    EXPECT_EQ(s.poll_period, 100'500'000);
    EXPECT_EQ(s.backoff_max, 2 * kSecond);
    EXPECT_EQ(s.registers.frequency.address, 100);
    EXPECT_EQ(s.registers.frequency.type, proto::RegisterType::f32);
    EXPECT_EQ(s.registers.frequency.order, proto::WordOrder::little);
    EXPECT_EQ(s.registers.frequency.scale, 1);
    EXPECT_EQ(s.registers.frequency.access, proto::Access::read_write) << "left at its default";
    EXPECT_EQ(s.registers.emergency_stop.mask, 0x0100);
    EXPECT_EQ(s.registers.emergency_stop.table, proto::RegisterTable::holding);
}

TEST(Sections, TheAmplitudeUnitIsFoldedIntoBothAmplitudeScales) {
    const std::string unit = "shaker.amplitude_unit = ";
    // GIVEN a controller that counts 1e-4 g r.m.s.
    const auto rms = accepted(unit + "\"g_rms\"").shaker.registers;
    EXPECT_DOUBLE_EQ(rms.amplitude.scale, 1e-4 * 1.4142135623730951);
    EXPECT_DOUBLE_EQ(rms.measured_amplitude.scale, 1e-4 * 1.4142135623730951);
    // GIVEN one that counts 0.01 m/s^2 peak
    const auto metric =
        accepted(unit + "\"mps2_peak\"\nshaker.registers.amplitude.scale = 0.01").shaker.registers;
    EXPECT_DOUBLE_EQ(metric.amplitude.scale, 0.01 / 9.80665);
    EXPECT_EQ(metric.frequency.scale, 1e-3) << "only amplitudes";
    EXPECT_EQ(accepted("").shaker.registers.amplitude.scale, 1e-4);
}

TEST(Sections, BusKeysReachPortAssemblerAndGimbal) {
    const Configuration c = accepted(R"(
        [can]
        port = "seqpacket"
        interface = "can1"
        path = "@rig"
        dbc = "lab.dbc"
        fd = false
        receive_buffer = 65536
        sample_rate_hz = 100
        join_deadline_ms = 5
        stale_deadline_ms = 50
        [can.signals]
        outer = "Box.Angle1"
        table_accel = ""
        message_sync_signal = "Sync8"
        command_echo = "Status.Echo"
        [gimbal]
        message = "Command"
        status_deadline_ms = 400
        slew_timeout_s = 60
        repeat_ms = 100)");
    EXPECT_EQ(c.can.kind, drivers::CanPortSettings::Kind::seqpacket);
    EXPECT_EQ(c.can.interface, "can1");
    EXPECT_EQ(c.can.path, "@rig");
    EXPECT_EQ(c.dbc, "lab.dbc");
    EXPECT_FALSE(c.can.fd);
    EXPECT_EQ(c.can.receive_buffer, 65536);
    EXPECT_EQ(c.assembler.sample_period, 10 * kMillisecond);
    EXPECT_EQ(c.assembler.join_deadline, 5 * kMillisecond);
    EXPECT_EQ(c.assembler.stale_deadline, 50 * kMillisecond);
    EXPECT_EQ(c.assembler.bindings.outer, "Box.Angle1");
    EXPECT_EQ(c.assembler.bindings.inner, "Resolvers.Inner") << "left at its default";
    EXPECT_EQ(c.assembler.bindings.table_accel, "") << "not bound";
    EXPECT_EQ(c.assembler.bindings.message_sync_signal, "Sync8");
    EXPECT_EQ(c.assembler.bindings.command_echo, "Status.Echo");
    EXPECT_EQ(c.gimbal.message, "Command");
    EXPECT_EQ(c.gimbal.status_deadline, 400 * kMillisecond);
    EXPECT_EQ(c.gimbal.slew_timeout, 60 * kSecond);
    EXPECT_EQ(c.gimbal.repeat, 100 * kMillisecond);
}

TEST(Sections, DaemonKeysReachTheDaemon) {
    const Configuration c = accepted(R"(
        clock.source = "rig"
        server.socket = "/tmp/s"
        [log]
        level = "debug"
        file = "/var/log/vibrig.log"
        [threads]
        acquisition_priority = 0
        estimator_priority = 99
        acquisition_cpu = 3
        lock_memory = false)");
    EXPECT_EQ(c.clock, Configuration::ClockKind::rig);
    EXPECT_EQ(c.socket, "/tmp/s");
    EXPECT_EQ(c.log_level, "debug");
    EXPECT_EQ(c.log_file, "/var/log/vibrig.log");
    EXPECT_EQ(c.acquisition_priority, 0);
    EXPECT_EQ(c.estimator_priority, 99);
    EXPECT_EQ(c.acquisition_cpu, 3);
    EXPECT_EQ(c.estimator_cpu, -1);
    EXPECT_FALSE(c.lock_memory);
}

TEST(Sections, RelativePathsAreRelativeToTheFileThatNamesThem) {
    const Configuration c = parse("can.dbc = \"../lab.dbc\"\ncampaign.results = \"/srv/r\"",
                                  "/etc/vibrig/rig.toml", false)
                                .configuration;
    EXPECT_EQ(c.dbc, "/etc/lab.dbc");
    EXPECT_EQ(c.results, "/srv/r");
    EXPECT_EQ(c.log_file, "");
}

TEST(Sections, TheResonanceComesFromTheTransmissionUnlessItIsGiven) {
    // transmission 2/3 = 1 / (r^2 - 1): r^2 = 2.5
    EXPECT_NEAR(accepted("vibration.transmission = 0.66666667").campaign.resonance_hz,
                15 / std::sqrt(2.5), 1e-6);
    EXPECT_EQ(accepted("campaign.resonance_hz = 8").campaign.resonance_hz, 8);
    EXPECT_EQ(accepted("vibration.transmission = 1.0").campaign.resonance_hz, 0);
}

}  // namespace
}  // namespace vibrig::configuration
