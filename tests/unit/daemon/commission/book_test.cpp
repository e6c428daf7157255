#include "daemon/commission/book.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>

#include "daemon/commission/acceptance.hpp"
#include "daemon/journal/signing_key.hpp"
#include "estimator/filter/parameters.hpp"
#include "tests/unit/support/temporary_folder.hpp"

namespace vibrig::commission {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr std::int64_t kNow = 1'795'000'000'000'000'000;
constexpr std::int64_t kDay = 86'400'000'000'000;

class Books : public ::testing::Test {
  protected:
    configuration::Loaded loaded(const std::string& more = {}) const {
        return configuration::parse("[commission]\nenforce = true\nsimulated = true\nfolder = \"" +
                                        folder.string() + "\"\n" + more,
                                    "/rig.toml", false);
    }
    static std::string text_of(const std::filesystem::path& path) {
        std::ifstream in(path);
        return {std::istreambuf_iterator<char>(in), {}};
    }
    void prove_all(const configuration::Loaded& as) const {
        PartRecord what;
        what.by = {"A. Person", "B. Person"};
        what.utc_ns = kNow;
        what.evidence = {{"ln_ratio", 13200}};
        what.version = "1";
        Book book(as);
        book.prove({kParts.begin(), kParts.end()}, what, as);
    }
    const TemporaryFolder temporary;
    const std::filesystem::path folder = temporary / "of_the_test";  // not there at first
};

TEST_F(Books, WithoutARecordNothingIsArmedAndTheCommandIsNamed) {
    const auto as = loaded();
    EXPECT_EQ(Book(as).refusal(kNow),
              "not commissioned: no record of bus, gimbals, accelerometers, earth, gyros, "
              "registers, watchdog, stop, units, excitation: vibrig commission");
}

TEST_F(Books, WhatIsProvenIsArmed) {
    const auto as = loaded();
    prove_all(as);
    EXPECT_EQ(Book(as).refusal(kNow + kDay), "");
    EXPECT_EQ(Book(as).status(kNow)["parts"]["gimbals"]["by"][1], "B. Person");
    // kNow is in 2026; its age, and until when it counts.
    const auto age = Book(as).status(kNow + 3 * kDay)["parts"]["gimbals"]["age"];
    EXPECT_NEAR(age["days"].get<double>(), 3, 1e-9);
    EXPECT_EQ(age["valid_days"], 365);
    EXPECT_EQ(age["expires"], date_of(kNow + 365 * kDay));
}

TEST_F(Books, AKeyThatHasChangedVoidsItsPartsAndNoOthers) {
    const auto proven = loaded();
    prove_all(proven);
    const auto as = loaded("[platform]\nencoder_sign = [1, -1, 1]\n");
    const Book book(as);
    EXPECT_EQ(book.refusal(kNow),
              "not commissioned: platform.encoder_sign is [1, -1, 1], was proven as [1, 1, 1] by "
              "A. Person, B. Person on 2026-11-18 (gimbals): vibrig commission gimbals");
    std::string void_parts;
    for (const auto& s : book.standing(kNow))
        if (!s.proven) void_parts += std::string(name_of(s.part)) + " ";
    EXPECT_EQ(void_parts, "gimbals earth gyros ");
}

TEST_F(Books, EachKeyOfTheTableVoidsItsPart) {
    const auto proven = loaded();
    prove_all(proven);
    for (const auto& [text, key] : std::vector<std::pair<std::string, std::string>>{
             {"[platform]\nencoder_zero_deg = [5, 0, 0]", "platform.encoder_zero_deg"},
             {"[platform]\ngyro_x_axes = [\"+x\", \"-y\", \"-z\"]", "platform.gyro_x_axes"},
             {"[platform]\ndrift_sign = 1", "platform.drift_sign"},
             {"[accelerometer]\nmatrix = [[0, 1, 0], [1, 0, 0], [0, 0, -1]]",
              "accelerometer.matrix"},
             {"[site]\nlatitude_deg = -45.75", "site.latitude_deg"},
             {"[site]\nazimuth_deg = 90", "site.azimuth_deg"},
             {"[can]\nsample_rate_hz = 100", "can.sample_rate_hz"},
             {"[gimbal]\nmessage = \"Other\"", "gimbal.message"}}) {
        const auto as = loaded(text + "\n");
        EXPECT_THAT(Book(as).refusal(kNow), HasSubstr(key + " is "));
    }
}

TEST_F(Books, AKeyOfTheShakerVoidsItsPartsAndNoneOfThePlatform) {
    const auto proven = loaded();
    prove_all(proven);
    const auto void_parts = [](const configuration::Loaded& as) {
        std::string names;
        for (const auto& s : Book(as).standing(kNow))
            if (!s.proven) names += std::string(name_of(s.part)) + " ";
        return names;
    };
    EXPECT_EQ(void_parts(loaded("[shaker.registers]\namplitude = { address = 90 }\n")),
              "registers watchdog stop units excitation ");
    EXPECT_EQ(void_parts(loaded("[shaker.limits]\ndisplacement_mm = 11\n")), "excitation ");
    EXPECT_EQ(void_parts(loaded("[vibration]\ntransmission = 0.7\n")), "excitation ");
    const auto other = "[commission]\nenforce = true\nsimulated = true\nfolder = \"" +
                       folder.string() + "\"\nbuttons = [\"rack\"]\n";
    EXPECT_EQ(void_parts(configuration::parse(other, "/rig.toml", false)), "stop ");
}

TEST_F(Books, AnotherControllerVoidsThePartsOfTheShakerByName) {
    const auto as = loaded();
    PartRecord what;
    what.by = {"A. Person", "B. Person"};
    what.utc_ns = kNow;
    Book first(as);
    first.shaker_is("ACME VC-3 2.11");
    first.prove({kParts.begin(), kParts.end()}, what, as);
    EXPECT_EQ(first.refusal(kNow), "");

    Book again(as);
    EXPECT_EQ(again.refusal(kNow), "") << "nobody knows yet";
    again.shaker_is("ACME VC-3 2.11");
    EXPECT_EQ(again.refusal(kNow), "");
    again.shaker_is("OTHER 7");
    EXPECT_EQ(again.refusal(kNow),
              "not commissioned: identity of the shaker's controller is \"OTHER 7\", was proven as "
              "\"ACME VC-3 2.11\" by A. Person, B. Person on 2026-11-18 (registers): vibrig "
              "commission watchdog stop units excitation");
    std::string names;
    for (const auto& s : again.standing(kNow))
        if (!s.proven) names += std::string(name_of(s.part)) + " ";
    EXPECT_EQ(names, "registers watchdog stop units excitation ");
    // A record from before it was asked.
    prove_all(as);
    Book old(as);
    old.shaker_is("OTHER 7");
    EXPECT_THAT(old.refusal(kNow), HasSubstr("is \"OTHER 7\", was not known then"));
}

TEST_F(Books, OfTheShakerOnePersonIsEnoughWhoHasArmedIt) {
    const auto as = loaded();
    PartRecord what;
    what.by = {"A. Person"};
    what.utc_ns = kNow;
    Book book(as);
    book.prove({kShakerParts.begin(), kShakerParts.end()}, what, as);
    EXPECT_THAT(book.refusal(kNow), HasSubstr("no record of bus, gimbals, accelerometers, earth, "
                                              "gyros: vibrig commission"));
    EXPECT_EQ(book.not_proven_below_shaker(kNow), "bus first: no record");
}

TEST_F(Books, AProofIsMadeWithoutThePartsThatItProves) {
    const auto as = loaded();
    PartRecord what;
    what.by = {"A. Person", "B. Person"};
    what.utc_ns = kNow;
    Book book(as);
    EXPECT_THAT(book.refusal(kNow, Part::gyros), HasSubstr("no record of bus, gimbals"));
    book.prove({Part::bus, Part::gimbals, Part::accelerometers, Part::earth, Part::gyros}, what,
               as);
    EXPECT_EQ(book.refusal(kNow, Part::gyros), "");
    EXPECT_THAT(book.refusal(kNow), HasSubstr("no record of registers, watchdog, stop, units, "
                                              "excitation: vibrig commission watchdog stop"));
}

TEST_F(Books, AZeroThatWasFoundAnewIsReportedOnly) {
    const auto proven = loaded();
    prove_all(proven);
    const auto moved = loaded("[accelerometer]\nzero_g = [0.004, -0.009, 0.0]\n");
    EXPECT_EQ(Book(moved).refusal(kNow), "");
    EXPECT_THAT(Book(moved).standing(kNow)[2].moved, HasSubstr("accelerometer.zero_g is"));
    const auto far = loaded("[accelerometer]\nzero_g = [0.014, 0.0, 0.0]\n");
    EXPECT_THAT(Book(far).refusal(kNow), HasSubstr("accelerometer.zero_g"));
}

TEST_F(Books, WhatAReleaseNamedOtherwiseIsVoid) {
    // GIVEN a record of a release that could name axes otherwise than the bus
    const auto as = loaded();
    prove_all(as);
    const auto path = folder / "record.json";
    Record old = record_from_json(text_of(path));
    for (auto& [part, r] : old.parts) r.meaning = 1;
    journal::SigningKey key((folder / "record.key").string());
    std::ofstream(path) << to_json(old, &key);
    // THEN the platform is to be measured again, and the shaker is not
    const Book book(as);
    EXPECT_EQ(book.refusal(kNow),
              "not commissioned: proven on 2026-11-18 with a version 1 that names axes otherwise "
              "(gimbals): vibrig commission gimbals");
    std::string void_parts;
    for (const auto& s : book.standing(kNow))
        if (!s.proven) void_parts += std::string(name_of(s.part)) + " ";
    EXPECT_EQ(void_parts, "gimbals accelerometers earth ");
}

TEST_F(Books, ARecordGrowsOld) {
    const auto as = loaded();
    prove_all(as);
    EXPECT_EQ(Book(as).refusal(kNow + 365 * kDay), "");
    EXPECT_THAT(Book(as).refusal(kNow + 367 * kDay), HasSubstr("367 days ago, 365 at most"));
}

TEST_F(Books, ARecordFromTheFutureIsRefused) {
    const auto as = loaded();
    prove_all(as);
    EXPECT_EQ(Book(as).refusal(kNow), "");
    EXPECT_THAT(Book(as).refusal(kNow - 1'000'000'000),
                AllOf(HasSubstr("proven on 2026-11-18T"), HasSubstr("yet to come")));
}

TEST_F(Books, OnePersonTwiceIsNotTwo) {
    const auto as = loaded();
    PartRecord what;
    what.by = {"Ada Lovelace (uid 0)", " ada  lovelace"};
    what.utc_ns = kNow;
    Book(as).prove({kParts.begin(), kParts.end()}, what, as);
    EXPECT_THAT(Book(as).refusal(kNow), HasSubstr("two persons are asked"));
    EXPECT_NE(not_two("Ada Lovelace (uid 0)", "ada lovelace"), "");
    EXPECT_NE(not_two("Ada (uid 0)", "  "), "");
    EXPECT_NE(not_two("Ada (uid 0)", " (uid 1)"), "");
    EXPECT_EQ(not_two("Ada (uid 0)", "Bo"), "");
}

TEST_F(Books, ARecordOfAnotherRigIsNone) {
    const auto as = loaded();
    prove_all(as);
    const auto path = folder / "record.json";
    Record record = record_from_json(text_of(path));
    record.rig += "-b";
    std::ofstream(path) << to_json(record);
    EXPECT_THAT(Book(as).refusal(kNow), HasSubstr("found the record of rig \"" + record.rig));
}

TEST_F(Books, WhatNobodyHasMeasuredIsNotRecorded) {
    const auto ran = loaded();
    const Book book(ran);
    Finding finding;
    finding.keys = {{"platform.encoder_sign", "[1, -1, 1]", ""}};
    const std::vector<Part> parts{Part::bus, Part::gimbals, Part::accelerometers, Part::earth};
    const auto found = loaded("[platform]\nencoder_sign = [1, -1, 1]\n");
    EXPECT_EQ(not_as_found(finding, found), "");
    EXPECT_EQ(not_as_running(parts, finding, book, found), "");
    EXPECT_THAT(not_as_found(finding, ran), HasSubstr("platform.encoder_sign: found [1, 1, 1]"));
    for (const auto& [text, key] : std::vector<std::pair<std::string, std::string>>{
             {"[accelerometer]\nrange_g = 12", "accelerometer.range_g"},
             {"[can]\nsample_rate_hz = 100", "can.sample_rate_hz"},
             {"[gimbal]\ntravel_deg = [[-100, 100], [-30, 30], [-175, 175]]", "gimbal.travel_deg"},
             {"[site]\nazimuth_deg = 90", "site.azimuth_deg"}}) {
        const auto file = loaded("[platform]\nencoder_sign = [1, -1, 1]\n" + text + "\n");
        EXPECT_EQ(not_as_found(finding, file), "");
        EXPECT_THAT(not_as_running(parts, finding, book, file),
                    AllOf(HasSubstr(key + " is "), HasSubstr("when vibrigd started")));
    }
    // Of what nothing measures all of it is as the daemon runs.
    EXPECT_EQ(not_as_running({Part::gyros}, {}, book, ran), "");
    EXPECT_THAT(not_as_running({Part::gyros}, {}, book, loaded("[platform]\ndrift_sign = 1\n")),
                HasSubstr("platform.drift_sign is 1"));
}

TEST_F(Books, DriftSignIsWhatTwoPersonsSayApart) {
    const auto with = [this](int sign, const std::string& torque = "[1, 1, 1]") {
        return loaded("[platform]\ndrift_sign = " + std::to_string(sign) +
                      "\n[levelling]\ntorque_sign = " + torque + "\n");
    };
    const auto doubt = [](int ada, int bo, const configuration::Loaded& file,
                          const std::string& source = "drawing 7") {
        return doubt_of_drift_sign({{"Ada", source, ada}, {"Bo", "certificate", bo}}, "Ada (uid 0)",
                                   "Bo", file);
    };
    EXPECT_EQ(doubt(1, 1, with(-1)), "");
    EXPECT_EQ(doubt(2, 2, with(1)), "");
    EXPECT_EQ(doubt(3, 3, with(-1)), "");
    EXPECT_EQ(doubt(3, 3, with(1, "[-1, -1, -1]")), "");
    EXPECT_EQ(doubt(1, 2, with(-1)),
              "drift_sign: Ada says 1 (drawing 7), Bo says 2 (certificate): they differ");
    EXPECT_THAT(doubt(2, 2, with(-1)),
                HasSubstr("platform.drift_sign: found -1, expected 1 as both say"));
    EXPECT_THAT(doubt(3, 3, with(-1, "[1, -1, 1]")), HasSubstr("whose signs differ"));
    EXPECT_THAT(doubt(4, 4, with(-1)), HasSubstr("found 4, expected 1, 2 or 3"));
    EXPECT_THAT(doubt(1, 1, with(-1), " "), HasSubstr("found no source"));
    EXPECT_THAT(doubt_of_drift_sign({}, "Ada", "Bo", with(-1)), HasSubstr("each alone"));
    EXPECT_THAT(doubt_of_drift_sign({{"Ada", "d", 1}, {"Ada", "d", 1}}, "Ada", "Bo", with(-1)),
                HasSubstr("each alone"));
    EXPECT_EQ(sign_statements(Json::parse(R"([{"by":"Ada","says":1,"source":"d"},7])")).size(), 2U);
    EXPECT_TRUE(sign_statements(Json::parse("{}")).empty());
}

TEST_F(Books, ADbcThatWasEditedMeanwhileIsNotWhatWasMeasured) {
    std::filesystem::create_directories(folder);
    const auto dbc = folder / "rig.dbc";
    std::ofstream(dbc) << "one";
    auto as = loaded();
    as.configuration.dbc = dbc.string();
    const Book book(as);
    EXPECT_EQ(not_as_running({Part::bus}, {}, book, as), "");
    std::ofstream(dbc) << "two";
    EXPECT_THAT(not_as_running({Part::bus}, {}, book, as), HasSubstr("contents of can.dbc is "));
}

TEST_F(Books, ARecordThatWasEditedIsNone) {
    const auto as = loaded("[platform]\nencoder_sign = [1, -1, 1]\n");
    prove_all(loaded());
    const auto path = folder / "record.json";
    std::string text = text_of(path);
    const auto at = text.find("[1, 1, 1]");
    ASSERT_NE(at, std::string::npos);
    text.replace(at, 9, "[1, -1, 1]");
    std::ofstream(path) << text;
    EXPECT_THAT(Book(as).refusal(kNow), AllOf(HasSubstr("record.json"), HasSubstr("SHA-256")));
    std::ofstream(path) << "nonsense";
    EXPECT_THAT(Book(as).refusal(kNow), HasSubstr("not a commissioning record"));
}

TEST_F(Books, ARecordWhoseHashesWereMadeAnewIsNotSigned) {
    const auto as = loaded("[platform]\nencoder_sign = [1, -1, 1]\n");
    prove_all(loaded());
    const auto path = folder / "record.json";
    const std::string genuine = text_of(path);
    ASSERT_EQ(record_from_json(genuine).signed_with.size(), 64U);
    EXPECT_EQ(Book(as).status(kNow)["signed_with"], record_from_json(genuine).signed_with);
    // GIVEN one who knows how hashes are made, and has no key
    Record forged = record_from_json(genuine);
    for (auto& [part, r] : forged.parts)
        if (r.keys.contains("platform.encoder_sign"))
            r.keys["platform.encoder_sign"] = "[1, -1, 1]";
    Json whole = Json::parse(to_json(forged));
    whole["signature"] = Json::parse(genuine)["signature"];
    std::ofstream(path) << whole.dump(1) << '\n';
    // WHEN the daemon reads it THEN nothing is armed
    EXPECT_THAT(Book(as).refusal(kNow), AllOf(HasSubstr("record.json: its signature is not that of "
                                                        "what it says")));
    // AND neither is it by a key of the forger's
    journal::SigningKey own((folder / "own.key").string());
    std::ofstream(path) << to_json(forged, &own);
    EXPECT_THAT(Book(as).refusal(kNow), HasSubstr("signed with another key than"));
    // AND on a real rig without any
    forged.simulated = false;
    std::ofstream(path) << to_json(forged);
    auto real = as;
    real.configuration.commission.simulated = false;
    EXPECT_THAT(Book(real).refusal(kNow), HasSubstr("it carries no signature, expected that of"));
    // AND the genuine one not without its key
    std::ofstream(path) << genuine;
    EXPECT_EQ(Book(loaded()).refusal(kNow), "");
    std::filesystem::remove(folder / "record.key");
    EXPECT_THAT(Book(as).refusal(kNow), HasSubstr("record.key, which has signed it, is gone"));
}

TEST_F(Books, ASignAgainstTheCertificateTakesGyrosOut) {
    // GIVEN values whose third has the other sign at 4, the first at 60 sigma
    std::array<double, 30> value{}, sigma{};
    sigma.fill(0.02);
    value[0] = -1.2;
    value[1] = 0.9;
    value[2] = -0.08;
    value[3] = std::nan("");
    const auto& names = estimator::parameter_names();
    EXPECT_EQ(against_certificate({{names[0], 1}, {names[1], 1}, {names[2], 1}, {names[3], -1}},
                                  value, sigma),
              std::string(names[0]) +
                  " is -1.2 +- 0.02, 1 by the certificate: sign of platform.drift_sign, or axes of "
                  "the gyro?");
    EXPECT_EQ(against_certificate({}, value, sigma), "");
    // WHEN it is taken out THEN it is missing, in the file, too, and the rest stands
    const auto as = loaded();
    prove_all(as);
    Book book(as);
    book.withdraw(Part::gyros);
    EXPECT_THAT(book.refusal(kNow), HasSubstr("no record of gyros: vibrig commission gyros"));
    EXPECT_EQ(Book(as).refusal(kNow), book.refusal(kNow));
}

TEST_F(Books, ARecordOfASimulatedRigDoesNotCountOnARealOne) {
    prove_all(loaded());
    auto real = loaded();
    real.configuration.commission.simulated = false;
    EXPECT_THAT(Book(real).refusal(kNow), HasSubstr("of a simulated rig"));
}

TEST_F(Books, ASimulatedRigNeedsNoneUnlessItIsEnforcedWithAFolder) {
    auto as = loaded();
    as.configuration.commission.enforce = false;
    EXPECT_EQ(Book(as).refusal(kNow), "");
    as.configuration.commission.enforce = true;
    as.configuration.commission.folder = configuration::kCommissionFolder;
    EXPECT_EQ(Book(as).refusal(kNow), "");
    as.configuration.commission.simulated = false;
    EXPECT_THAT(Book(as).refusal(kNow), Not(""));
}

TEST_F(Books, ATorqueSignThatWasMeasuredIsTheOneThatIsStated) {
    const Json measured{{"sign", {1, -1, 1}}};
    const auto with = [this](const std::string& sign) {
        return loaded("[levelling]\ntorque_sign = " + sign + "\n");
    };
    EXPECT_EQ(not_as_torqued(measured, with("[1, -1, 1]")), "");
    EXPECT_THAT(not_as_torqued(measured, with("[1, 1, 1]")),
                HasSubstr("levelling.torque_sign: found [1,1,1], expected [1,-1,1] as the torquers "
                          "were measured"));
    EXPECT_EQ(not_as_torqued(Json(), with("[1, 1, 1]")), "") << "nothing was measured";
    EXPECT_EQ(not_as_torqued(Json::object(), with("[1, 1, 1]")), "");
}

}  // namespace
}  // namespace vibrig::commission
