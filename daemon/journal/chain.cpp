#include "daemon/journal/chain.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "daemon/journal/database.hpp"
#include "daemon/journal/schema.hpp"
#include "daemon/journal/signing_key.hpp"

namespace vibrig::journal {

namespace {

Link after(const Link& before, std::string_view table, std::int64_t row, std::string_view digest) {
    std::string bytes = before.hash;
    bytes += fmt::format("{}\n{}\n", table, row);
    bytes += digest;
    return {before.entry + 1, sha256(bytes)};
}

}  // namespace

Link Chain::newest(Database& database) {
    const auto found = database.ask("SELECT entry, hash FROM chain ORDER BY entry DESC LIMIT 1");
    if (found.empty()) return {};
    return {found.front().numbers.at(0), found.front().texts.at(1)};
}

std::string Chain::name_of(Database& database) {
    const auto found = database.ask("SELECT hash FROM chain WHERE entry = 1");
    return found.empty() ? "" : to_hex(found.front().texts.at(0));
}

void Chain::append(Database& database, std::string_view table, std::int64_t row) {
    const std::string digest = sha256(database.row_bytes(std::string(table), row));
    last_ = after(last_, table, row, digest);
    database.run("INSERT INTO chain VALUES (?, ?, ?, ?, ?)",
                 {last_.entry, table, row, Blob{digest}, Blob{last_.hash}});
}

void Chain::take_over(Database& database) {
    for (const std::string_view table : kChained) {
        if (table == "origin") continue;
        const std::string ask = fmt::format("SELECT rowid FROM {} ORDER BY rowid", table);
        for (const Row& row : database.ask(ask.c_str())) append(database, table, row.numbers.at(0));
    }
}

void Verification::name(std::string what) {
    if (found_.size() < kMostNamed) {
        found_.push_back(std::move(what));
    } else if (found_.size() == kMostNamed) {
        found_.emplace_back("and more");
    }
}

void Verification::step(Database& database, std::int64_t entries, std::size_t bytes) {
    if (done_) return;
    const auto rows = database.ask(
        "SELECT entry, tbl, row, digest, hash, (SELECT max(entry) FROM chain AS later WHERE "
        "later.tbl = chain.tbl AND later.row = chain.row) FROM chain WHERE entry > ? "
        "ORDER BY entry LIMIT ?",
        {at_.entry, entries});
    std::size_t read = 0;
    for (const Row& row : rows) {
        const std::int64_t entry = row.numbers[0], number = row.numbers[2];
        const std::string &table = row.texts[1], &digest = row.texts[3], &hash = row.texts[4];
        if (entry != at_.entry + 1) {
            name(fmt::format("entries {} to {} are missing", at_.entry + 1, entry - 1));
        } else if (after(at_, table, number, digest).hash != hash) {
            name(fmt::format("entry {} ({} {}) does not follow from the one before it", entry,
                             table, number));
        }
        at_ = {entry, hash};
        // What was changed later is what its newest entry says.
        if (row.numbers[5] == entry) compare_row(database, entry, table, number, digest, read);
        if (read > bytes) return;
    }
    if (rows.size() == static_cast<std::size_t>(entries)) return;
    done_ = true;
    if (!strangers_) return;
    for (const std::string& strange : strange_objects(database))
        name(strange + " is none of the journal's");
    find_strangers(database);
}

void Verification::compare_row(Database& database, std::int64_t entry, const std::string& table,
                               std::int64_t row, const std::string& digest, std::size_t& read) {
    if (std::ranges::find(kChained, table) == kChained.end())
        return name(fmt::format("entry {} is of an unknown table, {}", entry, table));
    const std::string now = database.row_bytes(table, row);
    read += now.size();
    if (now.empty()) {
        name(fmt::format("{} {} (entry {}) is missing", table, row, entry));
    } else if (sha256(now) != digest) {
        name(fmt::format("{} {} (entry {}) was changed", table, row, entry));
    }
}

void Verification::find_strangers(Database& database) {
    for (const char* table : kChained) {
        if (!has_table(database, table)) continue;  // named where it is lacking
        const std::string ask = fmt::format(
            "SELECT rowid FROM {0} WHERE NOT EXISTS (SELECT 1 FROM chain WHERE tbl = '{0}' AND "
            "row = {0}.rowid) LIMIT {1}",
            table, kMostNamed + 1);
        for (const Row& row : database.ask(ask.c_str()))
            name(fmt::format("{} {} is in no entry of the chain", table, row.numbers.at(0)));
    }
}

std::string differs_from(Database& database, const Link& link, const std::string& place) {
    if (link.entry == 0) return {};
    const auto found = database.ask("SELECT hash FROM chain WHERE entry = ?", {link.entry});
    if (found.empty()) {
        return fmt::format(
            "ends at entry {}, earlier than entry {} that {} names: shortened, set "
            "back to an older copy, or on a disk that did not keep what it had synced",
            Chain::newest(database).entry, link.entry, place);
    }
    if (found.front().texts[0] != link.hash)
        return fmt::format("entry {} is another one than {} names", link.entry, place);
    return {};
}

std::string unsigned_end(Database& database, const std::string& public_key) {
    const Link newest = Chain::newest(database);
    const auto line = database.ask("SELECT line FROM head");
    const auto head =
        line.empty() ? std::optional<SignedHead>() : parse_head(line.front().texts.at(0));
    if (!head) return "its newest entry is not signed";
    if (!head->holds()) return "the signature of its newest entry does not hold";
    if (!public_key.empty() && head->public_key != public_key) {
        return fmt::format("its newest entry is signed with another key, {}, expected {}",
                           fingerprint(head->public_key), fingerprint(public_key));
    }
    if (head->link.entry < newest.entry) {
        return fmt::format("entries {} to {} are not signed: not written by the daemon",
                           head->link.entry + 1, newest.entry);
    }
    if (auto why = differs_from(database, head->link, "its own signature"); !why.empty())
        return why;
    return head->chain == Chain::name_of(database) ? "" : "its signature is of another journal";
}

}  // namespace vibrig::journal
