#include "daemon/rt/ring.hpp"

#include <gtest/gtest.h>

#include <boost/lockfree/spsc_queue.hpp>
#include <random>
#include <thread>
#include <vector>

namespace vibrig::rt {
namespace {

struct alignas(64) Record {
    std::uint64_t number = 0;
    std::uint64_t check = 0;  ///< number ^ kMagic: torn records show
    std::uint32_t dropped_before = 0;
    std::uint64_t published_to = 0;  ///< the ring's own
};
static_assert(sizeof(Record) == 64);
constexpr std::uint64_t kMagic = 0x9e3779b97f4a7c15;

Record record(std::uint64_t number) { return {number, number ^ kMagic, 0}; }

TEST(Ring, RefusesACapacityThatIsNoPowerOfTwo) {
    EXPECT_THROW(Ring<Record>(0), std::invalid_argument);
    EXPECT_THROW(Ring<Record>(100), std::invalid_argument);
}

TEST(Ring, GivesRecordsInOrderAndHoldsItsWholeCapacity) {
    // GIVEN a ring of eight
    Ring<Record> ring(8);
    // WHEN eight are pushed, THEN all fit and come out in order
    for (std::uint64_t i = 0; i < 8; ++i) EXPECT_TRUE(ring.try_push(record(i)));
    EXPECT_FALSE(ring.try_push(record(8)));
    std::vector<std::uint64_t> seen;
    EXPECT_EQ(ring.consume([&](const Record& r) { seen.push_back(r.number); }), 8U);
    EXPECT_EQ(seen, (std::vector<std::uint64_t>{0, 1, 2, 3, 4, 5, 6, 7}));
    EXPECT_EQ(ring.consume([](const Record&) { FAIL(); }), 0U);
}

TEST(Ring, DropsTheNewestAndTheNextRecordCarriesTheCount) {
    // GIVEN a full ring
    Ring<Record> ring(4);
    const std::vector<Record> six{record(0), record(1), record(2), record(3), record(4), record(5)};
    EXPECT_EQ(ring.push_n(six), 4U);
    EXPECT_FALSE(ring.try_push(record(6)));
    EXPECT_EQ(ring.counts().dropped, 3U);
    // WHEN there is room again
    ring.consume([](const Record& r) { EXPECT_EQ(r.dropped_before, 0U); }, 2);
    EXPECT_EQ(ring.push_n(std::vector<Record>{record(7), record(8)}), 2U);
    // THEN the first of the new ones says that three are missing before it, and only it
    std::vector<std::pair<std::uint64_t, std::uint32_t>> seen;
    ring.consume([&](const Record& r) { seen.emplace_back(r.number, r.dropped_before); });
    EXPECT_EQ(seen, (std::vector<std::pair<std::uint64_t, std::uint32_t>>{
                        {2, 0}, {3, 0}, {7, 3}, {8, 0}}));
    const RingCounts counts = ring.counts();
    EXPECT_EQ(counts.pushed, 6U);
    EXPECT_EQ(counts.popped, 6U);
}

TEST(Ring, BelievesNothingThatARecordBroughtFromAnotherRing) {
    // GIVEN records that say, as those of another ring do, that far more has been published
    Ring<Record> ring(8);
    const auto foreign = [](std::uint64_t number) {
        Record r = record(number);
        r.published_to = ~std::uint64_t{0} - number;
        return r;
    };
    std::vector<std::uint64_t> seen;
    const auto take = [&](const Record& r) { seen.push_back(r.number); };
    std::uint64_t next = 0;
    // WHEN they are pushed alone and together, all around the ring many times
    for (std::size_t round = 0; round < 200; ++round) {
        std::vector<Record> batch;
        for (std::size_t i = 0; i < 1 + round % 8; ++i) batch.push_back(foreign(next++));
        ASSERT_EQ(ring.push_n(batch), batch.size());
        seen.clear();
        // THEN what was pushed comes out, in parts or whole, and nothing after it
        std::size_t looks = 0;
        while (ring.consume(take, 1 + round % 5) > 0 && ++looks <= batch.size()) {
        }
        ASSERT_EQ(seen.size(), batch.size()) << "round " << round;
        for (std::size_t i = 0; i < seen.size(); ++i) ASSERT_EQ(seen[i], batch[i].number);
    }
}

TEST(Ring, GivesWhatCameAfterABatchThatWasTakenInPart) {
    Ring<Record> ring(8);
    std::vector<std::uint64_t> seen;
    const auto take = [&](const Record& r) { seen.push_back(r.number); };
    ring.push_n(std::vector<Record>{record(0), record(1), record(2)});
    EXPECT_EQ(ring.consume(take, 2), 2U);
    EXPECT_TRUE(ring.try_push(record(3)));
    ring.push_n(std::vector<Record>{record(4), record(5)});
    EXPECT_EQ(ring.consume(take, 0), 0U);
    EXPECT_EQ(ring.consume(take), 4U);
    EXPECT_EQ(seen, (std::vector<std::uint64_t>{0, 1, 2, 3, 4, 5}));
    EXPECT_EQ(ring.counts().popped, 6U);
}

TEST(Ring, BehavesLikeTheReferenceQueueInRandomUse) {
    const unsigned seed = 20260721;
    SCOPED_TRACE(seed);
    std::mt19937 random(seed);
    Ring<Record> ring(64);
    boost::lockfree::spsc_queue<Record, boost::lockfree::capacity<64>> reference;
    std::uint64_t next = 0;
    for (int step = 0; step < 200'000; ++step) {
        if (random() % 2 == 0) {
            std::vector<Record> batch(random() % 40);
            for (auto& r : batch) {
                r = record(next++);
                r.published_to = random();
            }
            const auto expected = reference.push(batch.data(), batch.size());
            ASSERT_EQ(ring.push_n(batch), expected);
            next -= batch.size() - expected;
        } else {
            const std::size_t at_most = random() % 40;
            std::vector<std::uint64_t> ours;
            std::vector<std::uint64_t> theirs;
            ring.consume([&](const Record& r) { ours.push_back(r.number); }, at_most);
            Record r;
            while (theirs.size() < at_most && reference.pop(r)) theirs.push_back(r.number);
            ASSERT_EQ(ours, theirs);
        }
    }
}

TEST(Ring, LosesTearsAndReordersNothingBetweenTwoThreads) {
    // GIVEN a producer that never waits and a consumer
    constexpr std::uint64_t kRecords = 10'000'000;
    Ring<Record> ring(1024);
    std::atomic<bool> finished{false};
    std::atomic<std::uint64_t> offered{0};
    std::thread producer([&] {
        std::array<Record, 32> batch{};
        std::uint64_t number = 0;
        std::uint64_t round = 0;
        // Longer where the consumer hardly gets a processor: else there was nothing to see.
        while (number < kRecords || ring.counts().popped < kRecords / 100) {
            const std::size_t n = 1 + static_cast<std::size_t>(round++ % batch.size());
            for (std::size_t i = 0; i < n; ++i) {
                batch[i] = record(number++);
                batch[i].published_to = number % 3 == 0 ? ~number : 0;  // of another ring
            }
            if (ring.push_n({batch.data(), n}) < n) std::this_thread::yield();
        }
        offered.store(number);
        finished.store(true);
    });
    // WHEN all records have been offered
    std::uint64_t expected = 0;
    std::uint64_t taken = 0;
    bool good = true;
    const auto take = [&](const Record& r) {
        expected += r.dropped_before;
        good = good && r.number == expected && r.check == (r.number ^ kMagic);
        ++expected;
        ++taken;
    };
    while (!finished.load()) {
        if (ring.consume(take) == 0) std::this_thread::yield();
    }
    while (ring.consume(take) > 0 && good) {
    }
    producer.join();
    // THEN every record was either taken, whole and in order, or counted as dropped
    EXPECT_TRUE(good);
    const RingCounts counts = ring.counts();
    EXPECT_EQ(counts.pushed, taken);
    EXPECT_EQ(counts.popped, taken);
    EXPECT_EQ(counts.pushed + counts.dropped, offered.load());
}

}  // namespace
}  // namespace vibrig::rt
