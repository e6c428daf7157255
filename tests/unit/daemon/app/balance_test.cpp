#include "daemon/app/balance.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>

namespace vibrig {
namespace {

using testing::HasSubstr;

/// A daemon that has received `n` samples of two frames each, and has counted everything.
Counted honest(std::uint64_t n) {
    Counted c;
    auto& port = c.acquisition.port;
    port.delivered = 2 * n + 10;
    port.own = 3;
    port.error_frames = 2;
    port.malformed = 1;
    port.received = port.delivered + 6;
    c.acquisition.rig_ticks = 6;
    c.acquisition.increments = 3;
    c.acquisition.in_hand = 1;
    auto& assembler = c.acquisition.assembler;
    assembler.received = 2 * n;
    assembler.used = 2 * n - 7;
    assembler.unknown = 3;
    assembler.duplicate = assembler.late = 1;
    assembler.wrong_length = 2;
    assembler.samples = c.acquisition.samples_offered = n;
    c.ring = {n - 5, n - 6, 5};
    c.recorder = rt::RingCounts{n - 2, n - 20, 2};
    c.estimator.taken = n - 6;
    c.estimator.in_dwell = n - 10;
    c.estimator.idle = 4;
    c.shaker.requests = n;
    c.shaker.replies = n - 6;
    c.shaker.timeouts = c.shaker.exceptions = c.shaker.wrong_replies = 1;
    c.shaker.lost = 2;
    c.journal.taken = 20;
    c.journal.written = 18;
    c.journal.waiting = 2;
    c.log.taken = 9;
    c.log.written = c.log.dropped = c.log.waiting = 3;
    return c;
}

TEST(Balance, WhoeverCountsEverythingIsLeftAlone) {
    Balance balance;
    for (std::uint64_t n = 1000; n < 1010; ++n) EXPECT_EQ(balance.look(honest(n)), "") << n;
    EXPECT_EQ(Balance().look({}), "") << "at the start";
}

TEST(Balance, WhatAnotherThreadHasCountedMeanwhileIsNoFault) {
    Balance balance;
    ASSERT_EQ(balance.look(honest(1000)), "");
    auto now = honest(1040);
    // Two more since the acquisition has shown itself, and one is being taken.
    now.ring.pushed += 2;
    now.recorder->pushed += 2;
    now.estimator.taken += 1;
    now.estimator.idle += 1;
    --now.shaker.replies;  // in flight
    EXPECT_EQ(balance.look(now), "");
}

struct Lie {
    const char* stage;
    std::function<void(Counted&)> tell;
};

class BalanceOf : public testing::TestWithParam<Lie> {};

TEST_P(BalanceOf, AStageThatLosesOrInventsIsNamed) {
    Balance balance;
    ASSERT_EQ(balance.look(honest(1000)), "");
    auto now = honest(1040);
    GetParam().tell(now);
    EXPECT_THAT(balance.look(now), HasSubstr(std::string(GetParam().stage) + ": "));
}

INSTANTIATE_TEST_SUITE_P(
    Stages, BalanceOf,
    testing::Values(
        Lie{"frames received", [](Counted& c) { ++c.acquisition.port.received; }},
        Lie{"frames delivered", [](Counted& c) { ++c.acquisition.rig_ticks; }},
        Lie{"frames for samples", [](Counted& c) { --c.acquisition.assembler.used; }},
        Lie{"samples offered", [](Counted& c) { ++c.acquisition.assembler.samples; }},
        // One that was lost on the way shows at once, as many as came in a second that came twice.
        Lie{"samples for the estimator", [](Counted& c) { --c.ring.pushed; }},
        Lie{"samples for the estimator",
            [](Counted& c) {
                c.acquisition.samples_offered = c.acquisition.assembler.samples = 999;
            }},
        Lie{"samples for the recorder", [](Counted& c) { --c.recorder->dropped; }},
        Lie{"samples taken", [](Counted& c) { --c.estimator.idle; }},
        Lie{"samples out of the ring",
            [](Counted& c) { c.estimator.taken += 33, c.estimator.in_dwell += 33; }},
        Lie{"requests to the shaker", [](Counted& c) { c.shaker.replies -= 42; }},
        Lie{"requests to the shaker", [](Counted& c) { c.shaker.timeouts += 2; }},
        Lie{"entries of the journal", [](Counted& c) { --c.journal.waiting; }},
        Lie{"lines logged", [](Counted& c) { --c.log.dropped; }}));

}  // namespace
}  // namespace vibrig
