#include "daemon/serve/history.hpp"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tests/unit/daemon/serve/fake_source.hpp"

namespace vibrig::serve {
namespace {

using Json = nlohmann::json;

StatusData at(double time_s, double measured_g, CampaignState state = CampaignState::recording) {
    StatusData status;
    status.time = drivers::from_seconds(time_s);
    status.state = state;
    status.shaker.valid = true;
    status.shaker.measured_g = measured_g;
    return status;
}

TEST(History, KeepsAWholeCampaignInABoundedNumberOfSteps) {
    History history;
    // GIVEN 30 hours, twice a second, with one moment that is out of the ordinary
    constexpr double kEnd_s = 108'000, kMoment_s = 54'321.5;
    double sum = 0;
    std::size_t count = 0;
    for (double t = 0; t < kEnd_s; t += 0.5) {
        const double value = t == kMoment_s ? 11.0 : 5 + t / kEnd_s;
        history.add(at(t, value));
        sum += value;
        ++count;
    }
    // THEN it takes no more room than a minute does, and the moment is still there
    EXPECT_LE(history.steps(), History::kMostSteps);
    EXPECT_GE(history.steps(), History::kMostSteps / 2);
    const Json answer = Json::parse(history.json("measured_g", 0));
    const auto& curve = answer["channels"][0];
    ASSERT_EQ(curve["max"].size(), history.steps());
    ASSERT_EQ(answer["time_s"].size(), history.steps());
    double largest = 0, mean = 0;
    for (std::size_t i = 0; i < history.steps(); ++i) {
        const double least = curve["min"][i], greatest = curve["max"][i], middle = curve["mean"][i];
        EXPECT_LE(least, middle);
        EXPECT_LE(middle, greatest);
        if (greatest == 11.0) {
            const double off = std::abs(answer["time_s"][i].get<double>() - kMoment_s);
            EXPECT_LE(off, answer["step_s"].get<double>());
        }
        largest = std::max(largest, greatest);
        mean += middle;
    }
    EXPECT_EQ(largest, 11.0);
    // Steps of equal length but the last: the mean of the means is nearly that of all.
    EXPECT_NEAR(mean / static_cast<double>(history.steps()), sum / static_cast<double>(count),
                1.0 / static_cast<double>(history.steps()) * 2);
}

TEST(History, GivesWhatCameAfterAMoment) {
    History history;
    for (double t = 100; t < 200; t += 0.5) history.add(at(t, t));
    const Json answer = Json::parse(history.json("measured_g,command_g", 150));
    EXPECT_EQ(answer["time_s"].size(), 100u);
    EXPECT_GE(answer["time_s"][0].get<double>(), 150.0);
    EXPECT_EQ(answer["channels"][1]["name"], "command_g");
    EXPECT_EQ(answer["channels"][0]["unit"], "g");
}

TEST(History, TellsTheCommandFromWhatTheControllerReadsBack) {
    History history;
    StatusData status = at(1, 6.9);
    status.command_table_g = 7.5;
    status.shaker.amplitude_g = 7.0;
    history.add(status);
    status = at(1.5, 0);
    status.shaker.valid = false;  // the link is gone: nothing old goes on
    history.add(status);
    const Json answer = Json::parse(history.json("command_g,set_point_g,measured_g", 0));
    EXPECT_EQ(answer["channels"][0]["mean"][0], 7.5);
    EXPECT_EQ(answer["channels"][1]["mean"][0], 7.0);
    EXPECT_EQ(answer["channels"][1]["unit"], "g");
    EXPECT_EQ(answer["channels"][2]["mean"][0], 6.9);
    EXPECT_TRUE(answer["channels"][1]["mean"][1].is_null());
}

TEST(History, BeginsWithTheCampaign) {
    History history;
    for (double t = 0; t < 50; t += 0.5) history.add(at(t, 0, CampaignState::idle));
    for (double t = 50; t < 60; t += 0.5) history.add(at(t, 5));
    EXPECT_EQ(history.steps(), 20u);
    // A pause in it is no new one, nor is the time after it.
    StatusData later = at(60, 5, CampaignState::finished);
    later.dwells.resize(1);
    history.add(later);
    EXPECT_EQ(history.steps(), 21u);
    // A daemon's clock that goes back is another daemon's.
    history.add(at(1, 5));
    EXPECT_EQ(history.steps(), 1u);
}

TEST(History, LeavesOutWhatIsNotKnown) {
    History history;
    StatusData status = at(1, 5);
    history.add(status);
    status = at(1.5, 0);
    status.shaker.valid = false;
    history.add(status);
    const Json answer = Json::parse(history.json("measured_g,progress", 0));
    EXPECT_EQ(answer["channels"][0]["mean"][0], 5.0);
    EXPECT_TRUE(answer["channels"][0]["mean"][1].is_null());
    EXPECT_TRUE(Json::parse(history.json("innovation_x_arcsec", 0))["time_s"].empty());
    // A platform that has fallen silent keeps no temperature.
    status = at(2, 0);
    status.platform.time = status.time;
    status.platform.temperature_c = 31.25;
    history.add(status);
    status.time += 10 * drivers::kSecond;
    history.add(status);
    const Json warm = Json::parse(history.json("temperature_c", 0));
    ASSERT_EQ(warm["time_s"].size(), 1u);
    EXPECT_EQ(warm["channels"][0]["mean"][0], 31.25);
}

TEST(History, RefusesWhatItDoesNotHave) {
    const History history;
    for (const char* wrong : {"", "nothing", ",", "measured_g,nothing"}) {
        try {
            (void)history.json(wrong, 0);
            ADD_FAILURE() << wrong;
        } catch (const std::invalid_argument& error) {
            EXPECT_NE(std::string(error.what()).find("innovation_x_arcsec"), std::string::npos);
        }
    }
    EXPECT_EQ(Json::parse(history.json("measured_g", 0))["time_s"].size(), 0u);
}

}  // namespace
}  // namespace vibrig::serve
