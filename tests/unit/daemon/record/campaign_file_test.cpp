#include "daemon/record/campaign_file.hpp"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <fstream>
#include <string>
#include <utility>
#include <vector>

#include "daemon/record/hdf5.hpp"
#include "daemon/record/replay.hpp"
#include "tests/unit/daemon/record/recording.hpp"

namespace vibrig::record {
namespace {

bool same(const drivers::Sample& a, const drivers::Sample& b) {
    const auto bits = [](double v) { return std::bit_cast<std::uint64_t>(v); };
    bool equal = a.time == b.time && a.sequence == b.sequence && a.quality == b.quality &&
                 bits(a.table_accel) == bits(b.table_accel);
    for (std::size_t k = 0; k < 3; ++k)
        equal =
            equal && bits(a.angle[k]) == bits(b.angle[k]) && bits(a.force[k]) == bits(b.force[k]);
    return equal;
}

TEST_F(Recording, ComesBackToTheLastBitWhileItIsWrittenAndAfterwards) {
    // GIVEN a campaign's file with samples, one of them bad and one not a number
    const std::string path = (folder_ / "campaign.h5").string();
    auto written = samples(3000, 7 * drivers::kSecond);
    written[5].quality[3] = drivers::Quality::stale;
    written[6].force[1] = std::nan("");
    CampaignWriter writer(path, head());
    for (const auto& sample : written) writer.put(sample);
    put_order(writer, 1, written[100].time, written[2000].time);
    writer.put(Gap{1, 2, "samples", 17, "ring full"});
    EventRecord event;
    event.text = "Umlaut \xc3\xa4";
    event.source = "test";
    event.severity = Severity::alarm;
    writer.put(event);
    writer.commit();
    for (const bool ended : {false, true}) {
        SCOPED_TRACE(ended ? "closed" : "open");
        if (ended) writer.end({"finished", "", "", R"({"a":1})", head().utc_ns + 1});
        // WHEN it is read, first beside its writer
        const Campaign read = read_campaign(folder_.string());
        // THEN everything is there
        ASSERT_EQ(read.samples.size(), written.size());
        for (std::size_t i = 0; i < written.size(); ++i)
            ASSERT_TRUE(same(read.samples[i], written[i])) << "sample " << i;
        EXPECT_EQ(read.state, ended ? "finished" : "running");
        EXPECT_EQ(read.result_json, ended ? R"({"a":1})" : "");
        EXPECT_EQ(read.head.started_by, "A. Person");
        ASSERT_EQ(read.gaps.size(), 1U);
        EXPECT_EQ(read.gaps[0].lost, 17U);
        ASSERT_EQ(read.events.size(), 1U);
        EXPECT_EQ(read.events[0].text, event.text);
        EXPECT_EQ(read.events[0].severity, Severity::alarm);
        const auto dwells = recorded_dwells(read);
        ASSERT_EQ(dwells.size(), 1U);
        EXPECT_EQ(dwells[0].first, 100U);
        EXPECT_EQ(dwells[0].count, 1900U);
    }
}

TEST_F(Recording, HasTheFrequencyOfASweepAndMakesItsBlocksAgain) {
    // GIVEN a dwell under a sweep, whose frequency the controller reported five times a second
    constexpr double kRate_hz = 400, kFrom_hz = 20, kTo_hz = 80, kSweep_s = 20;
    const Time from = 7 * drivers::kSecond;
    const auto hz_at = [&](double t) {
        return kFrom_hz * std::pow(kTo_hz / kFrom_hz, std::clamp(t / kSweep_s, 0.0, 1.0));
    };
    const std::string path = (folder_ / "campaign.h5").string();
    CampaignWriter writer(path, head());
    double phase = 0;
    for (int i = 0; i < static_cast<int>(kSweep_s * kRate_hz); ++i) {
        drivers::Sample s;
        s.time = from + drivers::from_seconds(i / kRate_hz);
        s.quality.fill(drivers::Quality::good);
        phase += 2 * std::numbers::pi * hz_at(i / kRate_hz) / kRate_hz;
        s.force = {0, 1 + 6 * std::sin(phase), 0};
        writer.put(s);
    }
    Order order{
        from - drivers::kSecond, from, from + drivers::from_seconds(kSweep_s), 1, 2, 6.0, false};
    order.sweep = {kFrom_hz, kTo_hz, kSweep_s};
    writer.put(order);
    Swept swept;
    for (double t = -1; t <= kSweep_s + 0.5; t += 0.2)
        swept.push_back({from + drivers::from_seconds(t), 1, 2, hz_at(t)});
    swept.push_back({from + drivers::kSecond, 3, 2, 5});  // of another dwell
    writer.put(swept);
    writer.commit();
    writer.end({"finished", "", "", "{}", head().utc_ns + 1});
    // WHEN it is read THEN they are there, and the accelerometers show what they say
    const Campaign read = read_campaign(folder_.string());
    ASSERT_EQ(read.swept.size(), swept.size());
    EXPECT_EQ(read.swept[7].time, swept[7].time);
    EXPECT_EQ(read.swept[7].frequency_hz, swept[7].frequency_hz);
    ASSERT_EQ(read.orders.size(), 1U);
    EXPECT_EQ(read.orders[0].sweep, order.sweep);
    EXPECT_EQ(read.orders[0].dwell().sweep, order.sweep);
    const auto dwells = recorded_dwells(read);
    ASSERT_EQ(dwells.size(), 1U);
    auto sweep = sweep_of(read, estimator::Settings{}, dwells[0]);
    const auto blocks = sweep.finish();
    EXPECT_GT(sweep.shown(), 0.99);
    ASSERT_EQ(blocks.blocks.size(), 20U);
    for (const auto& block : blocks.blocks)
        EXPECT_NEAR(block.from_hz, hz_at(block.time_s - 0.5), 0.01);
    // 6 g peak along the vertical: 18 g^2
    EXPECT_GT(blocks.known(), 15U);
    for (const auto& block : blocks.blocks)
        if (block.moment) {
            EXPECT_NEAR((*block.moment)[1][1], 18, 0.2);
        }
}

TEST_F(Recording, HasWhatWasAroundTheMeasurement) {
    // GIVEN a campaign with an interlock of three rows, and a look at what is around it
    const std::string path = (folder_ / "campaign.h5").string();
    Head with_rows = head();
    with_rows.interlocks = R"([{"name":"a"},{"name":"b"},{"name":"c"}])";
    with_rows.interlock_rows = 3;
    ConditionRow row;
    row.time = 17 * drivers::kSecond;
    row.temperature_c = 44.5;
    row.sensor_c = {21, 22, std::nan(""), 24};
    row.command_g = 9;
    row.set_point_g = 8.5;
    row.measured_g = std::nan("");
    row.shaker_state = 2;
    row.shaker_running = 1;
    row.ready = 1;
    row.fault = 0;
    row.interlock_value = {0.25, std::nan(""), -1};
    row.interlock_raised = {0, 1, 0};
    CampaignWriter writer(path, with_rows);
    for (const auto& sample : samples(10, 0)) writer.put(sample);
    writer.put(row);
    writer.commit();
    // WHEN it is read
    const Campaign read = read_campaign(path);
    // THEN it is there, and what was not known is not zero
    EXPECT_EQ(read.head.interlocks, with_rows.interlocks);
    ASSERT_EQ(read.conditions.size(), 1U);
    const ConditionRow& found = read.conditions[0];
    EXPECT_EQ(found.time, row.time);
    EXPECT_EQ(found.temperature_c, 44.5);
    EXPECT_EQ(found.sensor_c[1], 22);
    EXPECT_TRUE(std::isnan(found.sensor_c[2]));
    EXPECT_EQ(found.command_g, 9);
    EXPECT_EQ(found.set_point_g, 8.5);
    EXPECT_TRUE(std::isnan(found.measured_g));
    EXPECT_EQ(found.shaker_state, 2);
    EXPECT_EQ(found.shaker_running, 1);
    EXPECT_EQ(found.ready, 1);
    EXPECT_EQ(found.fault, 0);
    EXPECT_EQ(found.slewing, -1);
    ASSERT_EQ(found.interlock_value.size(), 3U);
    EXPECT_EQ(found.interlock_value[2], -1);
    EXPECT_TRUE(std::isnan(found.interlock_value[1]));
    EXPECT_EQ(found.interlock_raised, (std::vector<std::uint8_t>{0, 1, 0}));
}

TEST_F(Recording, ThatIsNoneIsRefusedByName) {
    std::ofstream(folder_ / "text.h5") << "time_s,run\n";
    std::ofstream(folder_ / "empty.h5");
    { hdf5::File::create((folder_ / "foreign.h5").string()).close(); }
    for (const auto& [name, part] :
         std::vector<std::pair<std::string, std::string>>{{"text.h5", "no HDF5 file"},
                                                          {"empty.h5", "no HDF5 file"},
                                                          {"foreign.h5", "vibrig-campaign"},
                                                          {"nowhere", "found nothing"},
                                                          {"", "no campaign.h5"}}) {
        const std::string path = name.empty() ? folder_.string() : (folder_ / name).string();
        try {
            static_cast<void>(read_campaign(path));
            ADD_FAILURE() << path << " was read";
        } catch (const std::runtime_error& error) {
            EXPECT_NE(std::string(error.what()).find(part), std::string::npos) << error.what();
            EXPECT_NE(std::string(error.what()).find(path), std::string::npos) << error.what();
        }
    }
}

TEST_F(Recording, IsSimulatedIfAnythingInItSaysSo) {
    const auto read = [this](bool attribute, const std::string& configuration,
                             const std::string& result) {
        const std::string path = (folder_ / "campaign.h5").string();
        fs::remove(path);
        Head written = head();
        written.simulated = attribute;
        written.configuration += configuration;
        CampaignWriter writer(path, written);
        for (const auto& sample : samples(5, 0)) writer.put(sample);
        writer.end({"finished", "", "", result, head().utc_ns});
        return read_campaign(path).head.simulated;
    };
    EXPECT_FALSE(read(false, "", R"({"nis":1,"simulated":false})"));
    EXPECT_FALSE(read(false, "clock.source = \"real\"\n", "{}"));
    EXPECT_TRUE(read(true, "", R"({"nis":1,"simulated":false})"));
    EXPECT_TRUE(read(false, "clock.source = \"rig\"\n", "{}"));
    EXPECT_TRUE(read(false, "", R"({"nis":1,"simulated":true})"));
    EXPECT_TRUE(read(false, "", R"({"simulated": true, "nis": 1})"));
}

}  // namespace
}  // namespace vibrig::record
