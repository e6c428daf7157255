#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <limits>

#include "daemon/archive/index.hpp"
#include "daemon/archive/manifest.hpp"
#include "daemon/archive/schema.hpp"
#include "daemon/journal/database.hpp"
#include "daemon/record/index.hpp"
#include "tests/unit/daemon/archive/entries.hpp"
#include "tests/unit/support/temporary_folder.hpp"

namespace vibrig::archive {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class ArchiveIndex : public ::testing::Test {
  protected:
    /// As a vibrig of that version left it, with a campaign.
    void make_version(int version) const {
        journal::Database database(path_);
        database.execute("CREATE TABLE index_version (number INTEGER PRIMARY KEY)");
        for (int to = 1; to <= version; ++to) {
            for (const auto& sql : migrations()[static_cast<std::size_t>(to) - 1])
                database.execute(sql.c_str());
            database.run("INSERT INTO index_version VALUES (?)", {std::int64_t{to}});
        }
        if (version == 0) return;
        database.execute("INSERT INTO campaign VALUES ('old', 'an old one', 'Ada', 5, 'finished')");
        if (version < 2) return;
        database.execute(
            "INSERT INTO result (campaign, hash, rig, unit_type, unit_serial, reason, mark, "
            "ended_utc_ns, simulated, version, compiler, instruction_set, configuration_hash, "
            "verdict, sentence, nis, dwells) VALUES ('old', 'h', 'r', 'T', '17', '', '', 9, 0, "
            "'0', '', '', '', 'valid', '', 1, 28)");
        database.execute(
            "INSERT INTO coefficient (campaign, position, name, value, sigma, u_a, u, expanded) "
            "VALUES ('old', 4, 'D_IIx', 0.5, 0.1, 0.1, 0.2, 0.4)");
    }
    static std::vector<std::string> keys(const std::vector<Entry>& entries) {
        std::vector<std::string> out;
        for (const auto& one : entries) out.push_back(one.key);
        return out;
    }

    TemporaryFolder temporary_;
    const std::string folder_ = temporary_.string(), path_ = index_in(folder_);
};

TEST_F(ArchiveIndex, ComesFromEachOlderVersionWithWhatItHad) {
    for (int version = 0; version < newest_version(); ++version) {
        SCOPED_TRACE(version);
        for (const char* end : {"", "-wal", "-shm"}) fs::remove(path_ + end);
        make_version(version);
        Index index(path_, Database::Mode::write);
        EXPECT_EQ(index.database().version(), newest_version());
        const auto found = index.campaigns({});
        ASSERT_EQ(found.size(), version == 0 ? 0U : 1U);
        if (version > 0) {
            EXPECT_EQ(found[0].name, "an old one");
        }
        if (version > 1) {
            EXPECT_EQ(found[0].unit_serial, "17");
            const auto square = index.results({}).at(0).coefficients[4];
            ASSERT_TRUE(square);
            EXPECT_EQ(square->value, 0.5);
            EXPECT_FALSE(square->at_hz) << "of which vibration it is nobody has noted";
        }
        index.put(entry_of("new", 1), true);
        EXPECT_EQ(index.campaigns({}).size(), found.size() + 1);
    }
}

TEST_F(ArchiveIndex, TakesOverWhatARecorderWritesAndLeavesItToIt) {
    // GIVEN the present recordings.sqlite3, without a number, open in a recorder
    record::Index recorder(folder_, [](const std::string&) {});
    journal::Database(path_).execute(
        "INSERT INTO campaign VALUES ('one', 'first', 'Ada', 5, 'finished')");
    // WHEN it is opened as an index
    Index index(path_, Database::Mode::write);
    // THEN it has the newest version and the campaign
    EXPECT_EQ(index.database().version(), newest_version());
    EXPECT_THAT(index.without_result(), ElementsAre("one"));
    // THEN the recorder's own program reads and writes it as before
    ASSERT_EQ(recorder.campaigns().size(), 1U);
    EXPECT_EQ(recorder.campaigns()[0].name, "first");
    journal::Database(path_).execute(
        "INSERT INTO campaign VALUES ('two', 'second', 'Ada', 6, 'running')");
    EXPECT_THAT(keys(index.campaigns({})), ElementsAre("one", "two"));
    EXPECT_THAT(index.without_result(), ElementsAre("one"));
}

TEST_F(ArchiveIndex, RefusesANewerVersionByName) {
    { Index index(path_, Database::Mode::write); }
    journal::Database(path_).execute("INSERT INTO index_version VALUES (1000)");
    try {
        Index index(path_, Database::Mode::write);
        FAIL() << "it was opened";
    } catch (const ArchiveError& error) {
        EXPECT_THAT(error.what(), HasSubstr(path_));
        EXPECT_THAT(error.what(), HasSubstr("version 1000"));
    }
}

TEST_F(ArchiveIndex, LeavesAnothersDatabaseAsItIs) {
    journal::Database(path_).execute("CREATE TABLE event (text TEXT)");
    EXPECT_THROW(Index(path_, Database::Mode::write), ArchiveError);
    EXPECT_THROW(record::Index(folder_, [](const auto&) {}), journal::DatabaseError);
    // It was neither made anew nor added to.
    const auto names = journal::Database(path_).ask("SELECT name FROM sqlite_master");
    ASSERT_EQ(names.size(), 1U);
    EXPECT_EQ(names[0].texts.at(0), "event");
}

TEST_F(ArchiveIndex, IsReadAsARecorderLeftItAndNothingIsMadeBesideIt) {
    // GIVEN a recorder's index with a log, of before it had a number, and nobody who writes
    {
        record::Index recorder(folder_, [](const std::string&) {});
    }
    journal::Database(path_).execute(
        "INSERT INTO campaign VALUES ('one', 'first', 'Ada', 5, 'finished')");
    const auto read_it = [&](Database::Mode mode) {
        Index index(path_, mode);
        EXPECT_EQ(index.database().version(), newest_version());
        EXPECT_THAT(index.without_result(), ElementsAre("one"));
        for (const char* end : {"-wal", "-shm", "-journal"})
            EXPECT_FALSE(fs::exists(path_ + end)) << end;
    };
    read_it(Database::Mode::read);
    // THEN what is noted in a copy goes with it
    {
        Index copy(path_, Database::Mode::copy);
        copy.put(entry_of("17", 1), true);
        EXPECT_EQ(copy.campaigns({}).size(), 2U);
    }
    read_it(Database::Mode::copy);
    // THEN what a recorder writes meanwhile is seen by whoever comes then
    journal::Database recorder(path_);
    recorder.execute("INSERT INTO campaign VALUES ('two', 'second', 'Ada', 6, 'finished')");
    EXPECT_THAT(Index(path_, Database::Mode::read).without_result(), ElementsAre("one", "two"));
}

TEST_F(ArchiveIndex, ADamagedOneIsNamedWithWhatMakesItAnew) {
    { Index index(path_, Database::Mode::write); }
    const auto size = fs::file_size(path_);
    const auto refused = [&](Database::Mode mode) {
        try {
            static_cast<void>(Index(path_, mode).campaigns({}));
        } catch (const ArchiveError& error) {
            return std::string(error.what());
        }
        return std::string();
    };
    const std::string anew = "vibrig archive add " + folder_ + " --archive " + folder_;
    fs::resize_file(path_, size / 4);
    for (const auto mode : {Database::Mode::read, Database::Mode::write}) {
        EXPECT_THAT(refused(mode), HasSubstr(path_ + ": is damaged: a part of it is missing"));
        EXPECT_THAT(refused(mode), HasSubstr(anew));
    }
    std::ofstream(path_) << std::string(8192, 'x');
    for (const auto mode : {Database::Mode::read, Database::Mode::write}) {
        EXPECT_THAT(refused(mode), HasSubstr(path_ + ": is damaged: it does not begin as"));
        EXPECT_THAT(refused(mode), HasSubstr(anew));
    }
    fs::resize_file(path_, 0);
    EXPECT_THAT(refused(Database::Mode::read), HasSubstr("found an empty file"));
    EXPECT_THAT(refused(Database::Mode::read), HasSubstr(anew));
    EXPECT_EQ(refused(Database::Mode::write), "");  // a new one
}

TEST_F(ArchiveIndex, GivesBackWhatItWasGiven) {
    Entry one = entry_of("17", 1, -1.25e-7, 3e-9);
    one.coefficients[4].reset();
    one.coefficients[5]->at_hz = 25.5;
    one.coefficients[6]->at_hz = 0.0;
    one.coefficients[7]->at_hz = kAtNoFrequency;
    one.coefficients[8]->at_hz.reset();
    one.covariance.assign(465, 0.5);
    one.covariance[7] = std::numeric_limits<double>::quiet_NaN();
    one.noise = {{"configured angle, arcsec", 5}};
    one.instruments = {{"resolver box; DROP TABLE \"x\" -- '", "S", "C", "2099-12-31"}};
    one.temperatures = {{"inner", 45, 44.5, 45.5}};
    one.files = {{"campaign.h5", 123, "abc"}, {"campaign-2.h5", 7, "def"}};
    Index index(path_, Database::Mode::write);
    index.put(one, true);
    index.put(one, true);  // again: nothing comes twice
    const auto found = index.campaign(one.key);
    ASSERT_TRUE(found);
    EXPECT_EQ(found->hash, one.hash);
    EXPECT_EQ(found->started_utc_ns, one.started_utc_ns);
    ASSERT_TRUE(found->coefficients[3]);
    EXPECT_EQ(found->coefficients[3]->value, -1.25e-7);
    EXPECT_EQ(found->coefficients[3]->u, 3e-9);
    EXPECT_FALSE(found->coefficients[4]);
    EXPECT_FALSE(found->coefficients[3]->at_hz);
    EXPECT_EQ(found->coefficients[5]->at_hz, 25.5);
    EXPECT_EQ(found->coefficients[6]->at_hz, 0.0);
    EXPECT_EQ(found->coefficients[7]->at_hz, kAtNoFrequency);
    EXPECT_FALSE(found->coefficients[8]->at_hz);
    ASSERT_EQ(found->covariance.size(), 465U);
    EXPECT_TRUE(std::isnan(found->covariance[7]));
    EXPECT_EQ(found->covariance[8], 0.5);
    ASSERT_EQ(found->instruments.size(), 1U);
    EXPECT_EQ(found->instruments[0].name, one.instruments[0].name);
    ASSERT_EQ(found->temperatures.size(), 1U);
    EXPECT_EQ(found->temperatures[0].high, 45.5);
    ASSERT_EQ(found->files.size(), 2U);
    EXPECT_EQ(found->files[1].sha256, "abc");
    EXPECT_EQ(index.campaigns({}).size(), 1U);
    EXPECT_EQ(index.key_of(one.hash), one.key);
    EXPECT_FALSE(index.key_of("another"));
}

TEST_F(ArchiveIndex, FindsByEachFilter) {
    Index index(path_, Database::Mode::write);
    for (int i = 0; i < 3; ++i) index.put(entry_of("17", i), true);
    Entry bad = entry_of("18", 3);
    bad.verdict = "not valid";
    bad.rig = "other";
    index.put(bad, true);
    Filter filter;
    filter.serial = "17";
    EXPECT_EQ(index.campaigns(filter).size(), 3U);
    filter.since_utc_ns = kFirst_ns + 24 * kHour_ns;
    EXPECT_THAT(keys(index.campaigns(filter)), ElementsAre("rig/17-1", "rig/17-2"));
    filter.until_utc_ns = kFirst_ns + 48 * kHour_ns;
    EXPECT_THAT(keys(index.results(filter)), ElementsAre("rig/17-1"));
    filter = {};
    filter.verdict = "not valid";
    EXPECT_THAT(keys(index.campaigns(filter)), ElementsAre("rig/18-3"));
    filter = {};
    filter.rig = "other";
    EXPECT_THAT(keys(index.campaigns(filter)), ElementsAre("rig/18-3"));
    filter = {};
    filter.newest = 2;
    EXPECT_THAT(keys(index.campaigns(filter)), ElementsAre("rig/17-2", "rig/18-3"));
    filter = {};
    filter.serial = "' OR 1=1 --";
    EXPECT_THAT(index.campaigns(filter), IsEmpty());
    const auto units = index.units();
    ASSERT_EQ(units.size(), 2U);
    EXPECT_EQ(units[0].campaigns, 3);
    EXPECT_EQ(units[1].verdict, "not valid");
}

TEST_F(ArchiveIndex, ACampaignThatWentOnTakesThePlaceOfItsFirstPart) {
    Index index(path_, Database::Mode::write);
    Entry first = entry_of("17", 1);
    index.put(first, true);
    Entry whole = first;
    whole.key += "~2";
    whole.hash = "another";
    whole.ended_utc_ns += kHour_ns;
    index.put(whole, true);
    EXPECT_THAT(keys(index.results({})), ElementsAre(whole.key));
    // The first part again, as after a crash: the order of deliveries does not matter.
    Filter all;
    all.superseded = true;
    EXPECT_EQ(index.campaigns(all).size(), 2U);
    index.put(first, true);
    EXPECT_THAT(keys(index.results({})), ElementsAre(whole.key));
    EXPECT_THAT(index.rivals_of(whole), IsEmpty());
}

TEST_F(ArchiveIndex, AnotherCopyOfTheSameEndIsARivalAndTakesNoPlace) {
    Index index(path_, Database::Mode::write);
    const Entry genuine = entry_of("17", 1);
    index.put(genuine, true);
    Entry other = genuine;
    other.key += "~2";
    other.hash = "another";
    EXPECT_THAT(index.rivals_of(other), ElementsAre(genuine.key));
    EXPECT_THAT(index.rivals_of(genuine), IsEmpty()) << "the same recording";
    index.put(other, true);
    EXPECT_EQ(index.results({}).size(), 2U) << "the genuine one stays";
    other.rig = "other";
    EXPECT_THAT(index.rivals_of(other), ElementsAre(genuine.key)) << "from somebody's desk";
    other.unit_serial = "another";
    EXPECT_THAT(index.rivals_of(other), IsEmpty());
    other.unit_serial.clear();
    EXPECT_THAT(index.rivals_of(other), IsEmpty()) << "nobody says of which unit";
}

TEST_F(ArchiveIndex, ADamagedCopyIsNamedAsWhatItIs) {
    const fs::path file = fs::path(folder_) / "campaign.h5";
    std::ofstream(file) << "0123456789";
    const auto files = list_files(folder_);
    const auto hash = campaign_hash(files);
    EXPECT_THAT(differences(folder_, files), IsEmpty());
    std::ofstream(file) << "012345678X";
    EXPECT_THAT(differences(folder_, files), ElementsAre(HasSubstr("different")));
    EXPECT_NE(campaign_hash(list_files(folder_)), hash);
    fs::resize_file(file, 9);
    EXPECT_THAT(differences(folder_, files), ElementsAre(HasSubstr("short")));
    fs::remove(file);
    EXPECT_THAT(differences(folder_, files), ElementsAre(HasSubstr("missing")));
    // What is written beside a recording later does not make it another.
    std::ofstream(file) << "0123456789";
    std::ofstream(fs::path(folder_) / "report.html") << "x";
    EXPECT_EQ(campaign_hash(list_files(folder_)), hash);
}

TEST(ArchiveManifest, ANameThatIsNotUtf8IsRefusedByName) {
    Entry one = entry_of("17", 1);
    one.files = {{"campaign.h5", 1, "abc"}, {"x\xff.txt", 1, "def"}};
    try {
        static_cast<void>(manifest_json(one, "/rec/one"));
        FAIL() << "it was written";
    } catch (const ArchiveError& error) {
        EXPECT_STREQ(error.what(),
                     "/rec/one: found a file \"x\\ufffd.txt\", expected a name in UTF-8");
    }
}

TEST(ArchiveDatabase, ShowsNoPassword) {
    EXPECT_EQ(shown("postgresql://ada:secret@host/x"), "postgresql://ada:...@host/x");
    EXPECT_EQ(shown("postgresql://host:5432/x"), "postgresql://host:5432/x");
    EXPECT_EQ(shown("/lab/archive.sqlite3"), "/lab/archive.sqlite3");
}

}  // namespace
}  // namespace vibrig::archive
