#include <algorithm>
#include <filesystem>
#include <iostream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "daemon/configuration/configuration.hpp"
#include "daemon/record/campaign_file.hpp"
#include "daemon/record/candump_campaign.hpp"
#include "daemon/record/replay.hpp"
#include "daemon/record/shaken.hpp"
#include "daemon/report/paperwork.hpp"
#include "daemon/report/result_charts.hpp"
#include "daemon/results/exit_status.hpp"
#include "daemon/results/json_values.hpp"
#include "daemon/results/progress.hpp"
#include "daemon/results/result_table.hpp"
#include "daemon/results/spectrum_text.hpp"
#include "daemon/results/text_line.hpp"
#include "daemon/tool/commands.hpp"
#include "daemon/tool/recordings/campaign_argument.hpp"
#include "daemon/tool/recordings/replayed_result.hpp"
#include "daemon/tool/simulated.hpp"
#include "estimator/filter/instruction_set.hpp"
#include "proto/candump.hpp"
#include "proto/json_text.hpp"
#include "proto/text.hpp"

namespace vibrig::tool {

namespace {

namespace fs = std::filesystem;

struct ReplayArguments {
    std::vector<std::string> files;
    std::string config, dwells, plot, speed = "max";
    std::string instruction_set = "auto";
    bool json = false;
    bool strict = false;
};

double replay_speed(const std::string& text) {
    double speed = 0;
    if (text == "max") return 0;
    std::string_view number = text;
    if (number.ends_with('x')) number.remove_suffix(1);
    if (!proto::read_number(number, speed) || !(speed >= 1e-3) || !(speed <= 1e6))
        throw std::runtime_error("--speed: found '" + proto::printable(text) +
                                 "', expected max or a number from 0.001 to 1000000");
    return speed;
}

/// That of --config, else that of the recording.
configuration::Configuration replayed_rig(const ReplayArguments& arguments,
                                          const record::Campaign& campaign) {
    if (!arguments.config.empty())
        return configuration::load(arguments.config, false).configuration;
    return report::configuration_of(campaign);
}

/// Whatever it is called: `vibrig export` writes one under any name.
bool is_log(const std::string& path) {
    if (path.ends_with(".log") || path.ends_with(".zst") || path.ends_with(".candump")) return true;
    std::error_code none;
    if (!fs::is_regular_file(path, none) || record::is_hdf5(path)) return false;
    try {
        return proto::CandumpReader(path).next().has_value();
    } catch (const std::exception&) {
        return false;
    }
}

record::Campaign replayed_campaign(const ReplayArguments& arguments) {
    const std::string& first = arguments.files.front();
    if (!std::ranges::any_of(arguments.files, is_log)) {
        if (arguments.files.size() > 1)
            throw std::runtime_error(arguments.files[1] +
                                     ": found a second campaign, expected one (or candump logs)");
        if (!arguments.dwells.empty())
            throw std::runtime_error("--dwells: found it with a campaign, expected candump logs");
        return read_named_campaign(first);
    }
    // Without words about it, what the recorder left beside the logs.
    const fs::path folder = fs::path(first).parent_path();
    std::string configuration, dbc;
    record::Campaign beside;
    const auto parts = record::part_files(folder.empty() ? "." : folder.string());
    if (!parts.empty()) {
        try {
            beside = record::read_part_head(parts.rbegin()->second);
            configuration = beside.head.configuration;
            dbc = beside.head.dbc;
        } catch (const std::exception& error) {
            if (arguments.config.empty())
                throw std::runtime_error(std::string(error.what()) +
                                         "; expected it, or --config FILE in its place");
            std::cerr << error.what() << "; whether the campaign is marked is not known\n";
        }
    }
    if (!arguments.config.empty()) {
        const auto loaded = configuration::load(arguments.config, false);
        configuration = configuration::format_effective(loaded);
        if (!loaded.configuration.dbc.empty())
            dbc = proto::read_whole_file(loaded.configuration.dbc, 16 << 20);
    }
    const std::string dwells =
        arguments.dwells.empty() ? (folder / "dwells.csv").string() : arguments.dwells;
    auto campaign = record::campaign_from_candump(arguments.files, dwells, configuration, dbc);
    campaign.head.name = beside.head.name;
    campaign.ended_utc_ns = beside.ended_utc_ns;
    campaign.mark = beside.mark;
    return campaign;
}

/// The result; where it is not the recording's, with a word about that.
std::string printed_json(const record::ReplayResult& replayed, std::string text,
                         const std::string& difference, bool same_build) {
    if (replayed.as_recorded() && difference.empty()) return text;
    nlohmann::ordered_json replay{{"dwells", replayed.compared},
                                  {"not_as_recorded", replayed.different},
                                  {"estimates", replayed.estimates},
                                  {"estimates_not_as_recorded", replayed.estimates_different},
                                  {"first", replayed.first_difference},
                                  {"result", text_or_null(difference)},
                                  {"same_build", same_build}};
    text.back() = ',';
    return text + "\"replay\":" + proto::json_text(replay) + "}";
}

std::string builds(const record::Head& recorded, bool same_build) {
    return "recorded by " + recorded.version + ", " + recorded.compiler + ", " +
           recorded.instruction_set + "; this is " + VIBRIG_VERSION + ", " +
           std::string(estimator::compiler()) + ", " + std::string(estimator::instruction_set()) +
           (same_build ? ": expected the same\n" : "\n");
}

/// `difference`: of the recording's result.
void say_how_it_went(const record::ReplayResult& replayed, const record::Head& recorded,
                     const std::string& difference, bool same_build) {
    std::cerr << line("%zu samples, %zu dwells: %.1f s recorded, replayed in %.2f s (%.0f times)",
                      replayed.samples, replayed.dwells.size(), replayed.recorded_s,
                      replayed.took_s,
                      replayed.took_s > 0 ? replayed.recorded_s / replayed.took_s : 0.0);
    if (replayed.compared == 0) return;
    if (!replayed.as_recorded()) {
        std::cerr << replayed.different << " of " << replayed.compared << " dwells and "
                  << replayed.estimates_different << " of " << replayed.estimates
                  << " rows of /estimates are not as recorded (" << replayed.first_difference
                  << "); " << builds(recorded, same_build);
    } else if (!difference.empty()) {
        std::cerr << "the recording's result is not that of its dwells (" << difference << "); "
                  << builds(recorded, same_build);
    } else {
        std::cerr << "estimates after each of " << replayed.compared
                  << " dwells: as recorded, to the last bit\n";
    }
}

/// False: of the frames something is missing, which is said.
bool is_whole(const std::vector<std::string>& files, const std::string& campaign_folder) {
    bool whole = true;
    if (std::ranges::none_of(files, is_log)) {
        // Its samples are those of the HDF5 files. What is gone of the frames was named when the
        // campaign was read; a file that is cut there may not be the only one.
        for (const auto& words : record::cut_raw(campaign_folder)) {
            std::cerr << campaign_folder << ": missing " << words << '\n';
            whole = false;
        }
    } else if (std::ranges::all_of(files, record::raw_number)) {  // others are anybody's
        const std::string folder = record::folder_of(files.front());
        whole = tell_missing_raw(folder);
        whole = tell_left_out(folder, files) && whole;
    } else {
        for (const auto& path : files) {
            if (!path.ends_with(".zst") || !record::is_cut(path)) continue;
            std::cerr << path << ": its end is missing: the file is cut off\n";
            whole = false;
        }
    }
    return whole;
}

int replay(const ReplayArguments& arguments) {
    estimator::use_instruction_set(arguments.instruction_set);
    record::ReplayOptions options;
    options.speed = replay_speed(arguments.speed);
    record::Campaign campaign;
    {
        const Working working("reading " + arguments.files.front());
        campaign = replayed_campaign(arguments);
        if (!arguments.config.empty()) {
            record::forget_noise(campaign);
            campaign.estimates.clear();
        }
    }
    const configuration::Configuration rig = replayed_rig(arguments, campaign);
    const estimator::Settings& settings = rig.estimator;
    record::ReplayResult replayed;
    {
        Progress progress("replaying");
        options.progress = [&](std::size_t done, std::size_t all) { progress.show(done, all); };
        replayed = record::replay(campaign, settings, options);
    }
    const bool whole = is_whole(arguments.files, campaign.folder);
    if (!arguments.config.empty()) replayed.different = replayed.compared = 0;
    const bool same_build = campaign.head.version == VIBRIG_VERSION &&
                            campaign.head.compiler == estimator::compiler() &&
                            campaign.head.instruction_set == estimator::instruction_set();
    auto found = assess(settings, replayed.found, replayed.result, replayed.rows,
                        record::shaken_of(campaign, rig));
    doubt_replayed(settings, replayed, found.assessed.verdict);
    // Of other settings, and where the dwells differ, it is another anyway.
    const std::string difference = arguments.config.empty() && replayed.as_recorded()
                                       ? not_as_recorded(campaign, replayed, found, settings)
                                       : "";
    const auto& assessed = found.assessed;
    const bool simulated = campaign.head.simulated;
    if (!arguments.plot.empty())
        report::plot_result(arguments.plot, replayed.result, assessed, simulated);
    std::cout << (arguments.json
                      ? printed_json(replayed, replayed_json(campaign, replayed, found, settings),
                                     difference, same_build) +
                            "\n"
                      : simulated_line(simulated) + result_table(replayed.result, assessed) +
                            (found.spectrum ? spectrum_text(*found.spectrum) : ""))
              << std::flush;
    say_how_it_went(replayed, campaign.head, difference, same_build);
    if (!std::cout) throw std::runtime_error("standard output: cannot be written");
    const bool as_recorded = (replayed.as_recorded() && difference.empty()) || !same_build;
    return whole && as_recorded ? exit_status(assessed.verdict.level, arguments.strict) : kNo;
}

}  // namespace

void add_replay(CLI::App& app, int& exit_code) {
    const auto [command, arguments] = add_command<ReplayArguments>(
        app, exit_code, "replay", "A recording through the daemon's own path, on a virtual clock",
        replay);
    command
        .add_option("FILE", arguments.files,
                    "a campaign: its folder, HDF5 file or name in the index; or candump logs in "
                    "order (.log, .log.zst, as vibrig export writes them)")
        ->required();
    command.add_option("--speed", arguments.speed, "times the recording's own, or max (default)");
    command.add_option("--config", arguments.config,
                       "identify anew with these settings (TOML) instead of the recorded ones");
    command.add_option("--dwells", arguments.dwells,
                       "with candump logs: which times are which dwell (default: dwells.csv "
                       "beside the first log)");
    command
        .add_option("--instruction-set", arguments.instruction_set,
                    "of the filter: auto (the best), or one of this processor's")
        ->envname("VIBRIG_INSTRUCTION_SET");
    command
        .add_option("--plot", arguments.plot,
                    "an SVG file: uncertainties of the coefficients; or a folder: their "
                    "correlation and the dwells' residuals, too")
        ->check(proto::charts());
    command.add_flag("--json", arguments.json, "print the result as JSON");
    command.add_flag("--strict", arguments.strict, "a doubtful result is a no as well");
    command.footer(
        "Example: vibrig replay /var/lib/vibrig/platform-17-20260301T080000Z --speed max\n"
        "On the build and instruction set of the recording the estimates come out as they were to\n"
        "the last bit; standard error says whether they did. 28 dwells of 100 s at 40 samples/s "
        "(142 000\n"
        "samples) take about a second.\n"
        "Exit codes: 0 the result is valid or doubtful, 1 it is not valid (with --strict: or "
        "doubtful), a segment of the raw log is\nmissing or was not given, or the recording's "
        "build and instruction "
        "set give other estimates or\nanother result (then \"replay\" in the JSON), 2 bad usage "
        "or input.");
}

}  // namespace vibrig::tool
