#include <algorithm>
#include <iostream>
#include <map>
#include <stdexcept>
#include <vector>

#include "daemon/allan/analysis.hpp"
#include "daemon/tool/analysis/allan_live.hpp"
#include "daemon/tool/commands.hpp"

namespace vibrig::tool {

namespace {

constexpr int kAlarms = 1;

struct Options {
    AllanRequest request;
    std::string data = "rate";
    std::string type = "oadev";
    std::string mean = "corrected";
    std::vector<double> reference;
    CLI::Option* known_mean = nullptr;
    std::string plot;
    std::string shape = "rectangular";
    bool json = false;
    bool live = false;
};

int run(const Options& options) {
    AllanRequest request = options.request;
    request.phase = options.data == "phase";
    request.statistic = allan::statistic_named(options.type);
    const std::map<std::string, allan::MeanMode> modes{
        {"window-mean", allan::MeanMode::window_mean},
        {"corrected", allan::MeanMode::corrected},
        {"known-mean", allan::MeanMode::known_mean}};
    request.mode = modes.at(options.mean);
    if (request.mode == allan::MeanMode::known_mean && options.known_mean->count() == 0) {
        throw std::runtime_error(
            "--mean: known-mean found without --known-mean, expected the mean rate in deg/h");
    }
    if (request.mode != allan::MeanMode::known_mean && options.known_mean->count() > 0) {
        throw std::runtime_error("--known-mean: found without --mean known-mean, expected both");
    }
    if (!options.reference.empty()) {
        allan::Terms terms{};
        std::copy(options.reference.begin(), options.reference.end(), terms.begin());
        if (std::all_of(terms.begin(), terms.end(), [](double t) { return t <= 0; })) {
            throw std::runtime_error(
                "--reference: five zeros found, expected at least one of Q,N,B,K,R above zero");
        }
        request.reference = terms;
    }
    const std::map<std::string, allan::WindowShape> shapes{
        {"rectangular", allan::WindowShape::rectangular},
        {"hann", allan::WindowShape::hann},
        {"exponential", allan::WindowShape::exponential}};
    request.shape = shapes.at(options.shape);
    if (options.live) return allan_live(request, options.json, options.plot) ? kAlarms : 0;
    if (options.plot.ends_with(".html"))
        throw std::runtime_error("--plot: found " + options.plot +
                                 ", a page is of --live; expected a name that ends in .svg, or a "
                                 "folder");
    const AllanAnalysis analysis = analyse(request);
    if (!options.plot.empty()) allan_plot(analysis, options.plot);
    std::cout << (options.json ? allan_json(analysis) + "\n" : allan_table(analysis));
    const bool alarms =
        std::any_of(analysis.windows.begin(), analysis.windows.end(),
                    [](const AllanWindow& w) { return w.row.refused || !w.alarms.empty(); });
    return alarms ? kAlarms : 0;
}

void add_dynamic_options(CLI::App& command, Options& options) {
    AllanRequest& request = options.request;
    CLI::Option* const dynamic =
        add_number(command, "--dynamic", request.window_s,
                   "windows of W s: surface, traces, alarms", kShortestStep, kLongestStep)
            ->type_name("W");
    add_number(command, "--overlap", request.overlap, "of neighbouring windows (0.5)", 0, 0.9999);
    command
        .add_option("--shape", options.shape,
                    "weights within a window: rectangular (default), hann, exponential")
        ->check(CLI::IsMember({"rectangular", "hann", "exponential"}));
    command.add_flag("--live", options.live,
                     "with FILE - and --dynamic: prints each window as soon as it is complete");
    command
        .add_option("--mean", options.mean,
                    "classical variance about: corrected (default), known-mean, window-mean (the "
                    "paper's way, biased)")
        ->check(CLI::IsMember({"corrected", "known-mean", "window-mean"}));
    options.known_mean =
        add_number(command, "--known-mean", request.known_mean,
                   "mean rate in deg/h for --mean known-mean", -kLargestValue, kLargestValue);
    add_number(command, "--alpha", request.alpha, "level of the alarms of one window (0.001)",
               1e-12, 0.5);
    add_numbers(command, "--reference", options.reference, static_cast<int>(allan::kTerms),
                "accepted Q,N,B,K,R (arcsec, deg/rt-h, deg/h, deg/h^1.5, deg/h^2); without it "
                "the first five windows teach",
                0, kLargestValue);
    for (const char* of_windows : {"--overlap", "--shape", "--mean", "--alpha", "--reference"})
        command.get_option(of_windows)->needs(dynamic);
}

}  // namespace

void add_allan(CLI::App& app, int& exit_code) {
    const auto [command, options] = add_command<Options>(
        app, exit_code, "allan", "Noise of a record: Allan and related deviations", run);
    AllanRequest& request = options.request;
    command
        .add_option("FILE", request.file,
                    "numbers, one a line, or CSV; plain or gzip; - is standard input")
        ->required();
    add_number(command, "--tau0", request.tau0, "s between samples; or give --time", kShortestStep,
               kLongestStep)
        ->type_name("S");
    command.add_option("--column", request.column, "name or number (from 1) of the column");
    command.add_option("--time", request.time, "column with time stamps in s");
    command.add_option("--data", options.data, "rate (default) or phase")
        ->check(CLI::IsMember({"rate", "phase"}));
    command.add_option("--unit", request.unit,
                       "of the data: deg/h (default), deg/s, rad/s; phase: arcsec, deg, rad");
    command.add_option("--type", options.type,
                       "adev, oadev (default), mdev, hdev, ohdev, tdev, totdev");
    command.add_option("--taus", request.taus, "octave (default), decade, all, or s: 1,10,100");
    add_number(command, "--confidence", request.confidence, "of the intervals (0.683)", 0.01,
               0.9999);
    command.add_flag("--fit", request.fit, "Q, N, B, K, R with errors");
    command.add_flag("--drop-outliers", request.drop_outliers, "treat outliers as missing");
    add_dynamic_options(command, options);
    command.add_flag("--json", options.json, "print the result as JSON");
    command
        .add_option("--plot", options.plot,
                    "an SVG file (with --dynamic the surface), or a folder for every chart; with "
                    "--live an .html file of both charts, which loads itself again")
        ->check(proto::charts(true, true));
    // A window is printed and gone.
    for (const char* whole :
         {"--fit", "--confidence", "--taus", "--type", "--drop-outliers", "--column", "--time"}) {
        command.get_option("--live")->excludes(command.get_option(whole));
    }
    command.footer(
        "Example: vibrig allan gyro.csv.gz --column rate --tau0 0.01 --fit --plot gyro.svg\n"
        "         some-stream | vibrig allan - --tau0 0.025 --dynamic 600 --live --json\n"
        "dev has the data's unit (phase: per second; tdev: of the phase). Fit and windows: deg/h.\n"
        "Exit codes: 0 done, 1 a window was refused or raised an alarm, 2 bad usage or input.");
}

}  // namespace vibrig::tool
