// vibrig journal verify: whether a journal is what was written into it.
#include <filesystem>
#include <iostream>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <vector>

#include "daemon/journal/verify.hpp"
#include "daemon/record/campaign_file.hpp"
#include "daemon/results/progress.hpp"
#include "daemon/tool/commands.hpp"
#include "proto/json_text.hpp"
#include "proto/text.hpp"

namespace vibrig::tool {
namespace {

constexpr const char* kWhoVerifies = "vibrig journal verify: ";
constexpr std::size_t kLargestReport = 256 << 20;

struct JournalOptions {
    std::string file = "/var/lib/vibrig/journal.sqlite3", key;
    std::vector<std::string> anchors;
    bool json = false;
};

/// The heads that one --anchor names: a line, or a file with some.
std::vector<journal::Anchor> anchors_in(const std::string& argument) {
    if (argument.starts_with(journal::kHeadWord)) {
        if (auto head = journal::parse_head(argument)) return {{"--anchor", std::move(*head)}};
        throw std::runtime_error("--anchor: found \"" + argument.substr(0, 60) +
                                 "\", expected the whole line of a signed head");
    }
    std::vector<journal::Anchor> anchors;
    const auto content = [&] {
        try {
            return proto::read_whole_file(argument, kLargestReport);
        } catch (const std::runtime_error& error) {
            throw std::runtime_error("--anchor: " + argument + ": " + error.what());
        }
    };
    const auto take = [&](const std::string& path, const std::string& text) {
        for (auto& head : journal::heads_in(text)) anchors.push_back({path, std::move(head)});
    };
    if (std::filesystem::is_directory(argument)) {
        for (const auto& [part, path] : record::part_files(argument))
            take(path, record::read_part_head(path).head.journal_head);
    } else if (record::is_hdf5(argument)) {
        take(argument, record::read_part_head(argument).head.journal_head);
    } else {
        take(argument, content());
    }
    if (anchors.empty()) {
        throw std::runtime_error(
            argument +
            ": found no signed head of a journal, expected one, as recordings, "
            "reports and vibrig status --json carry it");
    }
    return anchors;
}

std::string key_of(const std::string& text) {
    constexpr std::size_t kHex = 64, kFingerprint = 23;
    const bool hex =
        text.size() == kHex && text.find_first_not_of("0123456789abcdef") == std::string::npos;
    if (text.empty() || hex || (text.size() == kFingerprint && text.starts_with("SHA256:")))
        return text;
    throw std::runtime_error("--key: found \"" + text +
                             "\", expected 64 hexadecimal digits, or SHA256: and 16");
}

void print_json(const std::string& file, const journal::Verdict& verdict) {
    const nlohmann::ordered_json root{{"file", file},
                                      {"whole", verdict.found.empty()},
                                      {"entries", verdict.entries},
                                      {"chain", verdict.chain},
                                      {"begins", verdict.begins},
                                      {"head", verdict.head},
                                      {"public_key", verdict.public_key},
                                      {"fingerprint", journal::fingerprint(verdict.public_key)},
                                      {"newer_than_head", verdict.unpublished},
                                      {"found", verdict.found}};
    std::cout << proto::json_text(root, 2) << '\n';
}

void print_words(const std::string& file, const journal::Verdict& verdict, bool anchored) {
    if (verdict.begins.empty()) {
        std::cout << file << ": cannot be read as a whole\n";
    } else {
        std::cout << file << ": " << verdict.entries << " entries; its chain begins "
                  << verdict.begins << '\n';
    }
    if (!verdict.head.empty()) {
        std::cout << "signed with " << journal::fingerprint(verdict.public_key) << " ("
                  << verdict.public_key << ")\n"
                  << verdict.head << '\n';
    }
    for (const std::string& what : verdict.found) std::cout << "NOT as written: " << what << '\n';
    if (!verdict.found.empty()) return;
    if (verdict.unpublished > 0) {
        std::cout << "its last " << verdict.unpublished
                  << " entries are newer than the head beside it: it is being written, or was "
                     "killed\n";
    }
    std::cout << "whole: what was written into it, as far as it goes\n";
    if (!anchored) {
        std::cout << "whether it goes as far as it went says a recording or a report of later: "
                     "--anchor\n";
    }
}

int verify(const JournalOptions& options) {
    journal::Expectation expected;
    expected.public_key = key_of(options.key);
    for (const std::string& argument : options.anchors) {
        for (auto& anchor : anchors_in(argument)) expected.anchors.push_back(std::move(anchor));
    }
    Progress progress("verifying " + options.file);
    expected.progress = [&progress](double part) {
        progress.show(static_cast<std::size_t>(100 * part), 100);
    };
    const auto verdict = journal::verify_file(options.file, expected);
    if (options.json) {
        print_json(options.file, verdict);
    } else {
        print_words(options.file, verdict, !expected.anchors.empty());
    }
    return verdict.found.empty() ? 0 : kNo;
}

}  // namespace

void add_journal(CLI::App& app, int& exit_code) {
    CLI::App& journal = *app.add_subcommand("journal", "What the daemon has written down");
    journal.require_subcommand(1);
    journal.footer("Example: vibrig journal verify");
    const auto [verifying, options] = add_command<JournalOptions>(
        journal, exit_code, "verify", "Whether a journal is what was written into it", verify,
        kWhoVerifies);
    verifying
        .add_option("FILE", options.file, "The journal; its signed head (.head) lies beside it")
        ->capture_default_str();
    verifying.add_option("--anchor", options.anchors,
                         "A head that it has to go through: a recording, a report, a file or "
                         "the line itself; again for more");
    verifying.add_option("--key", options.key,
                         "The public key, or its fingerprint, that has to have signed it");
    verifying.add_flag("--json", options.json, "As JSON");
    verifying.footer(
        "Example: vibrig journal verify /var/lib/vibrig/journal.sqlite3 --anchor report.html\n"
        "Exit codes: 0 it is whole, 1 something is missing or changed, 2 it cannot be read.");
}

}  // namespace vibrig::tool
