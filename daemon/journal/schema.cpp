#include "daemon/journal/schema.hpp"

#include <algorithm>

#include "daemon/journal/database.hpp"

namespace vibrig::journal {

namespace {

constexpr const char* kTables = R"(
CREATE TABLE IF NOT EXISTS campaign (id INTEGER PRIMARY KEY, name TEXT NOT NULL,
    started_by TEXT NOT NULL, started_utc_ns INTEGER NOT NULL, configuration_hash INTEGER NOT NULL,
    state TEXT NOT NULL, reason TEXT NOT NULL DEFAULT '', ended_utc_ns INTEGER,
    result_json TEXT);
CREATE TABLE IF NOT EXISTS dwell (campaign INTEGER NOT NULL REFERENCES campaign(id),
    run INTEGER NOT NULL, position INTEGER NOT NULL, samples INTEGER NOT NULL,
    used INTEGER NOT NULL, rejected INTEGER NOT NULL, flagged INTEGER NOT NULL,
    reason TEXT NOT NULL, checkpoint BLOB NOT NULL, PRIMARY KEY (campaign, run, position));
CREATE TABLE IF NOT EXISTS event (id INTEGER PRIMARY KEY, utc_ns INTEGER NOT NULL,
    time_ns INTEGER NOT NULL, severity TEXT NOT NULL, source TEXT NOT NULL, text TEXT NOT NULL);
CREATE TABLE IF NOT EXISTS command (id INTEGER PRIMARY KEY, utc_ns INTEGER NOT NULL,
    kind TEXT NOT NULL, person TEXT NOT NULL, argument TEXT NOT NULL, accepted INTEGER NOT NULL,
    answer TEXT NOT NULL);
CREATE TABLE IF NOT EXISTS loop_check (id INTEGER PRIMARY KEY, utc_ns INTEGER NOT NULL,
    person TEXT NOT NULL, out_of_band TEXT NOT NULL);
CREATE TABLE IF NOT EXISTS safety (id INTEGER PRIMARY KEY, utc_ns INTEGER NOT NULL,
    what TEXT NOT NULL, name TEXT NOT NULL, person TEXT NOT NULL, text TEXT NOT NULL,
    two_persons INTEGER NOT NULL);
CREATE TABLE IF NOT EXISTS proof (id INTEGER PRIMARY KEY, utc_ns INTEGER NOT NULL,
    person TEXT NOT NULL, record TEXT NOT NULL);
CREATE TABLE IF NOT EXISTS commissioning (id INTEGER PRIMARY KEY, utc_ns INTEGER NOT NULL,
    part TEXT NOT NULL, step TEXT NOT NULL, by TEXT NOT NULL, identity TEXT NOT NULL,
    what TEXT NOT NULL, data_json TEXT NOT NULL);
CREATE TABLE origin (id INTEGER PRIMARY KEY, utc_ns INTEGER NOT NULL, text TEXT NOT NULL,
    public_key TEXT NOT NULL, previous TEXT NOT NULL);
CREATE TABLE chain (entry INTEGER PRIMARY KEY, tbl TEXT NOT NULL, row INTEGER NOT NULL,
    digest BLOB NOT NULL, hash BLOB NOT NULL);
CREATE INDEX chain_row ON chain (tbl, row, entry);
CREATE TABLE head (id INTEGER PRIMARY KEY CHECK (id = 1), line TEXT NOT NULL);
)";

constexpr std::array kOthers{"chain", "chain_row", "head"};

}  // namespace

void make_tables(Database& database) { database.execute(kTables); }

void make_commissioning(Database& database) {
    if (has_table(database, kCommissioning)) return;
    const std::string_view tables(kTables);
    const auto begin = tables.find(std::string("CREATE TABLE IF NOT EXISTS ") + kCommissioning);
    database.execute(std::string(tables.substr(begin, tables.find(';', begin) - begin)).c_str());
}

bool lacks_table(Database& database, const char* name) {
    if (has_table(database, name)) return false;
    return std::string_view(name) != kCommissioning ||
           !database.ask("SELECT 1 FROM chain WHERE tbl = ? LIMIT 1", {std::string_view(name)})
                .empty();
}

bool has_table(Database& database, const char* name) {
    return !database
                .ask("SELECT 1 FROM sqlite_master WHERE type = 'table' AND name = ?",
                     {std::string_view(name)})
                .empty();
}

std::vector<std::string> strange_objects(Database& database) {
    std::vector<std::string> strange;
    for (const Row& row : database.ask(
             "SELECT type, name FROM sqlite_master WHERE substr(name, 1, 7) != 'sqlite_'")) {
        const std::string& name = row.texts[1];
        if (std::ranges::find(kChained, name) == kChained.end() &&
            std::ranges::find(kOthers, name) == kOthers.end())
            strange.push_back(row.texts[0] + " " + name);
    }
    return strange;
}

}  // namespace vibrig::journal
