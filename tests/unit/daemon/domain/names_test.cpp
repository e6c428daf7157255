#include <gtest/gtest.h>

#include <set>
#include <string>

#include "daemon/domain/campaign_state.hpp"
#include "daemon/domain/events.hpp"

namespace vibrig {
namespace {

/// Each value up to the last has a name, no two the same, and nothing beyond it has one.
template <typename Value>
void expect_names(Value last) {
    std::set<std::string> names;
    const int count = static_cast<int>(last) + 1;
    for (int value = 0; value < count; ++value) {
        const std::string name = name_of(static_cast<Value>(value));
        EXPECT_NE(name, "unknown") << value;
        EXPECT_TRUE(names.insert(name).second) << name;
    }
    EXPECT_STREQ(name_of(static_cast<Value>(count)), "unknown") << "this is not the last";
}

TEST(Names, EachStateOfTheCampaignHasOne) { expect_names(CampaignState::commissioning); }

TEST(Names, EachSeverityHasOne) { expect_names(Severity::trip); }

}  // namespace
}  // namespace vibrig
