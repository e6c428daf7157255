#include "daemon/campaign/safety_proof.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vibrig::campaign {
namespace {

using ::testing::HasSubstr;

constexpr std::int64_t kHour = 3'600'000'000'000;
constexpr std::int64_t kNow = 1'800'000'000'000'000'000;
constexpr const char* kKeys = "can.sample_rate_hz=40\nshaker.port=502\n";

ProofSettings demanded(const std::string& keys = kKeys) {
    ProofSettings settings;
    settings.keys = keys;
    return settings;
}

ProofRecord proved(SafetyProof& proof, std::int64_t utc_ns, double stop_s = 1.2) {
    proof.begin("Ada", 0.5);
    proof.row("stop, platform", "s", stop_s, 0, 6);
    proof.row("watchdog, the controller says fault", true);
    proof.record().pads = {0.5, 0.4, 6.0};
    return proof.conclude(utc_ns, "");
}

TEST(SafetyProof, NothingIsArmedWithoutOne) {
    SafetyProof proof(demanded());
    EXPECT_THAT(proof.refusal(kNow), HasSubstr("there is no proof"));
    EXPECT_THAT(proof.refusal(kNow), HasSubstr("vibrig selftest --by"));
    // AND a simulated rig is not asked for one
    ProofSettings none = demanded();
    none.demanded = false;
    EXPECT_EQ(SafetyProof(none).refusal(kNow), "");
}

TEST(SafetyProof, HoldsForItsTimeAndNotBeforeItWasMade) {
    SafetyProof proof(demanded());
    EXPECT_TRUE(proved(proof, kNow).passed);
    EXPECT_EQ(proof.refusal(kNow), "");
    EXPECT_EQ(proof.refusal(kNow + 168 * kHour), "");
    EXPECT_THAT(proof.refusal(kNow + 169 * kHour), HasSubstr("169.0 h old, valid for 168 h"));
    EXPECT_THAT(proof.refusal(kNow - kHour), HasSubstr("in the future"));
}

TEST(SafetyProof, TheNewestWordCounts) {
    SafetyProof proof(demanded());
    proved(proof, kNow);
    // GIVEN a stop that took too long WHEN it was the newest
    EXPECT_FALSE(proved(proof, kNow + kHour, 7).passed);
    // THEN the older one that passed is worth nothing, and the row is named with its band
    EXPECT_THAT(proof.refusal(kNow + kHour), HasSubstr("stop, platform 7 s, expected 0 to 6"));
    // AND what was not completed proves nothing either
    proof.begin("Ada", 0.5);
    EXPECT_FALSE(proof.conclude(kNow + 2 * kHour, "not completed: aborted").passed);
    EXPECT_THAT(proof.refusal(kNow + 2 * kHour), HasSubstr("not completed: aborted"));
}

TEST(SafetyProof, ARunAtZeroProvesNoSafeState) {
    SafetyProof proof(demanded());
    const auto at_zero = [&](bool passed) {
        proof.begin("Ada", 0);
        proof.row("watchdog at 0 g, not fed", "s", passed ? 1.5 : 1e3, 0.75, 2);
        return proof.conclude(kNow, "").passed;
    };
    EXPECT_TRUE(at_zero(true));
    EXPECT_TRUE(proof.ran_at_zero());
    EXPECT_THAT(proof.refusal(kNow), HasSubstr("there is no proof"));
    proved(proof, kNow);
    EXPECT_EQ(proof.refusal(kNow), "");
    // A later one takes nothing away, as long as it passes.
    EXPECT_TRUE(at_zero(true));
    EXPECT_EQ(proof.refusal(kNow), "");
    EXPECT_EQ(proof.pads().level_g, 0.5);
    EXPECT_FALSE(at_zero(false));
    EXPECT_THAT(proof.refusal(kNow), HasSubstr("watchdog at 0 g, not fed 1000 s"));
    // AND a proof that failed is not made good by one
    EXPECT_FALSE(proved(proof, kNow + kHour, 7).passed);
    EXPECT_TRUE(at_zero(true));
    EXPECT_THAT(proof.refusal(kNow + kHour), HasSubstr("stop, platform 7 s"));
}

TEST(SafetyProof, SaysWhatHasChangedSince) {
    SafetyProof before(demanded());
    const ProofRecord record = proved(before, kNow);
    // GIVEN the same record and another configuration
    SafetyProof after(demanded("can.sample_rate_hz=40\nshaker.port=503\nshaker.unit=1\n"));
    after.take_over({record});
    EXPECT_THAT(after.refusal(kNow), HasSubstr("shaker.port is 503, was proved with 502"));
    EXPECT_THAT(after.refusal(kNow), HasSubstr("shaker.unit is 1, was not known then"));
    SafetyProof less(demanded("can.sample_rate_hz=40\n"));
    less.take_over({record});
    EXPECT_THAT(less.refusal(kNow), HasSubstr("shaker.port is gone, was 502"));
}

TEST(SafetyProof, OfAnotherControllerItCountsForNothing) {
    SafetyProof proof(demanded());
    proof.device_is("ACME VC-3");
    proof.begin("Ada", 0);
    proof.conclude(kNow, "");
    proved(proof, kNow);
    EXPECT_TRUE(proof.ran_at_zero());
    EXPECT_EQ(proof.refusal(kNow), "");
    proof.device_is("OTHER 7");
    EXPECT_FALSE(proof.ran_at_zero());
    EXPECT_TRUE(proof.with_these_keys().empty());
    EXPECT_THAT(proof.refusal(kNow),
                HasSubstr("the shaker's controller is \"OTHER 7\", was \"ACME VC-3\""));
    // AND until it has said who it is each counts, of an earlier life, too
    SafetyProof again(demanded());
    again.take_over({*proof_from_json(to_json(proof.history().back()))});
    EXPECT_EQ(again.refusal(kNow), "");
    again.device_is("OTHER 7");
    EXPECT_THAT(again.refusal(kNow), HasSubstr("was \"ACME VC-3\""));
}

TEST(SafetyProof, ARecordSurvivesTheJournal) {
    SafetyProof proof(demanded());
    ProofRecord record = proved(proof, kNow);
    record.transmissions = {{25.1, 0.3}, {65.1, 0.06}};
    const auto read = proof_from_json(to_json(record));
    ASSERT_TRUE(read);
    SafetyProof after(demanded()), other(demanded("can.sample_rate_hz=41\n"));
    after.take_over({*read});
    other.take_over({*read});
    EXPECT_EQ(after.transmissions(), record.transmissions);
    EXPECT_TRUE(other.transmissions().empty());
    EXPECT_EQ(to_json(*read), to_json(record));
    EXPECT_EQ(read->keys_sha256, sha256(kKeys));
    // AND what is no record is none
    for (const char* bad : {"", "{", "[]", "{\"by\":1}", "null"})
        EXPECT_FALSE(proof_from_json(bad)) << bad;
}

TEST(SafetyProof, SaysWhichStopTakesLongerThanItDid) {
    SafetyProof proof(demanded());
    // GIVEN a year of proofs whose times scatter by a poll or so
    for (int week = 0; week < 50; ++week) {
        proved(proof, kNow + week * 168 * kHour, 0.8 + 0.03 * (week % 4));
        EXPECT_EQ(proof.trend(), "") << week;
    }
    // WHEN the contactor sticks for half a second THEN the newest says so, and still passes
    EXPECT_TRUE(proved(proof, kNow + 50 * 168 * kHour, 1.4).passed);
    EXPECT_THAT(proof.trend(), HasSubstr("stop, platform takes longer: 1.40 s, 0.8"));
    EXPECT_THAT(proof.trend(), HasSubstr("of 50 earlier"));
    // AND a creeping wear shows against the median of all before it
    SafetyProof creeping(demanded());
    for (int week = 0; week < 50; ++week)
        proved(creeping, kNow + week * 168 * kHour, 0.8 + (week > 25 ? 0.02 * (week - 25) : 0));
    EXPECT_THAT(creeping.trend(), HasSubstr("takes longer"));
    // AND a few tell nothing
    SafetyProof young(demanded());
    for (int week = 0; week < 3; ++week) proved(young, kNow + week * kHour, 0.5 + week);
    EXPECT_EQ(young.trend(), "");
}

TEST(SafetyProof, ARecordingKeepsTheNewestWholeAndTheTimesOfAll) {
    SafetyProof proof(demanded());
    EXPECT_EQ(proof.recording_json(), "");
    proved(proof, kNow, 1.0);
    proved(proof, kNow + kHour, 1.1);
    const std::string json = proof.recording_json();
    EXPECT_THAT(json, HasSubstr("\"keys_sha256\":\"" + sha256(kKeys)));
    EXPECT_THAT(json, HasSubstr("\"by\":\"Ada\""));
    EXPECT_THAT(json, HasSubstr("{\"stop, platform\":1.0}"));
    EXPECT_THAT(json, HasSubstr("{\"stop, platform\":1.1}"));
}

TEST(SafetyProof, KeepsTheMeasuredTransmissionForTheConfigurationItWasMeasuredWith) {
    SafetyProof proof(demanded());
    EXPECT_FALSE(proof.transmission());
    proof.begin("Ada", 0.5);
    proof.record().transmission = 0.61;
    const ProofRecord record = proof.conclude(kNow, "");
    // GIVEN the next life of the daemon
    SafetyProof next(demanded());
    next.take_over({proof_from_json(to_json(record)).value()});
    EXPECT_EQ(next.transmission(), 0.61);
    // AND one with another configuration, which measures it anew
    SafetyProof other(demanded("vibration.transmission=0.5\n"));
    other.take_over({record});
    EXPECT_FALSE(other.transmission());
}

TEST(SafetyProof, AsksForTheEmergencyStopOnceAYear) {
    SafetyProof proof(demanded());
    proved(proof, kNow);
    EXPECT_THAT(proof.advice(kNow), HasSubstr("never been proved"));
    proof.begin("Ada", 0.5);
    proof.record().emergency_stop = true;
    static_cast<void>(proof.conclude(kNow, ""));
    EXPECT_EQ(proof.advice(kNow + 365 * 24 * kHour), "");
    EXPECT_THAT(proof.advice(kNow + 366 * 24 * kHour), HasSubstr("366 days ago"));
}

TEST(SafetyProof, ThePadsOfTheNewestThatPassedExtrapolateToTheArmedLevel) {
    SafetyProof proof(demanded());
    EXPECT_EQ(proof.pads().from_s(9), safety::kRingDown_s) << "an allowance without a proof";
    proved(proof, kNow);
    // From 9 g it takes ln 18 decay times longer than from 0.5 g
    EXPECT_NEAR(proof.pads().from_s(9), 0.4 + std::log(18) / 6, 1e-12);
}

TEST(StopTimes, AreThoseOfTheFirstWindowOfRestAfterTheOrder) {
    StopTimes times;
    const drivers::Time order = 10 * drivers::kSecond;
    times.begin(order);
    drivers::ShakerReading reading;
    reading.valid = true;
    reading.time = order - 1;  // from before: says nothing
    rt::Rest rest;
    rest.platform = {rt::RestVerdict::still, 0, order - drivers::kSecond, order};
    times.look(reading, rest);
    EXPECT_FALSE(times.controller_s || times.table_s || times.platform_s);
    reading.time = order + drivers::kSecond;
    rest.table = {rt::RestVerdict::still, 0, order + drivers::kSecond / 2,
                  order + drivers::kSecond};
    rest.platform = {rt::RestVerdict::moving, 0.1, order, order + drivers::kSecond};
    times.look(reading, rest);
    EXPECT_EQ(times.controller_s, 1);
    EXPECT_EQ(times.table_s, 0.5);
    EXPECT_FALSE(times.platform_s);
    EXPECT_TRUE(times.table_known);
}

}  // namespace
}  // namespace vibrig::campaign
