#include "daemon/serve/metrics.hpp"

#include <gtest/gtest.h>

#include <string>

#include "tests/unit/daemon/serve/fake_source.hpp"

namespace vibrig::serve {
namespace {

TEST(Metrics, CarryWhatIsValidAndAddUp) {
    StatusData status = full_status();
    const std::string text = metrics_text(status, {});
    EXPECT_TRUE(holds(text, "# TYPE vibrig_interlock_reaction_seconds histogram"));
    EXPECT_TRUE(holds(text, "vibrig_interlock_reaction_seconds_count 6\n")) << text;
    EXPECT_TRUE(holds(text, "vibrig_interlock_reaction_seconds_sum 0.0045\n"));
    EXPECT_TRUE(holds(text, "vibrig_interlock_reaction_seconds_bucket{le=\"+Inf\"} 6\n"));
    EXPECT_TRUE(holds(text, "vibrig_campaign_state{state=\"recording\"} 1\n"));
    EXPECT_TRUE(holds(text, "vibrig_acquisition_latency_seconds_bucket{le=\"0.0002\"} 1\n"));
    EXPECT_TRUE(holds(text, "vibrig_mqtt_messages_total{outcome=\"left_out\"} 104\n"));
    EXPECT_TRUE(holds(text, "vibrig_thread_deadline_misses_total{thread=\"estimator\"} 116\n"));
    EXPECT_TRUE(holds(
        text, "vibrig_thread_page_faults_total{kind=\"major\",thread=\"acquisition\"} 111\n"));
    EXPECT_TRUE(holds(text, "vibrig_thread_fifo_priority{thread=\"acquisition\"} 60\n"));
    EXPECT_TRUE(holds(text, "vibrig_memory_locked 1\n"));
    EXPECT_TRUE(holds(text, "vibrig_door_made_anew_total{door=\"control\"} 131\n"));
    EXPECT_TRUE(
        holds(text, "vibrig_certificate_expiry_timestamp_seconds{whose=\"server\"} 1800000000\n"));
    EXPECT_TRUE(holds(text, "vibrig_log_lines_total{outcome=\"dropped\"} 123\n"));
    EXPECT_TRUE(holds(text, "vibrig_interlock_value{name=\"amplitude_abort\",unit=\"dB\"} 2\n"));
    EXPECT_TRUE(holds(text, "vibrig_interlock_margin_ratio{name=\"amplitude_abort\"} 0.5\n"));
    EXPECT_FALSE(holds(text, "nan") || holds(text, "Nan")) << text;
    status.shaker.valid = false;
    EXPECT_FALSE(holds(metrics_text(status, {}), "vibrig_shaker_measured"));
    // An accelerometer of which nothing is known is not still, a filter without samples not right.
    status.rest.witnesses.platform = {rt::RestVerdict::moving, 1.0};
    status.rest.witnesses.table = {rt::RestVerdict::unknown, 0};
    status.estimate = {};
    const std::string unknown = metrics_text(status, {});
    EXPECT_TRUE(
        holds(unknown, "vibrig_rest_rms_meters_per_second_squared{body=\"platform\"} 9.80"));
    EXPECT_FALSE(holds(unknown, "vibrig_rest_rms_meters_per_second_squared{body=\"table\"}"));
    EXPECT_FALSE(holds(unknown, "vibrig_filter_nis_ratio"));
    EXPECT_FALSE(holds(unknown, "vibrig_innovation_radians"));
}

}  // namespace
}  // namespace vibrig::serve
