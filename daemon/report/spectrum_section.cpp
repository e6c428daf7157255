#include "daemon/report/spectrum_section.hpp"

#include <spdlog/fmt/fmt.h>

#include <array>
#include <nlohmann/json.hpp>

namespace vibrig::report {

namespace {

using SpectrumJson = nlohmann::json;

std::string shown(const SpectrumJson& value, const char* precision = "{:.5f}") {
    return value.is_number() ? fmt::format(fmt::runtime(precision), value.get<double>()) : "-";
}

void add_evidence(Page& page, const SpectrumJson& spectrum) {
    const SpectrumJson& flat = spectrum.at("flat");
    page.paragraph(
        fmt::format("One set of quadratic coefficients for all frequencies: chi-square {} on "
                    "{} degrees of freedom, p = {}.",
                    shown(flat.at("chi_square"), "{:.1f}"), flat.at("dof").get<int>(),
                    shown(flat.at("p"), "{:.2g}")));
    std::vector<std::vector<std::string>> rows{
        {"gyro", "log odds", "resonance, Hz", "95 %", "damping", "95 %"}};
    for (std::size_t j = 0; j < 3; ++j) {
        const SpectrumJson& of = spectrum.at("resonance").at(j);
        std::vector<std::string> row{std::string(1, "xyz"[j]),
                                     shown(spectrum.at("log_odds").at(j), "{:.1f}")};
        for (const char* key : {"hz", "damping"}) {
            const bool known = of.is_object() && spectrum.at("model") == "resonance";
            row.push_back(known ? shown(of.at(key), "{:.3f}") : "-");
            const SpectrumJson& band =
                known ? of.at(std::string(key) + "_interval") : SpectrumJson();
            row.push_back(known ? shown(band.at(0), "{:.3f}") + " to " + shown(band.at(1), "{:.3f}")
                                : "-");
        }
        rows.push_back(row);
    }
    page.table(rows);
}

/// Six coefficients of each gyro, as the dwells of each frequency have them.
void add_groups(Page& page, const SpectrumJson& frequencies) {
    constexpr std::array<const char*, 6> kTerms{"II", "OO", "SS", "IO", "IS", "OS"};
    std::vector<std::vector<std::string>> rows{{"coefficient"}};
    for (const SpectrumJson& at : frequencies)
        rows.front().push_back(fmt::format("{:g} Hz ({} dwells)", at.at("hz").get<double>(),
                                           at.at("dwells").get<int>()));
    for (std::size_t i = 0; i < 18; ++i) {
        std::vector<std::string> row{fmt::format("D_{}{}", kTerms[i % 6], "xyz"[i / 6])};
        for (const SpectrumJson& at : frequencies)
            row.push_back(shown(at.at("coefficients").at(i)) + " ± " + shown(at.at("sigma").at(i)));
        rows.push_back(row);
    }
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
        page.paragraph(fmt::format(
            "The dwells shook at {} frequencies. The coefficients above are those at the reference "
            "frequency; the result has {}. An elastic part of 20 % would have been seen up to {} "
            "Hz; beyond it nothing is known. A platform that moves in step with the vibration, "
            "elliptic motion and terms beyond the second order are not told apart from it.",
            spectrum.at("frequencies").size(),
            resonates ? "static quadratic coefficients and an elastic part" : "them as they are",
            shown(spectrum.at("highest_hz"), "{:g}")));
        add_evidence(page, spectrum);
        page.paragraph("Quadratic coefficients, deg/h/g^2, from the dwells of each frequency:");
        add_groups(page, spectrum.at("frequencies"));
    } catch (const SpectrumJson::exception& error) {
        page.paragraph(std::string("The recorded result cannot be read: ") + error.what());
    }
}

}  // namespace vibrig::report
