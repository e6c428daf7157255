// vibrig archive add and verify.
#include <iostream>
#include <nlohmann/json.hpp>

#include "daemon/archive/outbox.hpp"
#include "daemon/archive/trend.hpp"
#include "daemon/archive/verify.hpp"
#include "daemon/archive/vibration.hpp"
#include "daemon/results/json_values.hpp"
#include "daemon/results/progress.hpp"
#include "daemon/tool/commands.hpp"
#include "daemon/tool/recordings/archive_place.hpp"
#include "daemon/tool/recordings/campaign_argument.hpp"
#include "estimator/identification/identification.hpp"
#include "proto/json_text.hpp"

namespace vibrig::tool {

namespace {

using Json = nlohmann::ordered_json;

Json moved_json(const std::vector<archive::Moved>& moved) {
    Json list = Json::array();
    for (const auto& one : moved)
        list.push_back({{"coefficient", estimator::parameter_names()[one.position]},
                        {"unit", estimator::parameter_unit(one.position)},
                        {"value", one.value},
                        {"expected", one.by.expected},
                        {"sigma", number_or_null(one.by.sigma)},
                        {"t", number_or_null(one.by.t)},
                        {"dof", one.by.dof},
                        {"p", number_or_null(one.by.p)}});
    return list;
}

/// What a delivery did, one line of JSON for vibrigd, one of text for people.
void tell_delivery(const archive::Delivery& delivery, const std::string& folder,
                   const std::vector<archive::Entry>& history, bool json) {
    const auto& entry = delivery.entry;
    const auto moved = archive::moved(entry, history);
    const auto others = archive::count_of_other_vibrations(entry.coefficients, history);
    constexpr std::array<const char*, 3> kDone{"copied", "was there", "mended"};
    const char* const done = kDone[static_cast<std::size_t>(delivery.kind)];
    if (json) {
        std::cout << proto::json_text(Json{{"folder", folder},
                                           {"done", done},
                                           {"campaign", entry.key},
                                           {"rig", entry.rig},
                                           {"hash", entry.hash},
                                           {"unit", entry.unit_serial},
                                           {"verdict", entry.verdict},
                                           {"earlier", history.size()},
                                           {"of_other_vibration", others},
                                           {"moved", moved_json(moved)}})
                  << '\n';
    } else {
        std::cout << folder << ": " << done << ", " << entry.key;
        if (delivery.elsewhere)
            std::cout << ": the same recording is there already, of rig '" << entry.rig << "', "
                      << (delivery.kind == archive::Delivery::Kind::was_there ? "nothing was copied"
                                                                              : "and was damaged");
        std::cout << '\n';
        for (const auto& one : moved)
            std::cout << "  " << estimator::parameter_names()[one.position] << " is " << one.value
                      << ", " << one.by.expected << " +- " << one.by.sigma << " by this unit's "
                      << history.size() << " earlier campaigns"
                      << (others > 0 ? ", quadratic ones without those of " +
                                           std::to_string(others) + " of another vibration"
                                     : "")
                      << '\n';
    }
    std::cout << std::flush;
}

struct AddOptions {
    std::vector<std::string> folders;
    bool json = false;
    ArchiveOptions where = {};
};

/// vibrigd tries it again, unless it was taken where it lies: that nobody had refused.
void no_longer_refused(const std::string& folder, const std::string& archive) {
    std::error_code unknown;
    if (std::filesystem::equivalent(
            archive, std::filesystem::weakly_canonical(folder).parent_path(), unknown))
        return;
    if (const auto why = archive::try_again(folder); !why.empty()) std::cerr << why << '\n';
}

int add(const AddOptions& o) {
    Whereabouts at = whereabouts_of(o.where);
    if (at.place.folder.empty()) {
        if (at.named)
            throw std::runtime_error(
                "--archive: found an index alone, expected the archive's "
                "folder too: --archive FOLDER --index " +
                archive::shown(at.place.index));
        at.place = {".", archive::index_in(".")};
    }
    int code = 0;
    for (const auto& given : o.folders) {
        const auto found =
            archive::campaign_folders(given, [](const std::string& path, const std::string& why) {
                std::cerr << path << ": passed by: " << why << '\n';
            });
        if (found.empty())
            throw std::runtime_error(given +
                                     ": found no campaign.h5 in it or in folders below, "
                                     "expected a campaign's folder or one of campaigns");
        Progress progress(given);
        for (const auto& folder : found) {
            try {
                const auto delivery = archive::deliver(
                    folder, at.place, at.rig,
                    [&](std::size_t done, std::size_t all) { progress.show(done, all); });
                std::vector<archive::Entry> history;
                if (!delivery.entry.unit_serial.empty()) {
                    archive::Filter filter;
                    filter.serial = delivery.entry.unit_serial;
                    filter.until_utc_ns = delivery.entry.started_utc_ns;
                    archive::Index index(at.place.index, archive::Database::Mode::write);
                    history = index.results(filter);
                    std::erase_if(history, [&](const archive::Entry& one) {
                        return one.simulated != delivery.entry.simulated;
                    });
                    archive::read_vibrations(index, at.place.folder, history);
                }
                // Archived as it is, so that vibrigd does not try for ever.
                static_cast<void>(tell_missing_raw(folder));
                tell_delivery(delivery, folder, history, o.json);
                no_longer_refused(folder, at.place.folder);
            } catch (const std::exception& error) {
                // vibrigd tells it from a failure by this line.
                if (dynamic_cast<const archive::Refused*>(&error) != nullptr && o.json)
                    std::cout << proto::json_text(
                                     Json{{"folder", folder}, {"refused", error.what()}})
                              << std::endl;
                if (found.size() == 1 && o.folders.size() == 1) throw;
                std::cerr << error.what() << '\n';
                code = kNo;
            }
        }
    }
    return code;
}

struct VerifyOptions {
    std::string recordings;
    bool quick = false, json = false;
    ArchiveOptions where = {};
};

int verify_archive(const VerifyOptions& o) {
    const Whereabouts at = whereabouts_of(o.where);
    if (at.place.folder.empty())
        throw std::runtime_error(
            "found no archive here, in $VIBRIG_ARCHIVE or in a configuration, expected --archive "
            "FOLDER");
    Progress progress("verifying");
    const auto found = archive::verify(
        at.place, o.recordings.empty() ? at.recordings : o.recordings, at.rig, o.quick,
        [&](std::size_t done, std::size_t all) { progress.show(done, all); });
    if (o.json) {
        Json findings = Json::array();
        for (const auto& one : found.findings)
            findings.push_back(
                {{"what", one.what}, {"campaign", one.campaign}, {"text", one.text}});
        std::cout << proto::json_text(Json{{"campaigns", found.campaigns},
                                           {"files", found.files},
                                           {"bytes", found.bytes},
                                           {"findings", std::move(findings)}})
                  << '\n';
    } else {
        for (const auto& one : found.findings) std::cout << one.what << ": " << one.text << '\n';
        std::cout << found.campaigns << " campaigns, " << found.files << " files, " << found.bytes
                  << " bytes" << (o.quick ? " (lengths alone)" : "") << ": "
                  << (found.findings.empty() ? "all there"
                                             : std::to_string(found.findings.size()) + " findings")
                  << '\n';
    }
    return found.findings.empty() ? 0 : kNo;
}

}  // namespace

void add_archive(CLI::App& app, int& exit_code) {
    CLI::App* group = app.add_subcommand("archive", "Campaigns of all rigs in one place");
    group->footer(
        "Example: vibrig archive add /var/lib/vibrig/demo-20260301T080000Z --archive /lab/archive");
    group->require_subcommand(1);

    const auto [adding, to_add] = add_command<AddOptions>(
        *group, exit_code, "add",
        "Copies campaigns into an archive, verifies the copies and registers them", add);
    adding.add_option("FOLDER", to_add.folders, "of a campaign, or of campaigns")->required();
    adding.add_flag("--json", to_add.json, "print what was done as JSON, a line each");
    adding.add_option("--rig", to_add.where.rig,
                      "whose they are (default: of --config, else this machine's name)");
    add_archive_options(adding, to_add.where);
    adding.footer(
        "Example: vibrig archive add /var/lib/vibrig/demo-20260301T080000Z --archive /lab/archive\n"
        "Again it changes nothing; what was damaged in the archive is mended. A folder that lies "
        "in\n"
        "the archive is registered where it is; the archive is the current folder if none is "
        "named.\n"
        "What vibrigd had put aside, since the archive refused it, it delivers again from then "
        "on.\n"
        "Exit codes: 0, 1 one of several could not be added, 2 bad usage or input.");

    add_archive_serve(*group, exit_code);
    add_archive_type(*group, exit_code);

    const auto [verifying, to_verify] = add_command<VerifyOptions>(
        *group, exit_code, "verify",
        "Compares every campaign of an archive with its index, and with a rig's recordings",
        verify_archive);
    verifying.add_option("--recordings", to_verify.recordings,
                         "a rig's recordings, to be compared too (default: of --config)");
    verifying.add_option("--rig", to_verify.where.rig,
                         "whose they are (default: of --config, else this machine's name)");
    verifying.add_flag("--quick", to_verify.quick, "look at the files' lengths alone");
    verifying.add_flag("--json", to_verify.json, "print the findings as JSON");
    add_archive_options(verifying, to_verify.where);
    verifying.footer(
        "Example: vibrig archive verify --config /etc/vibrig/vibrigd.toml\n"
        "Exit codes: 0, 1 something is missing, short, different or not in the index, or the index "
        "says something else "
        "than the recordings, 2 bad usage "
        "or input.");
}

}  // namespace vibrig::tool
