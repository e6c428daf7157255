#include "daemon/journal/journal.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <bit>
#include <cmath>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <thread>

#include "daemon/journal/database.hpp"

namespace vibrig::journal {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

constexpr std::uint64_t kHash = 0x1234;

/// A folder of its own, gone afterwards.
struct JournalTest : testing::Test {
    std::filesystem::path folder = std::filesystem::path(testing::TempDir()) /
                                   ("vibrig-journal-" + std::to_string(::getpid()));
    std::string path = (folder / "journal.sqlite3").string();

    JournalTest() {
        std::filesystem::remove_all(folder);
        std::filesystem::create_directories(folder);
    }
    ~JournalTest() override { std::filesystem::remove_all(folder); }

    /// At rest and level, the platform drifting a little: `seconds` at 40 Hz through the filter.
    static DwellCheckpoint dwell(estimator::Identification& filter, int position,
                                 double seconds = 20) {
        DwellCheckpoint checkpoint;
        checkpoint.info = {1, position, 9};
        filter.begin_dwell(checkpoint.info);
        for (int n = 0; n < seconds * 40; ++n) {
            estimator::Measurement m;
            m.time_s = n * 0.025;
            const double a = 6 * std::sin(2 * std::numbers::pi * 15 * m.time_s);
            m.angle_rad = {1e-6 * n, 2e-6 * std::sin(n), 0.5 * position + 2e-6 * std::cos(2 * n)};
            m.force_g = {0, 1 + a, 1e-4 * std::cos(n)};
            m.angles_good = n % 97 != 0;
            filter.add(m);
            checkpoint.measurements.push_back(m);
        }
        checkpoint.summary = filter.end_dwell();
        return checkpoint;
    }

    static void feed(Journal& journal, const DwellCheckpoint& dwell) {
        bool first = true;
        for (const auto& m : dwell.measurements) {
            ASSERT_TRUE(journal.fed().try_push(
                {m, dwell.info.run, dwell.info.position, std::exchange(first, false), 0}));
        }
        journal.dwell_done(dwell.info, dwell.summary);
    }

    /// A campaign of two positions that nobody ended.
    void leave_unfinished(int positions = 2) {
        estimator::Identification filter{estimator::Settings{}};
        Journal journal(path, kHash);
        journal.start();
        journal.campaign_begun("night", "Ada");
        for (int p = 1; p <= positions; ++p) feed(journal, dwell(filter, p));
        journal.stop();
    }
    [[nodiscard]] std::vector<Row> ask(const char* sql) const { return Database(path).ask(sql); }
};

TEST_F(JournalTest, GivesBackTheFilterToTheLastBit) {
    // GIVEN a filter that has seen two positions, and a journal of them that was not ended
    leave_unfinished();
    estimator::Identification filter{estimator::Settings{}};
    for (int p = 1; p <= 2; ++p) dwell(filter, p);
    // WHEN the journal is opened again and its dwells are fed to a fresh filter
    Journal journal(path, kHash);
    EXPECT_THAT(journal.recovery().refused, IsEmpty());
    ASSERT_TRUE(journal.recovery().campaign);
    auto& campaign = *journal.recovery().campaign;
    EXPECT_EQ(campaign.started_by, "Ada");
    ASSERT_THAT(campaign.dwells, SizeIs(2));
    estimator::Identification again{estimator::Settings{}};
    EXPECT_EQ(replay(campaign.dwells, again), "");
    // THEN both say the same to the last bit, now and after one more position
    for (int p = 3; p <= 4; ++p) {
        const auto left = filter.result(), right = again.result();
        for (std::size_t i = 0; i < estimator::kParameters; ++i) {
            EXPECT_EQ(std::bit_cast<std::uint64_t>(left.value[i]),
                      std::bit_cast<std::uint64_t>(right.value[i]))
                << i;
            EXPECT_EQ(std::bit_cast<std::uint64_t>(left.sigma[i]),
                      std::bit_cast<std::uint64_t>(right.sigma[i]))
                << i;
        }
        EXPECT_EQ(left.samples, right.samples);
        dwell(filter, p);
        dwell(again, p);
    }
}

TEST_F(JournalTest, OffersNothingThatWasEndedOrIsOfAnotherConfiguration) {
    leave_unfinished();
    {
        Journal other(path, kHash + 1);
        EXPECT_FALSE(other.recovery().campaign);
        ASSERT_THAT(other.recovery().refused, SizeIs(1));
        EXPECT_THAT(other.recovery().refused[0], HasSubstr("of another configuration: cold start"));
    }
    {
        Journal journal(path, kHash);
        journal.start();
        journal.campaign_resumed(journal.recovery().campaign->id, "Grace");
        journal.campaign_ended("finished", "", "{}");
        journal.stop();
    }
    Journal journal(path, kHash);
    EXPECT_FALSE(journal.recovery().campaign);
    EXPECT_THAT(journal.recovery().refused, IsEmpty());
    EXPECT_EQ(ask("SELECT state, result_json FROM campaign").at(0).texts,
              (std::vector<std::string>{"finished", "{}"}));
}

TEST_F(JournalTest, KeepsEventsAndWhoCommandedWhat) {
    {
        Journal journal(path, kHash);
        journal.start();
        journal.event({1, 5, 6, Severity::alarm, "can", "bus off"});
        journal.command({CommandRequest::Kind::arm, "Ada", ""}, {false, "tripped"}, 7);
        journal.stop();
        EXPECT_EQ(journal.status().written, 2U);
    }
    const auto event = ask("SELECT utc_ns, time_ns, severity, source, text FROM event").at(0);
    EXPECT_EQ(event.numbers[0], 5);
    EXPECT_EQ(event.texts[2] + event.texts[3] + event.texts[4], "alarmcanbus off");
    const auto command = ask("SELECT kind, person, accepted, answer FROM command").at(0);
    EXPECT_EQ(command.texts[0] + command.texts[1] + command.texts[3], "armAdatripped");
    EXPECT_EQ(command.numbers[2], 0);
}

TEST_F(JournalTest, StartsColdAndSaysWhyFromABadCheckpoint) {
    // GIVEN good bytes of a checkpoint
    estimator::Identification filter{estimator::Settings{}};
    const std::string good = encode(dwell(filter, 1, 3), kHash);
    DwellCheckpoint out;
    EXPECT_EQ(decode(good, kHash, out), "");
    struct Case {
        std::string bytes;
        const char* says;
    };
    std::string newer = good, foreign = good;
    newer[8] = 2;
    foreign[0] = 'X';
    std::vector<Case> cases{{"", "truncated: 0 bytes"},
                            {good.substr(0, 11), "truncated"},
                            {foreign, "not a checkpoint"},
                            {newer, "version 2, newer than 1"}};
    // any cut and any flipped bit
    for (std::size_t at = 12; at < good.size(); at += good.size() / 50) {
        cases.push_back({good.substr(0, at), ""});
        std::string flipped = good;
        flipped[at] = static_cast<char>(flipped[at] ^ 0x10);
        cases.push_back({flipped, "corrupt"});
    }
    for (const Case& c : cases) {
        const std::string why = decode(c.bytes, kHash, out);
        EXPECT_NE(why, "");
        EXPECT_THAT(why, HasSubstr(c.says));
    }
    EXPECT_EQ(decode(good, kHash + 1, out), "of another configuration");
    // WHEN one such stands in the journal
    leave_unfinished();
    Database(path).run("UPDATE dwell SET checkpoint = ? WHERE position = 2",
                       {Blob{std::string_view(good).substr(0, 500)}});
    // THEN nothing is offered, with the place and the reason
    Journal journal(path, kHash);
    EXPECT_FALSE(journal.recovery().campaign);
    ASSERT_THAT(journal.recovery().refused, SizeIs(1));
    EXPECT_THAT(journal.recovery().refused[0],
                HasSubstr("checkpoint of run 1 position 2: corrupt: the checksum does not match: "
                          "cold start"));
}

TEST_F(JournalTest, TakesNoCheckpointThatDoesNotComeOutAsItDid) {
    estimator::Identification filter{estimator::Settings{}};
    std::vector<DwellCheckpoint> dwells{dwell(filter, 1)};
    dwells[0].measurements[100].angle_rad[0] += 1e-6;
    estimator::Identification again{estimator::Settings{}};
    EXPECT_EQ(replay(dwells, again), "run 1 position 1 does not come out as it did");
}

TEST_F(JournalTest, PutsADamagedOrNewerFileAside) {
    leave_unfinished();
    Database(path).execute("PRAGMA user_version = 7");
    {
        Journal journal(path, kHash);
        EXPECT_FALSE(journal.recovery().campaign);
        ASSERT_THAT(journal.recovery().refused, SizeIs(1));
        EXPECT_THAT(journal.recovery().refused[0], HasSubstr("version 7, newer than 1"));
        EXPECT_TRUE(std::filesystem::exists(path + ".version-7"));
    }
    std::ofstream(path, std::ios::trunc) << std::string(10'000, 'x');
    Journal journal(path, kHash);
    EXPECT_FALSE(journal.recovery().campaign);
    ASSERT_THAT(journal.recovery().refused, SizeIs(1));
    EXPECT_THAT(journal.recovery().refused[0], HasSubstr("cold start"));
    journal.start();
    journal.event({});
    journal.stop();
    EXPECT_TRUE(journal.status().running) << journal.status().note;
}

TEST_F(JournalTest, RefusesAPlaceWhereNothingCanBeKept) {
    EXPECT_THROW(Journal((folder / "missing" / "journal.sqlite3").string(), kHash), DatabaseError);
}

TEST_F(JournalTest, DoesNotKeepACheckpointWithMeasurementsMissing) {
    estimator::Identification filter{estimator::Settings{}};
    {
        Journal journal(path, kHash);
        journal.start();
        journal.campaign_begun("night", "Ada");
        auto short_of_one = dwell(filter, 1);
        short_of_one.measurements.pop_back();
        feed(journal, short_of_one);
        journal.stop();
    }
    Journal journal(path, kHash);
    EXPECT_FALSE(journal.recovery().campaign);
    ASSERT_THAT(journal.recovery().refused, SizeIs(1));
}

TEST_F(JournalTest, WaitsForADiskThatRefusesAndLosesNothing) {
    // GIVEN a journal whose files may not grow
    Journal journal(path, kHash);
    journal.start();
    journal.event({1, 1, 1, Severity::info, "a", "before"});
    const auto eventually = [](const auto& done) {
        for (int n = 0; n < 1000 && !done(); ++n)
            std::this_thread::sleep_for(std::chrono::milliseconds(10));
        return done();
    };
    ASSERT_TRUE(eventually([&] { return journal.status().written == 1; }));
    std::signal(SIGXFSZ, SIG_IGN);
    rlimit was{};
    ::getrlimit(RLIMIT_FSIZE, &was);
    const rlimit small{4096, was.rlim_max};
    ::setrlimit(RLIMIT_FSIZE, &small);
    // WHEN events come
    for (int n = 0; n < 200; ++n)
        journal.event({2, 2, 2, Severity::info, "b", std::string(1000, 'x')});
    const bool refused = eventually([&] { return !journal.status().running; });
    EXPECT_FALSE(journal.status().note.empty());
    ::setrlimit(RLIMIT_FSIZE, &was);
    ASSERT_TRUE(refused);
    // THEN they are on disk once it has room again
    EXPECT_TRUE(eventually([&] { return journal.status().running; }));
    journal.stop();
    EXPECT_EQ(journal.status().written, 201U);
    EXPECT_EQ(ask("SELECT count(*) FROM event").at(0).numbers[0], 201);
}

}  // namespace
}  // namespace vibrig::journal
