#include <gtest/gtest.h>

#include "daemon/serve/rate_limit.hpp"

namespace vibrig::serve {
namespace {

using std::chrono::seconds;

const TokenBucket::Instant kStart{seconds(1'000'000)};

TEST(TokenBucket, GivesABurstThenSoManyASecond) {
    TokenBucket bucket(2, 5);
    EXPECT_TRUE(bucket.full(kStart));
    for (int i = 0; i < 5; ++i) EXPECT_TRUE(bucket.take(kStart)) << i;
    EXPECT_FALSE(bucket.take(kStart));
    EXPECT_FALSE(bucket.take(kStart));
    EXPECT_EQ(bucket.missed(), 2u);
    EXPECT_EQ(bucket.missed(), 0u);
    for (int i = 0; i < 2; ++i) EXPECT_TRUE(bucket.take(kStart + seconds(1))) << i;
    EXPECT_FALSE(bucket.take(kStart + seconds(1)));
    EXPECT_FALSE(bucket.full(kStart + seconds(3)));
    EXPECT_TRUE(bucket.full(kStart + seconds(4)));
}

TEST(TokenBuckets, NobodyUsesUpAnothersAndTheyAreBounded) {
    TokenBuckets buckets(1, 1);
    for (std::size_t i = 0; i < TokenBuckets::kMost; ++i)
        EXPECT_TRUE(buckets.of(std::to_string(i), kStart).take(kStart)) << i;
    EXPECT_FALSE(buckets.of("0", kStart).take(kStart));
    // WHEN one more comes THEN it is one for all that come now
    EXPECT_TRUE(buckets.of("a", kStart).take(kStart));
    EXPECT_FALSE(buckets.of("b", kStart).take(kStart));
    // until those before have had none for a while
    const auto later = kStart + seconds(1);
    EXPECT_TRUE(buckets.of("a", later).take(later));
    EXPECT_TRUE(buckets.of("b", later).take(later));
    EXPECT_FALSE(buckets.of("b", later).take(later));
}

}  // namespace
}  // namespace vibrig::serve
