#include "daemon/watch/guard_link.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <thread>

#include "daemon/version.hpp"
#include "proto/safety.hpp"

namespace vibrig::watch {
namespace {

using testing::HasSubstr;

constexpr int kPatienceMs = 60'000;  // a busy machine has its time

/// vibrig-guard's end: it says what the test lets it say.
class FakeGuard {
  public:
    explicit FakeGuard(const std::string& name) {
        sockaddr_un address{};
        address.sun_family = AF_UNIX;
        name.copy(address.sun_path + 1, sizeof address.sun_path - 2);
        const auto length =
            static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + 1 + name.size());
        EXPECT_EQ(::bind(door_, reinterpret_cast<const sockaddr*>(&address), length), 0);
        EXPECT_EQ(::listen(door_, 1), 0);
    }
    ~FakeGuard() {
        if (link_ >= 0) ::close(link_);
        ::close(door_);
    }
    FakeGuard(const FakeGuard&) = delete;
    FakeGuard& operator=(const FakeGuard&) = delete;

    /// The daemon's next word; none where it has hung up or says nothing.
    std::optional<proto::DaemonWord> next() {
        if (link_ < 0 && comes(door_)) link_ = ::accept4(door_, nullptr, nullptr, SOCK_CLOEXEC);
        std::array<std::uint8_t, proto::kDaemonWordBytes + 1> bytes{};
        if (link_ < 0 || !comes(link_)) return {};
        const ssize_t size = ::recv(link_, bytes.data(), bytes.size(), 0);
        if (size <= 0) return {};
        return proto::decode_daemon_word({bytes.data(), static_cast<std::size_t>(size)});
    }
    void say(const proto::GuardWord& word) const { say_bytes(proto::encode(word)); }
    void say_bytes(std::span<const std::uint8_t> bytes) const {
        EXPECT_EQ(::send(link_, bytes.data(), bytes.size(), MSG_NOSIGNAL),
                  static_cast<ssize_t>(bytes.size()));
    }

  private:
    static bool comes(int descriptor) {
        pollfd one{descriptor, POLLIN, 0};
        return ::poll(&one, 1, kPatienceMs) > 0;
    }

    int door_ = ::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0);
    int link_ = -1;
};

TEST(GuardEyes, LackNothingThatIsOverInAMoment) {
    GuardEyes eyes;
    GuardStatus guard;
    guard.note = "gone";
    std::int64_t now_ns = 1'000'000'000;
    const auto after = [&](double seconds) {
        return eyes.lacks(guard, now_ns += static_cast<std::int64_t>(seconds * 1e9));
    };
    EXPECT_EQ(after(0), "is not heard: gone") << "which has its own deadline";
    guard.heard = guard.sees = guard.reaches_shaker = true;
    EXPECT_EQ(after(0), "");
    for (bool* one : {&guard.sees, &guard.reaches_shaker}) {
        // WHEN it is so for a moment, again and again
        for (int i = 0; i < 5; ++i) {
            *one = false;
            EXPECT_EQ(after(1), "");
            EXPECT_EQ(after(GuardEyes::kPatience_s - 0.1), "");
            *one = true;
            EXPECT_EQ(after(0.05), "");
        }
        // THEN it is none; and for longer it is said
        *one = false;
        EXPECT_EQ(after(0), "");
        EXPECT_EQ(after(GuardEyes::kPatience_s + 0.1),
                  one == &guard.sees ? "sees no accelerometer" : "does not reach the shaker");
        *one = true;
        EXPECT_EQ(after(0.05), "");
    }
    guard.sees = guard.reaches_shaker = false;
    EXPECT_EQ(after(1), "");
    EXPECT_EQ(after(GuardEyes::kPatience_s + 0.1),
              "sees no accelerometer and does not reach the shaker");
}

class GuardLinkTest : public testing::Test {
  protected:
    static bool until(const auto& holds) {
        for (int ms = 0; ms < kPatienceMs && !holds(); ++ms)
            std::this_thread::sleep_for(std::chrono::milliseconds(1));
        return holds();
    }

    const std::string name_ = "vibrig-test-guard-" + std::to_string(::getpid());
    GuardLink link_{"@" + name_, [] {
                        proto::DaemonWord word;
                        word.armed = true;
                        word.level_g = 9;
                        return word;
                    }};
};

TEST_F(GuardLinkTest, HearsAFindingUntilAPersonHasSeenIt) {
    FakeGuard guard(name_);
    EXPECT_FALSE(link_.heard());
    link_.start();
    // WHEN the guard answers the daemon's word with what it has found
    const auto first = guard.next();
    ASSERT_TRUE(first);
    EXPECT_EQ(first->sequence, 1U);
    EXPECT_TRUE(first->armed);
    EXPECT_EQ(first->level_g, 9);
    proto::GuardWord answer;
    answer.sequence = first->sequence;
    answer.cause = proto::GuardCause::over_level;
    answer.finding = 3;
    answer.sees = true;
    answer.table_g = 11;
    std::string_view(kVersion).copy(answer.version.data(), answer.version.size() - 1);
    std::optional<proto::DaemonWord> word = first;
    const auto answered = [&](const auto& holds) {
        return until([&] {
            guard.say(answer);
            word = guard.next();
            if (word) answer.sequence = word->sequence;
            return word && holds();
        });
    };
    // THEN it is the daemon's to tell
    ASSERT_TRUE(answered([&] { return link_.finding() == proto::GuardCause::over_level; }));
    EXPECT_TRUE(link_.status().heard);
    EXPECT_EQ(link_.status().note, "");
    EXPECT_EQ(link_.status().table_g, 11);
    // AND it is over once a person has seen it, which reaches the guard
    link_.acknowledge(3);
    EXPECT_TRUE(answered([&] { return word->acknowledged == 3; }));
    EXPECT_EQ(link_.finding(), proto::GuardCause::none);
    // AND a second finding is not that one
    answer.finding = 4;
    EXPECT_TRUE(answered([&] { return link_.finding() == proto::GuardCause::over_level; }));
}

TEST_F(GuardLinkTest, AGuardOfAnotherVersionIsHeardAndNamed) {
    FakeGuard guard(name_);
    link_.start();
    std::array<char, 16> version{"0.0.9"};
    EXPECT_TRUE(until([&] {
        const auto word = guard.next();
        if (!word) return false;
        proto::GuardWord answer;
        answer.sequence = word->sequence;
        answer.version = version;
        guard.say(answer);
        return link_.status().version == "0.0.9";
    }));
    EXPECT_TRUE(link_.status().heard);
    EXPECT_EQ(link_.status().note,
              std::string("version 0.0.9, vibrigd is ") + kVersion + ": restart vibrig-guard");
}

TEST_F(GuardLinkTest, WordsThatItDoesNotKnowAreSaidToBeSo) {
    FakeGuard guard(name_);
    link_.start();
    ASSERT_TRUE(guard.next());
    // WHEN a guard answers as it did before its words had a version
    guard.say_bytes(std::array<std::uint8_t, 32>{0x56, 0x62, 0x47, 0x31});
    // THEN it is not heard, and what is to be done is said
    EXPECT_TRUE(until([&] { return link_.status().note != "never heard"; }));
    EXPECT_THAT(link_.status().note, HasSubstr("does not know: restart vibrig-guard"));
    EXPECT_FALSE(link_.heard());
}

TEST_F(GuardLinkTest, WhatAnswersNoWordOfThisLifeIsNotHeard) {
    FakeGuard guard(name_);
    link_.start();
    // GIVEN a guard whose answers are to no word, or to one that has not been said
    for (int n = 0; n < 5; ++n) {
        const auto word = guard.next();
        ASSERT_TRUE(word);
        proto::GuardWord answer;
        guard.say(answer);
        answer.sequence = word->sequence + 1000;
        guard.say(answer);
    }
    // THEN nothing was heard of it
    EXPECT_FALSE(link_.heard());
    EXPECT_EQ(link_.status().note, "never heard");
}

TEST_F(GuardLinkTest, AGuardThatGoesIsMissedAndFoundAgain) {
    EXPECT_EQ(link_.status().note, "never heard");
    link_.start();
    EXPECT_TRUE(until([&] { return link_.status().note != "never heard"; }));
    EXPECT_THAT(link_.status().note, HasSubstr("@" + name_ + ": Connection refused"));
    for (const bool again : {false, true}) {
        SCOPED_TRACE(again);
        FakeGuard guard(name_);
        const auto heard = [&] {
            const auto word = guard.next();
            if (!word) return false;
            proto::GuardWord answer;
            answer.sequence = word->sequence;
            answer.cause = proto::GuardCause::over_level;
            answer.rest = answer.sees = answer.reaches_shaker = true;
            answer.table_g = 1;
            guard.say(answer);
            return link_.heard();
        };
        EXPECT_TRUE(until(heard));
    }
    // WHEN it has gone for good THEN its last word counts no longer than its deadline
    EXPECT_TRUE(until([&] { return !link_.heard(); }));
    EXPECT_THAT(link_.status().note, HasSubstr("@" + name_ + ": "));
    EXPECT_EQ(link_.finding(), proto::GuardCause::none);
    const GuardStatus status = link_.status();
    EXPECT_TRUE(status.cause.empty() && status.text.empty() && status.table_g == 0);
    EXPECT_FALSE(status.rest || status.sees || status.reaches_shaker);
}

TEST_F(GuardLinkTest, TheLastWordIsSaidBeforeItEnds) {
    FakeGuard guard(name_);
    link_.start();
    const auto first = guard.next();
    ASSERT_TRUE(first);
    link_.stop();
    std::uint64_t last = first->sequence;
    while (const auto word = guard.next()) last = word->sequence;
    EXPECT_GT(last, first->sequence);
}

}  // namespace
}  // namespace vibrig::watch
