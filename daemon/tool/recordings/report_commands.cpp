// vibrig report and vibrig compensate.
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <iostream>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "daemon/archive/trend.hpp"
#include "daemon/archive/vibration.hpp"
#include "daemon/configuration/configuration.hpp"
#include "daemon/plot/chart.hpp"
#include "daemon/record/shaken.hpp"
#include "daemon/report/journal_section.hpp"
#include "daemon/report/report.hpp"
#include "daemon/results/assessment_json.hpp"
#include "daemon/results/exit_status.hpp"
#include "daemon/results/json_values.hpp"
#include "daemon/results/progress.hpp"
#include "daemon/results/result_table.hpp"
#include "daemon/results/spectrum_result.hpp"
#include "daemon/results/text_line.hpp"
#include "daemon/tool/commands.hpp"
#include "daemon/tool/recordings/archive_place.hpp"
#include "daemon/tool/recordings/campaign_argument.hpp"
#include "daemon/tool/recordings/print_pdf.hpp"
#include "daemon/tool/recordings/replayed_result.hpp"
#include "daemon/tool/recordings/trend_output.hpp"
#include "daemon/tool/simulated.hpp"
#include "proto/durable_file.hpp"
#include "proto/json_text.hpp"
#include "proto/text.hpp"

namespace vibrig::tool {

namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;
using estimator::kParameters;

struct ReportArguments {
    std::string campaign, output = "report.html", config, compare, pdf, journal;
    bool strict = false;
    bool same_unit = false;
    bool json = false;
    ArchiveOptions archive = {};
};

struct CompensateArguments {
    std::string campaign, format = "text", output, config;
    std::optional<double> platform_g, table_g;  ///< peak acceleration
    std::vector<double> attitude{0, 0, 0};
};

configuration::Configuration rig_of(const record::Campaign& campaign, const std::string& config) {
    return config.empty() ? report::rig_of(campaign)
                          : configuration::load(config, false).configuration;
}

/// What the recording's own settings give, as the daemon writes it. Where the recorded result is
/// another, the page and standard error say so.
std::string own_result(const record::Campaign& campaign, report::Analysis& analysis) {
    const auto settings = report::configuration_of(campaign).estimator;
    const Assessed found{analysis.assessed, analysis.spectrum};
    // Where the dwells differ it is another anyway.
    if (analysis.replayed.as_recorded())
        analysis.not_as_recorded = not_as_recorded(campaign, analysis.replayed, found, settings);
    if (!analysis.not_as_recorded.empty())
        std::cerr << "the recording's result is not that of its dwells ("
                  << analysis.not_as_recorded << ")\n";
    return replayed_json(campaign, analysis.replayed, found, settings);
}

/// This campaign's coefficients, of that result, beside those of the unit's earlier ones in an
/// archive.
void add_history(const record::Campaign& campaign, const std::string& result,
                 const ArchiveOptions& where, report::Analysis& analysis) {
    const std::string serial = report::paperwork_of(campaign).unit_serial;
    if (serial.empty() || !whereabouts_of(where).named) return;
    archive::Filter filter;
    filter.serial = serial;
    filter.until_utc_ns = campaign.head.utc_ns;
    auto index = open_index(where);
    auto before = index->results(filter);
    archive::read_vibrations(*index, whereabouts_of(where).place.folder, before);
    archive::Entry now;
    now.simulated = campaign.head.simulated;
    now.started_utc_ns = campaign.head.utc_ns;
    now.rig = before.empty() ? "" : before.back().rig;
    archive::take_result(result, report::configuration_of(campaign).estimator.frequency_hz, now);
    const auto moved = archive::moved(now, before);
    const auto trend =
        archive::trend_of(before, archive::kShutdownAfterH, now.simulated, now.coefficients);
    const std::string vibration = vibration_words(trend);
    analysis.history_note =
        "Unit " + serial + ": " + std::to_string(trend.campaigns.size()) +
        " earlier campaigns in the archive" + (vibration.empty() ? "" : "; " + vibration) + "." +
        (moved.empty() ? "" : " What is marked has moved by more than they allow, at 1 in 1000.");
    analysis.history = {
        {"coefficient", "now", "mean before", "95 %", "shutdown instability", "unit"}};
    const auto number = [](double value) { return printed("%.5f", value); };
    for (const auto& of : trend.coefficients) {
        const auto& c = now.coefficients[of.position];
        const bool far = std::ranges::any_of(
            moved, [&](const archive::Moved& one) { return one.position == of.position; });
        analysis.history.push_back({estimator::parameter_names()[of.position],
                                    c ? (far ? "!" : "") + number(c->value) : "not determined",
                                    number(of.mean),
                                    number(of.mean_low) + " .. " + number(of.mean_high),
                                    of.shutdown.tested ? number(of.shutdown.value) : "not known",
                                    estimator::parameter_unit(of.position)});
    }
}

int make_report(const ReportArguments& arguments) {
    proto::check_output(arguments.output);
    proto::check_output(arguments.pdf);
    auto campaign = read_named_campaign(arguments.campaign);
    if (!arguments.config.empty()) record::forget_noise(campaign);
    const auto rig = rig_of(campaign, arguments.config);
    std::optional<report::Earlier> earlier;
    if (!arguments.compare.empty()) {
        earlier = report::earlier_of(read_named_campaign(arguments.compare), campaign,
                                     arguments.same_unit);
        std::cerr << "compared with " << earlier->path << " of " << earlier->when << '\n';
    }
    report::Analysis analysis;
    {
        Progress progress("analysing " + campaign.head.name);
        analysis = report::analyse(campaign, rig, [&](double fraction) {
            progress.show(static_cast<std::size_t>(100 * fraction), 100);
        });
    }
    doubt_replayed(rig.estimator, analysis.replayed, analysis.assessed.verdict);
    analysis.anew_with = proto::printable(arguments.config, proto::kLongestLine);
    // Beside other settings the history stays that of the recorded ones.
    const std::string result =
        arguments.config.empty() ? own_result(campaign, analysis) : campaign.result_json;
    try {
        add_history(campaign, result, arguments.archive, analysis);
    } catch (const std::exception& error) {
        // The report is of this campaign: an archive that is gone does not keep it.
        analysis.history_note = std::string("The archive could not be asked: ") + error.what();
        std::cerr << error.what() << '\n';
    }
    analysis.journal = report::journal_verdict(campaign, arguments.journal);
    if (analysis.journal.starts_with('!'))
        std::cerr << "journal: " << analysis.journal.substr(1) << '\n';
    const std::string page = report::make_page(campaign, analysis, earlier);
    proto::write_output(arguments.output, page);
    std::cerr << arguments.output << ": " << page.size() / 1000 << " kB\n";
    if (!arguments.pdf.empty()) {
        proto::OutputFile pdf(arguments.pdf);
        print_pdf(arguments.output, pdf.place());
        std::error_code none;
        const auto size = fs::file_size(pdf.place(), none);
        pdf.finish();
        std::cerr << arguments.pdf << (none ? "" : printed(": %ju kB", size / 1000)) << '\n';
    }
    const auto& verdict = analysis.assessed.verdict;
    std::cerr << "verdict: " << verdict.sentence << '\n';
    if (arguments.json) {
        Json written{{"campaign", campaign.head.name},
                     {"file", arguments.output},
                     {"pdf", text_or_null(arguments.pdf)},
                     {"compared_with", text_or_null(earlier ? earlier->path : "")},
                     {"identified_anew_with", text_or_null(arguments.config)}};
        written["verdict"] = assessment_json(analysis.assessed)["verdict"];
        std::cout << proto::json_text(written) << std::endl;
    }
    return exit_status(verdict.level, arguments.strict);
}

Json prediction_json(const report::Prediction& predicted, const CompensateArguments& arguments,
                     double kappa) {
    Json root;
    root["attitude_deg"] = arguments.attitude;
    root["platform_g"] = std::sqrt(2 * (kappa - 1));
    root["kappa"] = kappa;
    Json gyros = Json::array();
    for (std::size_t k = 0; k < 3; ++k) {
        gyros.push_back({{"gyro", std::string(1, "xyz"[k])},
                         {"drift_dph", predicted.drift_dph[k]},
                         {"residual_sigma_dph", predicted.residual_dph[k]},
                         {"determined", predicted.determined[k]}});
    }
    root["gyros"] = std::move(gyros);
    return root;
}

std::string coefficients_json(const record::Campaign& campaign, const report::Coefficients& c,
                              const estimator::Settings& settings, const std::string& frequencies,
                              const std::string& anew_with, const Json& verdict,
                              const std::vector<std::string>& warnings, const Json& prediction) {
    Json root;
    root["simulated"] = campaign.head.simulated;
    if (campaign.head.simulated) root["note"] = kSimulatedRig;
    root["campaign"] = campaign.head.name;
    root["started"] = report::utc_text(campaign.head.utc_ns);
    root["file"] = campaign.path;
    root["identified_anew_with"] = text_or_null(anew_with);
    root["verdict"] = verdict;
    root["warnings"] = warnings;
    root["model"] =
        "D = F + I aI + O aO + S aS + II aI^2 + OO aO^2 + SS aS^2 + IO aI aO + IS aI aS "
        "+ OS aO aS; a: specific force along input, output, spin axis, g";
    Json list = Json::array();
    for (std::size_t i = 0; i < kParameters; ++i) {
        const bool known = c.observable[i];
        list.push_back({{"name", estimator::parameter_names()[i]},
                        {"value", known ? Json(c.value[i]) : Json(nullptr)},
                        {"sigma", known ? Json(c.sigma[i]) : Json(nullptr)},
                        {"u", known && c.combined ? Json(c.sigma[i]) : Json(nullptr)},
                        {"unit", estimator::parameter_unit(i)}});
    }
    root["coefficients"] = std::move(list);
    for (std::size_t g = 0; g < 3; ++g) {
        Json axes = Json::array();
        for (const auto& axis : settings.gyro_axes[g])
            axes.push_back(printed("%c%c", axis.sign < 0 ? '-' : '+', "xyz"[axis.axis]));
        root["axes"][printed("gyro_%c", "xyz"[g])] = std::move(axes);
    }
    root["drift_sign"] = settings.drift_sign;
    root["frequencies"] = text_or_null(frequencies);
    root["prediction"] = prediction;
    return proto::json_text(root, 2) + "\n";
}

std::string axes_line(const estimator::Settings& settings) {
    std::string text = "input, output, spin axis (I, O, S) in platform axes:";
    for (std::size_t g = 0; g < 3; ++g) {
        text += printed("%s gyro %c", g == 0 ? "" : ",", "xyz"[g]);
        for (const auto& axis : settings.gyro_axes[g])
            text += printed(" %c%c", axis.sign < 0 ? '-' : '+', "xyz"[axis.axis]);
    }
    return text + printed("; drift sign %+d", settings.drift_sign);
}

/// What the coefficients rest on, and whether they can be believed.
std::vector<std::string> notes_of(const CompensateArguments& arguments,
                                  const estimator::uncertainty::Verdict& verdict,
                                  const std::vector<std::string>& warnings,
                                  const std::string& frequencies) {
    std::vector<std::string> notes;
    if (!arguments.config.empty())
        notes.push_back("identified anew with " +
                        proto::printable(arguments.config, proto::kLongestLine) +
                        ", not as recorded");
    notes.push_back("verdict: " + verdict.sentence);
    for (const std::string& warning : warnings) notes.push_back("warning: " + warning);
    if (!frequencies.empty()) notes.push_back(frequencies);
    return notes;
}

/// For comments: what the numbers refer to, and what they predict.
std::vector<std::string> comment_lines(std::vector<std::string> lines,
                                       const estimator::Settings& settings, bool combined,
                                       const report::Prediction& predicted,
                                       const CompensateArguments& arguments, double kappa) {
    lines.emplace_back(combined ? "sigma: the standard uncertainty u, of noise, drift of the "
                                  "biases and declared inputs"
                                : "sigma: of noise alone, the uncertainty was not assessed");
    lines.push_back(axes_line(settings));
    lines.push_back(printed("predicted at %g, %g, %g deg with %.4g g peak at the platform, deg/h:",
                            arguments.attitude[0], arguments.attitude[1], arguments.attitude[2],
                            std::sqrt(2 * (kappa - 1))));
    for (std::size_t k = 0; k < 3; ++k)
        lines.push_back(
            printed("gyro %c: drift %.6f, left after compensation 0 +- %.6f (1 sigma)%s", "xyz"[k],
                    predicted.drift_dph[k], predicted.residual_dph[k],
                    predicted.determined[k] ? "" : ", rests on what is not determined"));
    return lines;
}

std::string coefficients_csv(const report::Coefficients& c,
                             const std::vector<std::string>& comments) {
    std::string text;
    for (const auto& line : comments) text += "# " + line + "\n";
    text += "name,value,sigma,unit\n";
    for (std::size_t i = 0; i < kParameters; ++i) {
        text += estimator::parameter_names()[i];
        text +=
            c.observable[i] ? printed(",%.17g,%.17g,", c.value[i], c.sigma[i]) : std::string(",,,");
        text += std::string(estimator::parameter_unit(i)) + "\n";
    }
    return text;
}

std::string coefficients_header(const record::Campaign& campaign, const report::Coefficients& c,
                                const std::vector<std::string>& comments) {
    // A name in a comment must not end it.
    std::string name;
    for (const char ch : campaign.head.name)
        name += std::isalnum(static_cast<unsigned char>(ch)) != 0 ? ch : '_';
    std::string text;
    if (campaign.head.simulated) text = std::string("/* ") + kSimulatedRig + " */\n";
    text += "/* Gyro error coefficients of campaign " + name + ", " +
            report::utc_text(campaign.head.utc_ns) +
            ".\n * deg/h, deg/h/g, deg/h/g^2. Drift about the input axis of a gyro:\n"
            " *   D = c[0] + c[1] aI + c[2] aO + c[3] aS + c[4] aI^2 + c[5] aO^2 + c[6] "
            "aS^2\n *       + c[7] aI aO + c[8] aI aS + c[9] aO aS\n"
            " * with a the specific force along input, output and spin axis, g.\n";
    for (auto line : comments) {
        // Nor must a file's name.
        for (auto at = line.find("*/"); at != std::string::npos; at = line.find("*/"))
            line[at] = '_';
        text += " * " + line + "\n";
    }
    text += " */\n#ifndef VIBRIG_COEFFICIENTS_H\n#define VIBRIG_COEFFICIENTS_H\n\n";
    for (const bool sigma : {false, true}) {
        text += std::string("static const double vibrig_coefficient") + (sigma ? "_sigma" : "") +
                "[3][10] = {\n";
        for (std::size_t g = 0; g < 3; ++g) {
            text += "    {";
            for (std::size_t k = 0; k < 10; ++k)
                text += printed("%s%.17g", k == 0 ? "" : ", ",
                                sigma ? c.sigma[g * 10 + k] : c.value[g * 10 + k]);
            text += g == 2 ? "} /* z */\n" : g == 1 ? "}, /* y */\n" : "}, /* x */\n";
        }
        text += "};\n";
    }
    return text + "\n#endif\n";
}

std::string coefficients_text(const report::Coefficients& c, const std::string& axes,
                              const std::vector<std::string>& notes,
                              const report::Prediction& predicted,
                              const CompensateArguments& arguments, double kappa) {
    // Beside the sigma of `identify`, which is of noise alone, it has its own name.
    std::string text = printed("%-12s %12s %11s  %s\n", "coefficient", "value",
                               c.combined ? "u" : "sigma", "unit");
    for (std::size_t i = 0; i < kParameters; ++i) {
        text += c.observable[i]
                    ? printed("%-12s %12.6f %11.6f  %s\n", estimator::parameter_names()[i],
                              c.value[i], c.sigma[i], estimator::parameter_unit(i))
                    : printed("%-12s %12s %11s  %s\n", estimator::parameter_names()[i],
                              "not determined", "-", estimator::parameter_unit(i));
    }
    text += "\n" + axes + "\n";
    for (const auto& note : notes) text += note + "\n";
    text += printed("\nat %g, %g, %g deg with %.4g g peak at the platform (deg/h)\n",
                    arguments.attitude[0], arguments.attitude[1], arguments.attitude[2],
                    std::sqrt(2 * (kappa - 1)));
    text += printed("%-6s %14s %26s\n", "gyro", "drift", "left after compensation");
    for (std::size_t k = 0; k < 3; ++k)
        text += printed("%-6c %14.6f         0 +- %.6f (1 sigma)%s\n", "xyz"[k],
                        predicted.drift_dph[k], predicted.residual_dph[k],
                        predicted.determined[k] ? "" : "  rests on what is not determined");
    return text;
}

/// What the quadratic coefficients are of; empty: there is one frequency. Throws where they say
/// nothing of the drift under vibration.
std::string about_frequencies(const std::string& path, const Assessed& of, double level_g) {
    if (!of.spectrum) return {};
    if (of.spectrum->same_at_all()) return "of several frequencies, at which they do not differ";
    if (level_g > 0)
        throw std::runtime_error(
            path +
            ": found quadratic coefficients that depend on the frequency, expected no "
            "--platform-g or --table-g (vibrig predict has the drift under a vibration)");
    std::string text = "of several frequencies, at which quadratic ones differ; here they are";
    for (std::size_t j = 0; j < 3; ++j) {
        const double hz = of.spectrum->at_hz(estimator::kGroups * j + 4);  // D_II, as the others
        text += printed("%s gyro %c ", j == 0 ? "" : ",", "xyz"[j]) +
                (hz > 0           ? printed("at %g Hz", hz)
                 : std::isnan(hz) ? std::string("of no frequency, a compromise")
                                  : std::string("static"));
    }
    return text;
}

void check_finite(const std::string& path, const report::Coefficients& c) {
    for (std::size_t i = 0; i < kParameters; ++i) {
        for (const double number : {c.value[i], c.sigma[i]}) {
            if (c.observable[i] && !std::isfinite(number))
                throw std::runtime_error(path + ": " + estimator::parameter_names()[i] +
                                         ": found " + printed("%g", number) +
                                         ", expected a finite number");
        }
    }
}

int compensate(const CompensateArguments& arguments) {
    double level = arguments.table_g.value_or(arguments.platform_g.value_or(0));
    proto::check_output(arguments.output);
    auto campaign = read_named_campaign(arguments.campaign);
    if (!arguments.config.empty()) record::forget_noise(campaign);
    const auto rig = rig_of(campaign, arguments.config);
    const estimator::Settings& settings = rig.estimator;
    auto replayed = record::replay(campaign, settings, {});
    auto found = assess(settings, replayed.found, replayed.result, replayed.rows,
                        record::shaken_of(campaign, rig));
    doubt_replayed(settings, replayed, found.assessed.verdict);
    const auto& verdict = found.assessed.verdict;
    const auto coefficients =
        report::combined(found.assessed, report::final_coefficients(campaign.path, replayed));
    const std::string frequencies = about_frequencies(campaign.path, found, level);
    check_finite(campaign.path, coefficients);
    if (arguments.table_g) level *= settings.transmission;
    const double kappa = 1 + level * level / 2;
    const auto predicted = report::predict(
        settings, coefficients,
        {arguments.attitude[0], arguments.attitude[1], arguments.attitude[2]}, {.kappa = kappa});
    const bool all = std::ranges::all_of(coefficients.observable, [](bool b) { return b; });
    if (arguments.format == "c" && !all)
        throw std::runtime_error(
            campaign.path +
            ": found coefficients that are not determined, expected all 30 for "
            "a C header");
    const auto notes = notes_of(arguments, verdict, replayed.result.warnings, frequencies);
    auto comments =
        comment_lines(notes, settings, coefficients.combined, predicted, arguments, kappa);
    const bool simulated = campaign.head.simulated;
    // In the header it has a comment of its own.
    if (simulated && arguments.format == "csv") comments.insert(comments.begin(), kSimulatedRig);
    const std::string text =
        arguments.format == "json"
            ? coefficients_json(campaign, coefficients, settings, frequencies, arguments.config,
                                assessment_json(found.assessed)["verdict"],
                                replayed.result.warnings,
                                prediction_json(predicted, arguments, kappa))
        : arguments.format == "csv" ? coefficients_csv(coefficients, comments)
        : arguments.format == "c"
            ? coefficients_header(campaign, coefficients, comments)
            : simulated_line(simulated) + coefficients_text(coefficients, axes_line(settings),
                                                            notes, predicted, arguments, kappa);
    if (arguments.output.empty()) {
        std::cout << text << std::flush;
    } else {
        proto::write_output(arguments.output, text);
    }
    // On a terminal it stands in what was just printed.
    if (!arguments.output.empty() || isatty(STDOUT_FILENO) == 0)
        std::cerr << "verdict: " << verdict.sentence << '\n';
    return all ? exit_status(verdict.level, false) : kNo;
}

}  // namespace

void add_reports(CLI::App& app, int& exit_code) {
    const auto [reporting, report] = add_command<ReportArguments>(
        app, exit_code, "report", "One page of a recorded campaign, to be signed and filed",
        make_report);
    reporting.add_option("CAMPAIGN", report.campaign, kCampaignHelp)->required();
    reporting.add_option("-o,--output", report.output, "HTML file to write (default report.html)");
    reporting.add_option("--compare", report.compare,
                         "an earlier campaign of the same unit: repeatability and E_n");
    reporting
        .add_flag("--same-unit", report.same_unit,
                  "compare though a campaign states no serial number")
        ->needs("--compare");
    reporting.add_option("--config", report.config,
                         "identify anew with these settings instead of the recorded ones");
    reporting.add_option("--journal", report.journal,
                         "the daemon's journal, to be verified (default: journal.sqlite3 beside "
                         "the campaign's folder)");
    reporting.add_option("--archive", report.archive.archive,
                         "show the unit's earlier campaigns in this archive (default: "
                         "$VIBRIG_ARCHIVE)");
    reporting.add_option("--pdf", report.pdf, "print it to this PDF file, too (with chromium)");
    reporting.add_flag("--json", report.json, "print what was written, and the verdict, as JSON");
    reporting.add_flag("--strict", report.strict, "a doubtful result is a no as well");
    reporting.footer(
        "Exit codes: 0 the result is valid or doubtful, 1 it is not valid (with --strict: or "
        "doubtful), 2 bad\nusage or input.\n"
        "Example: vibrig report demo-20260301T080000Z -o report.html --pdf report.pdf");

    const auto [compensating, compensation] = add_command<CompensateArguments>(
        app, exit_code, "compensate",
        "Coefficients for a navigation computer, and what drift they leave", compensate);
    compensating.add_option("CAMPAIGN", compensation.campaign, kCampaignHelp)->required();
    compensating
        .add_option("--to", compensation.format, "text (default), json, csv or c (a header)")
        ->check(CLI::IsMember({"text", "json", "csv", "c"}));
    compensating.add_flag_callback(
        "--json", [&format = compensation.format] { format = "json"; }, "as --to json");
    compensating.add_option("-o,--output", compensation.output,
                            "file to write (default: standard output)");
    add_numbers(compensating, "--attitude", compensation.attitude, 3,
                "outer, inner, azimuth of the gimbals (no encoder readings) in deg at which the "
                "drift is predicted (default 0,0,0)",
                -360, 360);
    CLI::Option* const platform =
        add_number(compensating, "--platform-g", compensation.platform_g,
                   "vibration, peak at the platform, g (default 0)", 0, 1000);
    add_number(compensating, "--table-g", compensation.table_g, "or peak at the table, g", 0, 1000)
        ->excludes(platform);
    compensating.add_option("--config", compensation.config,
                            "identify anew with these settings instead of the recorded ones");
    compensating.footer(
        "Example: vibrig compensate demo-20260301T080000Z --attitude 45,0,90 --platform-g 6\n"
        "Exit codes: 0 all 30 coefficients are determined and the result is valid or doubtful, 1 "
        "some are\nnot, or it is not valid, 2 bad usage or input.");
}

}  // namespace vibrig::tool
