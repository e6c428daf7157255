#include "tests/plant/recording.hpp"
#include "tests/unit/support/temporary_folder.hpp"

#include <gtest/gtest.h>

#include <fstream>
#include <map>
#include <sstream>

namespace vibrig::plant {
namespace {

std::string recorded(std::uint64_t seed) {
    Truth truth;
    truth.seed = seed;
    CampaignPlan plan;
    plan.positions_deg = {{0, 0, 0}, {45, 0, 90}};
    plan.table_g = {9, 0};
    plan.dwell_s = 4;
    std::ostringstream out;
    EXPECT_EQ(record(truth, plan, out), 4U * 160);
    return out.str();
}

TEST(Recording, HasTheColumnsDwellsAndLevelsOfThePlan) {
    std::istringstream in(recorded(5));
    std::string line;
    ASSERT_TRUE(std::getline(in, line));
    EXPECT_EQ(line, "time_s,run,position,alpha_deg,beta_deg,gamma_deg,ax_g,ay_g,az_g,simulated");
    std::map<std::pair<int, int>, int> samples;
    std::map<std::pair<int, int>, double> kappa;
    double last_time = -1;
    while (std::getline(in, line)) {
        double t = 0, alpha = 0, beta = 0, gamma = 0, x = 0, y = 0, z = 0;
        int run = 0, position = 0;
        ASSERT_EQ(std::sscanf(line.c_str(), "%lf,%d,%d,%lf,%lf,%lf,%lf,%lf,%lf", &t, &run,
                              &position, &alpha, &beta, &gamma, &x, &y, &z),
                  9);
        EXPECT_TRUE(line.ends_with(",1")) << line;
        EXPECT_GT(t, last_time);
        last_time = t;
        ++samples[{run, position}];
        kappa[{run, position}] += (x * x + y * y + z * z) / 160;
        EXPECT_NEAR(alpha, position == 2 ? 45 : 0, 0.2);
    }
    ASSERT_EQ(samples.size(), 4U);
    for (const auto& [dwell, count] : samples) EXPECT_EQ(count, 160);
    // 160 samples are 60 whole periods; the noise of 1e-4 g leaves 2 a0 1e-4 sqrt(...) < 1e-3.
    EXPECT_NEAR((kappa[{1, 1}]), 19, 1e-3);
    EXPECT_NEAR((kappa[{2, 2}]), 1, 1e-4);
}

TEST(Recording, RepeatsByteForByteForASeed) {
    const std::string once = recorded(5);
    EXPECT_EQ(once, recorded(5));
    EXPECT_NE(once, recorded(6));
}

TEST(Positions, AreReadFromAFileAndBadOnesNamed) {
    EXPECT_EQ(read_positions("table1").size(), 14U);
    const TemporaryFolder folder;
    const std::string path = folder.file("positions.csv");
    const auto complaint = [&](const std::string& text) -> std::string {
        std::ofstream(path) << text;
        try {
            static_cast<void>(read_positions(path));
        } catch (const PlantError& error) {
            return error.what();
        }
        return "none";
    };
    EXPECT_EQ(complaint("gamma_deg, note, alpha_deg, beta_deg\n90, a, 45, 0\n\n-45,b,0,1e1\n"),
              "none");
    EXPECT_EQ(read_positions(path), (std::vector<Vec3>{{45, 0, 90}, {0, 10, -45}}));
    EXPECT_NE(complaint("alpha_deg,beta_deg\n1,2\n").find(":1: no column gamma_deg"),
              std::string::npos);
    EXPECT_NE(complaint("alpha_deg,beta_deg,gamma_deg\n1,x,2\n").find(":2: beta_deg: found \"x\""),
              std::string::npos);
    EXPECT_NE(complaint("alpha_deg,beta_deg,gamma_deg\n1,0,nan\n").find("gamma_deg"),
              std::string::npos);
    EXPECT_NE(complaint("alpha_deg,beta_deg,gamma_deg\n1,90,0\n").find("80"), std::string::npos);
    EXPECT_NE(complaint("").find("no positions"), std::string::npos);
    EXPECT_THROW(static_cast<void>(read_positions(folder.file("absent.csv"))), PlantError);
}

TEST(Recording, FollowsAnOrderAndTellsTheMeanOfWhatDrifts) {
    Truth truth;
    truth.bias_step_deg_h = {0.4, 0, 0};
    truth.step_after_dwell = 3;
    CampaignPlan plan;
    plan.positions_deg = {{0, 0, 0}, {0, 0, 1}};
    plan.table_g = {2, 0};
    plan.dwell_s = 1;
    plan.order = parse_order("2.1,1.2, 1.1,2.2");
    std::vector<std::pair<std::size_t, std::size_t>> seen;
    std::ostringstream out;
    std::array<GyroCoefficients, 3> mean{};
    EXPECT_EQ(record(truth, plan, out, &mean), 160U);
    std::istringstream lines(out.str());
    std::string line;
    std::getline(lines, line);
    while (std::getline(lines, line)) {
        std::size_t run = 0, position = 0;
        ASSERT_EQ(std::sscanf(line.c_str(), "%*f,%zu,%zu", &run, &position), 2) << line;
        if (seen.empty() || seen.back() != std::pair(run, position))
            seen.emplace_back(run, position);
    }
    EXPECT_EQ(seen, plan.order);
    EXPECT_NEAR(mean[0][kF], 1 + 0.4 / 4, 1e-12);
    EXPECT_NEAR(mean[1][kF], -1, 1e-12);
    for (const char* bad : {"1", "1.2.3", "a.1", "1.1,,2.1", "0x1.1"})
        EXPECT_THROW(static_cast<void>(parse_order(bad)), PlantError) << bad;
    plan.order = parse_order("3.1");
    EXPECT_THROW(record(truth, plan, out), PlantError);
}

}  // namespace
}  // namespace vibrig::plant
