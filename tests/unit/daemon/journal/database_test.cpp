#include "daemon/journal/database.hpp"
#include "tests/unit/support/temporary_folder.hpp"

#include <gtest/gtest.h>
#include <sqlite3.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

namespace vibrig::journal {
namespace {

/// A file of 8 MB in pages of 4 kB.
class DatabaseTest : public testing::Test {
  protected:
    DatabaseTest() {
        Database database(path.string());
        database.execute("CREATE TABLE event (text TEXT)");
        database.execute(
            "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n WHERE i < 2000) "
            "INSERT INTO event SELECT printf('%04000d', i) FROM n");
    }
    const TemporaryFolder folder;
    const std::filesystem::path path = folder / "database";
};

TEST_F(DatabaseTest, HoldsLittleOfAFileHoweverMuchIsReadOfIt) {
    for (const auto mode : {Database::Mode::read, Database::Mode::write}) {
        const auto before = ::sqlite3_memory_used();
        ::sqlite3_memory_highwater(1);
        Database database(path.string(), mode);
        // Each page once: a sum over the texts themselves.
        EXPECT_EQ(
            database.ask("SELECT count(*) FROM event WHERE text LIKE '%1'").at(0).numbers.at(0),
            200);
        // 256 kB of pages, and 5 % of each besides; with what a connection has, half of a
        // megabyte. SQLite itself would take 2 MB.
        EXPECT_LT(::sqlite3_memory_highwater(0) - before, 1 << 19) << "of 8 MB";
    }
}

TEST_F(DatabaseTest, OfSomebodyElseIsRefusedUnchanged) {
    const auto sum = [this] {
        std::ifstream file(path, std::ios::binary);
        return std::string(std::istreambuf_iterator<char>(file), {});
    };
    const std::string before = sum();
    EXPECT_NO_THROW(refuse_foreign(path.string(), {"chain", "event"}));
    EXPECT_NO_THROW(refuse_foreign(path.string() + "-none", {"event"}));
    try {
        refuse_foreign(path.string(), {"file"});
        FAIL();
    } catch (const DatabaseError& error) {
        EXPECT_FALSE(error.damaged()) << "it would be replaced";
        EXPECT_EQ(std::string(error.what())
                      .find(path.string() + ": found a database without a "
                                            "table file"),
                  0U)
            << error.what();
    }
    EXPECT_EQ(sum(), before);
}

}  // namespace
}  // namespace vibrig::journal
