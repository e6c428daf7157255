#include "daemon/report/journal_section.hpp"

#include <unistd.h>

#include <filesystem>
#include <stdexcept>

#include "daemon/journal/signing_key.hpp"
#include "daemon/journal/verify.hpp"

namespace vibrig::report {

std::string journal_verdict(const record::Campaign& campaign, const std::string& path) {
    const auto beside = std::filesystem::absolute(campaign.folder).parent_path();
    const std::string file = path.empty() ? (beside / "journal.sqlite3").string() : path;
    if (path.empty() && ::access(file.c_str(), R_OK) != 0)
        return "not looked at: none can be read beside the recording (--journal)";
    const auto head = journal::parse_head(campaign.head.journal_head);
    if (!head) return "not looked at: the recording carries no signed head of it";
    try {
        const auto verdict = journal::verify_file(file, {{{"the recording", *head}}, {}, {}});
        if (verdict.found.empty())
            return file + ": whole, and goes through the head that the recording carries";
        return "!" + file + " does not verify: " + verdict.found.front() +
               (verdict.found.size() > 1
                    ? " (and " + std::to_string(verdict.found.size() - 1) + " more)"
                    : "");
    } catch (const std::runtime_error& error) {
        if (!path.empty()) throw;
        return std::string("!") + error.what();
    }
}

void add_journal(Page& page, const record::Campaign& campaign, const std::string& verdict) {
    const auto head = journal::parse_head(campaign.head.journal_head);
    if (!head) {
        page.table({{"", ""}, {"Journal", "the recording carries no signed head of one"}}, "words");
        return;
    }
    page.table({{"", ""},
                {"Journal's key", journal::fingerprint(head->public_key)},
                {"Journal's head", "entry " + std::to_string(head->link.entry) + ", SHA-256 " +
                                       journal::to_hex(head->link.hash)},
                {"Signature", head->holds() ? "holds" : "!does not hold"},
                {"Journal", verdict}},
               "words");
    page.details("The journal's signed head, for vibrig journal verify --anchor", head->line());
}

}  // namespace vibrig::report
