// vibrig certificate.
#include <toml++/toml.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iomanip>
#include <iostream>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>
#include <string>

#include "daemon/journal/signed_head.hpp"
#include "daemon/plot/chart.hpp"
#include "daemon/record/digest.hpp"
#include "daemon/record/shaken.hpp"
#include "daemon/report/analysis.hpp"
#include "daemon/report/certificate.hpp"
#include "daemon/report/paperwork.hpp"
#include "daemon/results/progress.hpp"
#include "daemon/results/result_difference.hpp"
#include "daemon/tool/commands.hpp"
#include "daemon/tool/live/remote.hpp"
#include "daemon/tool/recordings/campaign_argument.hpp"
#include "daemon/tool/recordings/certificate_files.hpp"
#include "daemon/tool/recordings/print_pdf.hpp"
#include "daemon/tool/recordings/replayed_result.hpp"
#include "estimator/filter/parameters.hpp"
#include "proto/durable_file.hpp"
#include "proto/json_text.hpp"
#include "proto/text.hpp"

namespace vibrig::tool {

namespace {

using report::Issue;

struct CertificateArguments {
    std::string campaign, paper, output = "certificate", by;
    serve::Address at;
    bool no_journal = false;
    bool json = false;
};

[[noreturn]] void refuse(const std::string& file, const toml::node& node, const std::string& what) {
    throw std::runtime_error(file + ":" + std::to_string(node.source().begin.line) + ": " + what);
}

/// The table's keys, each of them known and of its type.
class PaperTable {
  public:
    PaperTable(std::string file, const toml::table& table, std::set<std::string> known)
        : file_(std::move(file)), table_(table) {
        for (const auto& [name, node] : table) {
            if (known.contains(std::string(name.str()))) continue;
            std::string all;
            for (const auto& key : known) all += (all.empty() ? "" : ", ") + key;
            refuse(file_, node,
                   "found an unknown key " + std::string(name.str()) + ", expected one of " + all);
        }
    }
    [[nodiscard]] std::string text(const char* name) const {
        const auto* node = table_.get(name);
        if (node == nullptr) return {};
        if (const auto value = node->value<std::string>()) return *value;
        refuse(file_, *node, std::string(name) + ": expected a text");
    }
    /// YYYY-MM-DD, as the configuration has its dates; none after `today`.
    [[nodiscard]] std::string past_date(const char* name, const std::string& today) const {
        const auto* node = table_.get(name);
        if (node == nullptr) return {};
        std::ostringstream found;
        if (const auto* words = node->as_string())
            found << std::quoted(words->get());
        else
            found << toml::node_view<const toml::node>(*node);
        const std::string text = found.str();
        if (!node->is_date())
            refuse(file_, *node,
                   std::string(name) + ": found " + proto::printable(text) +
                       ", expected a date such as " + today + ", without quotes");
        if (text > today)
            refuse(file_, *node,
                   std::string(name) + ": found " + text +
                       ", expected none after the day of issue (UTC), " + today);
        return text;
    }
    [[nodiscard]] std::optional<double> number(const char* name) const {
        const auto* node = table_.get(name);
        if (node == nullptr) return {};
        const auto value = node->value<double>();
        if (!value || !std::isfinite(*value))
            refuse(file_, *node, std::string(name) + ": expected a number");
        return value;
    }

  private:
    std::string file_;
    const toml::table& table_;
};

report::Limit limit_of(const std::string& file, const toml::node& node) {
    const auto* table = node.as_table();
    if (table == nullptr) refuse(file, node, "limit: expected [[limit]] tables");
    const PaperTable row(file, *table, {"coefficient", "low", "high"});
    report::Limit limit{row.text("coefficient"), row.number("low"), row.number("high")};
    const auto& names = estimator::parameter_names();
    if (std::ranges::find(names, limit.coefficient) == names.end())
        refuse(file, node,
               "limit: found coefficient \"" + limit.coefficient + "\", expected one such as D_Fx");
    if (!limit.low && !limit.high) refuse(file, node, "limit: found neither low nor high");
    if (limit.low && limit.high && !(*limit.low < *limit.high))
        refuse(file, node, "limit: found low not below high");
    return limit;
}

/// One for each coefficient: two would be two statements of conformity, which may contradict.
std::vector<report::Limit> limits_of(const std::string& file, const toml::node* limits) {
    std::vector<report::Limit> all;
    if (limits == nullptr) return all;
    if (limits->as_array() == nullptr) refuse(file, *limits, "limit: expected [[limit]] tables");
    for (const auto& node : *limits->as_array()) {
        auto limit = limit_of(file, node);
        if (std::ranges::find(all, limit.coefficient, &report::Limit::coefficient) != all.end())
            refuse(file, node,
                   "limit: found coefficient \"" + limit.coefficient +
                       "\" a second time, expected one limit of each");
        all.push_back(std::move(limit));
    }
    return all;
}

/// Two numbers that differ in blanks alone read the same on paper.
std::string trimmed(const std::string& text) {
    constexpr const char* kBlank = " \t\r\n\v\f";
    const auto begin = text.find_first_not_of(kBlank);
    if (begin == std::string::npos) return {};
    return text.substr(begin, text.find_last_not_of(kBlank) - begin + 1);
}

/// Of what is issued at that time.
Issue read_paper(const std::string& file, std::int64_t utc_ns) {
    std::ifstream in(file);
    if (!in || std::filesystem::is_directory(file))
        throw std::runtime_error(file + ": cannot be read");
    std::ostringstream text;
    text << in.rdbuf();
    toml::table root;
    try {
        root = toml::parse(text.str(), file);
    } catch (const toml::parse_error& error) {
        throw std::runtime_error(file + ":" + std::to_string(error.source().begin.line) + ": " +
                                 std::string(error.description()));
    }
    const PaperTable top(file, root,
                         {"number", "guard_band", "laboratory", "customer", "item", "limit"});
    Issue issue;
    issue.utc_ns = utc_ns;
    issue.number = trimmed(top.text("number"));
    if (issue.number.empty())
        throw std::runtime_error(file + ": number: found nothing, expected the certificate's");
    issue.guard_band = top.number("guard_band").value_or(1);
    if (!(issue.guard_band >= 0 && issue.guard_band <= 10))
        throw std::runtime_error(file + ": guard_band: expected 0 to 10 times U");
    const auto section = [&](const char* name, std::set<std::string> known, const auto& take) {
        const auto* node = root.get(name);
        if (node == nullptr) return;
        if (node->as_table() == nullptr) refuse(file, *node, std::string(name) + ": not a table");
        take(PaperTable(file, *node->as_table(), std::move(known)));
    };
    section("laboratory", {"name", "address", "accreditation", "location"},
            [&](const PaperTable& t) {
                issue.laboratory = t.text("name");
                issue.laboratory_address = t.text("address");
                issue.accreditation = t.text("accreditation");
                issue.location = t.text("location");
            });
    section("customer", {"name", "address"}, [&](const PaperTable& t) {
        issue.customer = t.text("name");
        issue.customer_address = t.text("address");
    });
    section("item", {"received", "condition"}, [&](const PaperTable& t) {
        issue.received = t.past_date("received", report::utc_text(utc_ns).substr(0, 10));
        issue.condition = t.text("condition");
    });
    for (const auto& [name, what] : {std::pair{&issue.laboratory, "[laboratory] name"},
                                     {&issue.customer, "[customer] name"}}) {
        if (name->empty())
            throw std::runtime_error(file + ": " + what + ": found nothing, expected it");
    }
    issue.limits = limits_of(file, root.get("limit"));
    return issue;
}

/// What the rig's daemon is asked to keep in its signed journal, which nobody else writes. Returns
/// why it refuses; empty: number and hashes are on disk.
std::string enter_in_journal(const CertificateArguments& arguments, const Issue& issue,
                             const std::string& campaign, const CertificateFiles& files) {
    const nlohmann::json entry{{"number", issue.number},
                               {"campaign", campaign},
                               {"pdf_sha256", record::sha256_of_file(files.path(".pdf"))},
                               {"json_sha256", record::sha256_of_file(files.path(".json"))}};
    const nlohmann::json command{
        {"kind", "certificate"}, {"by", issue.by}, {"argument", entry.dump()}};
    serve::Client client(arguments.at);
    const serve::Reply reply = client.post("/api/v1/commands", command.dump());
    if (reply.status == 200) return {};
    if (is_no(reply.status)) return problem_of(reply);
    throw serve::ClientError("vibrigd: " + problem_of(reply));
}

/// Whether there is a daemon that will be asked, before a long replay.
void look_for_daemon(const CertificateArguments& arguments) {
    try {
        serve::Client client(arguments.at);
        static_cast<void>(ask_status(client));
    } catch (const serve::ClientError& error) {
        throw std::runtime_error(
            std::string(error.what()) +
            ": number and hashes go into the rig's signed journal, which vibrigd writes; "
            "--no-journal issues without");
    }
}

int refused(const CertificateArguments& arguments, const std::string& why) {
    std::cerr << "refused: " << why << '\n';
    if (arguments.json)
        std::cout << proto::json_text(nlohmann::ordered_json{{"refused", why}}) << std::endl;
    return kNo;
}

void say_issued(const CertificateArguments& arguments, const std::string& number,
                const std::string& word) {
    const std::string pdf = arguments.output + ".pdf", json = arguments.output + ".json";
    const std::string hash = record::sha256_of_file(pdf);
    if (arguments.json) {
        std::cout << proto::json_text(
                         nlohmann::ordered_json{{"number", number},
                                                {"verdict", word},
                                                {"pdf", pdf},
                                                {"html", arguments.output + ".html"},
                                                {"json", json},
                                                {"pdf_sha256", hash},
                                                {"json_sha256", record::sha256_of_file(json)},
                                                {"in_journal", !arguments.no_journal}})
                  << std::endl;
        return;
    }
    std::cout << pdf << ": certificate " << number << ", " << word << ", SHA-256 " << hash
              << (arguments.no_journal ? ", in no journal" : ", in the rig's journal") << std::endl;
}

/// Of what the replay gives, which the recording's own result has to be. Throws report::Refused.
nlohmann::ordered_json certificate_for(const record::Campaign& campaign, const Issue& issue) {
    const auto tell = [](const std::string& words) { std::cerr << words << '\n'; };
    for (const auto& words : record::changed_parts(campaign.folder, tell))
        throw report::Refused(words);
    const auto rig = report::configuration_of(campaign);
    record::ReplayResult replayed;
    {
        Progress progress("replaying " + campaign.head.name);
        record::ReplayOptions options;
        options.progress = [&](std::size_t done, std::size_t all) { progress.show(done, all); };
        replayed = record::replay(campaign, rig.estimator, options);
    }
    Assessed found = assess(rig.estimator, replayed.found, replayed.result, replayed.rows,
                            record::shaken_of(campaign, rig));
    const std::string contradiction =
        doubt_replayed(rig.estimator, replayed, found.assessed.verdict);
    const std::string text = replayed_json(campaign, replayed, found, rig.estimator);
    auto certificate =
        report::certificate_of(campaign, nlohmann::ordered_json::parse(text), replayed, issue);
    const std::string difference = result_difference(campaign.result_json, text);
    if (!difference.empty())
        throw report::Refused(campaign.path +
                              ": found a result that does not come out of the recording again, "
                              "expected every number of it: " +
                              difference);
    if (!contradiction.empty())
        throw report::Refused(campaign.path + ": found a result that is " +
                              found.assessed.verdict.sentence + ", expected a valid one");
    return certificate;
}

int certify(const CertificateArguments& arguments) {
    Issue issue = read_paper(arguments.paper, journal::utc_now());
    issue.by = arguments.by;
    CertificateFiles files(arguments.output);
    if (!arguments.no_journal) look_for_daemon(arguments);
    const auto campaign = read_named_campaign(arguments.campaign);
    const std::string begun = report::utc_text(campaign.head.utc_ns).substr(0, 10);
    if (issue.received > begun)
        throw std::runtime_error(
            arguments.paper + ": received: found " + issue.received +
            ", expected none after the day on which the campaign began (UTC), " + begun);
    nlohmann::ordered_json certificate;
    try {
        certificate = certificate_for(campaign, issue);
    } catch (const report::Refused& why) {
        return refused(arguments, why.what());
    }
    proto::write_output(files.path(".json"), proto::json_text(certificate, 2) + "\n");
    proto::write_output(files.path(".html"), report::certificate_page(certificate));
    print_pdf(files.path(".html"), files.path(".pdf"));
    files.take_names();
    if (!arguments.no_journal) {
        files.keep(true);
        std::string no;
        try {
            no = enter_in_journal(arguments, issue, campaign.head.campaign, files);
        } catch (const std::exception& error) {
            throw std::runtime_error(std::string(error.what()) +
                                     "; whether the journal has it is not known, " +
                                     files.whereabouts());
        }
        if (!no.empty()) {
            files.keep(false);
            return refused(arguments, no);
        }
    }
    files.issue();
    say_issued(arguments, issue.number, certificate["verdict"]["word"]);
    return 0;
}

}  // namespace

void add_certificate(CLI::App& app, int& exit_code) {
    const auto [command, arguments] = add_command<CertificateArguments>(
        app, exit_code, "certificate", "Calibration certificate for a customer: HTML, PDF, JSON",
        certify);
    command.add_option("CAMPAIGN", arguments.campaign, kCampaignHelp)->required();
    command
        .add_option("--paper", arguments.paper,
                    "TOML: number, [laboratory], [customer], [item], [[limit]]")
        ->required();
    command.add_option("--by", arguments.by, "named person who issues it")
        ->required()
        ->check(one_line("a name"));
    command.add_option("-o,--output", arguments.output,
                       "files to write, without .html, .pdf, .json (default certificate)");
    add_socket(command, arguments.at);
    command.add_flag("--no-journal", arguments.no_journal,
                     "do not enter number and hashes in the rig's journal");
    command.add_flag("--json", arguments.json, "print what was issued, or refused, as JSON");
    command.footer(
        "Example: vibrig certificate demo-20260301T080000Z --paper C-17.toml --by \"A. Person\"\n"
        "A result that is not valid is refused, a doubtful one marked. The SHA-256 of PDF and "
        "JSON go\ninto the signed journal of the rig's daemon (--socket or --host), each number "
        "once.\n"
        "Exit codes: 0 issued, 1 refused, 2 bad usage or input.");
}

}  // namespace vibrig::tool
