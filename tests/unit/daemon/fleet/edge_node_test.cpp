#include "daemon/fleet/edge_node.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <map>
#include <random>
#include <set>

#include "proto/sparkplug.pb.h"
#include "tests/unit/daemon/serve/fake_source.hpp"

// What is published to a Sparkplug B host; tests/hil/mqtt.py reads the same through a broker.
namespace vibrig::fleet {
namespace {

sparkplug::Payload parsed(const std::string& bytes) {
    sparkplug::Payload payload;
    EXPECT_TRUE(payload.ParseFromString(bytes));
    return payload;
}

TEST(EdgeNode, ABirthNamesEverythingOnceAndDataWhatChanged) {
    EdgeNode node;
    node.next_session();
    StatusData status = serve::full_status();
    const auto birth = parsed(node.birth(status));
    EXPECT_EQ(birth.seq(), 0u);
    EXPECT_EQ(birth.metrics(0).name(), "bdSeq");
    EXPECT_EQ(birth.metrics(0).long_value(), 0u);
    std::set<std::string> names;
    std::set<std::uint64_t> aliases;
    std::uint64_t state = 0, sigma = 0;
    bool simulated = false;
    for (const auto& metric : birth.metrics()) {
        if (metric.name() == "Properties/SIMULATED") simulated = metric.boolean_value();
        EXPECT_TRUE(names.insert(metric.name()).second) << metric.name();
        const bool fresh = !metric.has_alias() || aliases.insert(metric.alias()).second;
        EXPECT_TRUE(fresh) << metric.name();
        if (metric.name() == "Campaign/State") state = metric.alias();
        if (metric.name() == "Coefficients/D_Fx/Sigma") sigma = metric.alias();
    }
    EXPECT_TRUE(simulated);
    EXPECT_EQ(aliases.size() + 2, names.size());
    EXPECT_TRUE(node.data(status).empty()) << "nothing has changed";
    status.state = CampaignState::tripped;
    status.estimate.sigma[0] = std::numeric_limits<double>::quiet_NaN();
    const auto data = parsed(node.data(status));
    ASSERT_EQ(data.metrics_size(), 2);
    EXPECT_EQ(data.seq(), 1u);
    EXPECT_EQ(data.metrics(0).alias(), state);
    EXPECT_EQ(data.metrics(0).string_value(), "tripped");
    EXPECT_FALSE(data.metrics(0).has_name());
    EXPECT_EQ(data.metrics(1).alias(), sigma);
    EXPECT_TRUE(data.metrics(1).is_null()) << "never NaN";
    EXPECT_TRUE(node.data(status).empty()) << "null is as null as before";
}

TEST(EdgeNode, NumbersGoRoundAt256) {
    EdgeNode node;
    StatusData status = serve::full_status();
    for (std::uint64_t session = 0; session < 300; ++session) {
        node.next_session();
        EXPECT_EQ(parsed(node.death(0)).metrics(0).long_value(), session % 256);
        EXPECT_FALSE(parsed(node.death(0)).has_seq());
    }
    (void)node.birth(status);
    for (std::uint64_t sequence = 1; sequence < 600; ++sequence) {
        ++status.assembler.samples;
        ASSERT_EQ(parsed(node.data(status)).seq(), sequence % 256);
    }
    EXPECT_EQ(parsed(node.birth(status)).seq(), 0u) << "a birth begins anew";
    ++status.assembler.samples;
    EXPECT_EQ(parsed(node.data(status)).seq(), 1u);
}

TEST(EdgeNode, TakesNothingButARebirth) {
    sparkplug::Payload command;
    auto& metric = *command.add_metrics();
    metric.set_name("Node Control/Rebirth");
    EXPECT_FALSE(EdgeNode::asks_for_birth(command.SerializeAsString())) << "no value";
    metric.set_boolean_value(false);
    EXPECT_FALSE(EdgeNode::asks_for_birth(command.SerializeAsString()));
    metric.set_boolean_value(true);
    const std::string good = command.SerializeAsString();
    EXPECT_TRUE(EdgeNode::asks_for_birth(good));
    metric.set_name("Campaign/State");
    EXPECT_FALSE(EdgeNode::asks_for_birth(command.SerializeAsString()));
    EXPECT_FALSE(EdgeNode::asks_for_birth(""));
    constexpr unsigned kSeed = 42;
    std::mt19937 random(kSeed);
    for (int i = 0; i < 20'000; ++i) {
        std::string spoilt = good;
        spoilt[random() % spoilt.size()] = static_cast<char>(random());
        spoilt.resize(random() % (spoilt.size() + 1));
        (void)EdgeNode::asks_for_birth(spoilt);
    }
}

/// By name, as born; the type stays what it is where the value is null.
std::map<std::string, sparkplug::Payload::Metric> born(const StatusData& status) {
    EdgeNode node;
    std::map<std::string, sparkplug::Payload::Metric> metrics;
    const auto birth = parsed(node.birth(status));
    for (const auto& metric : birth.metrics()) metrics[metric.name()] = metric;
    return metrics;
}

TEST(EdgeNode, SaysNothingOfWhatIsNotKnown) {
    constexpr std::uint32_t kBoolean = 11, kDouble = 10;
    // GIVEN a shaker that is not read, with its emergency stop open when it was
    StatusData status = serve::full_status();
    auto well = born(status);
    EXPECT_TRUE(well["Shaker/Emergency stop open"].boolean_value());
    status.shaker.valid = false;
    auto blind = born(status);
    // THEN nobody is told that the chain is closed, or that nothing runs
    for (const char* name : {"Shaker/Emergency stop open", "Shaker/Running"}) {
        EXPECT_TRUE(blind[name].is_null()) << name;
        EXPECT_FALSE(blind[name].has_boolean_value()) << name;
        EXPECT_EQ(blind[name].datatype(), kBoolean) << name;
    }
    // GIVEN a platform that was ready and has said nothing for ten seconds
    status = serve::full_status();
    status.platform.ready = true;
    EXPECT_TRUE(born(status)["Platform/Ready"].boolean_value());
    status.time += 10 * drivers::kSecond;
    auto silent = born(status);
    // THEN it is not said to be ready, nor to have the temperature of then
    EXPECT_TRUE(silent["Platform/Ready"].is_null());
    EXPECT_TRUE(silent["Platform/Temperature"].is_null());
    EXPECT_EQ(silent["Platform/Temperature"].datatype(), kDouble);
}

TEST(EdgeNode, MendsTextThatIsNotUtf8) {
    EdgeNode node;
    StatusData status = serve::full_status();
    status.reason = "\xff\xfe";
    EXPECT_NE(node.birth(status).find("??"), std::string::npos);
}

}  // namespace
}  // namespace vibrig::fleet
