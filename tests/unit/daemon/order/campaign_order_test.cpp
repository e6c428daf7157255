#include "daemon/order/campaign_order.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <map>
#include <string>
#include <tuple>
#include <vector>

#include "tests/unit/daemon/configuration/support.hpp"
#include "tests/unit/support/temporary_folder.hpp"

// The order of a plan's dwells: sines of several frequencies, random vibration, rest, held out.
namespace vibrig {
namespace {

using Stops = std::vector<campaign::Stop>;

/// Block by block: 15 Hz, 65 Hz, rest, random, and three held out at the end.
class PlanOrder : public ::testing::Test {
  protected:
    PlanOrder() {
        const std::array<const char*, 14> at{
            "0,0,0",   "0,0,45",   "0,0,90",    "0,0,180", "180,0,45", "45,0,0",  "45,0,90",
            "90,0,90", "90,0,180", "180,0,270", "270,0,0", "270,0,90", "-45,0,0", "-45,0,90"};
        std::ofstream plan(folder_.file("plan.csv"));
        plan << "alpha_deg,beta_deg,gamma_deg,table_g,frequency_hz,profile,level_db,role\n";
        for (const char* one : at) plan << one << ",6,15,,,\n";
        for (std::size_t i = 0; i < 14; i += 2) plan << at[i] << ",6,65.1,,,\n";
        for (std::size_t i = 0; i < 14; i += 2) plan << at[i] << ",0,0,,,\n";
        for (std::size_t i = 1; i < 14; i += 2) plan << at[i] << ",,,broad,-1.5,\n";
        for (std::size_t i = 1; i < 6; i += 2) plan << at[i] << ",,,broad,-1.5,verify\n";
    }

    [[nodiscard]] Stops stops(const std::string& order) const {
        std::string text = "[campaign]\nplan = \"" + folder_.file("plan.csv") + "\"\n";
        if (!order.empty()) text += "order = \"" + order + "\"\n";
        text += R"(
[spectrum]
mode = "mixed"
mount = "hard"
[shaker.registers]
mode = { address = 8 }
profile_number = { address = 9 }
profile_level_db = { address = 10 }
profile_checksum = { address = 5 }
measured_g_rms = { address = 7 }
control_state = { address = 9 }
[[profile]]
name = "broad"
number = 4
at = "table"
psd = [[20, 0.02], [120, 0.02]]
)";
        return put_in_order(
                   configuration::parse(configuration::as_simulated(text, true), "rig.toml", true))
            .configuration.campaign.stops;
    }

    TemporaryFolder folder_;
};

using Key = std::tuple<std::array<double, 3>, double, double, bool>;
Key key_of(const campaign::Stop& stop) {
    return {stop.position_deg, stop.table_g, stop.kind(), stop.verify};
}
std::vector<Key> keys_of(const Stops& stops) {
    std::vector<Key> keys;
    for (const auto& stop : stops) keys.push_back(key_of(stop));
    return keys;
}
/// Mean place of each kind's dwells, rest apart, relative to the middle; in lengths of the list.
std::map<std::pair<double, bool>, double> off_middle(const Stops& stops) {
    std::map<std::pair<double, bool>, std::pair<double, int>> sums;
    for (std::size_t i = 0; i < stops.size(); ++i) {
        if (stops[i].verify) continue;
        auto& [sum, count] = sums[{stops[i].kind(), stops[i].table_g > 0}];
        sum += (static_cast<double>(i) + 0.5) / static_cast<double>(stops.size()) - 0.5;
        ++count;
    }
    std::map<std::pair<double, bool>, double> out;
    for (const auto& [kind, sum] : sums) out[kind] = sum.first / sum.second;
    return out;
}

TEST_F(PlanOrder, StandsAsThePlanHasItUnlessAnOrderIsStated) {
    const Stops as_listed = stops("");
    ASSERT_EQ(as_listed.size(), 38U);
    EXPECT_EQ(as_listed[0].frequency_hz, 15);
    EXPECT_TRUE(as_listed[37].verify);
    EXPECT_EQ(keys_of(as_listed), keys_of(stops("sequential")));
}

TEST_F(PlanOrder, BalancedSpreadsFrequenciesProfilesAndRestOverTime) {
    // GIVEN the plan block by block, of which the last 65 Hz dwells lie off the middle by 0.03 to
    // 0.4 of its length WHEN balance is asked for
    const Stops balanced = stops("balanced");
    // THEN it is the same dwells
    auto listed = keys_of(stops("")), found = keys_of(balanced);
    std::sort(listed.begin(), listed.end());
    std::sort(found.begin(), found.end());
    EXPECT_EQ(found, listed);
    // AND no kind lies early or late: a trend of the bias would look like its coefficients. By
    // chance seven of 35 places have a mean with a standard deviation of 0.1.
    double worst_listed = 0;
    for (const auto& [kind, off] : off_middle(stops("")))
        worst_listed = std::max(worst_listed, std::abs(off));
    EXPECT_GT(worst_listed, 0.3);
    for (const auto& [kind, off] : off_middle(balanced))
        EXPECT_LT(std::abs(off), 0.1) << kind.first << " " << kind.second;
    // AND those held out lie among the others, in thirds of the campaign
    std::vector<std::size_t> held;
    for (std::size_t i = 0; i < balanced.size(); ++i)
        if (balanced[i].verify) held.push_back(3 * i / balanced.size());
    EXPECT_EQ(held, (std::vector<std::size_t>{0, 1, 2}));
    // AND it is the same each time: a resumed campaign goes on with it
    EXPECT_EQ(keys_of(stops("balanced")), keys_of(balanced));
}

TEST_F(PlanOrder, ByChanceIsTheSameDwellsInAnotherOrder) {
    const Stops random = stops("random");
    auto listed = keys_of(stops("")), found = keys_of(random);
    EXPECT_NE(found, listed);
    std::sort(listed.begin(), listed.end());
    std::sort(found.begin(), found.end());
    EXPECT_EQ(found, listed);
}

}  // namespace
}  // namespace vibrig
