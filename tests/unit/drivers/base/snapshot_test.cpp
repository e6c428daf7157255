#include "drivers/base/snapshot.hpp"

#include <gtest/gtest.h>

#include <thread>

namespace vibrig::rt {
namespace {

struct Wide {
    std::array<std::uint64_t, 100> value{};
    char tail = 0;
};

TEST(Snapshot, StartsWithADefaultValueAndShowsTheLatest) {
    Snapshot<Wide> snapshot;
    EXPECT_EQ(snapshot.read().value[99], 0U);
    Wide wide;
    wide.value.fill(7);
    wide.tail = 'x';
    snapshot.publish(wide);
    EXPECT_EQ(snapshot.read().value[50], 7U);
    EXPECT_EQ(snapshot.read().tail, 'x');
}

TEST(Snapshot, NeverShowsHalfAValue) {
    // GIVEN a writer that fills the value with one number after the other
    Snapshot<Wide> snapshot;
    std::atomic<bool> stop{false};
    std::thread writer([&] {
        Wide wide;
        for (std::uint64_t i = 1; !stop.load(); ++i) {
            wide.value.fill(i);
            snapshot.publish(wide);
        }
    });
    // WHEN it is read meanwhile, THEN all numbers of one reading agree and never go back
    std::uint64_t newest = 0;
    for (int i = 0; i < 50'000; ++i) {
        const Wide seen = snapshot.read();
        for (const auto v : seen.value) ASSERT_EQ(v, seen.value[0]);
        ASSERT_GE(seen.value[0], newest);
        newest = seen.value[0];
    }
    stop.store(true);
    writer.join();
}

}  // namespace
}  // namespace vibrig::rt
