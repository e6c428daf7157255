#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <functional>
#include <random>
#include <thread>

#include "daemon/journal/journal.hpp"
#include "daemon/journal/signing_key.hpp"
#include "daemon/journal/verify.hpp"
#include "tests/unit/support/temporary_folder.hpp"

namespace vibrig::journal {
namespace {

namespace fs = std::filesystem;
using testing::Contains;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using namespace std::chrono_literals;

constexpr std::uint64_t kRig = 0x99;
constexpr int kEvents = 30;
constexpr std::int64_t kEntries = kEvents + 4;  // begin, events, a command, a latch, a proof
constexpr Pace kQuick{5ms, 20ms, 2000, 1 << 20};

/// Of a journal in a folder of its own.
struct ChainTest : testing::Test {
    TemporaryFolder folder;
    std::string path = folder.file("journal.sqlite3");

    void clear() const {
        fs::remove_all(folder);
        fs::create_directories(folder);
    }
    static void write_some(Journal& journal, int events = kEvents) {
        for (int n = 0; n < events; ++n)
            journal.event({1, n, n, Severity::info, "rig", "event " + std::to_string(n)});
        journal.command({CommandRequest::Kind::arm, "Ada", ""}, {true, "armed"}, 7);
        journal.latched({"tilt", "tilted", "Ada", {}, false, 3});
        journal.proved("Ada", R"({"passed":true})");
    }
    /// A daemon's life that ends in order.
    void live() const {
        Journal journal(path, kRig);
        journal.start();
        write_some(journal);
        journal.stop();
    }
    /// One that ends by SIGKILL, its log beside it.
    void live_and_die() const {
        const pid_t child = ::fork();
        if (child == 0) {
            Journal journal(path, kRig);
            journal.start();
            write_some(journal);
            while (journal.status().written < kEntries - 1) std::this_thread::sleep_for(1ms);
            while (!published(journal)) std::this_thread::sleep_for(1ms);
            std::raise(SIGKILL);
        }
        ::waitpid(child, nullptr, 0);
    }
    /// The newest head lies beside it.
    [[nodiscard]] bool published(const Journal& journal) const {
        const auto head = read_head(path + kHeadSuffix).head;
        return head && head->link.entry == static_cast<std::int64_t>(journal.status().entries);
    }
    [[nodiscard]] static bool eventually(const std::function<bool()>& done) {
        for (int n = 0; n < 2000; ++n) {
            if (done()) return true;
            std::this_thread::sleep_for(5ms);
        }
        return false;
    }
    static void flip(const std::string& file, std::uintmax_t at, int bit) {
        std::fstream stream(file, std::ios::in | std::ios::out | std::ios::binary);
        stream.seekg(static_cast<std::streamoff>(at));
        char byte = 0;
        stream.get(byte);
        stream.seekp(static_cast<std::streamoff>(at));
        stream.put(static_cast<char>(byte ^ (1 << bit)));
    }
    static void cut(const std::string& file) { fs::resize_file(file, fs::file_size(file) / 2); }
    /// From its middle on, a page of SQLite.
    static void overwrite(const std::string& file) {
        std::fstream stream(file, std::ios::in | std::ios::out | std::ios::binary);
        stream.seekp(static_cast<std::streamoff>(fs::file_size(file) / 2 / 4096 * 4096));
        stream << std::string(4096, '\xa5');
    }
    static void pipe_for(const std::string& file) {
        ASSERT_TRUE(fs::remove(file) && ::mkfifo(file.c_str(), 0600) == 0);
    }
    void by_hand(const char* sql) const { Database(path).execute(sql); }
    /// As a backup would, or somebody who had kept one.
    void copy_to(const fs::path& to) const {
        fs::remove_all(to);
        fs::copy(folder, to);
    }
    [[nodiscard]] std::vector<std::string> found(const Expectation& expected = {}) const {
        try {
            return verify_file(path, expected).found;
        } catch (const std::runtime_error& error) {
            return {error.what()};
        }
    }
    /// What the next start says, which has to latch it and to keep what was latched.
    std::string next_start(const std::vector<Anchor>& anchors = {}) const {
        Journal journal(path, kRig, {}, anchors);
        const auto& recovery = journal.recovery();
        if (recovery.refused.empty()) return {};
        std::vector<std::string> names;
        for (const Latch& latch : recovery.latches) names.push_back(latch.name);
        EXPECT_THAT(names, Contains(kJournalLatch)) << recovery.refused[0];
        EXPECT_TRUE(journal.status().verified);
        return recovery.refused[0];
    }
    [[nodiscard]] Anchor anchor() const {
        return {"recording a", *parse_head(verify_file(path).head)};
    }
};

TEST_F(ChainTest, IsSignedAndVerifiesAsItWasWritten) {
    live();
    const auto verdict = verify_file(path);
    EXPECT_THAT(verdict.found, IsEmpty());
    EXPECT_EQ(verdict.entries, kEntries);
    EXPECT_EQ(verdict.begins, "with the file");
    EXPECT_EQ(verdict.unpublished, 0);
    EXPECT_EQ(verdict.public_key.size(), 64u);
    struct stat key {};
    ASSERT_EQ(::stat((path + kKeySuffix).c_str(), &key), 0);
    EXPECT_EQ(key.st_mode & 0777, 0600U);
    EXPECT_THAT(found({{anchor()}, verdict.public_key, {}}), IsEmpty());
    EXPECT_EQ(next_start({anchor()}), "");
    EXPECT_THROW((void)verify_file(path + "x"), std::runtime_error);
}

TEST_F(ChainTest, SignsTheProofOfTheSafeState) {
    live();
    std::string proof;
    {
        const Journal journal(path, kRig);
        proof = journal.status().proof_head;
    }
    const auto head = parse_head(proof);
    ASSERT_TRUE(head) << proof;
    EXPECT_TRUE(head->holds());
    EXPECT_EQ(head->link.entry, kEntries);
    EXPECT_THAT(found({{{"the proof", *head}}, {}, {}}), IsEmpty());
    by_hand("UPDATE proof SET record = '{\"passed\":false}'");
    EXPECT_THAT(found(), Contains(HasSubstr("proof 1 (entry 34) was changed")));
}

TEST_F(ChainTest, ASignedLineIsReadBackFromAnyTextAndNothingElseIs) {
    const SigningKey key((folder / "key").string());
    const Link link{7, sha256("seven")};
    const auto head = sign_head(to_hex(sha256("one")), link, 12, key);
    EXPECT_TRUE(head.holds());
    const auto again = heads_in("<p>head: " + head.line() + "</p>");
    ASSERT_EQ(again.size(), 1u);
    EXPECT_EQ(again[0].line(), head.line());
    EXPECT_TRUE(again[0].holds());
    auto other = head;
    ++other.link.entry;
    EXPECT_FALSE(other.holds());
    for (std::size_t n = 0; n < head.line().size(); ++n)
        EXPECT_FALSE(parse_head(head.line().substr(0, n))) << n;
}

TEST_F(ChainTest, ReadingChangesNothingAndLeavesNothing) {
    const auto files = [this] {
        std::vector<std::string> names;
        for (const auto& file : fs::directory_iterator(folder))
            names.push_back(file.path().string());
        std::ranges::sort(names);
        return names;
    };
    live();
    const auto before = files();
    EXPECT_THAT(found(), IsEmpty());
    EXPECT_EQ(files(), before);
    live_and_die();
    EXPECT_THAT(found(), IsEmpty()) << "with its log beside it";
}

TEST_F(ChainTest, NamesWhatWasChangedByHand) {
    struct Case {
        const char *sql, *says;
    };
    for (const Case& c : {
             Case{"UPDATE event SET text = 'nothing' WHERE id = 7",
                  "event 7 (entry 8) was changed"},
             Case{"DELETE FROM event WHERE id = 9", "event 9 (entry 10) is missing"},
             Case{"DELETE FROM command", "command 1 (entry 32) is missing"},
             Case{"UPDATE safety SET what = 'acknowledged'", "safety 1 (entry 33) was changed"},
             Case{"DELETE FROM proof", "proof 1 (entry 34) is missing"},
             Case{"UPDATE event SET id = 100 WHERE id = 3; UPDATE event SET id = 3 WHERE id = 4; "
                  "UPDATE event SET id = 4 WHERE id = 100",
                  "event 4 (entry 5) was changed"},
             Case{"INSERT INTO event (utc_ns, time_ns, severity, source, text) "
                  "VALUES (1, 1, 'info', 'rig', 'made up')",
                  "event 31 is in no entry of the chain"},
             Case{"DELETE FROM chain WHERE entry > 30; DELETE FROM event WHERE id > 29; "
                  "DELETE FROM command; DELETE FROM safety; DELETE FROM proof",
                  "ends at entry 30, earlier than entry 34 that its signed head names"},
             Case{"DELETE FROM chain WHERE entry = 12; DELETE FROM event WHERE id = 11",
                  "entries 12 to 12 are missing"},
             Case{"UPDATE chain SET digest = x'00' WHERE entry = 5",
                  "entry 5 (event 4) does not follow"},
             Case{"UPDATE chain SET digest = 'text' WHERE entry = 5",
                  "entry 5 (event 4) does not follow"},
             Case{"UPDATE chain SET tbl = 'none' WHERE entry = 5", "unknown table, none"},
             Case{"DELETE FROM head", "its newest entry is not signed"},
             Case{"UPDATE head SET line = 'x'", "its newest entry is not signed"},
             Case{"DROP TABLE chain", "chain"},
             Case{"DROP TABLE safety", "table safety is missing"},
             Case{"CREATE TRIGGER quiet AFTER INSERT ON event BEGIN "
                  "UPDATE event SET text = '' WHERE id = NEW.id; END",
                  "trigger quiet is none of the journal's"},
             Case{"ALTER TABLE event ADD COLUMN more", "event 1 (entry 2) was changed"},
             Case{"PRAGMA user_version = 1", "version 1"},
             Case{"PRAGMA user_version = 9", "found version 9, newer than 2"},
         }) {
        clear();
        live();
        by_hand(c.sql);
        EXPECT_THAT(found(), Contains(HasSubstr(c.says))) << c.sql;
        const auto said = next_start();
        EXPECT_THAT(said, HasSubstr(c.says)) << c.sql;
        EXPECT_THAT(said, HasSubstr("put aside as " + path + ".aside.")) << c.sql;
        EXPECT_EQ(next_start(), "") << c.sql << ": it is reported once, and stays latched";
        EXPECT_THAT(found(), IsEmpty()) << c.sql;
    }
}

TEST_F(ChainTest, TheTableOfCommissioningCameLaterAndIsMissedOnceItSaysSomething) {
    // GIVEN a file of a release that had no such table
    live();
    by_hand("DROP TABLE commissioning");
    EXPECT_THAT(found(), IsEmpty());
    // WHEN this one goes on with it
    {
        Journal journal(path, kRig);
        EXPECT_THAT(journal.recovery().refused, IsEmpty());
        journal.start();
        journal.commissioned(
            {"gimbals", "B", "Ada", "uid 0", "permission", R"({"value":"yes"})", 9});
        journal.stop();
    }
    // THEN what was done is in it and in the chain
    EXPECT_THAT(found(), IsEmpty());
    {
        Database database(path, Database::Mode::read);
        const auto row = database.ask("SELECT part, identity, what FROM commissioning").at(0);
        EXPECT_THAT(row.texts, testing::ElementsAre("gimbals", "uid 0", "permission"));
    }
    // AND is missed
    by_hand("DROP TABLE commissioning");
    EXPECT_THAT(found(), Contains(HasSubstr("table commissioning is missing")));
    EXPECT_THAT(next_start(), HasSubstr("table commissioning is missing"));
}

TEST_F(ChainTest, WhoHasSignedAPartOfTheCommissioningRecordIsKnownAtTheNextStart) {
    const auto signers = [this](const std::vector<std::pair<const char*, const char*>>& rows) {
        {
            Journal journal(path, kRig);
            journal.start();
            for (const auto& [part, what] : rows)
                journal.commissioned({part, "", "Ada", "uid 0", what, "{}", 9});
            journal.stop();
        }
        return Journal(path, kRig).recovery().signed_parts;
    };
    const std::pair<std::string, std::string> gyros{"gyros", "Ada"}, earth{"earth", "Ada"};
    EXPECT_THAT(signers({{"gyros", "accept"}, {"earth", "accept"}}), IsEmpty());
    EXPECT_THAT(signers({{"gyros", "sign"}}), testing::ElementsAre(gyros));
    EXPECT_THAT(signers({{"earth", "sign"}, {"gyros", "void"}}),
                testing::ElementsAre(gyros, earth));
    // Recorded anew, it was signed by nobody since.
    EXPECT_THAT(signers({{"gyros", "accept"}}), testing::ElementsAre(earth));
}

TEST_F(ChainTest, NoticesWhatSomebodyAddsWhoKnowsTheChainAndHasNoKey) {
    live();
    {
        Database database(path);
        database.execute(
            "INSERT INTO safety (utc_ns, what, name, person, text, two_persons) "
            "VALUES (9, 'acknowledged', 'tilt', 'Ada', '', 0)");
        Chain chain(Chain::newest(database));
        chain.append(database, "safety", database.last_id());
    }
    EXPECT_THAT(found(), Contains("entries 35 to 35 are not signed: not written by the daemon"));
    EXPECT_THAT(next_start(), HasSubstr("entries 35 to 35 are not signed"));
}

TEST_F(ChainTest, NoticesFilesThatAreGoneCutOrOthers) {
    struct Case {
        const char* what;
        bool died;
        std::function<void()> harm;
        const char* says;
    };
    const auto other_key = [&] {
        fs::remove(path + kKeySuffix);
        SigningKey(path + kKeySuffix).keep();
    };
    const auto other_with = [&](const std::string& table) {
        fs::remove(path);
        Database(path).execute(("CREATE TABLE " + table + " (id INTEGER)").c_str());
    };
    const std::vector<Case> cases{
        {"gone", false, [&] { fs::remove(path); }, "is gone, with 34 entries"},
        {"gone with its head", false,
         [&] {
             fs::remove(path);
             fs::remove(path + kHeadSuffix);
         },
         "and so is its signed head; its key is there"},
        {"zero length", false, [&] { fs::resize_file(path, 0); }, "has length zero"},
        {"another database", false, [&] { other_with("event"); }, "found version 0"},
        {"somebody else's database", false, [&] { other_with("file"); }, "found version 0"},
        {"no database", false, [&] { std::ofstream(path) << std::string(9000, 'x'); },
         "is damaged: it does not begin as an SQLite file does"},
        {"halved", false, [&] { cut(path); },
         "is damaged: a part of it is missing or was overwritten"},
        {"overwritten", false, [&] { overwrite(path); }, "is damaged: "},
        {"its log gone", true, [&] { fs::remove(path + "-wal"); }, ""},
        {"its log halved", true, [&] { cut(path + "-wal"); }, ""},
        {"both halved", true,
         [&] {
             cut(path);
             cut(path + "-wal");
         },
         ""},
        {"head gone", false, [&] { fs::remove(path + kHeadSuffix); }, "signed head is gone"},
        {"head cut", false, [&] { cut(path + kHeadSuffix); }, "is no journal's head"},
        {"key gone", false, [&] { fs::remove(path + kKeySuffix); }, "key is gone"},
        {"a pipe for its head", false, [&] { pipe_for(path + kHeadSuffix); },
         "is no journal's head"},
        {"a pipe for its key", false, [&] { pipe_for(path + kKeySuffix); }, "is no file"},
        {"key of others", false, [&] { ::chmod((path + kKeySuffix).c_str(), 0640); },
         "found mode 0640, expected 0600"},
        {"key cut", false, [&] { cut(path + kKeySuffix); }, "is no Ed25519 key"},
        {"another key", false, other_key, "the journal's key is SHA256:"},
    };
    for (const Case& c : cases) {
        clear();
        c.died ? live_and_die() : live();
        const auto kept = anchor();
        c.harm();
        const auto said = next_start({kept});
        EXPECT_NE(said, "") << c.what;
        EXPECT_THAT(said, HasSubstr(c.says)) << c.what;
        EXPECT_THAT(said, Not(HasSubstr("cannot write"))) << c.what;
        EXPECT_THAT(said, Not(HasSubstr("\n"))) << c.what;
        EXPECT_EQ(next_start({kept}), "") << c.what << ": goes on with a new one";
        EXPECT_THAT(found(), IsEmpty()) << c.what;
        struct stat key {};
        ASSERT_EQ(::stat((path + kKeySuffix).c_str(), &key), 0) << c.what;
        EXPECT_EQ(key.st_mode & 0777, 0600U) << c.what;
    }
}

TEST_F(ChainTest, NoticesABackupPutInItsPlaceByWhatIsKeptElsewhere) {
    const fs::path backup = folder.string() + "-backup";
    live();
    copy_to(backup);
    live();  // goes on
    const Anchor later = anchor();
    EXPECT_EQ(next_start({later}), "");
    copy_to(folder.string() + "-whole");
    for (const char* part : {"", kHeadSuffix})
        fs::copy_file(backup / ("journal.sqlite3" + std::string(part)), path + part,
                      fs::copy_options::overwrite_existing);
    EXPECT_THAT(found(), IsEmpty()) << "by itself it is whole";
    EXPECT_THAT(found({{later}, {}, {}}), Contains(HasSubstr("that recording a names")));
    EXPECT_THAT(next_start({later}), HasSubstr("that recording a names"));
    EXPECT_EQ(next_start({later}), "") << "known from then on";
    // All of it deleted, the key too: like a first start, but for the recording.
    clear();
    EXPECT_THAT(next_start({later}), HasSubstr("recording a names entry"));
    EXPECT_EQ(next_start({later}), "");
    EXPECT_THAT(found({{later}, {}, {}}), Contains(HasSubstr("of another journal")));
    fs::remove_all(backup);
    fs::remove_all(folder.string() + "-whole");
}

TEST_F(ChainTest, AnOlderHeadBesideItSaysNothingAndIsMended) {
    live();
    const auto older = folder / "older";
    fs::copy_file(path + kHeadSuffix, older);
    live();
    fs::copy_file(older, path + kHeadSuffix, fs::copy_options::overwrite_existing);
    EXPECT_THAT(found(), IsEmpty()) << "as after SIGKILL: its own signature covers the rest";
    EXPECT_GT(verify_file(path).unpublished, 0);
    EXPECT_EQ(next_start(), "");
    EXPECT_EQ(verify_file(path).unpublished, 0);
}

TEST_F(ChainTest, NoticesAnyFlippedBitOrItChangesNothingThatIsRead) {
    constexpr int kSeed = 5, kFlips = 200;
    live();
    const auto rows = [](const std::string& file) {
        Database database(file, Database::Mode::read);
        std::string all;
        for (const char* table : {"event", "command", "safety", "origin", "proof"}) {
            const std::string ask = std::string("SELECT rowid FROM ") + table;
            for (const Row& row : database.ask(ask.c_str()))
                all += database.row_bytes(table, row.numbers[0]);
        }
        return all;
    };
    const std::string whole = rows(path), kept = path + ".kept";
    fs::copy_file(path, kept);
    std::mt19937_64 random(kSeed);
    int noticed = 0;
    for (int n = 0; n < kFlips; ++n) {
        fs::copy_file(kept, path, fs::copy_options::overwrite_existing);
        const auto at = random() % fs::file_size(path);
        flip(path, at, static_cast<int>(random() % 8));
        const auto what = found();
        noticed += what.empty() ? 0 : 1;
        if (!what.empty()) continue;
        EXPECT_EQ(rows(path), whole) << "byte " << at << ", seed " << kSeed;
    }
    EXPECT_GT(noticed, 10);
    EXPECT_GT(noticed, 10);
    std::printf("# %d of %d flipped bits noticed; the others lie in bytes that say nothing\n",
                noticed, kFlips);
}

struct Harm {
    const char* what;
    std::function<void()> harm;
    const char* says;
};

/// What is done to it while it runs.
std::vector<Harm> harms_while_it_runs(const ChainTest& test) {
    const std::string& path = test.path;
    const std::string key = path + kKeySuffix;
    return {
        {"deleted", [=] { fs::remove(path); }, "was deleted while the daemon ran"},
        {"replaced",
         [=] {
             fs::copy_file(path, path + ".copy");
             fs::rename(path + ".copy", path);
         },
         "was replaced by another file"},
        {"cut", [=] { fs::resize_file(path, 100); }, "was cut from"},
        {"its log deleted", [=] { fs::remove(path + "-wal"); }, "-wal: was deleted or replaced"},
        {"its head deleted", [=] { fs::remove(path + kHeadSuffix); }, ".head: was deleted"},
        {"its key deleted", [=] { fs::remove(key); }, ".key: was deleted"},
        {"its key opened", [=] { ::chmod(key.c_str(), 0644); }, "or opened to others"},
        {"UPDATE by hand", [&test] { test.by_hand("UPDATE event SET text = 'x' WHERE id = 3"); },
         "event 3 (entry 4) was changed"},
        {"the tail by hand",
         [&test] {
             test.by_hand("DELETE FROM chain WHERE entry > 20; DELETE FROM event WHERE id > 10");
         },
         "earlier than entry"},
    };
}

TEST_F(ChainTest, NoticesWhileItRuns) {
    for (const Harm& c : harms_while_it_runs(*this)) {
        clear();
        {
            Journal journal(path, kRig, {}, {}, kQuick);
            journal.start();
            write_some(journal);
            ASSERT_TRUE(eventually([&] { return journal.status().written >= kEntries - 1; }));
            EXPECT_THAT(journal.take_found(), IsEmpty()) << c.what;
            const auto armed = journal.armed("Ada", "9 g");
            ASSERT_TRUE(eventually([&] { return journal.on_disk(armed) && published(journal); }));
            std::this_thread::sleep_for(100ms);  // the watch has looked at it all
            EXPECT_TRUE(eventually([&] { return journal.status().verified; })) << c.what;
            const std::string key = journal.status().public_key;
            c.harm();
            std::vector<std::string> said;
            ASSERT_TRUE(eventually([&] { return !(said = journal.take_found()).empty(); }))
                << c.what;
            EXPECT_THAT(said[0], HasSubstr(c.says)) << c.what;
            // It goes on, with what was latched and armed.
            journal.event({1, 1, 1, Severity::info, "rig", "after"});
            journal.stop();
            EXPECT_TRUE(journal.status().running) << journal.status().note;
            EXPECT_THAT(journal.take_found(), IsEmpty()) << c.what << ": said once";
            const bool of_key = std::string(c.what).find("key") != std::string::npos;
            EXPECT_EQ(journal.status().public_key == key, !of_key) << c.what;
        }
        EXPECT_THAT(found(), IsEmpty()) << c.what;
        Journal journal(path, kRig);
        EXPECT_THAT(journal.recovery().refused, IsEmpty()) << c.what;
        std::vector<std::string> names;
        for (const Latch& latch : journal.recovery().latches) names.push_back(latch.name);
        EXPECT_THAT(names, testing::UnorderedElementsAre("tilt", kJournalLatch, kDiedArmed))
            << c.what;
    }
}

/// Who closes a recording takes the head that is shown.
TEST_F(ChainTest, WhatIsSaidToBeWrittenIsBelowTheHeadThatIsShown) {
    Journal journal(path, kRig);
    std::atomic<int> looks{0}, short_of_it{0};
    journal.on_written([&] {
        const auto status = journal.status();
        const auto head = parse_head(status.head);
        // An entry for each, behind that of the file's origin.
        if (!head || head->link.entry <= static_cast<std::int64_t>(status.written)) ++short_of_it;
        ++looks;
    });
    journal.start();
    for (int i = 0; i < 20; ++i) {
        journal.event({1, 1, 1, Severity::info, "rig", "one at a time"});
        ASSERT_TRUE(eventually([&] { return looks > i; }));
    }
    journal.stop();
    EXPECT_EQ(short_of_it, 0);
}

TEST_F(ChainTest, IsNotVerifiedFromAWriteByAnotherUntilAllOfItWasLookedAt) {
    live();
    Journal journal(path, kRig, {}, {}, {5ms, 20ms, 1, 1 << 20});  // a step for each entry
    EXPECT_TRUE(journal.status().verified) << "a small one is, when the start goes on";
    journal.start();
    by_hand("CREATE TABLE scratch (x); DROP TABLE scratch");
    EXPECT_TRUE(eventually([&] { return !journal.status().verified; }));
    EXPECT_TRUE(eventually([&] { return journal.status().verified; }));
    EXPECT_THAT(journal.take_found(), IsEmpty());
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
    EXPECT_THAT(found(), Contains(HasSubstr("nothing says whether")));
    {
        Journal journal(path, kRig);
        EXPECT_THAT(journal.recovery().refused, IsEmpty());
        EXPECT_THAT(journal.recovery().begins, HasSubstr("2 rows that version 1 had kept"));
    }
    EXPECT_THAT(found(), IsEmpty());
    EXPECT_EQ(verify_file(path).entries, 3);
    by_hand("UPDATE event SET text = 'of new' WHERE id = 2");
    EXPECT_THAT(found(), Contains("event 2 (entry 3) was changed"));
    by_hand("UPDATE event SET text = 'of old' WHERE id = 2");
    {
        Journal journal(path, kRig);
        EXPECT_EQ(journal.recovery().begins, "") << "said once";
    }
    // An older file in its place is not taken for one that was never chained.
    by_hand("DROP TABLE chain; DROP TABLE origin; DROP TABLE head; PRAGMA user_version = 1");
    EXPECT_THAT(next_start(), HasSubstr("found version 1, expected 2"));
}

TEST_F(ChainTest, AStartThatIsKilledAnywhereRaisesNoAlarm) {
    std::mt19937 random(3);
    std::uniform_int_distribution<int> delay_us(0, 40'000);
    for (int kill = 0; kill < 40; ++kill) {
        SCOPED_TRACE("kill " + std::to_string(kill) + ", seed 3");
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
        // Seen by a reader, before anything mends it, and by the next start.
        const bool much = fs::exists(path + "-wal") && fs::file_size(path + "-wal") > 100'000;
        EXPECT_THAT(much ? found() : std::vector<std::string>(), IsEmpty());
        Journal journal(path, kRig);
        EXPECT_THAT(journal.recovery().refused, IsEmpty());
    }
}

}  // namespace
}  // namespace vibrig::journal
