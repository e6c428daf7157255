#include "daemon/journal/verify.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <stdexcept>

#include "daemon/journal/chain.hpp"
#include "daemon/journal/chained_file.hpp"
#include "daemon/journal/database.hpp"
#include "daemon/journal/schema.hpp"

namespace vibrig::journal {

namespace {

constexpr std::int64_t kSliceEntries = 2000;
constexpr std::size_t kSliceBytes = 16 << 20;

void require_readable(const std::string& path) {
    std::error_code none;
    if (!std::filesystem::exists(path, none))
        throw std::runtime_error(path + ": found nothing, expected a journal");
    if (!std::filesystem::is_regular_file(path, none))
        throw std::runtime_error(path + ": found no file, expected a journal");
    if (::access(path.c_str(), R_OK) != 0)
        throw std::runtime_error(path + ": cannot be read: " + std::strerror(errno));
}

void compare_head(Database& database, const FoundHead& beside, const std::string& path,
                  Verdict& verdict) {
    if (!beside.wrong.empty()) verdict.found.push_back(beside.wrong);
    if (!beside.head) {
        if (beside.wrong.empty())
            verdict.found.push_back(path + kHeadSuffix + ": the signed head is gone");
        return;
    }
    if (beside.head->chain != verdict.chain) {
        verdict.found.push_back(path + kHeadSuffix + ": is of another journal");
    } else if (auto why = differs_from(database, beside.head->link, "its signed head");
               !why.empty()) {
        verdict.found.push_back(std::move(why));
    } else {
        verdict.unpublished = verdict.entries - beside.head->link.entry;
    }
}

void compare_anchors(Database& database, const Expectation& expected, Verdict& verdict) {
    const std::string found = fingerprint(verdict.public_key);
    if (!expected.public_key.empty() && verdict.public_key != expected.public_key &&
        found != expected.public_key) {
        verdict.found.push_back(fmt::format("is signed with {}, expected {}",
                                            found.empty() ? "nothing" : found,
                                            expected.public_key));
    }
    for (const Anchor& anchor : expected.anchors) {
        const SignedHead& head = anchor.head;
        if (!head.holds()) {
            verdict.found.push_back(anchor.place + ": its signature does not hold");
        } else if (head.chain != verdict.chain) {
            verdict.found.push_back(fmt::format(
                "{} names entry {} of another journal ({:.16}), signed with {}", anchor.place,
                head.link.entry, head.chain, fingerprint(head.public_key)));
        } else if (head.public_key != verdict.public_key) {
            verdict.found.push_back(fmt::format("is signed with {}, {} with {}",
                                                fingerprint(verdict.public_key), anchor.place,
                                                fingerprint(head.public_key)));
        } else if (auto why = differs_from(database, head.link, anchor.place); !why.empty()) {
            verdict.found.push_back(std::move(why));
        }
    }
}

/// False: it has no chain that could be walked.
bool look_at_version(Database& database, const std::string& path, Verdict& verdict) {
    const auto version = database.ask("PRAGMA user_version").at(0).numbers.at(0);
    if (version > kSchemaVersion) {
        throw std::runtime_error(
            fmt::format("{}: found version {}, newer than {}", path, version, kSchemaVersion));
    }
    const auto beside = read_head(path + kHeadSuffix).head;
    if (version < kSchemaVersion && beside && beside->link.entry > 0) {
        verdict.found.push_back(fmt::format("found version {}, expected {} as its signed head says",
                                            version, kSchemaVersion));
        return false;
    }
    if (version == 1 && has_table(database, "event")) {
        verdict.begins = "of version 1, which has no chain";
        verdict.found.emplace_back("nothing says whether its rows are what was written");
        return false;
    }
    if (version < kSchemaVersion) {
        if (std::filesystem::file_size(path) > 0 && !beside)
            throw std::runtime_error(path + ": found another database, expected a journal");
        verdict.begins = "nowhere";
        verdict.found.emplace_back("has nothing in it");
        return false;
    }
    for (const char* table : kChained) {
        if (has_table(database, "chain") ? lacks_table(database, table)
                                         : !has_table(database, table))
            verdict.found.push_back(fmt::format("table {} is missing", table));
    }
    return verdict.found.empty();
}

void walk(Database& database, const Expectation& expected, Verdict& verdict) {
    Verification rows;
    while (!rows.done()) {
        rows.step(database, kSliceEntries, kSliceBytes);
        if (expected.progress && verdict.entries > 0)
            expected.progress(static_cast<double>(rows.at().entry) /
                              static_cast<double>(verdict.entries));
    }
    verdict.found.insert(verdict.found.end(), rows.found().begin(), rows.found().end());
}

void look_at(Database& database, const std::string& path, const Expectation& expected,
             Verdict& verdict) {
    if (!look_at_version(database, path, verdict)) return;
    verdict.found = database.damage(20);
    // The head first: the picture is one of later, whatever a daemon writes meanwhile.
    const auto beside = read_head(path + kHeadSuffix);
    const Snapshot snapshot(database);
    verdict.entries = Chain::newest(database).entry;
    verdict.chain = Chain::name_of(database);
    const auto begins = database.ask("SELECT text FROM origin ORDER BY id LIMIT 1");
    verdict.begins = begins.empty() ? "without a beginning" : begins.front().texts.at(0);
    const auto line = database.ask("SELECT line FROM head");
    if (const auto head =
            line.empty() ? std::optional<SignedHead>() : parse_head(line.front().texts.at(0))) {
        verdict.head = head->line();
        verdict.public_key = head->public_key;
    }
    compare_head(database, beside, path, verdict);
    if (auto why = unsigned_end(database, beside.head ? beside.head->public_key : ""); !why.empty())
        verdict.found.push_back(std::move(why));
    compare_anchors(database, expected, verdict);
    walk(database, expected, verdict);
}

}  // namespace

Verdict verify_file(const std::string& path, const Expectation& expected) {
    require_readable(path);
    Verdict verdict;
    try {
        Database database(path, Database::Mode::read);
        look_at(database, path, expected, verdict);
    } catch (const DatabaseError& error) {
        if (!error.damaged()) throw;
        verdict.found.emplace_back(error.what());
    }
    return verdict;
}

}  // namespace vibrig::journal
