#include <algorithm>
#include <array>
#include <cmath>
#include <iostream>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>

#include "daemon/configuration/configuration.hpp"
#include "daemon/results/assessment_json.hpp"
#include "daemon/results/spectrum_json.hpp"
#include "daemon/results/text_line.hpp"
#include "daemon/tool/analysis/held_out.hpp"
#include "daemon/tool/analysis/profile_options.hpp"
#include "daemon/tool/commands.hpp"
#include "daemon/tool/simulated.hpp"
#include "estimator/filter/angles.hpp"
#include "estimator/filter/kinematics.hpp"
#include "estimator/filter/mapped.hpp"
#include "estimator/spectrum/prediction.hpp"
#include "estimator/spectrum/profile.hpp"
#include "proto/json_file.hpp"
#include "proto/json_text.hpp"

namespace vibrig::tool {

namespace {

using namespace estimator::spectrum;
using Eigen::Index;
using PredictionJson = nlohmann::ordered_json;

/// Of the strongest level that was measured: from where on a note says so, and where it is too
/// much.
constexpr double kNotedBeyond = 1.5, kMostBeyond = 3;

struct PredictOptions {
    std::string result, profile, config, recording;
    std::optional<std::string> at;
    std::vector<std::string> attitudes;
    double seconds = 0;
    std::optional<double> elastic_beyond, tolerance;
    bool same_accelerometers = false, json = false, list = false, force = false;
};

bool vertical(const Eigen::Matrix3d& moment) {
    return moment.trace() - moment(1, 1) < 1e-6 * moment.trace();
}

const char* word_of(const Verification& of) {
    if (!of.confirmed) return "contradicted";
    return of.tight ? "confirmed" : "confirmed, but the test is weak";
}

PredictionJson three(const Eigen::MatrixXd& of, Index row) {
    PredictionJson list = PredictionJson::array();
    for (Index j = 0; j < 3; ++j) list.push_back(number_or_null(of(row, j)));
    return list;
}

PredictionJson attitudes_json(const Prediction& of, const std::vector<std::array<double, 3>>& deg) {
    PredictionJson list = PredictionJson::array();
    for (std::size_t k = 0; k < deg.size(); ++k) {
        const auto row = static_cast<Index>(k);
        PredictionJson u = PredictionJson::array();
        for (Index j = 0; j < 3; ++j) u.push_back(number_or_null(of.u(row, j)));
        list.push_back({{"angles", deg[k]},
                        {"drift", three(of.drift, row)},
                        {"u", std::move(u)},
                        {"budget",
                         {{"coefficients", three(of.coefficients, row)},
                          {"resonance", three(of.resonance, row)},
                          {"gain", three(of.gain, row)},
                          {"realisation", three(of.realisation, row)},
                          {"outside", three(of.outside, row)}}}});
    }
    return list;
}

/// "gyro y at (30, 10, -20)": the worst of a verification.
std::string worst_text(const Verification& of, const Held& held) {
    const auto& deg = held.deg[static_cast<std::size_t>(of.dwell)];
    return line(
        "largest z %.1f, gyro %c at (%.1f, %.1f, %.1f): \"%s\" would have to be %.1f "
        "times as large",
        of.largest_z, "xyz"[of.gyro], deg[0], deg[1], deg[2], of.part.c_str(), of.larger);
}

struct Predicted {
    Profile profile;
    Prediction prediction;
    std::vector<std::array<double, 3>> deg;
    std::optional<Verification> verification;
    Held held;
    std::string refusal, note;
    bool simulated = false;     ///< the rig of the result, or of what is to prove it, was a program
    double g_rms = 0;           ///< at the platform
    double measured_g_rms = 0;  ///< of the strongest dwell; 0: the result does not say
    /// That the drift goes with the square is proven for what was measured, and little beyond.
    [[nodiscard]] double level() const { return measured_g_rms > 0 ? g_rms / measured_g_rms : 0; }
    [[nodiscard]] bool covered() const { return prediction.covered() && level() <= kMostBeyond; }
};

void add_note(Predicted& of, const std::string& note) {
    of.note += (of.note.empty() ? "" : "; ") + note;
}

void compare_levels(Predicted& of) {
    if (of.level() <= kNotedBeyond) return;
    add_note(of, printed("%.3g g rms at the platform are %.2g times the strongest vibration that "
                         "was measured, %.3g g rms: that the drift goes with its square up to "
                         "there is not proven",
                         of.g_rms, of.level(), of.measured_g_rms));
}

std::string predicted_json(const Predicted& of) {
    PredictionJson verification = nullptr;
    if (of.verification) {
        const Verification& v = *of.verification;
        PredictionJson dwells = PredictionJson::array();
        for (Index k = 0; k < v.z.rows(); ++k)
            dwells.push_back(
                {{"angles", of.held.deg[static_cast<std::size_t>(k)]},
                 {"g_rms", number_or_null(std::sqrt(
                               of.held.situations[static_cast<std::size_t>(k)].moment.trace()))},
                 {"rate", three(of.held.rates, k)},
                 {"z", three(v.z, k)}});
        verification = {
            {"chi_square", v.chi_square}, {"dof", v.degrees},           {"p", v.p},
            {"word", word_of(v)},         {"largest_z", v.largest_z},   {"part", v.part},
            {"larger", v.larger},         {"dwells", std::move(dwells)}};
    }
    const PredictionJson root{
        {"simulated", of.simulated},
        {"prediction",
         {{"profile", of.profile.name},
          {"g_rms", std::sqrt(mean_square(of.profile))},
          {"platform_g_rms", of.g_rms},
          {"measured_g_rms",
           of.measured_g_rms > 0 ? PredictionJson(of.measured_g_rms) : PredictionJson(nullptr)},
          {"power_outside", of.prediction.power_outside},
          {"verdict", of.covered() ? "covered" : "not covered"},
          {"note", of.note.empty() ? PredictionJson(nullptr) : PredictionJson(of.note)},
          {"refusal", of.refusal.empty() ? PredictionJson(nullptr) : PredictionJson(of.refusal)},
          {"attitudes", attitudes_json(of.prediction, of.deg)},
          {"verification", std::move(verification)}}}};
    return proto::json_text(root) + "\n";
}

std::string predicted_text(const Predicted& of) {
    std::string text =
        simulated_line(of.simulated) +
        line("%s: %.4g g rms", of.profile.name.c_str(), std::sqrt(mean_square(of.profile)));
    if (!of.refusal.empty()) text += "FORCED: " + of.refusal + "\n";
    if (!of.note.empty()) text += "Note: " + of.note + "\n";
    text += line("%-24s %-4s %12s %10s   %s", "attitude, deg", "gyro", "drift deg/h", "u",
                 "of it coefficients, resonance, gain, realisation, outside");
    for (std::size_t k = 0; k < of.deg.size(); ++k) {
        const auto row = static_cast<Index>(k);
        const Prediction& p = of.prediction;
        for (Index j = 0; j < 3; ++j)
            text += line("(%6.1f, %6.1f, %6.1f) %-4c %12.6f %10.6f   %.6f %.6f %.6f %.6f %.6f",
                         of.deg[k][0], of.deg[k][1], of.deg[k][2], "xyz"[j], p.drift(row, j),
                         p.u(row, j), p.coefficients(row, j), p.resonance(row, j), p.gain(row, j),
                         p.realisation(row, j), p.outside(row, j));
    }
    text += line("%.1f %% of the profile's power lies outside what was measured%s: %s",
                 100 * of.prediction.power_outside,
                 of.level() > kMostBeyond
                     ? printed(", and its level is %.2g times as high", of.level()).c_str()
                     : "",
                 of.covered() ? "covered" : "NOT COVERED");
    if (of.verification) {
        const Verification& v = *of.verification;
        text += line("held-out dwells: chi-square %.1f of %d, p = %.2g: %s", v.chi_square,
                     v.degrees, v.p, word_of(v));
        if (!v.confirmed) text += worst_text(v, of.held);
    }
    return text;
}

Predicted predict_for(const PredictOptions& options) {
    if (options.result.empty())
        throw std::runtime_error("found no RESULT.json, expected that of vibrig identify --json");
    if (options.profile.empty())
        throw std::runtime_error("found no --profile, expected a JSON file or a name of --list");
    if (options.attitudes.empty() && options.recording.empty())
        throw std::runtime_error("found no --attitude, expected one or more, or --verify");
    const nlohmann::json result = proto::read_json(options.result);
    const Model model = read_model(result, options.result);
    if (!model.refusal.empty() && !options.force)
        throw std::runtime_error(options.result + ": spectrum.refusal: found \"" + model.refusal +
                                 "\", expected a campaign that a model fits (or --force)");
    Predicted out;
    out.simulated = result.value("simulated", nlohmann::json()) == true;
    out.refusal = model.refusal;
    const ResultVerdict verdict = read_verdict(result, options.result);
    if (verdict.not_valid && !options.force)
        throw std::runtime_error(options.result + ": verdict: found \"" + verdict.sentence +
                                 "\", expected a result that is valid (or --force)");
    if (verdict.not_valid)
        out.refusal += (out.refusal.empty() ? "" : "; ") + ("the result is " + verdict.sentence);
    if (verdict.doubtful) add_note(out, "the result is " + verdict.sentence);
    const auto rig = configuration::load(options.config, false).configuration;
    const plan::StatedProfile stated = find_profile(options.profile, rig);
    out.profile = stated.profile;
    const AtPlatform vibration = at_platform(out.profile, where_it_holds(stated, options.at), rig);
    if (vibration.behind_pads && !vertical(vibration.moment))
        add_note(out,
                 "the isolators' transmission is measured along the vertical, and is taken for "
                 "every direction");
    out.g_rms = std::sqrt(vibration.moment.trace());
    out.measured_g_rms = strongest_g_rms(result);
    compare_levels(out);
    const PredictionOptions how{options.elastic_beyond.value_or(rig.spectrum.elastic_beyond),
                                options.same_accelerometers};
    std::vector<Situation> situations;
    for (const std::string& text : options.attitudes) {
        const auto deg = read_attitude(text);
        out.deg.push_back(deg);
        situations.push_back({Eigen::Vector3d(deg[0], deg[1], deg[2]) * estimator::kRadPerDeg,
                              vibration.moment, vibration.bands, options.seconds, false,
                              vibration.moments});
    }
    if (!options.recording.empty()) {
        out.held = held_out(options.recording, options.config, out.profile, vibration, result);
        out.simulated = out.simulated || out.held.simulated;
        if (!out.held.doubt.empty()) add_note(out, out.held.doubt);
        const Prediction of_held = predict(model, out.held.situations, how);
        out.verification =
            verify(of_held, out.held.rates, out.held.variances, out.held.relative_errors,
                   options.tolerance.value_or(rig.spectrum.tolerance_deg_h));
        if (situations.empty()) {
            situations = out.held.situations;
            out.deg = out.held.deg;
        }
    }
    out.prediction = predict(model, situations, how);
    return out;
}

int run_predict(const PredictOptions& options) {
    if (options.list) {
        std::cout << (options.json ? proto::json_text(profiles_json()) + "\n" : profiles_text());
        return 0;
    }
    const Predicted of = predict_for(options);
    std::cout << (options.json ? predicted_json(of) : predicted_text(of)) << std::flush;
    const bool good =
        of.covered() && of.refusal.empty() && (!of.verification || of.verification->confirmed);
    return good ? 0 : kNo;
}

}  // namespace

void add_predict(CLI::App& app, int& exit_code) {
    const auto [command, options] = add_command<PredictOptions>(
        app, exit_code, "predict",
        "Drift under a vibration profile, with its uncertainty, and held-out dwells", run_predict);
    command.add_option("RESULT", options.result, "JSON of vibrig identify --json");
    command.add_option("--profile", options.profile,
                       "JSON file {psd: [[hz, g2_hz], ..] or {north, up, east}, cross: {north_up, "
                       "..}, sines: [[hz, g_peak], ..], direction, g_rms, at}, a name of --list, "
                       "or of a [[profile]] of the configuration");
    command
        .add_option("--attitude", options.attitudes,
                    "ALPHA,BETA,GAMMA of the gimbals (no encoder readings), deg; again for more")
        ->allow_extra_args(false);
    command
        .add_option("--at", options.at,
                    "where the profile holds, if it does not say: platform (default), or table "
                    "(pads)")
        ->check(CLI::IsMember({"platform", "table"}));
    add_number(command, "--seconds", options.seconds,
               "mean over so long: what a random vibration's realisation varies is added",
               kAboveZero, 1e7);
    command.add_option("--verify", options.recording,
                       "recording of dwells under the profile that were not in the fit");
    add_number(command, "--tolerance", options.tolerance,
               "deg/h that two standard deviations stay below in a tight test "
               "(spectrum.tolerance_deg_h)",
               kAboveZero, 1e3);
    add_number(command, "--elastic-beyond", options.elastic_beyond,
               "elastic part allowed for beyond what was measured, of the static "
               "(spectrum.elastic_beyond)",
               0, 100);
    command.add_flag("--same-accelerometers", options.same_accelerometers,
                     "the profile was measured with the campaign's: their gain cancels");
    command.add_option("--config", options.config, "configuration file (TOML) of the rig");
    command.add_flag("--force", options.force, "print what is refused, marked");
    command.add_flag("--json", options.json, "print the prediction as JSON");
    command.add_flag("--list", options.list, "built-in profiles: examples of their types");
    command.footer(
        "Example: vibrig predict result.json --profile truck --attitude 45,0,90 --seconds 600\n"
        "Exit codes: 0 covered, and confirmed where it was verified; 1 not covered by what was "
        "measured,\nforced, or contradicted; 2 bad usage or input.");
}

}  // namespace vibrig::tool
