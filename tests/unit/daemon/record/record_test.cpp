#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <random>

#include "daemon/record/campaign_file.hpp"
#include "daemon/record/hdf5.hpp"
#include "daemon/record/raw_log.hpp"
#include "daemon/record/recorder.hpp"
#include "daemon/record/replay.hpp"
#include "daemon/rt/real_clock.hpp"

namespace vibrig::record {
namespace {

namespace fs = std::filesystem;
using drivers::Time;

constexpr Time kPeriod = 25 * drivers::kMillisecond;

class Recording : public ::testing::Test {
  protected:
    Recording() {
        std::string name = (fs::temp_directory_path() / "vibrig-record.XXXXXX").string();
        folder_ = ::mkdtemp(name.data());
    }
    ~Recording() override {
        std::error_code ignored;
        fs::remove_all(folder_, ignored);
    }

    static Head head() {
        Head head;
        head.name = "test";
        head.started_by = "A. Person";
        head.utc_ns = 1'767'225'600 * drivers::kSecond;
        head.utc_offset_ns = head.utc_ns - 5 * drivers::kSecond;
        head.clock = "real";
        head.version = "0";
        head.configuration = "site.latitude_deg = 45.75 # deg\nnoise.resolver_arcsec = 5.0\n";
        head.interface = "vcan0";
        return head;
    }
    /// A platform that drifts slowly on a shaking table.
    static std::vector<drivers::Sample> samples(std::size_t count, Time from, unsigned seed = 1) {
        std::mt19937 random(seed);
        std::normal_distribution<double> noise;
        std::vector<drivers::Sample> made(count);
        for (std::size_t i = 0; i < count; ++i) {
            drivers::Sample& s = made[i];
            s.time = from + static_cast<Time>(i) * kPeriod;
            s.sequence = static_cast<std::uint32_t>(i);
            const double t = drivers::to_seconds(s.time - from);
            for (std::size_t k = 0; k < 3; ++k)
                s.angle[k] = 0.1 + 1e-5 * t + 2.4e-5 * noise(random);
            const double shake = 6 * std::sin(2 * std::numbers::pi * 15 * t);
            s.force = {1e-4 * noise(random), 1 + shake, 1e-4 * noise(random)};
            s.table_accel = 1.5 * shake;
        }
        return made;
    }
    static void put_order(CampaignWriter& writer, int position, Time from, Time to) {
        writer.put(Order{from - drivers::kSecond, from, to, 1, position, 9.0, false});
    }
    static std::string file(const fs::path& path) {
        std::ifstream in(path, std::ios::binary);
        return {std::istreambuf_iterator<char>(in), {}};
    }

    fs::path folder_;
};

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
    // GIVEN a dwell under a sweep, of which the controller told the frequency five times a second
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
        swept.rows.push_back({from + drivers::from_seconds(t), 1, 2, hz_at(t)});
    swept.rows.push_back({from + drivers::kSecond, 3, 2, 5});  // of another dwell
    writer.put(swept);
    writer.commit();
    writer.end({"finished", "", "", "{}", head().utc_ns + 1});
    // WHEN it is read THEN they are there, and the accelerometers show what they say
    const Campaign read = read_campaign(folder_.string());
    ASSERT_EQ(read.swept.size(), swept.rows.size());
    EXPECT_EQ(read.swept[7].time, swept.rows[7].time);
    EXPECT_EQ(read.swept[7].frequency_hz, swept.rows[7].frequency_hz);
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
        if (block.moment.allFinite()) {
            EXPECT_NEAR(block.moment(1, 1), 18, 0.2);
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

TEST_F(Recording, OfAWriterThatDiedIsMendedOnce) {
    // GIVEN what is on the disk while a campaign is written
    const std::string path = (folder_ / "campaign.h5").string();
    {
        CampaignWriter writer((folder_ / "living.h5").string(), head());
        for (const auto& sample : samples(500, 0)) writer.put(sample);
        put_order(writer, 3, 2 * drivers::kSecond, 100 * drivers::kSecond);
        writer.commit();
        EXPECT_THROW(static_cast<void>(recover((folder_ / "living.h5").string(), {})),
                     std::runtime_error);
        fs::copy_file(folder_ / "living.h5", path);
    }
    // WHEN it is mended
    const Recovery recovery = recover(path, {}).at(0);
    // THEN it says what there is and what is lost
    EXPECT_FALSE(recovery.was_closed);
    EXPECT_EQ(recovery.samples, 500U);
    EXPECT_EQ(recovery.cut_dwell, "run 1 position 3: 420 samples, 10.475 of 98.000 s, are there");
    const Campaign read = read_campaign(path);
    EXPECT_EQ(read.state, "recovered");
    EXPECT_EQ(read.samples.size(), 500U);
    ASSERT_EQ(read.gaps.size(), 1U);
    EXPECT_EQ(read.gaps[0].stream, "end");
    // AND a second time there is nothing to do
    const std::string bytes = file(path);
    const Recovery again = recover(path, {}).at(0);
    EXPECT_TRUE(again.was_closed);
    EXPECT_TRUE(again.recovered);
    EXPECT_EQ(again.cut_dwell, recovery.cut_dwell);
    EXPECT_EQ(again.words, recovery.words);
    EXPECT_EQ(file(path), bytes);
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

FrameRecord frame(std::uint32_t id, Time time, bool sent = false) {
    FrameRecord record;
    record.frame.can_id = id;
    record.frame.len = 2;
    record.frame.data[0] = 0xab;
    record.frame.data[1] = static_cast<std::uint8_t>(id);
    record.time = time;
    record.sent = sent;
    return record;
}

TEST_F(Recording, OfFramesIsACandumpLogInSegmentsThatAreCompressed) {
    Settings settings;
    settings.segment_s = 1;
    std::vector<Segment> closed;
    RawLog log(folder_.string(), "vcan0", settings, 1'700'000'000 * drivers::kSecond,
               [&closed](const Segment& segment) { closed.push_back(segment); });
    // GIVEN frames of both directions over more than two segments
    for (int i = 0; i < 25; ++i) {
        log.add(frame(0x101, i * 100 * drivers::kMillisecond + 123'456'000, i % 5 == 4));
        log.flush();
    }
    log.close();
    // THEN the segments hold them all, in order and as candump writes them
    ASSERT_EQ(closed.size(), 3U);
    const auto files = raw_files(folder_.string());
    ASSERT_EQ(files.size(), 3U);
    std::string text;
    for (const auto& name : files) {
        EXPECT_TRUE(name.ends_with(".log.zst")) << name;
        read_raw(name, [&text](std::string_view piece) {
            text += piece;
            return true;
        });
    }
    EXPECT_EQ(std::ranges::count(text, '\n'), 25);
    EXPECT_TRUE(text.starts_with("(1700000000.123456) vcan0 101#AB01 R\n")) << text.substr(0, 80);
    EXPECT_NE(text.find("(1700000000.523456) vcan0 101#AB01 T\n"), std::string::npos);
    EXPECT_EQ(log.frames(), 25U);
    EXPECT_EQ(log.lost(), 0U);
}

TEST_F(Recording, OfFramesCountsWhatTheDiskRefusesAndGoesOnWhenItDoesNot) {
    // GIVEN a folder that is not there
    const fs::path gone = folder_ / "gone";
    RawLog log(gone.string(), "vcan0", Settings{}, 0, {});
    for (int i = 0; i < 3; ++i) log.add(frame(1, i * drivers::kSecond));
    log.flush();
    Gap gap;
    EXPECT_FALSE(log.good());
    EXPECT_EQ(log.lost(), 3U);
    EXPECT_FALSE(log.take_gap(gap)) << "nobody could read it yet";
    // WHEN it comes back, and the time to try again has come
    fs::create_directory(gone);
    for (int i = 0; i < 100 && !log.good(); ++i) {
        log.add(frame(1, (10 + i) * drivers::kSecond));
        log.flush();
        ::usleep(50'000);
    }
    // THEN it writes, and tells what is missing
    EXPECT_TRUE(log.good());
    ASSERT_TRUE(log.take_gap(gap));
    EXPECT_EQ(gap.lost, log.lost());
    EXPECT_GE(gap.lost, 3U);
    EXPECT_EQ(gap.from, 0);
    EXPECT_NE(gap.reason.find("gone"), std::string::npos) << gap.reason;
    EXPECT_FALSE(log.take_gap(gap));
}

TEST_F(Recording, OfTheRecorderHoldsWhatTheRingsGaveAndTellsWhatTheyDropped) {
    rt::RealClock clock;
    const auto waiter = clock.make_waiter();
    std::vector<std::string> told;
    Settings settings;
    settings.keep_free_mb = 0;
    Recorder recorder(settings, folder_.string(), clock, *waiter,
                      [&told](Severity, const std::string& text) { told.push_back(text); });
    // GIVEN more samples than the ring holds before the recorder comes to look
    const auto made = samples(20'000, drivers::kSecond);
    recorder.campaign_begun(head());
    Recorder* const running = &recorder;
    for (const auto& sample : made) running->samples().try_push(sample);
    for (int i = 0; i < 10; ++i) running->received().try_push(frame(0x80, i * kPeriod));
    running->sent().try_push(frame(0x200, 3 * kPeriod + 1, true));
    const auto counts = recorder.samples().counts();
    ASSERT_GT(counts.dropped, 0U);
    // WHEN it begins to look: what was there before the campaign is not of it, so once more
    recorder.start();
    while (recorder.samples().counts().popped < counts.pushed) ::usleep(1000);
    for (std::size_t i = 0; i < 100; ++i) {
        auto sample = made[i];
        sample.time += 1000 * drivers::kSecond;
        running->samples().try_push(sample);
    }
    recorder.campaign_ended({"finished", "", "", "{}", head().utc_ns});
    recorder.stop();
    // THEN the file has what came after the beginning, and the gap
    const Campaign read = read_campaign(folder_.string());
    EXPECT_EQ(read.state, "finished");
    ASSERT_GE(read.samples.size(), 100U);
    EXPECT_EQ(read.samples.back().time, made[99].time + 1000 * drivers::kSecond);
    std::uint64_t lost = 0;
    for (const auto& gap : read.gaps) lost += gap.lost;
    EXPECT_EQ(lost, counts.dropped);
    EXPECT_EQ(recorder.status().samples_lost, counts.dropped);
    ASSERT_FALSE(told.empty());
}

TEST_F(Recording, ReplaysToTheSameBitsAndSeesAChangedOne) {
    // GIVEN a campaign of two dwells, as it was the first time
    Campaign campaign;
    campaign.samples = samples(4000, drivers::kSecond);
    for (const int position : {1, 2}) {
        const std::size_t first = position == 1 ? 100 : 2100;
        campaign.orders.push_back({campaign.samples[first - 50].time, campaign.samples[first].time,
                                   campaign.samples[first + 1500].time, 1, position, 9.0, false});
    }
    estimator::Settings settings;
    const auto once = replay(campaign, settings, {});
    ASSERT_EQ(once.dwells.size(), 2U);
    EXPECT_EQ(once.dwells[0].summary.samples, 1500U);
    EXPECT_GT(once.dwells[0].summary.used, 1400U);
    campaign.dwells = once.dwells;
    // WHEN it is replayed, at another speed too
    for (const double speed : {0.0, 2000.0}) {
        const auto again = replay(campaign, settings, {.speed = speed});
        EXPECT_EQ(again.compared, 2U);
        EXPECT_EQ(again.different, 0U) << again.first_difference;
    }
    // THEN one last bit in one sample is seen
    double& angle = campaign.samples[900].angle[1];
    angle = std::nextafter(angle, 1.0);
    EXPECT_GT(replay(campaign, settings, {}).different, 0U);
}

}  // namespace
}  // namespace vibrig::record
