#include "daemon/report/sections.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <string>

namespace vibrig::report {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;
using SectionJson = nlohmann::json;

/// A result of two frequencies in which each number is its place: 18 by gyro and term of a
/// frequency, 16 of a hypothesis.
SectionJson result() {
    SectionJson coefficients, sigma, x, p;
    for (int i = 0; i < 18; ++i) {
        coefficients.push_back(0.001 * i);
        sigma.push_back(0.0001);
    }
    for (int i = 0; i < 16; ++i) {
        x.push_back(0.01 * i);
        p.push_back(SectionJson::array());
        for (int k = 0; k < 16; ++k) p.back().push_back(i == k ? 1e-6 : 0);
    }
    const SectionJson hypothesis{{"w", 1}, {"hz", 60}, {"damping", 0.05}, {"x", x}, {"p", p}};
    const SectionJson one{{"hz", 60},
                          {"hz_interval", {59, 61}},
                          {"damping", 0.05},
                          {"damping_interval", {0.04, 0.06}}};
    SectionJson frequencies;
    for (const int hz : {15, 85})
        frequencies.push_back(
            {{"hz", hz}, {"dwells", 7}, {"coefficients", coefficients}, {"sigma", sigma}});
    SectionJson mixture = SectionJson::array();
    for (int j = 0; j < 3; ++j) mixture.push_back(SectionJson::array({hypothesis}));
    const SectionJson dwell{{"rate", {1, 2, 3}}, {"residual", {0.1, 0.2, 0.3}}};
    const SectionJson apart{{"run", 2},
                            {"position", 5},
                            {"hz", 55},
                            {"rate", {1.25, -0.5, 0}},
                            {"predicted", {1, 0, 0}},
                            {"u", {0.1, 0.1, 0.1}},
                            {"z", {2.5, -5, 0}}};
    return {{"dwell_rates", SectionJson::array({dwell})},
            {"spectrum",
             {{"held_out", SectionJson::array({apart})},
              {"model", "resonance"},
              {"frequencies", frequencies},
              {"flat", {{"chi_square", 100}, {"dof", 18}, {"p", 0.0}}},
              {"log_odds", {5, 5, 5}},
              {"resonance", {one, one, one}},
              {"mixture", mixture},
              {"highest_hz", 85},
              {"not_told", {"the first thing", "the second thing"}}}}};
}

std::string page_of(const SectionJson& root, const std::string& configuration = "") {
    record::Campaign campaign;
    campaign.head.configuration = configuration;
    campaign.result_json = root.dump();
    Page page;
    add_spectrum(page, campaign);
    return page.html("test");
}

TEST(SpectrumSection, EachCoefficientHasItsOwnNumbers) {
    const std::string html = page_of(result());
    // The filter's order: II SS OO IS IO OS.
    for (const auto& [name, value] : {std::pair{"D_IIx", "0.00000"},
                                      {"D_SSx", "0.00100"},
                                      {"D_OOx", "0.00200"},
                                      {"D_ISx", "0.00300"},
                                      {"D_IOx", "0.00400"},
                                      {"D_OSy", "0.01100"}}) {
        const auto row = html.find(std::string(">") + name + "<");
        ASSERT_NE(row, std::string::npos) << name;
        const auto cell = html.find(" ± ", row);
        EXPECT_EQ(html.substr(cell - 7, 7), value) << name;
    }
}

TEST(SpectrumSection, ChartsOfEachCoefficientAndWhatIsNotShown) {
    const std::string html = page_of(result());
    std::size_t charts = 0;
    for (auto at = html.find("<svg"); at != std::string::npos; at = html.find("<svg", at + 1))
        ++charts;
    EXPECT_EQ(charts, 19U) << "one more of predicted and measured";
    EXPECT_THAT(html, HasSubstr("D_OOz over frequency"));
    EXPECT_THAT(html, HasSubstr("the first thing; the second thing."));
    SectionJson groups = result();
    groups["spectrum"]["model"] = "groups";
    EXPECT_EQ(page_of(groups).find("over frequency</"), std::string::npos)
        << "between them nothing is known";
}

TEST(SpectrumSection, DwellsHeldOutStandBesideWhatWasPredicted) {
    const std::string html = page_of(result());
    EXPECT_THAT(html, HasSubstr("Drift predicted against measured"));
    for (const char* cell : {"2, 5", "55", "1.2500", "-0.5000", "1.0000", "2.5", "-5.0"})
        EXPECT_THAT(html, HasSubstr(std::string("<td>") + cell + "</td>"));
    SectionJson earlier = result();
    earlier["spectrum"].erase("held_out");
    EXPECT_THAT(page_of(earlier), HasSubstr("No dwell was held out"));
}

TEST(SpectrumSection, OneFrequencyAndSweepsAreReportedAsWhatTheyAre) {
    SectionJson one = result();
    one["spectrum"]["flat"] = nullptr;
    one["spectrum"]["frequencies"].erase(1);
    one["spectrum"]["log_odds"] = {nullptr, nullptr, nullptr};
    one["spectrum"]["sweeps"] = SectionJson::array({{{"run", 3},
                                                     {"position", 4},
                                                     {"from_hz", 20.5},
                                                     {"to_hz", 120},
                                                     {"seconds", 300},
                                                     {"used", 41}}});
    const std::string html = page_of(one);
    EXPECT_THAT(html, Not(HasSubstr("cannot be read")));
    EXPECT_THAT(html, HasSubstr("was not tested"));
    for (const char* cell : {"3, 4", "20.5 Hz", "120 Hz", "300", "41"})
        EXPECT_THAT(html, HasSubstr(std::string("<td>") + cell + "</td>"));
    EXPECT_THAT(html, HasSubstr("D_OOz over frequency")) << "the sweeps' range";
}

TEST(SpectrumSection, TwoResonancesOfAGyroHaveARowEach) {
    SectionJson two = result();
    SectionJson one = two["spectrum"]["resonance"][1], second = one;
    second["hz"] = 95.5;
    two["spectrum"]["resonance"][1] = SectionJson::array({one, second});
    const std::string html = page_of(two);
    EXPECT_THAT(html, HasSubstr("<td>95.500</td>"));
    std::size_t rows = 0;
    for (auto at = html.find("<td>60.000</td>"); at != std::string::npos;
         at = html.find("<td>60.000</td>", at + 1))
        ++rows;
    EXPECT_EQ(rows, 3U);
}

/// Two resonances fitted: 22 coefficients, and four more of ln hz and ln damping in p.
std::string of_two_fitted(double variance_of_resonances) {
    SectionJson root = result();
    SectionJson& one = root["spectrum"]["mixture"][0][0];
    one["hz"] = {60, 95};
    one["damping"] = {0.05, 0.05};
    one["x"] = std::vector<double>(22, 0.01);
    one["p"] = SectionJson::array();
    for (std::size_t i = 0; i < 26; ++i) {
        std::vector<double> row(26, 0.0);
        row[i] = i < 22 ? 1e-9 : variance_of_resonances;
        one["p"].push_back(row);
    }
    return page_of(root);
}

TEST(SpectrumSection, TheBandOfTwoResonancesHasTheirFrequenciesAndDampings) {
    const std::string known = of_two_fitted(0), open = of_two_fitted(1e-3);
    EXPECT_THAT(open, Not(HasSubstr("cannot be read")));
    EXPECT_NE(known, open) << "a resonance known to 3 % only widens the band";
}

TEST(SpectrumSection, AProfileIsNoFrequency) {
    SectionJson random = result();
    random["spectrum"]["frequencies"][1]["profile"] = "floor";
    random["spectrum"]["frequencies"][1]["hz"] = 48.125;
    const std::string html = page_of(
        random,
        "profile = [{ name = \"floor\", number = 1, psd = [[20.0, 0.01], [100.0, 0.01]] }]\n");
    EXPECT_THAT(html, HasSubstr("floor (7 dwells)"));
    EXPECT_THAT(html, HasSubstr("shook with 15 Hz, floor."));
    EXPECT_THAT(html, Not(HasSubstr("48.125")));
    EXPECT_THAT(html, HasSubstr("Profiles under which it shook"));
    EXPECT_THAT(page_of(random), Not(HasSubstr("Profiles under which"))) << "of none that is known";
}

}  // namespace
}  // namespace vibrig::report
