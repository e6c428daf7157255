#include "daemon/serve/event_log.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <thread>

#include "daemon/domain/campaign_state.hpp"

namespace vibrig::serve {
namespace {

EventRecord event(const std::string& text) {
    EventRecord record;
    record.text = text;
    return record;
}

TEST(EventLog, NumbersEventsFromOneAndGivesThemOldestFirst) {
    EventLog log;
    EXPECT_TRUE(log.after(0, 10).empty());
    EXPECT_EQ(log.append(event("a")), 1u);
    EXPECT_EQ(log.append(event("b")), 2u);
    EXPECT_EQ(log.append(event("c")), 3u);

    const auto all = log.after(0, 10);
    ASSERT_EQ(all.size(), 3u);
    EXPECT_EQ(all[0].id, 1u);
    EXPECT_EQ(all[2].text, "c");
    const auto later = log.after(1, 1);
    ASSERT_EQ(later.size(), 1u);
    EXPECT_EQ(later[0].text, "b");
    EXPECT_TRUE(log.after(3, 10).empty());
    EXPECT_TRUE(log.after(std::numeric_limits<std::uint64_t>::max(), 10).empty());
    EXPECT_TRUE(log.after(0, 0).empty());
}

TEST(EventLog, ForgetsTheOldestWhenFullAndKeepsCounting) {
    EventLog log(3);
    for (int i = 1; i <= 10; ++i) log.append(event(std::to_string(i)));
    const auto all = log.after(0, 100);
    ASSERT_EQ(all.size(), 3u);
    EXPECT_EQ(all[0].id, 8u);
    EXPECT_EQ(all[0].text, "8");
    EXPECT_EQ(all[2].id, 10u);
    EXPECT_EQ(log.after(8, 100).size(), 2u);
    EXPECT_EQ(log.after(5, 1).at(0).id, 8u);
}

TEST(EventLog, LosesNothingBetweenThreads) {
    constexpr int kEach = 2000;
    EventLog log(3 * kEach);
    {
        std::vector<std::jthread> writers;
        for (int w = 0; w < 3; ++w) {
            writers.emplace_back([&log] {
                for (int i = 0; i < kEach; ++i) log.append(event("x"));
            });
        }
        std::uint64_t seen = 0;
        while (seen < 3 * kEach) {
            for (const EventRecord& record : log.after(seen, 100)) ASSERT_EQ(record.id, ++seen);
            std::this_thread::yield();
        }
    }
    EXPECT_TRUE(log.after(3 * kEach, 1).empty());
}

TEST(Names, EveryCampaignStateAndSeverityHasOne) {
    EXPECT_STREQ(name_of(CampaignState::idle), "idle");
    EXPECT_STREQ(name_of(CampaignState::tripped), "tripped");
    EXPECT_STREQ(name_of(static_cast<CampaignState>(200)), "unknown");
    EXPECT_STREQ(name_of(Severity::alarm), "alarm");
}

}  // namespace
}  // namespace vibrig::serve
