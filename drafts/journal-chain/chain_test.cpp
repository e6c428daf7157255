#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <functional>
#include <random>
#include <thread>

#include "daemon/journal/journal.hpp"
#include "daemon/journal/verify.hpp"

namespace vibrig::journal {
namespace {

namespace fs = std::filesystem;
using testing::AnyOf;
using testing::Contains;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using testing::SizeIs;
using namespace std::chrono_literals;

constexpr std::uint64_t kRig = 0x99;
constexpr int kEvents = 30;

struct ChainTest : testing::Test {
    fs::path folder = fs::path(testing::TempDir()) / ("vibrig-chain-" + std::to_string(::getpid()));
    std::string path = (folder / "journal.sqlite3").string();

    ChainTest() { clear(); }
    ~ChainTest() override { fs::remove_all(folder); }
    void clear() const {
        fs::remove_all(folder);
        fs::create_directories(folder);
    }
    static void write_events(Journal& journal, int events = kEvents) {
        for (int n = 0; n < events; ++n)
            journal.event({1, n, n, Severity::info, "rig", "event " + std::to_string(n)});
        journal.command({CommandRequest::Kind::arm, "Ada", ""}, {true, "armed"}, 7);
        journal.latched({"tilt", "tilted", "Ada", {}, false, 3});
    }
    /// A daemon's life that ends in order.
    void live() const {
        Journal journal(path, kRig);
        journal.start();
        write_events(journal);
        journal.stop();
    }
    /// One that ends by SIGKILL, its log beside it.
    void live_and_die() const {
        const pid_t child = ::fork();
        if (child == 0) {
            Journal journal(path, kRig);
            journal.start();
            write_events(journal);
            while (journal.status().written < kEvents + 2U) std::this_thread::sleep_for(1ms);
            std::this_thread::sleep_for(50ms);  // the head lies beside it
            std::raise(SIGKILL);
        }
        ::waitpid(child, nullptr, 0);
    }
    [[nodiscard]] static bool eventually(const std::function<bool()>& done) {
        for (int n = 0; n < 2000 && !done(); ++n) std::this_thread::sleep_for(5ms);
        return done();
    }
    void flip(const std::string& file, std::uintmax_t at, int bit) const {
        std::fstream stream(file, std::ios::in | std::ios::out | std::ios::binary);
        stream.seekg(static_cast<std::streamoff>(at));
        char byte = 0;
        stream.get(byte);
        stream.seekp(static_cast<std::streamoff>(at));
        stream.put(static_cast<char>(byte ^ (1 << bit)));
    }
    void by_hand(const char* sql) const { Database(path).execute(sql); }
    /// What the next start says, which has to latch it and to keep what was latched.
    std::string next_start() const {
        Journal journal(path, kRig);
        const auto& recovery = journal.recovery();
        if (recovery.refused.empty()) return {};
        EXPECT_THAT(recovery.refused[0], HasSubstr("put aside as " + path + ".changed."));
        std::vector<std::string> names;
        for (const Latch& latch : recovery.latches) names.push_back(latch.name);
        EXPECT_THAT(names, Contains(kJournalLatch));
        return recovery.refused[0];
    }
};

TEST_F(ChainTest, IsSignedAndVerifiesAsItWasWritten) {
    live();
    const auto verdict = verify_file(path);
    EXPECT_THAT(verdict.found, IsEmpty());
    EXPECT_EQ(verdict.entries, kEvents + 3) << "how it begins, events, a command, a latch";
    EXPECT_EQ(verdict.begins, "the chain begins with the file");
    EXPECT_THAT(verdict.public_key, SizeIs(64));
    struct stat key {};
    ASSERT_EQ(::stat((path + kKeySuffix).c_str(), &key), 0);
    EXPECT_EQ(key.st_mode & 0777, 0600U);
    EXPECT_EQ(next_start(), "");
    // and says by which head it goes
    EXPECT_THAT(verify_file(path, verdict.head).found, IsEmpty());
    auto other = verdict.head;
    other.back() = other.back() == '0' ? '1' : '0';
    EXPECT_THAT(verify_file(path, other).found, Contains(HasSubstr("is another one than --head")));
    EXPECT_THROW(verify_file(path, "12:ab"), std::runtime_error);
    EXPECT_THROW(verify_file(path + "x"), std::runtime_error);
}

TEST_F(ChainTest, ReadingChangesNothingAndLeavesNothing) {
    live();
    const auto files = [this] {
        std::vector<std::string> names;
        for (const auto& file : fs::directory_iterator(folder)) names.push_back(file.path().string());
        std::ranges::sort(names);
        return names;
    };
    const auto before = files();
    EXPECT_THAT(verify_file(path).found, IsEmpty());
    EXPECT_EQ(files(), before);
    live_and_die();
    EXPECT_THAT(verify_file(path).found, IsEmpty()) << "with its log beside it";
}

TEST_F(ChainTest, NamesWhatWasChangedByHand) {
    struct Case {
        const char* sql;
        const char* says;
    };
    for (const Case& c : {
             Case{"UPDATE event SET text = 'nothing' WHERE id = 7", "event 7 (entry 8) was changed"},
             Case{"DELETE FROM event WHERE id = 9", "event 9 (entry 10) is missing"},
             Case{"DELETE FROM command", "command 1 (entry 32) is missing"},
             Case{"UPDATE safety SET what = 'acknowledged'", "safety 1 (entry 33) was changed"},
             Case{"INSERT INTO event (utc_ns, time_ns, severity, source, text) "
                  "VALUES (1, 1, 'info', 'rig', 'made up')",
                  "event 31 is in no entry of the chain"},
             Case{"DELETE FROM chain WHERE entry > 30; DELETE FROM event WHERE id > 29; "
                  "DELETE FROM command; DELETE FROM safety",
                  "entries 31 to 33 are missing, as the signed head says"},
             Case{"DELETE FROM chain WHERE entry = 12; DELETE FROM event WHERE id = 11",
                  "entries 12 to 12 are missing"},
             Case{"UPDATE chain SET digest = x'00' WHERE entry = 5",
                  "entry 5 (event 4) does not follow"},
             Case{"UPDATE campaign SET state = 'x'; UPDATE event SET utc_ns = NULL WHERE 0", ""},
         }) {
        clear();
        live();
        by_hand(c.sql);
        const auto found = verify_file(path).found;
        if (*c.says == '\0') {
            EXPECT_THAT(found, IsEmpty());
            continue;
        }
        EXPECT_THAT(found, Contains(HasSubstr(c.says))) << c.sql;
        EXPECT_THAT(next_start(), HasSubstr(c.says)) << c.sql;
        EXPECT_EQ(next_start(), "") << "it is told once, and stays latched";
    }
}

TEST_F(ChainTest, NoticesFilesThatAreGoneCutOrOthers) {
    const auto cut = [](const std::string& file) { fs::resize_file(file, fs::file_size(file) / 2); };
    struct Case {
        const char* what;
        bool died;
        std::function<void()> harm;
        const char* says;
    };
    const std::vector<Case> cases{
        {"gone", false, [&] { fs::remove(path); }, "is gone, with 33 entries"},
        {"zero length", false, [&] { fs::resize_file(path, 0); }, "has length zero"},
        {"halved", false, [&] { cut(path); }, ""},
        {"its log gone", true, [&] { fs::remove(path + "-wal"); }, ""},
        {"its log halved", true, [&] { cut(path + "-wal"); }, "are missing, as the signed head"},
        {"both halved", true, [&] { cut(path); cut(path + "-wal"); }, ""},
        {"head gone", false, [&] { fs::remove(path + ".head"); }, "the signed head is gone"},
        {"head cut", false, [&] { cut(path + ".head"); }, "is no journal's head"},
        {"key gone", false, [&] { fs::remove(path + ".key"); }, "the key is gone"},
        {"key open", false, [&] { ::chmod((path + ".key").c_str(), 0644); }, "others than its owner"},
    };
    for (const Case& c : cases) {
        clear();
        c.died ? live_and_die() : live();
        c.harm();
        const auto said = next_start();
        EXPECT_NE(said, "") << c.what;
        EXPECT_THAT(said, HasSubstr(c.says)) << c.what;
        EXPECT_EQ(next_start(), "") << c.what << ": goes on with a new one";
        EXPECT_THAT(verify_file(path).found, IsEmpty()) << c.what;
    }
}

TEST_F(ChainTest, NoticesAnyFlippedBitOrItChangesNothingThatIsRead) {
    live();
    const auto rows = [](const std::string& file) {
        Database database(file, Database::Mode::read);
        std::string all;
        for (const char* table : {"event", "command", "safety", "origin"}) {
            const std::string ask = std::string("SELECT rowid FROM ") + table;
            for (const Row& row : database.ask(ask.c_str()))
                all += database.row_bytes(table, row.numbers[0]);
        }
        return all;
    };
    const std::string whole = rows(path);
    const std::string kept = path + ".kept";
    fs::copy_file(path, kept);
    std::mt19937_64 random(5);
    int noticed = 0;
    for (int n = 0; n < 200; ++n) {
        fs::copy_file(kept, path, fs::copy_options::overwrite_existing);
        const auto at = random() % fs::file_size(path);
        flip(path, at, static_cast<int>(random() % 8));
        std::vector<std::string> found;
        try {
            found = verify_file(path).found;
        } catch (const std::runtime_error& error) {
            found.emplace_back(error.what());
        }
        noticed += found.empty() ? 0 : 1;
        if (found.empty()) EXPECT_EQ(rows(path), whole) << "byte " << at << ", seed 5";
    }
    EXPECT_GT(noticed, 20);
    std::printf("# %d of 200 flipped bits noticed; the others lie in bytes that say nothing\n", noticed);
}

TEST_F(ChainTest, NoticesWhileItRuns) {
    struct Case {
        const char* what;
        std::function<void()> harm;
        const char* says;
    };
    const std::vector<Case> cases{
        {"deleted", [&] { fs::remove(path); }, "was deleted while the daemon ran"},
        {"replaced",
         [&] {
             fs::copy_file(path, path + ".copy");
             fs::rename(path + ".copy", path);
         },
         "was replaced by another file"},
        {"its log deleted", [&] { fs::remove(path + "-wal"); }, "-wal: was deleted"},
        {"UPDATE by hand", [&] { by_hand("UPDATE event SET text = 'x' WHERE id = 3"); },
         "event 3 (entry 4) was changed"},
        {"the tail by hand",
         [&] { by_hand("DELETE FROM chain WHERE entry > 20; DELETE FROM event WHERE id > 10"); },
         "are missing"},
    };
    for (const Case& c : cases) {
        clear();
        {
            Journal journal(path, kRig, {}, {2000, 1 << 20, 100'000'000});
            journal.start();
            write_events(journal);
            ASSERT_TRUE(eventually([&] { return journal.status().written >= kEvents + 2U; }));
            ASSERT_TRUE(eventually([&] { return journal.status().verified; })) << c.what;
            EXPECT_THAT(journal.take_found(), IsEmpty()) << c.what;
            const auto armed = journal.armed("Ada", "9 g");
            ASSERT_TRUE(eventually([&] { return journal.on_disk(armed); }));
            c.harm();
            std::vector<std::string> found;
            ASSERT_TRUE(eventually([&] { return !(found = journal.take_found()).empty(); }))
                << c.what;
            EXPECT_THAT(found[0], HasSubstr(c.says)) << c.what;
            EXPECT_THAT(found[0], HasSubstr("put aside")) << c.what;
            // It goes on, with what was latched and armed.
            journal.event({1, 1, 1, Severity::info, "rig", "after"});
            journal.stop();
            EXPECT_TRUE(journal.status().running) << journal.status().note;
        }
        EXPECT_THAT(verify_file(path).found, IsEmpty()) << c.what;
        Journal journal(path, kRig);
        std::vector<std::string> names;
        for (const Latch& latch : journal.recovery().latches) names.push_back(latch.name);
        EXPECT_THAT(names, testing::UnorderedElementsAre("tilt", kJournalLatch, kDiedArmed))
            << c.what;
    }
}

TEST_F(ChainTest, BeginsWithWhatAnOlderVersionHadKept) {
    {
        Database old(path);
        old.execute(
            "CREATE TABLE event (id INTEGER PRIMARY KEY, utc_ns INTEGER NOT NULL, time_ns INTEGER "
            "NOT NULL, severity TEXT NOT NULL, source TEXT NOT NULL, text TEXT NOT NULL);"
            "INSERT INTO event VALUES (1, 1, 1, 'info', 'rig', 'of old'), "
            "(2, 1, 1, 'info', 'rig', 'of old'); PRAGMA user_version = 1");
    }
    EXPECT_THAT(verify_file(path).found, Contains(HasSubstr("nothing says whether")));
    {
        Journal journal(path, kRig);
        EXPECT_THAT(journal.recovery().refused, IsEmpty());
        EXPECT_THAT(journal.recovery().begins, HasSubstr("version 1 had kept without one: 2 rows"));
    }
    const auto verdict = verify_file(path);
    EXPECT_THAT(verdict.found, IsEmpty());
    EXPECT_THAT(verdict.begins, HasSubstr("version 1"));
    // An older file in its place is not taken for one that was never chained.
    Database(path).execute("DROP TABLE chain; PRAGMA user_version = 1");
    EXPECT_THAT(next_start(), HasSubstr("found version 1, expected 2"));
}

TEST_F(ChainTest, AStartThatIsKilledAnywhereRaisesNoAlarm) {
    std::mt19937 random(3);
    std::uniform_int_distribution<int> delay_us(0, 40'000);
    clear();
    for (int kill = 0; kill < 30; ++kill) {
        if (kill % 3 == 0) clear();
        const pid_t child = ::fork();
        if (child == 0) {
            Journal journal(path, kRig);
            journal.start();
            for (;;) {
                journal.event({1, 1, 1, Severity::info, "rig", "on and on"});
                std::this_thread::sleep_for(1ms);
            }
        }
        std::this_thread::sleep_for(std::chrono::microseconds(delay_us(random)));
        ::kill(child, SIGKILL);
        ::waitpid(child, nullptr, 0);
        Journal journal(path, kRig);
        EXPECT_THAT(journal.recovery().refused, IsEmpty()) << "kill " << kill << ", seed 3";
    }
}

}  // namespace
}  // namespace vibrig::journal
