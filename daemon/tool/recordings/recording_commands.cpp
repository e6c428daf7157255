// vibrig export and vibrig recover.
#include <algorithm>
#include <array>
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "daemon/record/campaign_file.hpp"
#include "daemon/record/raw_log.hpp"
#include "daemon/report/paperwork.hpp"
#include "daemon/results/json_values.hpp"
#include "daemon/results/progress.hpp"
#include "daemon/results/text_line.hpp"
#include "daemon/tool/commands.hpp"
#include "daemon/tool/recordings/campaign_argument.hpp"
#include "daemon/tool/recordings/export_csv.hpp"
#include "daemon/tool/recordings/mat_file.hpp"
#include "estimator/filter/angles.hpp"
#include "proto/durable_file.hpp"
#include "proto/json_text.hpp"

namespace vibrig::tool {

namespace {

namespace fs = std::filesystem;
using estimator::kDegPerRad;

void export_mat(const record::Campaign& campaign, const std::string& path) {
    const auto& samples = campaign.samples;
    const auto dwells = record::recorded_dwells(campaign);
    std::vector<double> angle, force, quality, run(samples.size()), position(samples.size());
    for (const auto& dwell : dwells) {
        for (std::size_t i = dwell.first; i < dwell.first + dwell.count; ++i) {
            run[i] = dwell.order->run;
            position[i] = dwell.order->position;
        }
    }
    for (const auto& s : samples) {
        for (const double a : s.angle) angle.push_back(a * kDegPerRad);
        force.insert(force.end(), s.force.begin(), s.force.end());
        for (std::size_t k = 0; k < drivers::kChannels; ++k)
            quality.push_back(static_cast<double>(s.quality[k]));
    }
    const drivers::Time origin = samples.empty() ? 0 : samples.front().time;
    const auto since = [origin](drivers::Time time) { return drivers::to_seconds(time - origin); };
    MatFile file(path);
    const auto add = [&file](const char* name, const auto& rows, const auto& number_of) {
        std::vector<double> column;
        for (const auto& row : rows) column.push_back(number_of(row));
        file.add(name, column);
    };
    file.add("name", campaign.head.name);
    file.add("configuration", campaign.head.configuration);
    file.add("result_json", campaign.result_json);
    file.add("simulated", std::vector<double>{campaign.head.simulated ? 1.0 : 0.0});
    file.add("start_utc_s",
             std::vector<double>{drivers::to_seconds(origin + campaign.head.utc_offset_ns)});
    add("time_s", samples, [&](const auto& s) { return since(s.time); });
    add("sequence", samples, [](const auto& s) { return s.sequence; });
    file.add("angle_deg", angle, 3);
    file.add("force_g", force, 3);
    add("table_accel_g", samples, [](const auto& s) { return s.table_accel; });
    file.add("quality", quality, drivers::kChannels);
    file.add("run", run);
    file.add("position", position);
    std::vector<double> value, sigma, covariance;
    for (const auto& dwell : campaign.dwells) {
        value.insert(value.end(), dwell.value.begin(), dwell.value.end());
        sigma.insert(sigma.end(), dwell.sigma.begin(), dwell.sigma.end());
    }
    if (!campaign.dwells.empty()) covariance = campaign.dwells.back().covariance;
    std::string names;
    for (const char* name : estimator::parameter_names())
        names += (names.empty() ? "" : " ") + std::string(name);
    file.add("coefficients", names);
    add("dwell_run", dwells, [](const auto& dwell) { return dwell.order->run; });
    add("dwell_position", dwells, [](const auto& dwell) { return dwell.order->position; });
    add("dwell_table_g", dwells, [](const auto& dwell) { return dwell.order->table_g; });
    add("dwell_from_s", dwells, [&](const auto& dwell) { return since(dwell.order->from); });
    add("dwell_to_s", dwells, [&](const auto& dwell) { return since(dwell.order->to); });
    add("dwell_kappa", campaign.dwells, [](const auto& dwell) { return dwell.summary.kappa; });
    add("dwell_nis_per_dof", campaign.dwells,
        [](const auto& dwell) { return dwell.summary.nis_per_dof; });
    file.add("dwell_value", value, estimator::kParameters);
    file.add("dwell_sigma", sigma, estimator::kParameters);
    file.add("covariance", covariance, estimator::kParameters);
    file.finish();
    std::cerr << path << ": " << samples.size() << " samples\n";
}

/// Whole lines of a candump log without what Wireshark does not take: directions, comments.
class PlainLines {
  public:
    std::string_view of(std::string_view piece) {
        rest_ += piece;
        plain_.clear();
        std::size_t begin = 0;
        for (std::size_t end = rest_.find('\n'); end != std::string::npos;
             begin = end + 1, end = rest_.find('\n', begin)) {
            std::string_view line(rest_.data() + begin, end - begin);
            if (!line.starts_with('(')) continue;
            if (line.ends_with(" R") || line.ends_with(" T")) line.remove_suffix(2);
            plain_ += std::string(line) + "\n";
        }
        rest_.erase(0, begin);
        return plain_;
    }

  private:
    std::string rest_, plain_;
};

/// False: a segment is missing.
bool export_candump(const record::Campaign& campaign, const std::string& path, bool plain) {
    const auto files = record::raw_files(campaign.folder);
    if (files.empty())
        throw std::runtime_error(campaign.folder +
                                 ": found no raw-*.log, expected the campaign's raw log");
    if (const auto words = record::misplaced_raw(campaign.folder); !words.empty())
        throw std::runtime_error(words);
    std::optional<proto::OutputFile> out;
    if (path != "-") out.emplace(path);
    const auto close = [](std::FILE* file) { std::fclose(file); };
    std::unique_ptr<std::FILE, decltype(close)> file(
        out ? std::fopen(out->place().c_str(), "wb") : nullptr, close);
    std::FILE* const to = out ? file.get() : stdout;
    if (to == nullptr) throw std::runtime_error(path + ": cannot be written");
    std::size_t bytes = 0;
    bool good = true;
    for (const auto& segment : files) {
        PlainLines lines;
        record::read_raw(segment, [&](std::string_view piece) {
            if (plain) piece = lines.of(piece);
            good = good && std::fwrite(piece.data(), 1, piece.size(), to) == piece.size();
            bytes += piece.size();
            return good;
        });
    }
    good = (out ? std::fclose(file.release()) : std::fflush(stdout)) == 0 && good;
    if (!good) throw std::runtime_error(path + ": cannot be written");
    if (out) out->finish();
    if (out) std::cerr << path << ": " << bytes << " bytes of " << files.size() << " segments\n";
    return tell_missing_raw(campaign.folder);
}

struct ExportOptions {
    std::string campaign, format, output;
    bool json = false;
};

int export_campaign(const ExportOptions& options) {
    const std::string &argument = options.campaign, &format = options.format;
    std::string path = options.output;
    if (options.json && path == "-")
        throw std::runtime_error("--json: found it beside --output -, expected a file to write");
    record::Campaign campaign;
    {
        const Working working("reading " + argument);
        campaign = read_named_campaign(argument);
    }
    if (path.empty()) {
        // Here, whatever the recording says of itself.
        path = campaign.head.name +
               (format == "candump" || format == "wireshark" ? ".log" : "." + format);
        std::ranges::replace(path, '/', '_');
    }
    proto::check_output(path);
    bool whole = true;
    std::optional<Working> working("exporting " + campaign.head.name);
    if (format == "csv") {
        export_csv(campaign, path);
    } else if (format == "mat") {
        export_mat(campaign, path);
    } else {
        whole = export_candump(campaign, path, format == "wireshark");
    }
    working.reset();
    if (options.json) {
        std::cout << proto::json_text(nlohmann::ordered_json{{"campaign", campaign.head.name},
                                                             {"format", format},
                                                             {"file", path},
                                                             {"whole", whole}})
                  << std::endl;
    }
    return whole ? 0 : kNo;
}

std::vector<std::string> lost(const record::Recovery& found) {
    std::vector<std::string> lost;
    if (found.recovered && found.ends_utc_ns > 0)
        lost.push_back("everything after " + report::utc_text(found.ends_utc_ns));
    if (!found.cut_dwell.empty()) lost.push_back("the end of " + found.cut_dwell);
    if (found.missing > 0)
        lost.push_back(std::to_string(found.missing) + " sync counts within what is there");
    lost.insert(lost.end(), found.words.begin(), found.words.end());
    return lost;
}

nlohmann::ordered_json recovery_json(const record::Recovery& found) {
    nlohmann::ordered_json root;
    root["campaign"] = found.path;
    if (!found.failed.empty()) {
        root["error"] = found.failed;
        return root;
    }
    root["was_closed"] = found.was_closed;
    root["recovered"] = found.recovered;
    root["parts"] = found.parts;
    root["samples"] = found.samples;
    root["samples_from_raw"] = found.samples_from_raw;
    root["samples_missing"] = found.missing;
    root["recorded_s"] = found.recorded_s;
    root["ends"] = nullptr;
    if (found.ends_utc_ns > 0) root["ends"] = report::utc_text(found.ends_utc_ns);
    root["dwells"] = found.dwells;
    root["dwell_in_progress"] = nullptr;
    if (!found.cut_dwell.empty()) root["dwell_in_progress"] = found.cut_dwell;
    root["raw_beyond_s"] = found.raw_until_s;
    root["missing_raw"] = found.missing_raw;
    root["misplaced_raw"] = text_or_null(found.misplaced_raw);
    root["lost"] = lost(found);
    return root;
}

std::string recovery_text(const record::Recovery& found) {
    std::string text = !found.was_closed ? "mended\n"
                       : found.recovered ? "mended before: nothing to mend\n"
                                         : "closed in order: nothing to mend\n";
    text += line("%zu samples over %.3f s, %zu dwells done, %zu %s", found.samples,
                 found.recorded_s, found.dwells, found.parts, found.parts == 1 ? "file" : "files");
    if (found.recovered) {
        text += line("%zu samples more from the raw log, which goes on %.3f s longer",
                     found.samples_from_raw, found.raw_until_s);
        if (found.cut_dwell.empty()) text += "no dwell was in progress\n";
    }
    for (const auto& words : lost(found)) text += "lost: " + words + "\n";
    for (const auto& words : found.missing_raw) text += "missing " + words + "\n";
    if (!found.misplaced_raw.empty()) text += found.misplaced_raw + "\n";
    return text;
}

struct RecoverOptions {
    std::string campaign;
    bool json = false;
};

int recover(const RecoverOptions& options) {
    const auto found =
        record::recover(named_campaign(options.campaign),
                        [](const std::string& words) { std::cerr << words << '\n'; });
    int code = 0;
    for (const auto& campaign : found) {
        if (!campaign.missing_raw.empty() || !campaign.misplaced_raw.empty() ||
            !campaign.failed.empty())
            code = kNo;
        if (options.json) {
            std::cout << proto::json_text(recovery_json(campaign)) << '\n';
        } else if (campaign.failed.empty()) {
            if (found.size() > 1) std::cout << campaign.path << ": ";
            std::cout << recovery_text(campaign);
        }
    }
    std::cout << std::flush;
    for (const auto& campaign : found)
        if (!campaign.failed.empty()) std::cerr << campaign.failed << '\n';
    return code;
}

}  // namespace

void add_recordings(CLI::App& app, int& exit_code) {
    const auto [exporting, options] = add_command<ExportOptions>(
        app, exit_code, "export", "A recorded campaign for other programs", export_campaign);
    exporting.add_option("CAMPAIGN", options.campaign, kCampaignHelp)->required();
    exporting
        .add_option(
            "--to", options.format,
            "csv (as `vibrig identify` reads it: samples of good quality, zeros that were taken "
            "in place subtracted), mat (MATLAB, Octave), candump (both directions; "
            "canplayer, log2asc) or wireshark (the same without directions)")
        ->required()
        ->check(CLI::IsMember({"csv", "mat", "candump", "wireshark"}));
    exporting.add_option("-o,--output", options.output,
                         "file to write (default: the campaign's name here; candump: - is "
                         "standard output)");
    exporting.add_flag("--json", options.json, "print what was written as JSON");
    exporting.footer(
        "Example: vibrig export demo-20260301T080000Z --to csv -o demo.csv\n"
        "A sample takes 79 bytes in the recording's HDF5 file (93 with estimates and covariances), "
        "59 as\n"
        "frames in its compressed raw log (470 as text).\n"
        "Exit codes: 0, 1 a segment of the raw log is missing (candump, wireshark), 2 bad usage or "
        "input.");

    const auto [recovering, to_recover] = add_command<RecoverOptions>(
        app, exit_code, "recover", "Mends a campaign's files after a crash and says what was lost",
        recover);
    recovering
        .add_option("CAMPAIGN", to_recover.campaign,
                    std::string(kCampaignHelp) +
                        "; or the folder of all recordings: then its index is made anew, too")
        ->required();
    recovering.add_flag("--json", to_recover.json, "print what was found as JSON");
    recovering.footer(
        "Example: vibrig recover /var/lib/vibrig/platform-17-20260301T080000Z\n"
        "A file that was closed in order is left as it is.\n"
        "Exit codes: 0, 1 a segment of the raw log is missing or in another's place, or one of "
        "several "
        "campaigns\ncannot be recovered, 2 bad usage or input.");
}

}  // namespace vibrig::tool
