#include <gtest/gtest.h>

#include "daemon/serve/expiry_watch.hpp"

namespace vibrig::serve {
namespace {

constexpr std::int64_t kDay = 86'400;
constexpr std::int64_t kEnd = 1'800'000'000;  // 2027-01-15

TEST(ExpiryWatch, SpeaksThirtyDaysBeforeSevenDaysBeforeAndAtTheEndOnceEach) {
    ExpiryWatch watch;
    int words = 0;
    std::string all;
    // GIVEN a certificate looked at every hour for 40 days before its end and one after
    for (std::int64_t now = kEnd - 40 * kDay; now <= kEnd + kDay; now += 3600) {
        const std::string said = watch.check("the server's certificate", kEnd, now);
        if (said.empty()) continue;
        ++words;
        all += said + '\n';
        const std::int64_t left = kEnd - now;
        EXPECT_TRUE(left == 30 * kDay || left == 7 * kDay || left == 0) << left << ": " << said;
    }
    EXPECT_EQ(words, 3) << all;
    EXPECT_NE(all.find("expires in 30 days, on 2027-01-15"), std::string::npos) << all;
    EXPECT_NE(all.find("expires in 7 days"), std::string::npos) << all;
    EXPECT_NE(all.find("has expired on 2027-01-15"), std::string::npos) << all;
}

TEST(ExpiryWatch, SpeaksAtOnceAboutAnEndThatIsNear) {
    ExpiryWatch watch;
    EXPECT_NE(watch.check("a", kEnd, kEnd - kDay / 2).find("less than a day"), std::string::npos);
    EXPECT_EQ(watch.check("a", kEnd, kEnd - kDay / 2), "");
    EXPECT_NE(watch.check("b", kEnd, kEnd + 5).find("expired"), std::string::npos)
        << "each has an end of its own";
}

TEST(ExpiryWatch, StartsAnewWithARenewedCertificate) {
    ExpiryWatch watch;
    EXPECT_NE(watch.check("a", kEnd, kEnd - 3 * kDay), "");
    EXPECT_EQ(watch.check("a", kEnd + 800 * kDay, kEnd - 3 * kDay), "");
    EXPECT_NE(watch.check("a", kEnd + 800 * kDay, kEnd + 790 * kDay), "");
}

}  // namespace
}  // namespace vibrig::serve
