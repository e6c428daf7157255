#include "daemon/report/sections.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <exception>
#include <limits>
#include <nlohmann/json.hpp>
#include <vector>

#include "daemon/plot/chart.hpp"
#include "daemon/report/paperwork.hpp"
#include "daemon/results/spectrum_json.hpp"
#include "estimator/spectrum/prediction.hpp"

namespace vibrig::report {

using estimator::spectrum::Hypothesis;
using tool::plot::Axis;
using tool::plot::Chart;
using tool::plot::Curve;
using tool::plot::Look;

namespace {

using SpectrumJson = nlohmann::json;

/// In the order of the result's numbers.
constexpr std::array<const char*, 6> kTerms{"II", "SS", "OO", "IS", "IO", "OS"};
constexpr double kNinetyFive = 1.96;

std::string shown(const SpectrumJson& value, const char* precision = "{:.5f}") {
    return value.is_number() ? fmt::format(fmt::runtime(precision), value.get<double>()) : "-";
}

/// "15 Hz", or the profile's name.
std::string name_of_group(const SpectrumJson& at) {
    const auto profile = at.find("profile");
    return profile != at.end() && profile->is_string()
               ? profile->get<std::string>()
               : fmt::format("{:g} Hz", at.at("hz").get<double>());
}

bool at_random(const SpectrumJson& at) {
    return at.contains("profile") && at.at("profile").is_string();
}

void add_flatness(Page& page, const SpectrumJson& flat) {
    if (flat.is_null())
        return page.paragraph(
            "Whether one set of quadratic coefficients holds for all frequencies was not tested: "
            "the dwells shook at one; of a resonance the sweeps alone tell.");
    page.paragraph(
        fmt::format("One set of quadratic coefficients for all frequencies: chi-square {} on "
                    "{} degrees of freedom, p = {}.",
                    shown(flat.at("chi_square"), "{:.1f}"), flat.at("dof").get<int>(),
                    shown(flat.at("p"), "{:.2g}")));
}

void add_sweeps(Page& page, const SpectrumJson& sweeps) {
    if (!sweeps.is_array() || sweeps.empty()) return;
    Rows rows{{"sweep: run, position", "from", "to", "s", "used"}};
    for (const SpectrumJson& one : sweeps)
        rows.push_back(
            {fmt::format("{}, {}", one.at("run").get<int>(), one.at("position").get<int>()),
             shown(one.at("from_hz"), "{:.4g} Hz"), shown(one.at("to_hz"), "{:.4g} Hz"),
             shown(one.at("seconds"), "{:g}"), shown(one.at("used"), "{:g}")});
    page.table(rows);
}

void add_evidence(Page& page, const SpectrumJson& spectrum) {
    add_flatness(page, spectrum.at("flat"));
    Rows rows{{"gyro", "log odds", "resonance, Hz", "95 %", "damping", "95 %"}};
    for (std::size_t j = 0; j < 3; ++j) {
        // One, several, or none that is known.
        SpectrumJson list = spectrum.at("resonance").at(j);
        if (list.is_object()) list = SpectrumJson::array({list});
        if (!list.is_array() || spectrum.at("model") != "resonance") list = SpectrumJson::array();
        const std::string gyro(1, "xyz"[j]), odds = shown(spectrum.at("log_odds").at(j), "{:.1f}");
        if (list.empty()) rows.push_back({gyro, odds, "-", "-", "-", "-"});
        for (const SpectrumJson& of : list) {
            std::vector<std::string> row{gyro, odds};
            for (const char* key : {"hz", "damping"}) {
                const SpectrumJson& band = of.at(std::string(key) + "_interval");
                row.push_back(shown(of.at(key), "{:.3f}"));
                row.push_back(shown(band.at(0), "{:.3f}") + " to " + shown(band.at(1), "{:.3f}"));
            }
            rows.push_back(std::move(row));
        }
    }
    page.table(rows);
}

/// Six coefficients of each gyro, as the dwells of each frequency have them.
void add_groups(Page& page, const SpectrumJson& frequencies) {
    Rows rows{{"coefficient"}};
    for (const SpectrumJson& at : frequencies)
        rows.front().push_back(
            fmt::format("{} ({} dwells)", name_of_group(at), at.at("dwells").get<int>()));
    for (std::size_t i = 0; i < 18; ++i) {
        std::vector<std::string> row{fmt::format("D_{}{}", kTerms[i % 6], "xyz"[i / 6])};
        for (const SpectrumJson& at : frequencies)
            row.push_back(shown(at.at("coefficients").at(i)) + " ± " + shown(at.at("sigma").at(i)));
        rows.push_back(row);
    }
    page.table(rows);
}

/// Over the frequencies, with its band of 95 %; the inputs that are declared are not in it.
Curve curve_of(const std::vector<Hypothesis>& mixture, std::size_t term, double low, double high) {
    constexpr int kPoints = 200;
    Curve curve{.name = kTerms[term]};
    for (int i = 0; i <= kPoints; ++i) {
        const double hz = low * std::pow(high / low, static_cast<double>(i) / kPoints);
        const auto [value, sigma] =
            estimator::spectrum::at_frequency(mixture, static_cast<Eigen::Index>(term), hz);
        const double wide = kNinetyFive * sigma;
        curve.add(hz, value, value - wide, value + wide);
    }
    return curve;
}

/// Each gyro's coefficients over frequency, and as the dwells of each frequency have them.
void add_charts(Page& page, const SpectrumJson& spectrum) {
    const SpectrumJson& frequencies = spectrum.at("frequencies");
    double low = 1e9, high = 0;
    const auto include = [&](const SpectrumJson& hz) {
        low = std::min(low, hz.get<double>());
        high = std::max(high, hz.get<double>());
    };
    for (const SpectrumJson& at : frequencies) include(at.at("hz"));
    for (const SpectrumJson& one : spectrum.value("sweeps", SpectrumJson::array())) {
        include(one.at("from_hz"));
        include(one.at("to_hz"));
    }
    if (!(high > low)) return;
    for (std::size_t j = 0; j < 3; ++j) {
        std::vector<Hypothesis> mixture;
        for (const SpectrumJson& one : spectrum.at("mixture").at(j))
            mixture.push_back(tool::read_hypothesis(one));
        for (std::size_t term = 0; term < kTerms.size(); ++term) {
            Chart chart{.title = fmt::format("D_{}{} over frequency", kTerms[term], "xyz"[j]),
                        .x = Axis("Hz", true),
                        .y = Axis("deg/h/g^2")};
            chart.curves.push_back(curve_of(mixture, term, low / 1.5, 1.5 * high));
            chart.curves.back().name = "model, 95 %";
            Curve dwells{.name = "dwells of one frequency, 95 %", .look = Look::dots};
            for (const SpectrumJson& at : frequencies) {
                if (at_random(at)) continue;  // a mean over its band is no point of the curve
                const double value = at.at("coefficients").at(6 * j + term).get<double>();
                const double wide = kNinetyFive * at.at("sigma").at(6 * j + term).get<double>();
                dwells.add(at.at("hz").get<double>(), value, value - wide, value + wide);
            }
            chart.curves.push_back(std::move(dwells));
            page.figure(chart.svg(), chart.title);
        }
    }
}

/// Where the power of the profiles lies, beside the frequencies of the sines.
void add_profiles(Page& page, const SpectrumJson& frequencies, const record::Campaign& campaign) {
    if (std::ranges::none_of(frequencies, at_random)) return;
    Chart chart{
        .title = "Profiles under which it shook", .x = Axis("Hz", true), .y = Axis("g^2/Hz", true)};
    double least = std::numeric_limits<double>::infinity();
    for (const auto& one : configuration_of(campaign).profiles) {
        if (std::ranges::none_of(frequencies, [&](const SpectrumJson& at) {
                return at_random(at) && at.at("profile") == one.profile.name;
            }))
            continue;
        Curve curve{.name = one.profile.name};
        for (const auto& [hz, density] :
             one.controller_psd.empty() ? one.profile.psd : one.controller_psd) {
            curve.add(hz, density);
            least = std::min(least, density);
        }
        chart.curves.push_back(std::move(curve));
    }
    if (chart.curves.empty()) return;
    Curve sines{.name = "sines, at the foot", .look = Look::dots};
    for (const SpectrumJson& at : frequencies) {
        if (at_random(at)) continue;
        sines.add(at.at("hz").get<double>(), least);
    }
    if (!sines.x.empty()) chart.curves.push_back(std::move(sines));
    page.figure(chart.svg(), chart.title);
}

/// Measured over what the coefficients foretell, all gyros; what the fit has not seen apart.
void add_predicted(Page& page, const SpectrumJson& root) {
    Curve fitted{.name = "dwells of the fit", .look = Look::dots};
    Curve held{.name = "held out", .look = Look::dots};
    Curve equal{.name = "as predicted"};
    const auto add = [&](Curve& to, double predicted, double measured) {
        to.add(predicted, measured);
        equal.x.push_back(predicted);
    };
    for (const SpectrumJson& row : root.at("dwell_rates")) {
        for (std::size_t j = 0; j < 3; ++j) {
            const double rate = row.at("rate").at(j).get<double>();
            add(fitted, rate - row.at("residual").at(j).get<double>(), rate);
        }
    }
    // Results of earlier versions do not have it.
    const SpectrumJson none = SpectrumJson::array();
    const auto found = root.at("spectrum").find("held_out");
    const SpectrumJson& apart = found != root.at("spectrum").end() ? *found : none;
    Rows rows{{"run, position", "Hz or profile", "measured x", "y", "z", "predicted x", "y", "z",
               "z x", "y", "z"}};
    for (const SpectrumJson& row : apart) {
        std::vector<std::string> cells{
            fmt::format("{}, {}", row.at("run").get<int>(), row.at("position").get<int>()),
            row.value("profile", SpectrumJson()).is_string() ? row.at("profile").get<std::string>()
                                                             : shown(row.at("hz"), "{:g}")};
        for (const char* key : {"rate", "predicted"}) {
            for (const SpectrumJson& value : row.at(key)) cells.push_back(shown(value, "{:.4f}"));
        }
        for (const SpectrumJson& value : row.at("z")) cells.push_back(shown(value, "{:.1f}"));
        rows.push_back(std::move(cells));
        for (std::size_t j = 0; j < 3; ++j)
            add(held, row.at("predicted").at(j).get<double>(), row.at("rate").at(j).get<double>());
    }
    if (equal.x.empty()) return;
    const auto [low, high] = std::ranges::minmax(equal.x);
    equal.x = equal.y = {low, high};
    Chart chart{.title = "Drift predicted against measured",
                .x = Axis("predicted, deg/h"),
                .y = Axis("measured, deg/h")};
    chart.curves = {equal, fitted};
    if (!held.x.empty()) chart.curves.push_back(held);
    page.figure(chart.svg(), "All three gyros, each dwell of each frequency.");
    if (rows.size() < 2)
        return page.paragraph("No dwell was held out (role \"verify\" of a plan).");
    page.paragraph(
        "Dwells held out from the fit, deg/h about the input axes; z: measured less predicted in "
        "standard uncertainties of both.");
    page.table(rows);
}

}  // namespace

void add_spectrum(Page& page, const record::Campaign& campaign) {
    const SpectrumJson root = SpectrumJson::parse(campaign.result_json, nullptr, false);
    if (!root.is_object() || !root.contains("spectrum") || root.at("spectrum").is_null()) return;
    page.section("spectrum", "Over frequency");
    try {
        const SpectrumJson& spectrum = root.at("spectrum");
        const bool resonates = spectrum.at("model") == "resonance";
        const SpectrumJson& frequencies = spectrum.at("frequencies");
        std::string with;
        for (const SpectrumJson& at : frequencies)
            with += (with.empty() ? "" : ", ") + name_of_group(at);
        const std::string reach =
            spectrum.at("flat").is_null()
                ? "nothing is known"
                : fmt::format(
                      "an elastic part of 20 % would have been seen up to {} Hz; beyond it "
                      "nothing is known",
                      shown(spectrum.at("highest_hz"), "{:g}"));
        page.paragraph(fmt::format(
            "The dwells shook with {}. The coefficients of section Coefficients are those at the "
            "reference frequency; the result has {}. Of other frequencies {}.",
            with,
            resonates ? "static quadratic coefficients and an elastic part" : "them as they are",
            reach));
        add_sweeps(page, spectrum.value("sweeps", SpectrumJson::array()));
        add_evidence(page, spectrum);
        page.paragraph("Quadratic coefficients, deg/h/g^2, from the dwells of each frequency:");
        add_groups(page, frequencies);
        if (spectrum.at("model") != "groups") add_charts(page, spectrum);
        add_profiles(page, frequencies, campaign);
        add_predicted(page, root);
        std::string limits = "What such a campaign cannot show:";
        for (const SpectrumJson& one : spectrum.value("not_told", SpectrumJson::array()))
            limits += (limits.ends_with(':') ? " " : "; ") + one.get<std::string>();
        if (!limits.ends_with(':')) page.paragraph(limits + ".");
    } catch (const std::exception& error) {
        page.paragraph(std::string("The recorded result cannot be read: ") + error.what());
    }
}

}  // namespace vibrig::report
