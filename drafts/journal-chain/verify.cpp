#include "daemon/journal/verify.hpp"

#include <fmt/format.h>

#include <charconv>
#include <filesystem>
#include <stdexcept>

#include "daemon/journal/chain.hpp"
#include "daemon/journal/database.hpp"
#include "daemon/journal/journal.hpp"
#include "daemon/journal/signing_key.hpp"

namespace vibrig::journal {

namespace {

Link parse_link(const std::string& text) {
    Link link;
    const auto colon = text.find(':');
    const char* const end = text.data() + std::min(colon, text.size());
    const auto [stop, error] = std::from_chars(text.data(), end, link.entry);
    if (colon != std::string::npos) link.hash = from_hex(text.substr(colon + 1));
    if (error != std::errc() || stop != end || link.entry < 1 || link.hash.size() != 32) {
        throw std::runtime_error("--head: found \"" + text +
                                 "\", expected the number of an entry, a colon and its hash of 64 "
                                 "hexadecimal digits");
    }
    return link;
}

void look_at_head(Database& database, const FoundHead& beside, const std::string& path,
                  Verdict& verdict) {
    if (!beside.wrong.empty()) verdict.found.push_back(beside.wrong);
    if (!beside.head) {
        if (beside.wrong.empty() && verdict.entries > 0)
            verdict.found.push_back(path + kHeadSuffix + ": the signed head is gone");
        return;
    }
    verdict.public_key = beside.head->public_key;
    if (auto why = Verification::compare(database, beside.head->link, "the signed head");
        !why.empty())
        verdict.found.push_back(std::move(why));
}

}  // namespace

Verdict verify_file(const std::string& path, const std::string& head) {
    const Link expected = head.empty() ? Link{} : parse_link(head);
    if (!std::filesystem::is_regular_file(path))
        throw std::runtime_error(path + ": found nothing, expected a journal");
    Verdict verdict;
    try {
        Database database(path, Database::Mode::read);
        const auto version = database.ask("PRAGMA user_version").at(0).numbers.at(0);
        if (version > Journal::kSchemaVersion) {
            throw std::runtime_error(fmt::format("{}: found version {}, newer than {}", path, version,
                                                 Journal::kSchemaVersion));
        }
        for (const Row& row : database.ask("PRAGMA integrity_check(20)")) {
            if (row.texts.at(0) != "ok") verdict.found.push_back("integrity: " + row.texts.at(0));
        }
        if (version < 2) {
            verdict.begins = fmt::format("of version {}, which has no chain", version);
            verdict.found.push_back("nothing says whether its rows are what was written");
            return verdict;
        }
        // One picture of it, whatever a daemon writes meanwhile, and no older than the head.
        const auto beside = read_head(path + kHeadSuffix);
        database.execute("BEGIN");
        const Link newest = Chain::newest(database);
        verdict.entries = newest.entry;
        verdict.head = fmt::format("{}:{}", newest.entry, to_hex(newest.hash));
        const auto begins = database.ask("SELECT text FROM origin ORDER BY id LIMIT 1");
        verdict.begins = begins.empty() ? "empty" : begins.front().texts.at(0);
        look_at_head(database, beside, path, verdict);
        if (auto why = Verification::compare(database, expected, "--head"); !why.empty())
            verdict.found.push_back(std::move(why));
        Verification verification;
        while (!verification.done()) verification.step(database, 10'000, 64 << 20);
        verdict.found.insert(verdict.found.end(), verification.found().begin(),
                             verification.found().end());
    } catch (const DatabaseError& error) {
        if (!error.damaged()) throw;
        verdict.found.emplace_back(error.what());
    }
    return verdict;
}

}  // namespace vibrig::journal
