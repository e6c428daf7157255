#include "daemon/record/recorder.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include "daemon/record/campaign_file.hpp"
#include "daemon/record/dwells_csv.hpp"
#include "daemon/rt/real_clock.hpp"
#include "tests/unit/daemon/record/recording.hpp"

namespace vibrig::record {
namespace {

TEST_F(Recording, OfTheRecorderHoldsWhatTheRingsGaveAndTellsWhatTheyDropped) {
    rt::RealClock clock;
    const auto waiter = clock.make_waiter();
    std::vector<std::string> reported;
    configuration::RecordSettings settings;
    settings.keep_free_mb = 0;
    Recorder recorder(settings, folder_.string(), clock, *waiter,
                      [&reported](Severity, const std::string& text) { reported.push_back(text); });
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
    recorder.sign_with(
        [](std::uint64_t entry) { return std::optional("head of " + std::to_string(entry)); });
    recorder.start();
    while (recorder.samples().counts().popped < counts.pushed) ::usleep(1000);
    for (std::size_t i = 0; i < 100; ++i) {
        auto sample = made[i];
        sample.time += 1000 * drivers::kSecond;
        running->samples().try_push(sample);
    }
    recorder.campaign_ended({"finished", "", "", "{}", head().utc_ns, 7});
    recorder.stop();
    // THEN the file has what came after the beginning, and the gap
    const Campaign read = read_campaign(folder_.string());
    EXPECT_EQ(read.state, "finished");
    EXPECT_EQ(read.head.journal_head, "head of 7") << "the one with the campaign's end in it";
    ASSERT_GE(read.samples.size(), 100U);
    EXPECT_EQ(read.samples.back().time, made[99].time + 1000 * drivers::kSecond);
    std::uint64_t lost = 0;
    for (const auto& gap : read.gaps) lost += gap.lost;
    EXPECT_EQ(lost, counts.dropped);
    EXPECT_EQ(recorder.status().samples_lost, counts.dropped);
    ASSERT_FALSE(reported.empty());
}

/// A recorder whose folder is no folder at first: as a disk that refuses, and for root too.
class RecorderWithoutDisk : public Recording {
  protected:
    void wait(const auto& until) const {
        for (int i = 0; i < 10'000 && !until(); ++i) ::usleep(1000);
        ASSERT_TRUE(until());
    }
    Recorder made() {
        settings_.keep_free_mb = 0;
        settings_.flush_s = 0.01;
        return {settings_, there_.string(), clock_, *waiter_, [](Severity, const std::string&) {}};
    }
    static rt::DwellOrder order(int position) {
        rt::DwellOrder order;
        order.from = position * drivers::kSecond;
        order.to = order.from + 10 * drivers::kSecond;
        order.dwell.run = 1;
        order.dwell.position = position;
        order.dwell.table_g = 9;
        return order;
    }
    static Dwell dwell(int position) {
        Dwell dwell;
        dwell.summary.run = 1;
        dwell.summary.position = position;
        return dwell;
    }
    static Head named(const char* name) {
        Head of = head();
        of.name = name;
        return of;
    }

    const fs::path there_ = folder_ / "recordings";
    rt::RealClock clock_;
    const std::unique_ptr<drivers::Waiter> waiter_ = clock_.make_waiter();
    configuration::RecordSettings settings_;
};

TEST_F(RecorderWithoutDisk, GivesTheNextCampaignNothingOfTheOneBefore) {
    // GIVEN a campaign that no disk took
    std::ofstream(there_) << "no folder";
    Recorder recorder = made();
    recorder.start();
    recorder.campaign_begun(named("first"));
    recorder.ordered(order(1), drivers::kSecond, {});
    recorder.dwell_done(dwell(1));
    recorder.campaign_ended({"finished", "", "", "{}", head().utc_ns});
    wait([&] { return !recorder.status().recording && !recorder.status().note.empty(); });
    EXPECT_EQ(recorder.status().entries_dropped, 2U) << "its order and its dwell";
    // WHEN the disk is there again for the next one
    fs::remove(there_);
    recorder.campaign_begun(named("second"));
    recorder.ordered(order(2), 2 * drivers::kSecond, {});
    recorder.dwell_done(dwell(2));
    recorder.campaign_ended({"finished", "", "", "{}", head().utc_ns});
    recorder.stop();
    // THEN its file, and the table beside it, have its own dwell alone
    const Campaign read = read_campaign(there_.string());
    EXPECT_EQ(read.head.name, "second");
    ASSERT_EQ(read.orders.size(), 1U);
    EXPECT_EQ(read.orders[0].position, 2);
    ASSERT_EQ(read.dwells.size(), 1U);
    EXPECT_EQ(read.dwells[0].summary.position, 2);
    const std::string lines = file(fs::path(read.folder) / "dwells.csv");
    EXPECT_EQ(std::ranges::count(lines, '\n'), 2) << lines;
}

TEST_F(RecorderWithoutDisk, TellsInItsTableOfDwellsWhatWasOrderedMeanwhile) {
    // GIVEN a campaign that no disk takes, and two dwells of it
    std::ofstream(there_) << "no folder";
    Recorder recorder = made();
    recorder.start();
    recorder.campaign_begun(named("first"));
    recorder.ordered(order(1), drivers::kSecond, {});
    recorder.ordered(order(2), 2 * drivers::kSecond, {});
    wait([&] { return !recorder.status().note.empty(); });
    // WHEN one does
    fs::remove(there_);
    wait([&] { return recorder.status().note.empty() && !recorder.status().file.empty(); });
    recorder.ordered(order(3), 3 * drivers::kSecond, {});
    recorder.campaign_ended({"finished", "", "", "{}", head().utc_ns});
    recorder.stop();
    // THEN all three are there, in their order
    const Campaign read = read_campaign(there_.string());
    ASSERT_EQ(read.orders.size(), 3U);
    const std::string lines = file(fs::path(read.folder) / "dwells.csv");
    EXPECT_EQ(lines.rfind(kDwellsHeader, 0), 0U) << lines;
    for (const char* line : {"\n1,1,9,", "\n1,2,9,", "\n1,3,9,"})
        EXPECT_NE(lines.find(line), std::string::npos) << lines;
}

}  // namespace
}  // namespace vibrig::record
