#include "daemon/report/certificate.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <nlohmann/json.hpp>

#include "estimator/identification/identification.hpp"

namespace vibrig::report {
namespace {

using Json = nlohmann::ordered_json;
using ::testing::HasSubstr;

class Certificate : public ::testing::Test {
  protected:
    Certificate() {
        campaign_.path = "campaign.h5";
        campaign_.state = "finished";
        campaign_.head.clock = "real";
        campaign_.head.configuration =
            "unit.type = \"GP-3\"\nunit.serial = \"<17>\"\ninstrument = [{ name = \"shaker\", "
            "certificate = \"C-77\", uncertainty = \"0.5 %, k = 2\", due = 2020-01-31 }]\n";
        campaign_.head.utc_ns = 1'767'225'600'000'000'000;
        record::ConditionRow row;
        row.temperature_c = 44.25;
        row.sensor_c.fill(std::numeric_limits<double>::quiet_NaN());
        campaign_.conditions = {row};
        replayed_.compared = 28;
        for (std::size_t i = 0; i < estimator::kParameters; ++i)
            result_["parameters"].push_back({{"name", estimator::parameter_names()[i]},
                                             {"value", 1.0},
                                             {"u", 0.01},
                                             {"k", 2.1},
                                             {"expanded", 0.021},
                                             {"unit", estimator::parameter_unit(i)}});
        result_["verdict"] = {{"word", "valid"}, {"reasons", Json::array()}};
        issue_.number = "C-1";
        issue_.laboratory = "Lab & Co";
        issue_.by = "A. Person";
    }
    [[nodiscard]] Json made() const {
        return certificate_of(campaign_, result_, replayed_, issue_);
    }
    [[nodiscard]] std::string refusal() const {
        try {
            static_cast<void>(made());
        } catch (const Refused& why) {
            return why.what();
        }
        return "not refused";
    }

    record::Campaign campaign_;
    record::ReplayResult replayed_;
    Json result_;
    Issue issue_;
};

TEST_F(Certificate, SaysOnThePageWhatItSaysInJson) {
    issue_.limits = {{"D_Fx", {}, 1.5}};
    issue_.location = "Hall 4";
    campaign_.head.configuration += "uncertainty.coverage = 0.9\n";
    replayed_.dwells.resize(1);
    replayed_.dwells[0].reason = "bumped";
    replayed_.dwells[0].summary.run = 2;
    replayed_.dwells[0].summary.position = 3;
    replayed_.dwells[0].summary.flagged = true;
    result_["parameters"][0]["budget"] = {{{"input", "encoder_zero"}, {"contribution", 3e-4}},
                                          {{"input", "encoder_zero"}, {"contribution", 4e-4}}};
    EXPECT_THAT(certificate_page(made()), ::testing::Not(HasSubstr("correlations")));
    result_["parameters"][0]["correlation_variance"] = -4e-8;
    const Json certificate = made();
    const std::string page = certificate_page(certificate);
    for (const char* words :
         {"Lab &amp; Co", "C-1", "GP-3, serial number &lt;17&gt;", "passes", "44.25", "C-77",
          "overdue at the time", "0.5 %, k = 2", "as found", "Hall 4", "End of certificate C-1",
          "about 90 %", "run 2 position 3 flagged: bumped",
          "content:\"Certificate\\20 C\\2d 1\\2c \\20 Lab\\20 \\26 \\20 Co\"",
          "apply to the item as tested", "last bit", "D = D_F + D_I aI"})
        EXPECT_THAT(page, HasSubstr(words));
    EXPECT_THAT(page, HasSubstr("<td>1.000</td><td>0.021</td><td>2.10</td>"));
    EXPECT_THAT(page, HasSubstr("<th>encoder zero</th>"));
    EXPECT_THAT(page, HasSubstr("<td>D_Fx</td><td>5.0e-04</td><td>-2.0e-04</td>"));
    EXPECT_EQ(certificate["results"].size(), 30U);
    EXPECT_FALSE(certificate["simulated"]);
    EXPECT_THAT(page, ::testing::Not(HasSubstr("class=\"mark\"")));
}

TEST_F(Certificate, OverFrequencySaysOfWhichVibrationACoefficientIs) {
    EXPECT_TRUE(made()["frequencies"].is_null());
    EXPECT_THAT(certificate_page(made()), ::testing::Not(HasSubstr("<th>vibration</th>")));
    for (std::size_t i = 0; i < estimator::kParameters; ++i)
        result_["parameters"][i]["at_hz"] = i == 14 ? 15.1 : 0.0;
    result_["spectrum"] = {{"model", "resonance"},
                           {"refusal", nullptr},
                           {"flat", {{"alarm", true}}},
                           {"highest_hz", 125}};
    const std::string page = certificate_page(made());
    for (const char* words :
         {"<th>vibration</th>", "<td>deg/h</td><td>any</td>", "<td>deg/h/g^2</td><td>static</td>",
          "<td>deg/h/g^2</td><td>15.1 Hz</td>", "do not give the drift under a vibration"})
        EXPECT_THAT(page, HasSubstr(words));
    // A compromise between frequencies at which they differ is at none of them.
    result_["parameters"][14]["at_hz"] = nullptr;
    EXPECT_THAT(certificate_page(made()), HasSubstr("<td>deg/h/g^2</td><td>no single frequency"));
    // Flat, and nothing against it: of all frequencies.
    result_["spectrum"] = {{"model", "flat"}, {"refusal", nullptr}, {"flat", {{"alarm", false}}}};
    EXPECT_THAT(certificate_page(made()), HasSubstr("that depend on them were not found"));
    // An alarm against it, or what does not fit: not so.
    for (const char* what : {"flat", "refusal"}) {
        Json spectrum = {{"model", "flat"}, {"refusal", nullptr}, {"flat", nullptr}};
        if (std::string(what) == "flat")
            spectrum["flat"] = {{"alarm", true}};
        else
            spectrum["refusal"] = "two resonances";
        result_["spectrum"] = spectrum;
        EXPECT_THAT(certificate_page(made()), HasSubstr("coefficients depend on them")) << what;
    }
}

TEST_F(Certificate, TheMethodNamesTheVibrationOnWhichTheCoefficientsRest) {
    const auto method = [this] { return made()["method"].get<std::string>(); };
    const char* const sine = "at rest and under sinusoidal vibration along the vertical,";
    EXPECT_THAT(method(), HasSubstr(sine));
    const Json hz{{"hz", 15.0}, {"profile", nullptr}}, floor{{"hz", 48.0}, {"profile", "floor"}};
    const auto of = [&](const std::vector<Json>& frequencies, int blocks_of_a_sweep) {
        result_["spectrum"] = {{"model", "flat"}, {"frequencies", frequencies}};
        result_["spectrum"]["sweeps"] = Json::array();
        result_["spectrum"]["sweeps"].push_back({{"used", blocks_of_a_sweep}});
        return method();
    };
    EXPECT_THAT(of({hz}, 0), HasSubstr(sine)) << "a sweep of which nothing was used";
    EXPECT_THAT(of({hz, floor}, 0),
                HasSubstr("at rest and under sinusoidal and random vibration along the vertical,"));
    EXPECT_THAT(of({floor, floor}, 0), HasSubstr("at rest and under random vibration"));
    EXPECT_THAT(of({hz, hz}, 41),
                HasSubstr("at rest and under sinusoidal and swept-sine vibration"));
    EXPECT_THAT(of({hz, floor}, 41),
                HasSubstr("at rest and under sinusoidal, random and swept-sine vibration"));
    // Two levels, and never at rest.
    result_.erase("spectrum");
    for (const double level : {6.36, 4.95}) result_["dwell_rates"].push_back({{"level", level}});
    EXPECT_THAT(method(), HasSubstr("drift under sinusoidal vibration along the vertical,"));
    result_["dwell_rates"].push_back({{"level", 0.0}});
    EXPECT_THAT(method(), HasSubstr(sine));
}

TEST_F(Certificate, OfADoubtfulResultOrASimulatedRigSaysSoAcrossThePage) {
    result_["verdict"] = {{"word", "doubtful"},
                          {"reasons", {{{"code", "walk"}, {"text", "biases walk"}}}}};
    const std::string doubtful = certificate_page(made());
    EXPECT_THAT(doubtful, HasSubstr("<span>DOUBTFUL</span>"));
    EXPECT_THAT(doubtful, HasSubstr("biases walk"));
    campaign_.head.simulated = true;
    const std::string both = certificate_page(made());
    EXPECT_THAT(both, HasSubstr("<span>SIMULATED</span><span>DOUBTFUL</span>"));
    EXPECT_THAT(both, HasSubstr("The result is DOUBTFUL"));
    EXPECT_TRUE(made()["simulated"]);
}

TEST_F(Certificate, SaysWhatWasEstimatedBesideTheCoefficientsAndWhatIsDeclaredOfMotion) {
    EXPECT_THAT(certificate_page(made()), HasSubstr("Deviations from the method: none."));
    result_["freed"] = {{{"class", "azimuth"},
                         {"element", nullptr},
                         {"value", -3.25},
                         {"sigma", 0.5},
                         {"unit", "arcmin"}}};
    campaign_.head.configuration += "uncertainty.sync_motion = \"base\"\n";
    result_["sync_motion_arcsec"] = 5.1;
    const Json certificate = made();
    ASSERT_EQ(certificate["deviations"].size(), 2U);
    const std::string page = certificate_page(certificate);
    EXPECT_THAT(page, HasSubstr("estimated beside the coefficients (estimator.free): azimuth, "
                                "-3.25 +- 0.5 arcmin"));
    EXPECT_THAT(page, HasSubstr("up to 5.1 arcsec, is rocking of the base"));
    EXPECT_THAT(page, ::testing::Not(HasSubstr("Deviations from the method: none.")));
}

TEST_F(Certificate, ALimitStandsOnPaperAsTheStatementTookIt) {
    issue_.limits = {{"D_Fx", 0.978999999, 1.0}, {"D_Ix", 0.979000001, {}}};
    issue_.guard_band = 1;
    const Json certificate = made();
    EXPECT_EQ(certificate["statements"][1]["statement"], "inconclusive");
    const std::string page = certificate_page(certificate);
    EXPECT_THAT(page, HasSubstr("<td>0.978999999</td><td>1</td>"));
    EXPECT_THAT(page, HasSubstr("<td>0.979000001</td><td>-</td>"));
}

TEST_F(Certificate, IsRefusedForWhatIsNotValid) {
    const auto with = [&](const auto& spoil) {
        const auto campaign = campaign_;
        const auto replayed = replayed_;
        const auto result = result_;
        spoil();
        const auto words = refusal();
        campaign_ = campaign;
        replayed_ = replayed;
        result_ = result;
        return words;
    };
    const auto nan = std::numeric_limits<double>::quiet_NaN();
    EXPECT_THAT(with([&] { result_["verdict"]["word"] = "not valid"; }), HasSubstr("not valid"));
    EXPECT_THAT(with([&] { result_["verdict"]["word"] = "splendid"; }), HasSubstr("splendid"));
    EXPECT_THAT(with([&] { result_["verdict"] = nullptr; }), HasSubstr("without a verdict"));
    EXPECT_THAT(with([&] { result_.erase("verdict"); }), HasSubstr("without a verdict"));
    EXPECT_THAT(with([&] { campaign_.state = "aborted"; }), HasSubstr("is aborted"));
    EXPECT_THAT(with([&] { campaign_.head.configuration = "unit.type = \"GP-3\"\n"; }),
                HasSubstr("no serial number"));
    EXPECT_THAT(with([&] { replayed_.different = 1; }), HasSubstr("every bit"));
    EXPECT_THAT(with([&] { replayed_.estimates_different = 1; }), HasSubstr("every bit"));
    EXPECT_THAT(with([&] { replayed_.compared = 0; }), HasSubstr("every bit"));
    EXPECT_THAT(with([&] { result_["parameters"][7]["value"] = nullptr; }),
                HasSubstr("D_IOx: found no value"));
    EXPECT_THAT(with([&] { result_["parameters"][0]["expanded"] = nan; }),
                HasSubstr("D_Fx: found no expanded"));
    EXPECT_THAT(with([&] { result_["parameters"][0]["expanded"] = 0; }), HasSubstr("U = 0"));
    EXPECT_THAT(with([&] { result_["parameters"].erase(3); }), HasSubstr("found 29"));
    EXPECT_EQ(refusal(), "not refused");
}

TEST(StatementOfConformity, DrawsTheLimitInByTheGuardBand) {
    const Limit both{"D_Fx", -1, 1};
    EXPECT_EQ(statement_of(both, 0.89, 0.1, 1), "passes");
    EXPECT_EQ(statement_of(both, 0.91, 0.1, 1), "inconclusive");
    EXPECT_EQ(statement_of(both, -1.09, 0.1, 1), "inconclusive");
    EXPECT_EQ(statement_of(both, -1.11, 0.1, 1), "fails");
    EXPECT_EQ(statement_of(both, 0, 1.5, 1), "inconclusive") << "U wider than the limits";
    EXPECT_EQ(statement_of({"D_Fx", {}, 1}, -1e9, 0.1, 1), "passes");
    EXPECT_EQ(statement_of({"D_Fx", 1, {}}, -1e9, 0.1, 1), "fails");
    EXPECT_EQ(statement_of(both, 0.99, 0.1, 0), "passes") << "no guard band";
}

}  // namespace
}  // namespace vibrig::report
