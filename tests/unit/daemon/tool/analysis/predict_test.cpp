#include "tests/unit/daemon/tool/analysis/predict_fixture.hpp"

namespace vibrig::tool {
namespace {

using ::testing::HasSubstr;

TEST_F(Predict, SurveyNamesTheResonanceAndTellsStaticCoefficients) {
    const PredictJson found = result();
    const PredictJson& spectrum = found["spectrum"];
    EXPECT_EQ(spectrum["model"], "resonance");
    ASSERT_EQ(spectrum["frequencies"].size(), 7U);
    EXPECT_EQ(spectrum["frequencies"][0]["dwells"], 14);
    EXPECT_EQ(spectrum["frequencies"][0]["coefficients"].size(), 18U);
    EXPECT_EQ(spectrum["highest_hz"], 125);
    EXPECT_TRUE(spectrum["flat"]["alarm"]);
    EXPECT_EQ(spectrum["flat"]["dof"], 108);
    for (std::size_t gyro = 0; gyro < 3; ++gyro) {
        EXPECT_GT(spectrum["log_odds"][gyro], 4);
        EXPECT_NEAR(spectrum["resonance"][gyro]["hz"].get<double>(), 60, 1);
        EXPECT_LE(spectrum["mixture"][gyro].size(), 300U);
    }
    // 0.03 at rest, 6.6 % of the elastic half more at 15 Hz: five sigmas.
    const PredictJson& square = found["parameters"][4];
    EXPECT_EQ(square["at_hz"], 0);
    EXPECT_NEAR(square["value"].get<double>(), 0.03, 3 * square["u"].get<double>());
    EXPECT_EQ(found["dwell_rates"].size(), 63U);
    EXPECT_EQ(found["dwell_rates"][0]["lines"][0][0], 15);
}

TEST_F(Predict, WhatIsTakenAsFlatAgainstTheDataIsDoubtedAndNotPredictedWith) {
    const Ended flat = run("identify survey.csv --spectrum flat --json");
    EXPECT_EQ(flat.exit_code, 0);
    EXPECT_EQ(flat.json()["verdict"]["word"], "doubtful");
    EXPECT_EQ(flat.json()["verdict"]["sentence"],
              "doubtful, because quadratic coefficients depend on the frequency (p = 0.000000 that "
              "they do not)");
    write("flat.json", flat.out);
    const Ended ended = run("predict flat.json --profile sine.json --attitude 0,0,0");
    EXPECT_EQ(ended.exit_code, 2);
    EXPECT_THAT(ended.error, HasSubstr("are taken as flat"));
    EXPECT_EQ(run("predict flat.json --profile sine.json --attitude 0,0,0 --force").exit_code, 1);
}

TEST_F(Predict, TheBudgetSaysWhatWasDeclaredAndHow) {
    write("gain.toml", "[uncertainty]\naccelerometer_gain = { u = 0.004, dof = 12 }\n");
    const PredictJson coefficient =
        run("identify survey.csv --config gain.toml --json").json()["parameters"][4];
    const auto part = [&](const std::string& input) {
        for (const PredictJson& one : coefficient["budget"])
            if (one["input"] == input) return one;
        return PredictJson();
    };
    const PredictJson stated = part("accelerometer_gain"), silent = part("time_base");
    ASSERT_FALSE(stated.is_null() || silent.is_null()) << coefficient["budget"];
    EXPECT_EQ(stated["declared"], true);
    EXPECT_EQ(stated["shape"], "normal");
    EXPECT_EQ(stated["dof"], 12);
    EXPECT_EQ(stated["u"], 0.004);
    EXPECT_NEAR(stated["contribution"], std::abs(stated["c"].get<double>()) * 0.004, 1e-12);
    // What nobody has stated stands at its default.
    EXPECT_EQ(silent["declared"], false);
    EXPECT_EQ(silent["shape"], "rectangular");
    EXPECT_EQ(silent["u"], 1e-5);
    EXPECT_THAT(part("gain_between_frequencies")["element"].get<std::string>(),
                ::testing::MatchesRegex("[0-9]+ Hz"));
}

TEST_F(Predict, WhatNoDwellShowsIsInTheBudgetOverFrequencyToo) {
    write("place.toml",
          "[uncertainty]\nlocal_g = { u = 0.01, dof = 4 }\nsync_motion = \"platform\"\n"
          "turn_on_bias = 0.2\nturn_on_linear = 0.03\n");
    const PredictJson found = run("identify survey.csv --config place.toml --json").json();
    const PredictJson plain = run("identify survey.csv --json").json();
    for (const std::size_t i : {0U, 1U, 4U}) {
        const PredictJson& c = found["parameters"][i];
        EXPECT_EQ(c["value"], plain["parameters"][i]["value"]);
        double square = 0, of_g = 0;
        bool sync = false;
        for (const PredictJson& one : c["budget"]) {
            const double part = one["contribution"];
            square += part * part;
            if (one["input"] == "local_g") of_g = part;
            sync = sync || one["input"] == "sync_motion";
        }
        const double value = c["value"], u = c["u"];
        // The bias knows no gravity, a linear term goes with it, a quadratic one with its square.
        const double power = i == 0 ? 0 : i == 1 ? 1 : 2;
        EXPECT_NEAR(of_g, 0.01 * power * std::abs(value), 1e-12) << c["name"];
        EXPECT_EQ(sync, i == 4) << c["name"];
        EXPECT_NEAR(square / (u * u), 1, 1e-6) << c["name"];
        EXPECT_NEAR(found["covariance_combined"][i][i].get<double>() / (u * u), 1, 1e-9);
        EXPECT_NEAR(c["expanded"].get<double>(), c["k"].get<double>() * u, 1e-12);
        // For another power-on: of this u, not of that at one frequency.
        const double again = i == 0 ? 0.2 : i == 1 ? 0.03 : 0;
        EXPECT_GE(c["u_use"].get<double>(), std::hypot(u, again) * (1 - 1e-9)) << c["name"];
        EXPECT_LT(c["u_use"].get<double>(), 1.01 * std::hypot(u, again)) << c["name"];
    }
    // Gravity is most of what is not known of D_Ix, and it is known from five measurements:
    // Student's factor of 4 degrees of freedom is 2.78.
    const PredictJson& linear = found["parameters"][1];
    EXPECT_GT(linear["k"].get<double>(), 2);
    EXPECT_LT(linear["nu_eff"].get<double>(), plain["parameters"][1]["nu_eff"].is_null()
                                                  ? 1e9
                                                  : plain["parameters"][1]["nu_eff"].get<double>());
}

TEST_F(Predict, NothingIsDrawnOfSeveralFrequencies) {
    for (const char* command : {"identify", "uncertainty"}) {
        const Ended ended = run(std::string(command) + " survey.csv --monte-carlo");
        EXPECT_EQ(ended.exit_code, 2);
        EXPECT_THAT(ended.error, HasSubstr("--monte-carlo: found dwells at several frequencies"));
        EXPECT_EQ(ended.out, "");
    }
}

TEST_F(Predict, InGroupsACoefficientIsThatAtTheLowestFrequency) {
    const Ended ended = run("identify survey.csv --spectrum groups --json");
    ASSERT_EQ(ended.exit_code, 0) << ended.error;
    const PredictJson found = ended.json();
    const PredictJson& square = found["parameters"][4];
    EXPECT_EQ(square["at_hz"], 15);
    EXPECT_EQ(square["value"], found["spectrum"]["frequencies"][0]["coefficients"][0]);
    // 0.03, and 6.59 % of the elastic half; over all frequencies it would be 0.02.
    EXPECT_NEAR(square["value"].get<double>(), 0.030989, 4 * square["u"].get<double>());
    EXPECT_LT(square["u"], 0.002);
}

TEST_F(Predict, HeldOutDwellsConfirm) {
    const Ended ended =
        run("predict result.json --profile sine.json --verify held_out.csv --config held.toml "
            "--attitude 30,10,-20 --json");
    ASSERT_EQ(ended.exit_code, 0) << ended.error << ended.out;
    const PredictJson prediction = ended.json()["prediction"];
    EXPECT_EQ(prediction["verification"]["word"], "confirmed");
    EXPECT_EQ(prediction["verification"]["dof"], 9);
    EXPECT_EQ(prediction["attitudes"].size(), 1U);
    EXPECT_EQ(prediction["attitudes"][0]["drift"].size(), 3U);
    EXPECT_EQ(prediction["power_outside"], 0);
    EXPECT_EQ(ended.error, "");
}

TEST_F(Predict, HeldOutDwellsContradictAResultWithoutItsElasticPart) {
    write_without_elastic_part("broken.json");
    const Ended ended =
        run("predict broken.json --profile sine.json --verify held_out.csv --config held.toml");
    EXPECT_EQ(ended.exit_code, 1) << ended.error;
    EXPECT_THAT(ended.out, HasSubstr("contradicted"));
    EXPECT_THAT(ended.out, HasSubstr("times as large"));
}

TEST_F(Predict, CampaignAtOneFrequencyDoesNotCoverAProfile) {
    ASSERT_EQ(plant("--truth truth.json --dwell 40 --table-g 6,0 -o today.csv").exit_code, 0);
    const Ended today = run("identify today.csv --json");
    EXPECT_EQ(today.json()["parameters"][4]["at_hz"], 15);
    EXPECT_EQ(today.json()["spectrum"]["model"], "flat");
    write("today.json", today.out);
    for (const char* profile : {"truck", "minimum-integrity", "sine.json"}) {
        const Ended ended =
            run(std::string("predict today.json --attitude 45,0,90 --profile ") + profile);
        EXPECT_EQ(ended.exit_code, 1) << ended.error;
        EXPECT_THAT(ended.out, HasSubstr("NOT COVERED"));
    }
}

TEST_F(Predict, TimeAndPadsMatter) {
    const auto of = [&](const std::string& more) {
        return run("predict result.json --profile truck --attitude 45,0,90 --json " + more)
            .json()["prediction"]["attitudes"][0];
    };
    const PredictJson for_ever = of(""), short_one = of("--seconds 100"), pads = of("--at table");
    EXPECT_EQ(for_ever["budget"]["realisation"][0], 0);
    EXPECT_GT(short_one["budget"]["realisation"][0], 0);
    EXPECT_GT(short_one["u"][0], for_ever["u"][0]);
    EXPECT_NE(pads["drift"][0], for_ever["drift"][0]);
}

/// Section 1's truth from samples: four profiles at four attitudes that no fit has seen, with a
/// controller whose gain is as uncertain as it is declared to be.
TEST_F(Predict, SoakHeldOutDwellsOfFourProfilesFromSamples) {
    constexpr unsigned kCampaigns = 20;
    std::ifstream in(folder() / "truth.json");
    PredictJson truth = PredictJson::parse(in);
    truth["shaker"]["limit_mm"] = 1000;
    truth["shaker"]["limit_g"] = 100;
    const std::vector<PredictJson> densities = {{{20, 0.05}, {200, 0.05}},
                                                {{10, 0.1241}, {40, 0.1241}, {500, 0.001241}},
                                                {{20, 0.04}, {1000, 0.04}, {2000, 0.01}}};
    // Without the allowance for what lies above the survey: all of this truth lies within.
    std::string config = "[spectrum]\nmount = \"hard\"\nelastic_beyond = 0.0\n";
    for (std::size_t k = 0; k < densities.size(); ++k) {
        const std::string number = std::to_string(k + 1);
        truth["shaker"]["profiles"].push_back({{"number", k + 1}, {"psd", densities[k]}});
        config += "[[profile]]\nname = \"profile " + number + "\"\nnumber = " + number +
                  "\nat = \"table\"\npsd = " + densities[k].dump() + "\n";
    }
    write("four.toml", config +
                           "[shaker.limits]\ndisplacement_mm = 1000\nacceleration_g = 100\n"
                           "velocity_mps = 10\n");
    write("75.json", R"({"name": "75 Hz", "sines": [[75, 3]]})");
    write("four.csv", "alpha_deg,beta_deg,gamma_deg\n30,10,-20\n-50,0,70\n100,15,30\n60,-20,140\n");
    std::mt19937_64 random(77);
    std::normal_distribution<double> normal;
    unsigned confirmed = 0, asked = 0;
    std::map<std::string, double> squares;
    for (unsigned seed = 1; seed <= kCampaigns; ++seed) {
        // 1 % of the mean square; the survey, whose sines are measured, has its own.
        truth["shaker"]["amplitude_scaled"] = 1 + 0.005 * normal(random);
        write("four.json", truth.dump());
        ASSERT_EQ(plant("--truth truth.json --seed " + std::to_string(seed) + kSurvey +
                        " --dwell 100 --order " + survey_order() + " -o four_survey.csv")
                      .exit_code,
                  0);
        write("four_result.json", run("identify four_survey.csv --json").out);
        write_without_elastic_part("four_broken.json", "four_result.json");
        ASSERT_EQ(plant("--truth four.json --seed " + std::to_string(1000 + seed) +
                        " --dwell 100 --table-g 3,3,3,7.69 --frequency 75,15,15,15 --profile "
                        "0,1,2,3 --positions four.csv -o four_held.csv")
                      .exit_code,
                  0);
        unsigned contradicted = 0;
        for (const std::string profile : {"75.json", "'profile 1'", "'profile 2'", "'profile 3'"}) {
            const auto verified = [&](const std::string& result) {
                return run("predict " + result + " --profile " + profile +
                           " --verify four_held.csv --config four.toml --json")
                    .json()["prediction"]["verification"];
            };
            const PredictJson right = verified("four_result.json");
            ++asked;
            confirmed += right["word"] == "contradicted" ? 0U : 1U;
            for (const auto& dwell : right["dwells"]) {
                for (const double z : dwell["z"]) squares[profile] += z * z / (12 * kCampaigns);
            }
            contradicted += verified("four_broken.json")["word"] == "contradicted" ? 1U : 0U;
        }
        EXPECT_GT(contradicted, 0U) << "seed " << seed;
    }
    // A right one is contradicted with a probability of 0.01 for the profile and 0.001 for each
    // dwell: of 80 more than four are so once in a thousand.
    EXPECT_GE(confirmed, asked - 4);
    // Rates of a dwell are correlated within a campaign and profile by the gain and the common
    // coefficients: of 240 values some 80 are of their own, 8 % for one standard deviation.
    for (const auto& [profile, square] : squares) EXPECT_NEAR(std::sqrt(square), 1, 0.2) << profile;
    double all = 0;
    for (const auto& [profile, square] : squares) all += square / 4;
    EXPECT_NEAR(std::sqrt(all), 1, 0.15);
}

TEST_F(Predict, ATestThatWouldSeeNothingIsCalledWeak) {
    const auto word = [&](const std::string& tolerance) {
        return run("predict result.json --profile sine.json --verify held_out.csv --config "
                   "held.toml "
                   "--json --tolerance " +
                   tolerance)
            .json()["prediction"]["verification"]["word"];
    };
    EXPECT_EQ(word("1"), "confirmed");
    EXPECT_EQ(word("0.001"), "confirmed, but the test is weak");
}

TEST_F(Predict, WhatContradictsIsNamedByGyroAttitudeAndPart) {
    write_without_elastic_part("broken.json");
    const std::string command =
        "predict broken.json --profile sine.json --verify held_out.csv --config held.toml";
    const PredictJson verified = run(command + " --json").json()["prediction"]["verification"];
    double largest = 0;
    std::string where;
    for (const PredictJson& dwell : verified["dwells"]) {
        for (std::size_t j = 0; j < 3; ++j) {
            const double z = dwell["z"][j];
            if (std::abs(z) <= std::abs(largest)) continue;
            largest = z;
            std::array<char, 80> text{};
            std::snprintf(text.data(), text.size(), "gyro %c at (%.1f, %.1f, %.1f)", "xyz"[j],
                          dwell["angles"][0].get<double>(), dwell["angles"][1].get<double>(),
                          dwell["angles"][2].get<double>());
            where = text.data();
        }
    }
    EXPECT_EQ(verified["largest_z"], largest);
    EXPECT_THAT(run(command).out, HasSubstr(where + ": \"" + std::string(verified["part"]) + "\""));
}

TEST_F(Predict, TheSameAccelerometersTakeTheirCommonGainOut) {
    const auto gain = [&](const std::string& more) {
        return run("predict result.json --profile sine.json --attitude 45,0,90 --json" + more)
            .json()["prediction"]["attitudes"][0]["budget"]["gain"][0]
            .get<double>();
    };
    const double with = gain(""), without = gain(" --same-accelerometers");
    PredictJson alone = result();
    PredictJson& effects = alone["spectrum"]["effects"];
    for (std::size_t i = effects.size(); i-- > 0;)
        if (effects[i]["input"] != "accelerometer_gain") effects.erase(i);
    ASSERT_EQ(effects.size(), 1U);
    write("gain.json", alone.dump());
    const double common = run("predict gain.json --profile sine.json --attitude 45,0,90 --json")
                              .json()["prediction"]["attitudes"][0]["budget"]["gain"][0];
    EXPECT_NEAR(without * without + common * common, with * with, 1e-12);
    EXPECT_GT(common, 0);
}

/// Half width `elastic_beyond` of a rectangle over the static coefficients, of the power above.
TEST_F(Predict, PowerBeyondWhatWasMeasuredWidensAndAFifthOfItIsTooMuch) {
    const auto at = [&](const std::string& profile, const std::string& more = "") {
        write("flat_psd.json", R"({"name": "flat", "psd": )" + profile + "}");
        return run("predict result.json --profile flat_psd.json --attitude 45,0,90 --json" + more)
            .json()["prediction"];
    };
    const double reach = result()["spectrum"]["highest_hz"];
    const auto flat_to = [](double hz) {
        return "[[20, 0.01], [" + std::to_string(hz) + ", 0.01]]";
    };
    for (const double share : {0.19, 0.21}) {
        const auto seen = at(flat_to((reach - share * 20) / (1 - share)));
        EXPECT_NEAR(seen["power_outside"].get<double>(), share, 2e-3) << "one band of 800 a decade";
        EXPECT_EQ(seen["verdict"], share < 0.2 ? "covered" : "not covered");
    }
    const std::string wide = flat_to(2 * reach);
    const double once = at(wide)["attitudes"][0]["budget"]["outside"][0],
                 twice = at(wide, " --elastic-beyond 2")["attitudes"][0]["budget"]["outside"][0];
    EXPECT_GT(once, 0);
    EXPECT_NEAR(twice, 2 * once, 1e-12);
    EXPECT_EQ(at(wide, " --elastic-beyond 0")["attitudes"][0]["budget"]["outside"][0], 0);
    // Below the lowest frequency over 1.5, too.
    const auto low = at("[[1, 0.01], [9, 0.01]]");
    EXPECT_NEAR(low["power_outside"].get<double>(), 1, 1e-12);
    EXPECT_EQ(low["verdict"], "not covered");
    EXPECT_EQ(at("[[10.1, 0.01], [100, 0.01]]")["power_outside"], 0);
}

TEST_F(Predict, WhatIsForcedIsMarkedAndGroupsForetellNothing) {
    const Ended groups = run("identify survey.csv --spectrum groups --json");
    write("groups.json", groups.out);
    const std::string command = "predict groups.json --profile truck --attitude 0,0,0";
    const Ended refused = run(command);
    EXPECT_EQ(refused.exit_code, 2);
    EXPECT_THAT(refused.error, HasSubstr("groups know nothing between their frequencies"));
    const Ended forced = run(command + " --force");
    EXPECT_EQ(forced.exit_code, 1);
    EXPECT_THAT(forced.out, HasSubstr("FORCED: coefficients in groups"));
}

/// A profile at the table comes through the pads by their |T|^2.
TEST_F(Predict, PadsTakeTheirPartOfASine) {
    write("pads.toml", "[vibration]\ntransmission = 0.667\n[spectrum]\nmount = \"isolated\"\n");
    const auto drift = [&](const std::string& more) {
        return run("predict result.json --profile sine.json --attitude 45,0,90 --json --config "
                   "pads.toml" +
                   more)
            .json()["prediction"]["attitudes"][0];
    };
    write("still.json", R"({"name": "still", "sines": [[55, 0.0001]]})");
    const double still = run("predict result.json --profile still.json --attitude 45,0,90 --json")
                             .json()["prediction"]["attitudes"][0]["drift"][0];
    const double full = drift("")["drift"][0], through = drift(" --at table")["drift"][0];
    // 0.667 at 15 Hz with a damping of 0.2 is a natural frequency of 9.18 Hz.
    const double r = 55 / 9.18, damped = 2 * 0.2 * r * 2 * 0.2 * r;
    const double power = (1 + damped) / ((1 - r * r) * (1 - r * r) + damped);
    EXPECT_NEAR((through - still) / (full - still) / power, 1, 4 * 0.005 / 9.18 + 1e-3);
}

TEST_F(Predict, WhatSuchACampaignDoesNotTellIsInTheResult) {
    std::string all;
    const PredictJson of = result();
    for (const PredictJson& one : of["spectrum"]["not_told"]) all += std::string(one) + "\n";
    for (const char* about : {"in step", "elliptic", "angular", "above the highest", "second",
                              "shock", "fixture", "one frequency are not flat"})
        EXPECT_THAT(all, HasSubstr(about));
    EXPECT_THAT(run("identify survey.csv").out, HasSubstr("Not shown either:"));
}

TEST_F(Predict, AlongThreeAxesAtOnceEachHasItsPart) {
    const auto drift = [&](const std::string& psd, const std::string& more = "") {
        write("axes.json", R"({"psd": {)" + psd + "}}");
        const Ended ended =
            run("predict result.json --profile axes.json --attitude 45,0,90 --json " + more);
        EXPECT_LE(ended.exit_code, 1) << ended.error;
        return ended.json()["prediction"];
    };
    const std::string north = R"("north": [[20, 0.01], [120, 0.01]])",
                      up = R"("up": [[10, 0.05], [90, 0.01]])",
                      east = R"("east": [[30, 0.02], [125, 0.02]])";
    const PredictJson n = drift(north), u = drift(up), e = drift(east),
                      all = drift(north + ", " + up + ", " + east);
    const double rest = drift(R"("up": [[20, 1e-12], [21, 1e-12]])")["attitudes"][0]["drift"][1];
    const auto of = [&](const PredictJson& one) {
        return one["attitudes"][0]["drift"][1].get<double>() - rest;
    };
    // What is not coherent adds its drifts and its powers.
    EXPECT_NEAR(of(all), of(n) + of(u) + of(e), 1e-7);
    EXPECT_NEAR(std::pow(all["g_rms"].get<double>(), 2),
                std::pow(n["g_rms"].get<double>(), 2) + std::pow(u["g_rms"].get<double>(), 2) +
                    std::pow(e["g_rms"].get<double>(), 2),
                1e-9);
    EXPECT_EQ(all["note"], nullptr);
    write("pads.toml", "[vibration]\ntransmission = 0.667\n");
    EXPECT_THAT(std::string(drift(north, "--at table --config pads.toml")["note"]),
                HasSubstr("along the vertical, and is taken for every direction"));
    EXPECT_EQ(drift(up, "--at table --config pads.toml")["note"], nullptr);
}

TEST_F(Predict, ALevelFarBeyondWhatWasMeasuredIsNotCovered) {
    // GIVEN a survey at 6 g, 4.24 g rms, WHEN sines of 1, 2 and 5 times that are foretold
    struct Case {
        double peak;
        int exit_code;
        bool noted;
    };
    for (const Case& c : {Case{6, 0, false}, Case{12, 0, true}, Case{30, 1, true}}) {
        write("strong.json", R"({"sines": [[25, )" + std::to_string(c.peak) + "]]}");
        const std::string command = "predict result.json --profile strong.json --attitude 0,0,0";
        const Ended ended = run(command + " --json");
        EXPECT_EQ(ended.exit_code, c.exit_code) << c.peak;
        const PredictJson prediction = ended.json()["prediction"];
        EXPECT_NEAR(prediction["measured_g_rms"], 6 / std::sqrt(2), 0.1);
        EXPECT_NEAR(prediction["platform_g_rms"], c.peak / std::sqrt(2), 1e-9);
        EXPECT_EQ(prediction["verdict"], c.exit_code == 0 ? "covered" : "not covered");
        // THEN a note says so of twice, and five times is not covered
        EXPECT_EQ(prediction["note"].is_string(), c.noted) << prediction["note"];
        const std::string text = run(command).out;
        EXPECT_EQ(text.find("and its level is 5 times as high: NOT COVERED") != std::string::npos,
                  c.exit_code == 1)
            << text;
    }
}

TEST_F(Predict, ListsItsProfiles) {
    const Ended ended = run("predict --list");
    EXPECT_EQ(ended.exit_code, 0);
    EXPECT_THAT(ended.out, HasSubstr("minimum-integrity: 7.69 g rms"));
    EXPECT_THAT(ended.out, HasSubstr("truck: 1.04 g rms"));
    EXPECT_EQ(run("predict --list --json").json()["profiles"].size(), 2U);
}

TEST_F(Predict, BadInputIsNamedByPlaceAndValue) {
    const auto refused = [&](const std::string& arguments, const std::string& message) {
        const Ended ended = run("predict " + arguments);
        EXPECT_EQ(ended.exit_code, 2) << arguments;
        EXPECT_THAT(ended.error, HasSubstr(message));
        EXPECT_EQ(ended.out, "");
    };
    const auto profile = [&](const std::string& text, const std::string& message) {
        write("bad.json", text);
        refused("result.json --attitude 0,0,0 --profile bad.json", "bad.json: " + message);
    };
    profile(R"({"psd": [[60, 0.1], [40, 0.1]]})",
            "psd[1]: found 40 Hz after 60 Hz, expected growing frequencies");
    profile(R"({"psd": [[20, 0.1], [40, 0]]})",
            "psd[1]: found 0 g^2/Hz, expected a density above 0");
    profile(R"({"psd": [[20, 0.1], [40, -1]]})", "psd[1]: found -1 g^2/Hz");
    profile(R"({"psd": [[20, 0.05], [40, 0.05]], "g_rms": 3})", "g_rms: found 3, expected");
    profile(R"({"psd": [[20, 0.05], [40]]})", "psd[1]: found [40], expected [hz, g2_hz]");
    profile(R"({"cross_spectra": []})", "cross_spectra: found an unknown key");
    profile(R"({"psd": {"north": [[20, 0.1], [40, 0.1]]}, "quadrature": {}})",
            "quadrature: found cross-spectra with an imaginary part");
    profile(R"({"psd": {"down": [[20, 0.1], [40, 0.1]]}})",
            "psd.down: found an unknown axis, expected north, up, east");
    profile(R"({"psd": {"up": [[20, 0.1], [40]]}})", "psd.up[1]: found [40], expected [hz, g2_hz]");
    profile(R"({"psd": {"up": [[20, 0.1], [40, "a"]]}})", "psd.up[1]: found [40,\"a\"]");
    profile(R"({"psd": {"up": [[20, 1e308], [40, 1e308]]}})", "found more than 10000 g rms");
    profile(R"({"psd": [[20, 1e308], [40, 1e308]]})", "found more than 10000 g rms");
    profile(R"({"sines": [[20, 1e200]]})", "found more than 10000 g rms");
    profile(R"({"sines": [[55, 3], [55, 3]]})", "sines[1]: found 55 Hz as in [0], expected one");
    profile(R"({"psd": {}})", "psd: found {}, expected an object with north, up, east");
    profile(R"({"psd": [[20, 0.1], [40, 0.1]], "cross": {}})",
            "cross: found without a psd of several axes");
    profile(R"({"psd": {"up": [[20, 0.1], [40, 0.1]]}, "direction": [1, 0, 0]})",
            "direction: found with a psd of several axes");
    profile(R"({"psd": {"up": [[20, 0.1], [40, 0.1]], "north": [[20, 0.1], [40, 0.1]]},
                "cross": {"north_up": [[20, 0.2], [40, 0.2]]}})",
            "cross: found 20.");
    write("axes.json", R"({"psd": {"up": [[20, 0.1], [40, 0.1]]}})");
    refused("result.json --profile axes.json --verify held_out.csv --config held.toml",
            "--verify: found a profile along several axes");
    profile("{}", "psd: found neither");
    profile("nonsense", "found no JSON");
    refused("result.json --profile none.json --attitude 0,0,0", "--profile: found 'none.json'");
    refused("result.json --profile truck --attitude 0,0", "--attitude: found '0,0'");
    refused("result.json --profile truck --attitude 0,85,0", "inner angle");
    refused("result.json --profile truck", "found no --attitude");
    refused("missing.json --profile truck --attitude 0,0,0", "missing.json: cannot be read");
    refused("result.json --profile truck --verify held_out.csv --config held.toml",
            "held_out.csv: found no dwell under the profile 'truck'");
    write("old.json", R"({"parameters": []})");
    refused("old.json --profile truck --attitude 0,0,0", "old.json: spectrum: found nothing");
}

TEST_F(Predict, ForbiddenFrequencyIsRefusedAndTheNearestFreeOneNamed) {
    ASSERT_EQ(plant("--dwell 5 --table-g 1,1 --frequency 15,60 -o closed.csv").exit_code, 0);
    const Ended ended = run("identify closed.csv");
    EXPECT_EQ(ended.exit_code, 2);
    EXPECT_THAT(ended.error, HasSubstr("closed.csv: column frequency_hz: found 60 Hz at 40 "
                                       "samples/s"));
    EXPECT_THAT(ended.error, HasSubstr("the nearest free one is 60.2 Hz"));
}

TEST_F(Predict, WhatWasFittedProvesNothing) {
    write("p15.json", R"({"name": "15 Hz", "sines": [[15, 6]]})");
    const Ended ended = run("predict result.json --profile p15.json --verify survey.csv");
    EXPECT_EQ(ended.exit_code, 2) << ended.out;
    EXPECT_THAT(ended.error, HasSubstr("with which the result was fitted, expected dwells"));
}

TEST_F(Predict, AProfileOfTwoSinesIsNotProvenByDwellsOfOne) {
    write("two_sines.json", R"({"name": "two", "sines": [[55, 3], [90, 2]]})");
    const Ended ended = run(
        "predict result.json --profile two_sines.json --verify held_out.csv --config held.toml");
    EXPECT_EQ(ended.exit_code, 2) << ended.out;
    EXPECT_THAT(ended.error, HasSubstr("found no dwell at the profile's frequencies"));
}

TEST_F(Predict, ADamagedResultIsNamedByItsPlace) {
    const auto damaged = [&](auto&& damage, const char* message) {
        PredictJson of = result();
        damage(of["spectrum"]["mixture"][1][0]);
        write("damaged.json", of.dump());
        const Ended ended = run("predict damaged.json --profile truck --attitude 0,0,0");
        EXPECT_EQ(ended.exit_code, 2) << ended.out;
        EXPECT_THAT(ended.error,
                    HasSubstr(std::string("damaged.json: spectrum.mixture[1][0].") + message));
    };
    damaged([](PredictJson& one) { one["p"].erase(0); }, "p: found 15 entries, expected 16");
    damaged([](PredictJson& one) { one["x"].erase(0); }, "x: found 15 entries, expected 16");
    damaged([](PredictJson& one) { one["w"] = -0.5; }, "w: found -0.5");
    damaged([](PredictJson& one) { one["w"] = 3; }, "w: found 3");
}

}  // namespace
}  // namespace vibrig::tool
