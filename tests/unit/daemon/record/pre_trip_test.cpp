#include "daemon/record/pre_trip.hpp"
#include "tests/unit/support/temporary_folder.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>

namespace vibrig::record {
namespace {

using drivers::kMillisecond;
using drivers::kSecond;
using drivers::Time;

struct PreTripTest : testing::Test {
    const TemporaryFolder temporary;
    const std::filesystem::path folder = temporary / "of_the_test";  // not there at first
    std::vector<EventRecord> events;
    std::mutex mutex;
    std::vector<std::pair<Severity, std::string>> reported;

    PreTrip make(const std::filesystem::path& where) {
        return {where.string(), 25 * kMillisecond, [this] { return events; },
                [this](Severity severity, const std::string& text) {
                    const std::lock_guard lock(mutex);
                    reported.emplace_back(severity, text);
                }};
    }
    static drivers::Sample sample(std::uint32_t n) {
        drivers::Sample s;
        s.time = n * 25 * kMillisecond;
        s.sequence = n;
        s.angle = {0, 0, 0.5};
        s.force = {0, 1, std::numeric_limits<double>::quiet_NaN()};
        s.quality[2] = drivers::Quality::stale;
        return s;
    }
    [[nodiscard]] std::vector<nlohmann::json> lines() const {
        std::vector<nlohmann::json> found;
        for (const auto& entry : std::filesystem::directory_iterator(folder)) {
            EXPECT_EQ(entry.path().filename(), "trip-20010909T014640.250Z-tilt.jsonl");
            std::ifstream file(entry.path());
            for (std::string line; std::getline(file, line);)
                found.push_back(nlohmann::json::parse(line));
        }
        return found;
    }
};

TEST_F(PreTripTest, SavesTheLastMinuteOfSamplesAndEvents) {
    // GIVEN two minutes of samples and events
    PreTrip pre_trip = make(folder);
    pre_trip.start();
    constexpr std::uint32_t kLast = 4800;
    for (std::uint32_t n = 1; n <= kLast; ++n) {
        while (!pre_trip.samples().try_push(sample(n)))
            std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    const Time now = kLast * 25 * kMillisecond;
    events = {{1, 0, now - 61 * kSecond, Severity::info, "can", "too old"},
              {2, 0, now - kSecond, Severity::alarm, "interlock", "tilt_alarm: \xff"},
              {3, 0, now, Severity::trip, "campaign", "stop ordered"}};
    // WHEN it trips
    pre_trip.tripped(
        {"tilt", "tilt_abort", "the platform has tilted", now, 1'000'000'000'250'000'000});
    pre_trip.stop();
    // THEN there is one whole file: the cause, two events, the samples of the last minute in order
    const auto found = lines();
    ASSERT_EQ(found.size(), 1 + 2 + 2401U);
    EXPECT_EQ(found[0]["trip"], "tilt_abort");
    EXPECT_EQ(found[0]["text"], "the platform has tilted");
    EXPECT_NEAR(found[0]["time_s"].get<double>(), 120, 1e-9);
    EXPECT_EQ(found[1]["severity"], "alarm");
    EXPECT_EQ(found[2]["event"], "stop ordered");
    for (std::size_t i = 0; i <= 2400; ++i) ASSERT_EQ(found[3 + i]["sequence"], kLast - 2400 + i);
    const auto& last = found.back();
    EXPECT_NEAR(last["angle_deg"][2].get<double>(), 28.6479, 1e-4);
    EXPECT_TRUE(last["force_g"][2].is_null());
    EXPECT_EQ(last["quality"]["azimuth"], "stale");
    EXPECT_EQ(last["quality"]["outer"], "good");
    ASSERT_EQ(reported.size(), 1U);
    EXPECT_EQ(reported[0].first, Severity::info);
}

TEST_F(PreTripTest, ARateThatNobodyHasStatedIsRefused) {
    EXPECT_THROW(PreTrip(folder.string(), 0, nullptr, nullptr), std::invalid_argument);
}

TEST_F(PreTripTest, SaysSoWhenItCannotBeSavedAndLeavesNothingHalf) {
    // GIVEN a file where the folder should be
    std::ofstream(folder.string()) << "x";
    PreTrip pre_trip = make(folder / "trips");
    pre_trip.start();
    pre_trip.tripped({"tilt", "tilt", "tilted", 0, 0});
    pre_trip.stop();
    ASSERT_EQ(reported.size(), 1U);
    EXPECT_EQ(reported[0].first, Severity::alarm);
    EXPECT_THAT(reported[0].second, testing::HasSubstr("cannot save what was before the trip"));
}

}  // namespace
}  // namespace vibrig::record
