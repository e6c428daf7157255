#include "daemon/journal/chain.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <sstream>

#include "daemon/journal/database.hpp"
#include "daemon/journal/signing_key.hpp"

namespace vibrig::journal {

namespace {

/// Tables whose rows are chained.
constexpr std::array kChained{"campaign", "dwell",      "event", "command",
                              "loop_check", "safety", "origin"};
constexpr const char* kHeadLine = "vibrig journal head 1";

Link after(const Link& before, std::string_view table, std::int64_t row, std::string_view digest) {
    std::string bytes = before.hash;
    bytes += fmt::format("{}\n{}\n", table, row);
    bytes += digest;
    return {before.entry + 1, sha256(bytes)};
}

bool has_table(Database& database, const char* name) {
    return !database.ask("SELECT 1 FROM sqlite_master WHERE type = 'table' AND name = ?",
                         {std::string_view(name)})
                .empty();
}

std::string signed_text(const Link& link) {
    return fmt::format("{}\n{}\n{}\n", kHeadLine, link.entry, to_hex(link.hash));
}

}  // namespace

void Chain::make_table(Database& database) {
    database.execute(
        "CREATE TABLE chain (entry INTEGER PRIMARY KEY, tbl TEXT NOT NULL, row INTEGER NOT NULL, "
        "digest BLOB NOT NULL, hash BLOB NOT NULL)");
    database.execute("CREATE INDEX chain_row ON chain (tbl, row, entry)");
}

Link Chain::newest(Database& database) {
    const auto found = database.ask("SELECT entry, hash FROM chain ORDER BY entry DESC LIMIT 1");
    if (found.empty()) return {};
    return {found.front().numbers.at(0), found.front().texts.at(1)};
}

void Chain::append(Database& database, std::string_view table, std::int64_t row) {
    const std::string digest = sha256(database.row_bytes(std::string(table), row));
    last_ = after(last_, table, row, digest);
    database.run("INSERT INTO chain VALUES (?, ?, ?, ?, ?)",
                 {last_.entry, table, row, Blob{digest}, Blob{last_.hash}});
}

std::int64_t Chain::take_over(Database& database) {
    std::int64_t rows = 0;
    for (const char* table : kChained) {
        if (!has_table(database, table)) continue;
        const std::string ask = fmt::format("SELECT rowid FROM {} ORDER BY rowid", table);
        for (const Row& row : database.ask(ask.c_str())) {
            append(database, table, row.numbers.at(0));
            ++rows;
        }
    }
    return rows;
}

bool SignedHead::holds() const { return signature_holds(public_key, signed_text(link), signature); }

SignedHead sign_head(const Link& link, const SigningKey& key) {
    return {link, key.public_key(), key.sign(signed_text(link))};
}

std::string write_head(const std::string& path, const SignedHead& head) {
    const std::string text =
        fmt::format("{}{}\n{}\n", signed_text(head.link), head.public_key, head.signature);
    const std::string unfinished = path + ".new";
    const int fd = ::open(unfinished.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
    if (fd < 0) return unfinished + ": " + std::strerror(errno);
    const bool written =
        ::write(fd, text.data(), text.size()) == static_cast<ssize_t>(text.size()) &&
        ::fsync(fd) == 0;
    const int why = errno;
    ::close(fd);
    if (written && ::rename(unfinished.c_str(), path.c_str()) == 0) return {};
    return unfinished + ": " + std::strerror(written ? errno : why);
}

FoundHead read_head(const std::string& path) {
    std::ifstream file(path);
    if (!file) return {};
    std::string first, hash;
    SignedHead head;
    std::getline(file, first);
    file >> head.link.entry >> hash >> head.public_key >> head.signature;
    head.link.hash = from_hex(hash);
    if (!file || first != kHeadLine || head.link.entry < 0 || head.link.hash.size() != 32)
        return {{}, path + ": is no journal's head"};
    if (!head.holds()) return {{}, path + ": its signature does not hold"};
    return {head, {}};
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
        "SELECT entry, tbl, row, digest, hash FROM chain WHERE entry > ? ORDER BY entry LIMIT ?",
        {at_.entry, entries});
    std::size_t read = 0;
    for (const Row& row : rows) {
        const std::int64_t entry = row.numbers[0], number = row.numbers[2];
        const std::string &table = row.texts[1], &digest = row.texts[3], &hash = row.texts[4];
        if (entry != at_.entry + 1) {
            name(fmt::format("entries {} to {} are missing", at_.entry + 1, entry - 1));
            at_.entry = entry - 1;
        } else if (after(at_, table, number, digest).hash != hash) {
            name(fmt::format("entry {} ({} {}) does not follow from the one before it", entry,
                             table, number));
        }
        at_ = {entry, hash};
        if (std::ranges::find(kChained, table) == kChained.end()) {
            name(fmt::format("entry {} is of an unknown table, {}", entry, table));
            continue;
        }
        // What was changed later is what its newest entry says.
        const auto newest = database.ask("SELECT max(entry) FROM chain WHERE tbl = ? AND row = ?",
                                         {std::string_view(table), number});
        if (newest.front().numbers[0] != entry) continue;
        const std::string now = database.row_bytes(table, number);
        read += now.size();
        if (now.empty()) {
            name(fmt::format("{} {} (entry {}) is missing", table, number, entry));
        } else if (sha256(now) != digest) {
            name(fmt::format("{} {} (entry {}) was changed", table, number, entry));
        }
        if (read > bytes) return;
    }
    if (rows.size() == static_cast<std::size_t>(entries)) return;
    done_ = true;
    find_strangers(database);
}

void Verification::find_strangers(Database& database) {
    for (const char* table : kChained) {
        if (!has_table(database, table)) continue;
        const std::string ask = fmt::format(
            "SELECT rowid FROM {0} WHERE NOT EXISTS (SELECT 1 FROM chain WHERE tbl = '{0}' AND "
            "row = {0}.rowid) LIMIT {1}",
            table, kMostNamed + 1);
        for (const Row& row : database.ask(ask.c_str()))
            name(fmt::format("{} {} is in no entry of the chain", table, row.numbers.at(0)));
    }
}

std::string Verification::compare(Database& database, const Link& link, const std::string& place) {
    if (link.entry == 0) return {};
    const auto found =
        database.ask("SELECT hash FROM chain WHERE entry = ?", {link.entry});
    if (found.empty()) {
        const std::int64_t last = Chain::newest(database).entry;
        return fmt::format("entries {} to {} are missing, as {} says", last + 1, link.entry, place);
    }
    if (found.front().texts[0] != link.hash)
        return fmt::format("entry {} is another one than {} says", link.entry, place);
    return {};
}

}  // namespace vibrig::journal
