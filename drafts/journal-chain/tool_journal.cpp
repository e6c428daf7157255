// vibrig journal verify: whether a journal is what was written into it.
#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <charconv>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "daemon/journal/verify.hpp"
#include "daemon/tool/commands.hpp"

namespace vibrig::tool {
namespace {

constexpr const char* kWho = "vibrig journal verify: ";

struct VerifyOptions {
    std::string file = "/var/lib/vibrig/journal.sqlite3";
    std::string head;
    bool json = false;
};

int verify(const VerifyOptions& options) {
    const auto verdict = journal::verify_file(options.file, options.head);
    if (options.json) {
        nlohmann::ordered_json root{{"file", options.file},
                                    {"good", verdict.found.empty()},
                                    {"entries", verdict.entries},
                                    {"head", verdict.head},
                                    {"public_key", verdict.public_key},
                                    {"begins", verdict.begins},
                                    {"found", verdict.found}};
        std::cout << root.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) << '\n';
    } else {
        std::cout << options.file << ": " << verdict.entries << " entries, " << verdict.begins
                  << '\n';
        if (!verdict.public_key.empty()) {
            std::cout << "head " << verdict.head << "\nsigned by " << verdict.public_key << '\n';
        }
        for (const std::string& what : verdict.found) std::cout << "NOT as written: " << what << '\n';
        if (verdict.found.empty()) std::cout << "as it was written\n";
    }
    return verdict.found.empty() ? 0 : kNo;
}

}  // namespace

void add_journal(CLI::App& app, int& exit_code) {
    CLI::App& journal = *app.add_subcommand("journal", "What the daemon has written down");
    journal.require_subcommand(1);
    CLI::App& verifying = *journal.add_subcommand(
        "verify", "Whether a journal is what was written into it; exit code 1 unless it is");
    auto options = std::make_shared<VerifyOptions>();
    verifying.add_option("file", options->file, "The journal; its signed head lies beside it")
        ->capture_default_str();
    verifying.add_option("--head", options->head,
                         "ENTRY:HASH as a report, a result or a recording states it: the journal "
                         "has to go through it");
    verifying.add_flag("--json", options->json, "As JSON");
    verifying.footer(
        "Example: vibrig journal verify /var/lib/vibrig/journal.sqlite3\n"
        "Every row is in a chain of SHA-256; its head is signed with the key made at the daemon's "
        "first start.");
    verifying.callback([options, &exit_code] {
        exit_code = guarded([&] { return verify(*options); }, kWho);
    });
}

}  // namespace vibrig::tool
