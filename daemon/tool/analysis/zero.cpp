#include <array>
#include <cmath>
#include <fstream>
#include <iomanip>
#include <iostream>
#include <memory>
#include <optional>
#include <stdexcept>
#include <vector>

#include "daemon/allan/column_file.hpp"
#include "daemon/plot/chart.hpp"
#include "daemon/results/progress.hpp"
#include "daemon/results/text_line.hpp"
#include "daemon/tool/analysis/zero_command.hpp"
#include "daemon/tool/commands.hpp"
#include "estimator/zeros/simulation.hpp"
#include "estimator/zeros/together.hpp"
#include "proto/durable_file.hpp"
#include "proto/json_text.hpp"
#include "proto/option_value.hpp"
#include "proto/text.hpp"

namespace vibrig::tool::zero_command {

namespace {

struct Options {
    zeros::CalibrationSettings calibration;
    double latitude_deg = 45.75;
    std::optional<double> heading_deg, gravity_mps2;
    double scale_ppm = 100;
    double misalignment_arcsec = 50;
    std::vector<double> slews{0, 90, -90, 90};
    std::string upright = "z";
    std::vector<double> lever_arm{0, 0, 0};
    bool json = false;
    std::string plot;
    std::string file;
    std::string down, y_up, y_down;  ///< the same this way up
    std::string azimuth = "azimuth_deg";
    // simulate
    std::vector<double> zero_mg{5, -5, 5};
    std::vector<double> real_scale_ppm{0, 0, 0};
    std::vector<double> real_misalignment_arcsec{0, 0};
    double period_s = 0.01;
    double vibration_g = 0;
    std::uint64_t seed = 1;
    bool both_ways = false, second_axis = false;
    std::string write;
};

zeros::CalibrationSettings settings_of(const Options& options) {
    zeros::CalibrationSettings s = options.calibration;
    s.site.latitude_rad = options.latitude_deg * estimator::kRadPerDeg;
    s.site.gravity_mps2 = options.gravity_mps2.value_or(s.site.gravity_mps2);
    s.noise.scale_factor = options.scale_ppm * 1e-6;
    s.noise.misalignment = options.misalignment_arcsec * kRadPerArcsec;
    s.plan.targets_deg = options.slews;
    s.heading_deg = options.heading_deg.value_or(0);
    s.upright = options.upright == "y" ? 1 : 2;
    for (std::size_t i = 0; i < 3; ++i) s.lever_arm_m[i] = options.lever_arm[i];
    return s;
}

void plot_runs(const std::string& path, const std::vector<zeros::Calibration>& runs) {
    plot::Pictures pictures;
    for (const zeros::Calibration& run : runs) {
        const zeros::CalibrationResult result = run.result();
        const std::string way =
            std::string(kAxisLetters[static_cast<std::size_t>(result.upright)]) +
            (result.inverted ? "-down" : "-up");
        pictures.emplace_back("zeros-" + way, chart_of(run.trace()).svg());
    }
    plot::write_pictures(path, pictures);
}

/// Of the first calibration, and of all of them together.
int report(const Options& options, const std::vector<zeros::Calibration>& runs) {
    const zeros::CalibrationSettings s = settings_of(options);
    zeros::CalibrationResult result = runs.front().result();
    std::vector<zeros::CalibrationResult> results{result};
    for (std::size_t k = 1; k < runs.size(); ++k) {
        results.push_back(runs[k].result());
        const zeros::CalibrationResult& other = results.back();
        result.valid = result.valid && other.valid;
        for (const std::string& problem : other.problems) {
            result.problems.push_back(
                std::string(kAxisLetters[static_cast<std::size_t>(other.upright)]) +
                (other.inverted ? " down: " : " up: ") + problem);
        }
    }
    std::optional<zeros::ZerosApart> apart;
    if (results.size() > 1) apart = zeros::together(results);
    const zeros::Observability seen = zeros::observability(s.plan.segments_deg(), s.site);
    if (!options.plot.empty()) plot_runs(options.plot, runs);
    // A simulated unit stands as it is told.
    const bool assumed = !options.file.empty() && !options.heading_deg;
    const bool gravity_assumed = !options.file.empty() && !options.gravity_mps2;
    if (options.json) {
        Json json = result_json(result, seen);
        json["heading_deg"] = s.heading_deg;
        json["heading_assumed"] = assumed;
        json["gravity_mps2"] = s.site.gravity_mps2;
        json["gravity_assumed"] = gravity_assumed;
        if (apart) {
            json["apart"] = apart_json(*apart, result.valid);
        }
        std::cout << proto::json_text(json) << '\n';
    } else {
        std::cout << result_table(result, seen);
        if (assumed)
            std::cout << "assumed: at azimuth 0 the unit's "
                      << kAxisLetters[static_cast<std::size_t>(result.upright + 1) % 3]
                      << " points true east (--heading)\n";
        // A unit that is sure of 0.1 mg cannot tell its zero from 1e-4 of gravity.
        if (gravity_assumed)
            std::cout << printed(
                "assumed: gravity is %g m/s^2 (--gravity); %s is off by 1 mg for each %.2g that it "
                "is off\n",
                s.site.gravity_mps2, kAxisLetters[static_cast<std::size_t>(result.upright)],
                1e-3 * s.site.gravity_mps2);
        if (apart) {
            std::cout << apart_table(*apart, result.valid);
        }
    }
    return result.valid ? 0 : kNo;
}

zeros::Calibration calibration_of(const Options& options, const std::string& file,
                                  const zeros::Way& way) {
    zeros::CalibrationSettings settings = settings_of(options);
    settings.upright = way.upright;
    settings.inverted = way.down;
    // Of a file the reference is zero: how still the unit may have stood, not a measured noise.
    settings.noise.reference_is_bound = true;
    zeros::Calibration calibration(settings);
    Progress progress("reading " + file);
    const auto show = [&](std::size_t done, std::size_t all) { progress.show(done, all); };
    std::array<ColumnFile, 6> columns;
    for (std::size_t i = 0; i < 6; ++i) {
        const std::string name = i < 3 ? std::string("turn_") + kAxisLetters[i] + "_arcsec"
                                       : std::string("dv_") + kAxisLetters[i - 3] + "_mps";
        columns[i] = read_columns(file, {name, "time_s"}, show);
    }
    ColumnFile azimuth;
    if (options.azimuth != "none") {
        azimuth = read_columns(file, {options.azimuth, "time_s"}, show);
    }
    check_increments(file, columns, azimuth);
    for (std::size_t k = 0; k < columns[0].values.size(); ++k) {
        zeros::Increment in;
        in.time_s = columns[0].times[k];
        for (std::size_t i = 0; i < 3; ++i) {
            in.turn_rad[i] = columns[i].values[k] * kRadPerArcsec;
            in.velocity_mps[i] = columns[i + 3].values[k];
        }
        in.azimuth_rad =
            azimuth.values.empty() ? std::nan("") : azimuth.values[k] * estimator::kRadPerDeg;
        if (!calibration.add(in)) break;
    }
    // Without an update there is no result, but zeros that look like one.
    const zeros::CalibrationResult result = calibration.result();
    if (result.updates == 0)
        throw std::runtime_error(
            file + ": " +
            (calibration.given_up()
                 ? result.problems.front()
                 : printed("found increments of %.6g s, expected %g s or more of them",
                           columns[0].times.back() - columns[0].times.front(), settings.update_s)));
    return calibration;
}

int run_file(const Options& options) {
    if (options.file.empty()) {
        throw std::invalid_argument("zero: FILE or `simulate` expected");
    }
    std::vector<zeros::Calibration> runs;
    runs.push_back(calibration_of(options, options.file,
                                  {settings_of(options).upright, options.calibration.inverted}));
    using Of = std::pair<const std::string&, zeros::Way>;
    for (const auto& [file, way] : {Of{options.down, {2, true}}, Of{options.y_up, {1, false}},
                                    Of{options.y_down, {1, true}}}) {
        if (!file.empty()) runs.push_back(calibration_of(options, file, way));
    }
    return report(options, runs);
}

void write_increments(const Options& options, const zeros::CalibrationSettings& s,
                      const zeros::UnitErrors& errors) {
    proto::OutputFile file(options.write);
    std::ofstream out(file.place());
    out << "time_s,turn_x_arcsec,turn_y_arcsec,turn_z_arcsec,dv_x_mps,dv_y_mps,dv_z_mps,azimuth_"
           "deg\n"
        << std::setprecision(15);
    zeros::UnitSimulation unit(s, errors, options.period_s, options.seed);
    const double steps = std::round(s.plan.duration_s / options.period_s);
    for (double k = 0; k <= steps; ++k) {
        const zeros::Increment in = unit.next();
        out << in.time_s;
        for (const double turn : in.turn_rad) out << ',' << turn / kRadPerArcsec;
        for (const double dv : in.velocity_mps) out << ',' << dv;
        out << ',' << in.azimuth_rad / estimator::kRadPerDeg << '\n';
    }
    out.close();
    if (!out) {
        throw std::runtime_error(options.write + ": cannot be written");
    }
    file.finish();
}

int run_simulate(const Options& options) {
    zeros::CalibrationSettings s = settings_of(options);
    if (s.plan.duration_s / options.period_s > 1e7) {
        throw std::invalid_argument(
            printed("--duration: %g s are %g increments, expected at most 1e7", s.plan.duration_s,
                    s.plan.duration_s / options.period_s));
    }
    zeros::UnitErrors errors;
    for (std::size_t i = 0; i < 3; ++i) {
        errors.zero_mg[i] = options.zero_mg[i];
        errors.scale[i] = options.real_scale_ppm[i] * 1e-6;
    }
    for (std::size_t i = 0; i < 2; ++i)
        errors.accelerometer_cross[i][2] = options.real_misalignment_arcsec[i] * kRadPerArcsec;
    errors.vibration_g = options.vibration_g;
    if (!options.write.empty()) {
        for (const auto& [asked, name] :
             {std::pair{options.json, "--json"}, std::pair{!options.plot.empty(), "--plot"},
              std::pair{options.both_ways, "--both-ways"},
              std::pair{options.second_axis, "--second-axis"}}) {
            if (asked)
                throw std::invalid_argument(std::string(name) +
                                            ": found it with --write, which has the increments of "
                                            "one run instead of a result; expected one of them");
        }
        (void)zeros::Calibration(s);  // refuses what cannot work
        write_increments(options, s, errors);
        return 0;
    }
    if (options.both_ways && s.inverted)
        throw std::invalid_argument(
            "--both-ways: found it with --inverted, whose second run would be down as the first; "
            "expected one of them");
    std::vector<zeros::Way> ways{{s.upright, s.inverted}};
    if (options.both_ways) ways.push_back({2, true});
    if (options.second_axis) ways.insert(ways.end(), {{1, false}, {1, true}});
    std::vector<zeros::Calibration> runs;
    std::optional<Working> working("simulating");
    for (const zeros::Way& way : ways) {
        s.upright = way.upright;
        s.inverted = way.down;
        runs.push_back(zeros::simulate(s, errors, options.period_s, options.seed + runs.size()));
    }
    working.reset();
    return report(options, runs);
}

/// What belongs to a file.
void refuse_file(const CLI::App& command, const Options& options) {
    if (!options.file.empty())
        throw std::invalid_argument("zero: found " + proto::printable(options.file) +
                                    " with `simulate`, expected one of them");
    for (const char* name : {"--azimuth", "--down", "--y-up", "--y-down"}) {
        if (command.count(name) > 0)
            throw std::invalid_argument(std::string(name) +
                                        ": found it with `simulate`, expected a file with it");
    }
}

void add_common(CLI::App& command, Options& o) {
    zeros::CalibrationSettings& s = o.calibration;
    add_number(command, "--latitude", o.latitude_deg, "deg (45.75)", -89, 89);
    add_number(command, "--gravity", o.gravity_mps2, "where the unit stands, m/s^2 (9.80665)", 1,
               30);
    add_number(command, "--heading", o.heading_deg,
               "of platform x (of z with --upright y, --y-up and --y-down) at azimuth 0, deg from "
               "true east, counter-clockwise about up: 90 is north (0)",
               -360, 360);
    add_numbers(command, "--slews", o.slews, 0,
                "azimuths in deg (0,90,-90,90); the last two repeat", -360, 360);
    add_number(command, "--rate", s.plan.rate_deg_s, "of the slews, deg/s (5)", kAboveZero, 100);
    add_number(command, "--duration", s.plan.duration_s, "s (180)", kAboveZero, 86400);
    command.add_flag("--static", s.allow_unobservable,
                     "go on with a plan that cannot tell zeros from tilt");
    command.add_option("--upright", o.upright, "platform axis turned about, y or z (z)")
        ->check(CLI::IsMember({"y", "z"}));
    command.add_flag("--inverted", s.inverted, "that axis down");
    add_numbers(command, "--lever-arm", o.lever_arm, 3,
                "from the azimuth axis, body axes, m (0,0,0)", -10, 10);
    add_number(command, "--gyro-noise", s.noise.angle_random_walk, "deg/sqrt(h) (0.01)", 0, 100);
    add_number(command, "--accelerometer-noise", s.noise.velocity_random_walk, "g/sqrt(Hz) (2e-5)",
               0, 1);
    add_number(command, "--velocity-noise", s.noise.velocity_reference,
               "of the reference, m/s (0.005)", kAboveZero, 1000);
    add_number(command, "--position-noise", s.noise.position_reference,
               "of the reference, m (0.01)", kAboveZero, 1e6);
    add_number(command, "--scale-uncertainty", o.scale_ppm,
               "of the vertical accelerometer, ppm (100)", 0, 1e6);
    add_number(command, "--misalignment-uncertainty", o.misalignment_arcsec,
               "of x and y against the gyros, arcsec (50)", 0, 1e5);
    add_number(command, "--vibration-limit", s.vibration_limit_g,
               "g, standard deviation within 1 s (0.01)", kAboveZero, 10);
    command.add_flag("--json", o.json, "print the result as JSON");
    command.add_option("--plot", o.plot, "an SVG file, or a folder: one for each way up")
        ->check(proto::charts());
}

}  // namespace

}  // namespace vibrig::tool::zero_command

namespace vibrig::tool {

void add_zero(CLI::App& app, int& exit_code) {
    using namespace zero_command;
    auto options = std::make_shared<zero_command::Options>();
    CLI::App* command =
        app.add_subcommand("zero", "Accelerometer zeros in place, from azimuth slews");
    command->require_subcommand(0, 1);
    command->add_option("FILE", options->file,
                        "increments, CSV or gzip: time_s, turn_x_arcsec ..., dv_x_mps ..., "
                        "azimuth_deg");
    command->add_option("--azimuth", options->azimuth,
                        "column of the azimuth read-out (azimuth_deg), or none; positive "
                        "counter-clockwise about up, whichever way up the unit is, and from a true "
                        "heading that --heading states");
    add_common(*command, *options);
    command
        ->add_option("--down", options->down,
                     "the same unit with platform z down, a second file: zeros apart from "
                     "misalignment and scale error")
        ->excludes("--inverted");
    for (const auto& [name, file] :
         {std::pair{"--y-up", &options->y_up}, std::pair{"--y-down", &options->y_down}}) {
        command
            ->add_option(name, *file,
                         std::string("the same unit with platform y ") + (name + 4) +
                             ", turned about it; azimuth of z")
            ->excludes("--inverted");
    }
    command->footer(
        "Example: vibrig zero increments.csv --slews 0,90,-90,90 --rate 5 --plot zeros.svg\n"
        "         vibrig zero up.csv --down down.csv\n"
        "         vibrig zero up.csv --y-up y_up.csv --y-down y_down.csv\n"
        "Exit codes: 0 valid, 1 not valid (says why), 2 bad usage or input.");
    CLI::App* simulate = command->add_subcommand("simulate", "A simulated unit instead of a file");
    add_common(*simulate, *options);
    add_numbers(*simulate, "--zero", options->zero_mg, 3, "mg (5,-5,5)", -1000, 1000);
    add_numbers(*simulate, "--scale", options->real_scale_ppm, 3, "errors, ppm (0,0,0)", -1e5, 1e5);
    add_numbers(*simulate, "--misalignment", options->real_misalignment_arcsec, 2,
                "of x and y towards z, arcsec (0,0)", -1e4, 1e4);
    add_number(*simulate, "--period", options->period_s, "of the increments, s (0.01)", 1e-4, 0.1);
    add_number(*simulate, "--vibration", options->vibration_g, "peak at 15 Hz, g (0)", 0, 10);
    simulate->add_option("--seed", options->seed, "of the noise (1)")->check(proto::whole());
    simulate->add_flag("--both-ways", options->both_ways,
                       "a second run with z down, for zeros apart from misalignment and scale");
    simulate->add_flag("--second-axis", options->second_axis,
                       "two more runs, about y up and y down: the same where z cannot be down");
    simulate->add_option("--write", options->write,
                         "write the increments to this CSV file instead");
    simulate->footer("Example: vibrig zero simulate --scale 0,0,100 --both-ways");
    simulate->callback([options, command, &exit_code] {
        exit_code = guarded([&] {
            refuse_file(*command, *options);
            return run_simulate(*options);
        });
    });
    command->callback([options, simulate, &exit_code] {
        if (!simulate->parsed()) exit_code = guarded([&] { return run_file(*options); });
    });
}

}  // namespace vibrig::tool
