#include "daemon/record/recorder.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <string>
#include <vector>

#include "daemon/record/campaign_file.hpp"
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

}  // namespace
}  // namespace vibrig::record
