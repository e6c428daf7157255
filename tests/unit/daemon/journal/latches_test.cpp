#include "daemon/journal/latches.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <random>
#include <thread>

#include "daemon/journal/database.hpp"
#include "daemon/journal/journal.hpp"
#include "tests/unit/support/temporary_folder.hpp"

namespace vibrig::journal {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;
using namespace std::chrono_literals;

constexpr std::uint64_t kConfiguration = 0x77;
const Latch kTrip{
    "over_amplitude", "table acceleration above the limit", "Ada (uid 1)", {}, false, 5};

Latch emergency_stop(const std::string& armed_by) {
    return {"emergency_stop", "emergency-stop chain open", armed_by, {}, true, 5};
}

TEST(Latches, StayUntilANamedPersonAcknowledgesThem) {
    Latches latches;
    EXPECT_FALSE(latches.tripped());
    latches.add(kTrip);
    EXPECT_TRUE(latches.tripped());
    EXPECT_FALSE(latches.acknowledge("tilt", "Ada").accepted);
    EXPECT_TRUE(latches.tripped());
    const auto answer = latches.acknowledge("over_amplitude", "Ada");
    EXPECT_TRUE(answer.accepted);
    EXPECT_THAT(answer.words, HasSubstr("acknowledged: table acceleration above the limit"));
    EXPECT_THAT(latches.open(), IsEmpty());
}

TEST(Latches, AreAllAcknowledgedAsTripButNotTheJournals) {
    Latches latches;
    latches.add(kTrip);
    latches.add({kDiedArmed, "died", "Ada", {}, false, 6});
    latches.add({kJournalLatch, "entry 7 is missing", {}, {}, false, 7});
    EXPECT_THAT(latches.acknowledge("trip", "Grace").over, SizeIs(2));
    EXPECT_FALSE(latches.tripped());
    ASSERT_THAT(latches.open(), SizeIs(1));
    EXPECT_TRUE(latches.acknowledge("journal", "Grace").accepted);
    EXPECT_THAT(latches.open(), IsEmpty());
}

TEST(Latches, TakeASecondPersonAfterAnEmergencyStop) {
    // GIVEN an emergency stop while Ada had armed
    Latches latches;
    latches.add(emergency_stop("Ada Lovelace (uid 1)"));
    // WHEN she acknowledges it, twice and spelt otherwise THEN it stays
    EXPECT_THAT(latches.acknowledge("trip", "Ada Lovelace (uid 1)").first, SizeIs(1));
    const auto again = latches.acknowledge("trip", "ada  lovelace (certificate ada)");
    EXPECT_FALSE(again.accepted);
    EXPECT_THAT(again.words, HasSubstr("another person than Ada Lovelace"));
    EXPECT_TRUE(latches.tripped());
    // until another person does
    EXPECT_THAT(latches.acknowledge("trip", "Grace Hopper (uid 1)").over, SizeIs(1));
    EXPECT_FALSE(latches.tripped());

    // AND of another person than the one who armed, one is enough
    latches.add(emergency_stop("Ada (uid 1)"));
    EXPECT_TRUE(latches.acknowledge("trip", "Grace (uid 2)").accepted);
    EXPECT_FALSE(latches.tripped());

    // AND where nobody had armed, two different ones
    latches.add(emergency_stop(""));
    EXPECT_THAT(latches.acknowledge("emergency_stop", "Ada").first, SizeIs(1));
    EXPECT_FALSE(latches.acknowledge("emergency_stop", "ADA").accepted);
    EXPECT_TRUE(latches.acknowledge("emergency_stop", "Grace").accepted);
    EXPECT_FALSE(latches.tripped());
}

TEST(Latches, BeginTheirAcknowledgementAnewWhenTheyLatchAgain) {
    Latches latches;
    latches.add(emergency_stop("Ada"));
    EXPECT_THAT(latches.acknowledge("trip", "Ada").first, SizeIs(1));
    latches.add(emergency_stop("Grace"));
    EXPECT_THAT(latches.acknowledge("trip", "Grace").first, SizeIs(1));
    EXPECT_TRUE(latches.tripped());
}

struct KeptLatchesTest : testing::Test {
    TemporaryFolder folder;
    std::string path = (folder / "journal.sqlite3").string();

    void clear() const {
        std::filesystem::remove_all(folder);
        std::filesystem::create_directories(folder);
    }
    [[nodiscard]] static bool eventually(const std::function<bool()>& done) {
        for (int n = 0; n < 4000 && !done(); ++n) std::this_thread::sleep_for(5ms);
        return done();
    }
    [[nodiscard]] std::vector<std::string> names() const {
        Journal journal(path, kConfiguration);
        std::vector<std::string> names;
        for (const Latch& latch : journal.recovery().latches) names.push_back(latch.name);
        return names;
    }
    /// A daemon's life: armed, on disk; then a trip. Ends by a signal.
    [[noreturn]] static void live(const std::string& path, const std::function<void()>& armed) {
        Journal journal(path, kConfiguration);
        journal.start();
        const auto entry = journal.armed("Ada", "platform 17, 9 g");
        while (!journal.on_disk(entry)) std::this_thread::sleep_for(100us);
        armed();
        journal.latched(kTrip);
        journal.disarmed("Ada", kTrip.cause);
        std::this_thread::sleep_for(20ms);
        std::raise(SIGKILL);
        std::_Exit(1);
    }
};

TEST_F(KeptLatchesTest, OutliveTheDaemonUntilAcknowledged) {
    {
        Journal journal(path, kConfiguration);
        EXPECT_THAT(journal.recovery().latches, IsEmpty());
        journal.start();
        journal.latched(emergency_stop("Ada"));
        journal.latched(kTrip);
        journal.acknowledged("emergency_stop", "Ada", false);
        journal.stop();
    }
    {
        Journal journal(path, kConfiguration);
        ASSERT_THAT(journal.recovery().latches, SizeIs(2));
        const Latch& stop = journal.recovery().latches[0];
        EXPECT_EQ(stop.name + "/" + stop.cause + "/" + stop.armed_by + "/" + stop.first,
                  "emergency_stop/emergency-stop chain open/Ada/Ada");
        EXPECT_TRUE(stop.two_persons);
        journal.start();
        journal.acknowledged("emergency_stop", "Grace", true);
        journal.acknowledged("over_amplitude", "Grace", true);
        journal.stop();
    }
    EXPECT_THAT(names(), IsEmpty());
}

TEST_F(KeptLatchesTest, KnowAnArmingWithoutAnEnd) {
    for (const bool ended : {true, false}) {
        clear();
        Journal journal(path, kConfiguration);
        journal.start();
        const auto entry = journal.armed("Ada", "platform 17, 9 g");
        if (ended) journal.disarmed("Ada", "finished");
        journal.stop();
        EXPECT_TRUE(journal.on_disk(entry));
        EXPECT_THAT(names(), SizeIs(ended ? 0 : 1));
    }
    // Nobody wrote that it has latched: the next start finds it again.
    Journal journal(path, kConfiguration);
    ASSERT_THAT(journal.recovery().latches, SizeIs(1));
    EXPECT_EQ(journal.recovery().latches[0].name, kDiedArmed);
    EXPECT_THAT(journal.recovery().latches[0].cause, HasSubstr("Ada: platform 17, 9 g"));
    journal.start();
    journal.stop();
    EXPECT_THAT(names(), SizeIs(1)) << "once written it stays one";
}

TEST_F(KeptLatchesTest, SurviveSigkillAtAnyMomentBetweenTripAndJournal) {
    std::mt19937 random(7);
    std::uniform_int_distribution<int> delay_us(0, 2'500);
    int tripped = 0, died = 0;
    for (int kill = 0; kill < 40; ++kill) {
        clear();
        std::array<int, 2> pipe{};
        ASSERT_EQ(::pipe(pipe.data()), 0);
        const pid_t child = ::fork();
        if (child == 0) live(path, [&] { static_cast<void>(!::write(pipe[1], "a", 1)); });
        char armed = 0;
        ASSERT_EQ(::read(pipe[0], &armed, 1), 1);
        std::this_thread::sleep_for(std::chrono::microseconds(delay_us(random)));
        ::kill(child, SIGKILL);
        ::waitpid(child, nullptr, 0);
        ::close(pipe[0]);
        ::close(pipe[1]);
        const auto found = names();
        EXPECT_THAT(found, testing::Not(IsEmpty())) << "kill " << kill << ", seed 7";
        for (const auto& name : found) ++(name == kDiedArmed ? died : tripped);
    }
    std::printf("# %d trips, %d armings without an end\n", tripped, died);
    EXPECT_GE(tripped + died, 40);
}

TEST_F(KeptLatchesTest, SurviveTheEndAtEachStepOfTheWriting) {
    // The kernel ends a process whose file would grow over its limit: in the middle of the write
    // that does it. One step of the file's writing after the other, and all of them at last.
    int tripped = 0, died = 0;
    for (rlim_t more = 0; more < 40'000; more += 1000) {
        clear();
        const pid_t child = ::fork();
        if (child == 0) {
            std::signal(SIGXFSZ, SIG_DFL);
            live(path, [&] {
                std::uintmax_t largest = 0;
                for (const auto& file :
                     std::filesystem::directory_iterator(path.substr(0, path.rfind('/')))) {
                    // The journal's thread makes and renames files beside this one.
                    std::error_code gone;
                    const auto size = file.file_size(gone);
                    if (!gone) largest = std::max(largest, size);
                }
                const rlimit limit{largest + more, RLIM_INFINITY};
                ::setrlimit(RLIMIT_FSIZE, &limit);
            });
        }
        int status = 0;
        ::waitpid(child, &status, 0);
        ASSERT_TRUE(WIFSIGNALED(status));
        const auto found = names();
        EXPECT_THAT(found, testing::Not(IsEmpty())) << "after " << more << " bytes";
        for (const auto& name : found) ++(name == kDiedArmed ? died : tripped);
    }
    EXPECT_GT(died, 0);
    EXPECT_GT(tripped, 0);
}

TEST_F(KeptLatchesTest, AreNotConfirmedByADiskThatRefuses) {
    Journal journal(path, kConfiguration);
    journal.start();
    journal.event({});
    ASSERT_TRUE(eventually([&] { return journal.status().written == 1; }));
    std::signal(SIGXFSZ, SIG_IGN);
    rlimit was{};
    ::getrlimit(RLIMIT_FSIZE, &was);
    const rlimit small{4096, was.rlim_max};
    ::setrlimit(RLIMIT_FSIZE, &small);
    const auto entry = journal.armed("Ada", "platform 17, 9 g");
    const bool refused = eventually([&] { return !journal.status().running; });
    EXPECT_FALSE(journal.on_disk(entry));
    ::setrlimit(RLIMIT_FSIZE, &was);
    ASSERT_TRUE(refused);
    EXPECT_TRUE(eventually([&] { return journal.on_disk(entry); })) << "once there is room again";
}

TEST_F(KeptLatchesTest, AreNotDroppedWhenTooMuchWaits) {
    Journal journal(path, kConfiguration);
    for (std::size_t n = 0; n <= Journal::kMostWaiting; ++n) journal.event({});
    EXPECT_EQ(journal.status().dropped, 1U);
    EXPECT_NE(journal.latched(kTrip), 0U);
    journal.start();
    journal.stop();
    EXPECT_THAT(names(), SizeIs(1));
}

}  // namespace
}  // namespace vibrig::journal
