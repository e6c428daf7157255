// vibrig list: which campaigns there are.
#include <algorithm>
#include <cstdio>
#include <iostream>
#include <nlohmann/json.hpp>

#include "daemon/results/json_values.hpp"
#include "daemon/tool/colour.hpp"
#include "daemon/tool/commands.hpp"
#include "daemon/tool/recordings/archive_place.hpp"
#include "proto/json_text.hpp"

namespace vibrig::tool {

namespace {

using Json = nlohmann::ordered_json;

struct ListOptions {
    archive::Filter filter = {};
    std::string since, until;
    bool json = false;
    ArchiveOptions where = {};
};

Json entry_json(const archive::Entry& one) {
    return {{"campaign", one.key},
            {"name", one.name},
            {"started", iso_text(one.started_utc_ns)},
            {"ended", one.ended_utc_ns > 0 ? Json(iso_text(one.ended_utc_ns)) : Json(nullptr)},
            {"started_by", one.started_by},
            {"rig", text_or_null(one.rig)},
            {"unit",
             {{"type", text_or_null(one.unit_type)}, {"serial", text_or_null(one.unit_serial)}}},
            {"state", one.state},
            {"reason", text_or_null(one.reason)},
            {"verdict", text_or_null(one.verdict)},
            {"sentence", text_or_null(one.sentence)},
            {"mark", text_or_null(one.mark)},
            {"nis", one.nis > 0 ? Json(one.nis) : Json(nullptr)},
            {"dwells", one.dwells},
            {"simulated", one.simulated},
            {"version", text_or_null(one.version)},
            {"configuration_hash", text_or_null(one.configuration_hash)},
            {"superseded", one.superseded},
            {"hash", text_or_null(one.hash)}};
}

std::string or_dash(const std::string& text) { return text.empty() ? "-" : text; }

void print_table(const std::vector<archive::Entry>& found) {
    std::size_t serial = 6, rig = 3, type = 4;
    for (const auto& one : found) {
        serial = std::max(serial, one.unit_serial.size());
        rig = std::max(rig, one.rig.size());
        type = std::max(type, one.unit_type.size());
    }
    const auto row = [&](const std::string& started, const std::string& kind,
                         const std::string& unit, const std::string& by, const std::string& state,
                         const std::string& verdict, const std::string& key) {
        std::printf("%-16s  %-*s  %-*s  %-*s  %-11s  %-9s  %s\n", started.c_str(),
                    static_cast<int>(type), kind.c_str(), static_cast<int>(serial), unit.c_str(),
                    static_cast<int>(rig), by.c_str(), state.c_str(), verdict.c_str(), key.c_str());
    };
    row("started, UTC", "type", "serial", "rig", "state", "verdict", "campaign");
    for (const auto& one : found)
        row(minute_text(one.started_utc_ns), or_dash(one.unit_type), or_dash(one.unit_serial),
            or_dash(one.rig), one.state, or_dash(one.verdict),
            one.key + (one.simulated ? "  (simulated)" : ""));
    std::fflush(stdout);
}

int list(const ListOptions& o) {
    archive::Filter filter = o.filter;
    if (filter.verdict == "not-valid") filter.verdict = "not valid";
    if (!o.since.empty()) filter.since_utc_ns = utc_of("--since", o.since);
    if (!o.until.empty()) filter.until_utc_ns = utc_of("--until", o.until);
    const auto found = open_index(o.where)->campaigns(filter);
    if (o.json) {
        // One by one: of ten thousand a whole document would be slow.
        std::string text = "{\"campaigns\":[";
        for (const auto& one : found) {
            if (&one != &found.front()) text += ',';
            text += proto::json_text(entry_json(one));
        }
        std::cout << text << "]}\n";
    } else {
        print_table(found);
        std::cerr << found.size() << (found.size() == 1 ? " campaign\n" : " campaigns\n");
    }
    return 0;
}

}  // namespace

void add_list(CLI::App& app, int& exit_code) {
    const auto [command, options] = add_command<ListOptions>(
        app, exit_code, "list", "Campaigns of an archive or a rig, by time", list);
    command.add_option("--serial", options.filter.serial, "of this unit");
    command.add_option("--type", options.filter.type, "of this type of unit");
    command.add_option("--rig", options.filter.rig, "of this rig");
    command.add_option("--name", options.filter.name, "of this name");
    command.add_option("--since", options.since, "begun on this day or later, UTC: 2026-03-01");
    command.add_option("--until", options.until, "begun before this day, UTC");
    command.add_option("--verdict", options.filter.verdict, "with this verdict")
        ->check(CLI::IsMember({"valid", "doubtful", "not valid", "not-valid"}));
    command.add_option("--newest", options.filter.newest, "at most so many, the newest")
        ->check(CLI::Range(1, 1'000'000'000));
    command.add_flag("--superseded", options.filter.superseded,
                     "also what was delivered before the campaign went on");
    command.add_flag("--json", options.json, "print them as JSON");
    add_archive_options(command, options.where);
    command.footer(
        "Example: vibrig list --serial 0017 --since 2026-01-01 --archive /lab/archive\n"
        "In a rig's folder of recordings it reads, once, what the recorder noted.\n"
        "Exit codes: 0, 2 bad usage or input.");
}

}  // namespace vibrig::tool
