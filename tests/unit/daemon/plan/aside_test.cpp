#include "daemon/plan/aside.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <future>
#include <thread>

namespace vibrig::plan {
namespace {

using namespace std::chrono_literals;

/// Until there is one; a busy machine has its time.
std::optional<int> result_of(Aside<int>& aside) {
    for (int n = 0; n < 60'000; ++n) {
        if (const auto found = aside.take()) return found;
        std::this_thread::sleep_for(1ms);
    }
    return {};
}

TEST(Aside, GivesItsResultOnceAndTellsThatItIsThere) {
    std::atomic<int> notified{0};
    Aside<int> aside([&] { ++notified; });
    EXPECT_FALSE(aside.asked());
    aside.ask([] { return 7; });
    EXPECT_EQ(result_of(aside), 7);
    EXPECT_FALSE(aside.asked());
    EXPECT_FALSE(aside.take());
    for (int n = 0; n < 60'000 && notified.load() == 0; ++n) std::this_thread::sleep_for(1ms);
    EXPECT_EQ(notified.load(), 1);
}

TEST(Aside, WhoMayWaitHasTheResultAtOnceAndNobodyIsNotified) {
    std::atomic<int> notified{0};
    Aside<int> aside([&] { ++notified; });
    for (int n = 0; n < 100; ++n) EXPECT_EQ(aside.compute([n] { return n; }), n);
    EXPECT_FALSE(aside.asked());
    EXPECT_FALSE(aside.take());
    EXPECT_EQ(notified.load(), 0);
    // and whoever may not wait is notified again
    aside.ask([] { return 7; });
    EXPECT_EQ(result_of(aside), 7);
    for (int n = 0; n < 60'000 && notified.load() == 0; ++n) std::this_thread::sleep_for(1ms);
    EXPECT_EQ(notified.load(), 1);
}

TEST(Aside, NobodyWaitsForAComputationThatIsAbandoned) {
    // GIVEN a computation that ends only when this thread lets it, later
    std::promise<void> let_go;
    auto gate = let_go.get_future().share();
    Aside<int> aside([] {});
    std::promise<void> begun;
    aside.ask([&, gate] {
        begun.set_value();
        gate.wait();
        return 1;
    });
    begun.get_future().wait();
    // WHEN it is abandoned and another one asked, THEN neither waits: this thread comes to here
    aside.abandon();
    EXPECT_FALSE(aside.asked());
    aside.ask([] { return 2; });
    EXPECT_TRUE(aside.asked());
    EXPECT_FALSE(aside.take());
    // and the result is that of the second
    let_go.set_value();
    EXPECT_EQ(result_of(aside), 2);
    EXPECT_FALSE(aside.take()) << "the first one's result";
}

TEST(Aside, ManyQuestionsFromAnImpatientThreadNeverGetTheAnswerToAnother) {
    Aside<int> aside([] {});
    for (int n = 0; n < 2'000; ++n) {
        aside.ask([n] { return n; });
        if (n % 3 == 0) std::this_thread::yield();
        if (n % 7 == 0) aside.abandon();
        ASSERT_EQ(aside.take().value_or(n), n);
    }
}

}  // namespace
}  // namespace vibrig::plan
