#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>

#include "tests/unit/support/vibrig_command.hpp"

namespace vibrig::test {
namespace {

class VibrigOptions : public VibrigCommand {
  protected:
    /// Of another program: its exit code.
    int run(const std::string& program, const std::string& arguments) {
        return vibrig("--version; cd '" + folder_.string() + "' && '" + program +
                      "' >out 2>error </dev/null " + arguments);
    }
};

TEST_F(VibrigOptions, AnEmptyValueIsNoDefault) {
    // GIVEN values of variables that are not set
    // WHEN options are given them, whose absence would mean something else
    for (const char* const arguments :
         {"plan --config ''", "plan --positions ''", "plan --evaluate ''", "plan -o ''",
          "plan --plot ''", "level design --plot ''", "identify ''", "identify a.csv --config ''",
          "arm --host ''", "status --socket ''", "zero simulate --write ''",
          "pki init --p12-password ''"}) {
        // THEN each says which
        expect_refusal(arguments, "found nothing, expected a value: ");
        EXPECT_EQ(out, "") << arguments;
    }
    expect_refusal("arm --host ''", "--host: found nothing");
    // AND so do the daemon and the simulated rig
    EXPECT_EQ(run(VIBRIGD, "--check --config ''"), 2);
    EXPECT_NE(error.find("--config: found nothing"), std::string::npos) << error;
    EXPECT_EQ(run(VIBRIG_PLANT, "record -o x.csv --truth ''"), 2);
    EXPECT_NE(error.find("--truth: found nothing"), std::string::npos) << error;
}

TEST_F(VibrigOptions, AnEmptyElementOfAListIsNamed) {
    // GIVEN lists in which a variable that is not set left nothing between two commas, or at an end
    for (const auto& [option, arguments] :
         {std::pair{"--levels", "plan --levels 0,,6"}, std::pair{"--levels", "plan --levels=0,6,"},
          std::pair{"--levels", "plan --levels 0 4,,6"},
          std::pair{"--without", "plan --without ,D12"},
          std::pair{"--spheres", "plan --turntable --spheres [1,,2]"},
          std::pair{"--tilt", "level simulate --tilt 30,,-20"},
          std::pair{"--without", "calibrate a.csv --without D12,,D13"},
          std::pair{"--attitude", "compensate c --attitude 1,,2,3"},
          std::pair{"--reference", "allan a.txt --tau0 1 --dynamic 9 --reference 1,,2,3,4,5"}}) {
        // WHEN they are read THEN each is named
        expect_refusal(arguments, std::string(option) + ": found '");
        EXPECT_NE(error.find("', expected something between commas"), std::string::npos) << error;
    }
    // AND so does the simulated rig
    EXPECT_EQ(run(VIBRIG_PLANT, "record -o x.csv --table-g 9,,7"), 2);
    EXPECT_NE(error.find("--table-g: found '9,,7'"), std::string::npos) << error;
    // AND what is no element of one is taken as it is
    write("a,,b.csv", "no positions\n");
    expect_refusal("plan --outer -90,90 --positions a,,b.csv", "a,,b.csv");
    EXPECT_EQ(error.find("between commas"), std::string::npos) << error;
}

TEST_F(VibrigOptions, AnOutputIsNoInputAndNoRecording) {
    // GIVEN what is read, and a campaign
    const std::string rows = "time_s,run,position,alpha_deg,beta_deg,gamma_deg,ax_g,ay_g,az_g\n";
    write("rec.csv", rows);
    write("v.toml", "# a rig\n");
    std::filesystem::create_directories(folder_ / "c");
    write("c/campaign.h5", "of a campaign");
    std::filesystem::create_symlink("c/campaign.h5", folder_ / "link.svg");
    // WHEN it is to be written THEN nothing is
    for (const char* const arguments :
         {"uncertainty rec.csv --plot rec.csv", "uncertainty c --plot c/campaign.h5",
          "identify rec.csv --plot rec.csv", "replay c --plot link.svg",
          "plan --runs 14 -o c/campaign.h5", "plan --config v.toml -o v.toml",
          "plan --config v.toml -o ./c/../v.toml", "allan rec.csv --plot rec.csv"}) {
        expect_refusal(arguments, "expected another to write");
    }
    for (const char* const arguments : {"-o c/campaign.h5", "-o x.csv --write-truth c/campaign.h5",
                                        "-o x.csv --truth v.toml --write-mean v.toml"}) {
        EXPECT_EQ(run(VIBRIG_PLANT, std::string("record --dwell 1 ") + arguments), 2) << arguments;
        EXPECT_NE(error.find("expected another to write"), std::string::npos) << error;
    }
    EXPECT_EQ(content("rec.csv"), rows);
    EXPECT_EQ(content("v.toml"), "# a rig\n");
    EXPECT_EQ(content("c/campaign.h5"), "of a campaign");
    // AND a plan that cannot be taken leaves the recording that was there
    EXPECT_EQ(run(VIBRIG_PLANT, "record -o rec.csv --order 99.1"), 2);
    EXPECT_EQ(content("rec.csv"), rows);
    // AND what is no file is written as it is
    ASSERT_EQ(vibrig("plan --runs 14 --seed 1 -o /dev/fd/3 3>third"), 0) << error;
    EXPECT_NE(content("third").find("\"runs\""), std::string::npos);
}

TEST_F(VibrigOptions, APictureOfAnotherKindIsNoFolder) {
    // GIVEN names that somebody takes for a picture's, THEN no folder of that name comes of them
    for (const char* const command :
         {"plan", "identify x.csv", "uncertainty c", "replay c", "trend 17", "calibrate x.csv",
          "level simulate", "level design", "zero simulate", "allan x.csv", "study merge s",
          "reproduce all"}) {
        for (const char* const name : {"x.png", "deep/x.PDF", "x.jpeg", "x.ps"})
            expect_refusal(std::string(command) + " --plot " + name,
                           std::string(name) + ": charts are SVG; expected a");
        EXPECT_EQ(out, "") << command;
    }
    expect_refusal("plan --plot x.html",
                   "x.html: charts are SVG; expected a name that ends in .svg, or a folder");
    expect_refusal("study merge s --plot x.svg", "x.svg: charts are SVG; expected a folder");
    write("rates.csv", "1\n2\n1\n2\n");
    expect_refusal("allan rates.csv --tau0 1 --plot x.html", "a page is of --live");
    for (const char* const name : {"x.png", "deep", "x.jpeg", "x.ps", "x.html", "x.svg"})
        EXPECT_FALSE(std::filesystem::exists(folder_ / name)) << name;
    // A folder's name may have a point.
    EXPECT_EQ(vibrig("plan --runs 14 --plot plan.v2"), 0) << error;
    EXPECT_TRUE(std::filesystem::is_directory(folder_ / "plan.v2"));
}

TEST_F(VibrigOptions, FramesAreReplayedWhateverTheirFileIsCalled) {
    const std::string frames = "(1700000000.000000) vcan0 123#0102\n";
    for (const char* const name : {"x.candump", "x.txt", "x.log"}) {
        write(name, "# of a bus\n" + frames);
        EXPECT_EQ(vibrig(std::string("replay ") + name), 2);
        EXPECT_EQ(error.find("HDF5"), std::string::npos) << error;
        EXPECT_NE(error.find("dwells.csv"), std::string::npos) << error;
    }
    write("other.txt", "of another kind\n");
    expect_refusal("replay other.txt", "other.txt");
}

TEST_F(VibrigOptions, WhatStandsInAFileIsPrintable) {
    write("z.csv", "time_s,turn_x_arcsec\xff,b\n1,2,3\n");
    expect_refusal("zero z.csv", R"(no column "turn_x_arcsec", found time_s, turn_x_arcsec\xff)");
    write("z.csv",
          "time_s,turn_x_arcsec,turn_y_arcsec,turn_z_arcsec,dv_x_mps,dv_y_mps,dv_z_mps\n"
          "1,\xff\x1b,3,3,3,3,3\n");
    expect_refusal("zero z.csv", R"(column turn_x_arcsec: "\xff\x1b" found)");
}

TEST_F(VibrigOptions, WhatCannotBeReadIsNamed) {
    write("cut.json", "{\n  \"parameters\": [1,");
    std::filesystem::create_directories(folder_ / "folder");
    expect_refusal("predict folder --profile truck --attitude 0,0,0",
                   "folder: cannot be read, expected a JSON file");
    expect_refusal("predict cut.json --profile truck --attitude 0,0,0",
                   "cut.json: found no JSON, expected it; line 2, column 20");
    expect_refusal("plan --about folder", "folder: cannot be read");
    write("j", "");
    expect_refusal("journal verify j --anchor nosuch", "nosuch: cannot be opened");
    expect_refusal("replay folder --dwells rec.csv", "--dwells: found it with a campaign");
}

TEST_F(VibrigOptions, AnEmptyKeyOfAnAuthorityIsNamed) {
    // GIVEN what a full disk had left
    std::filesystem::create_directories(folder_ / "p");
    write("p/authority.crt", "");
    write("p/authority.key", "");
    expect_refusal("pki init --folder p --viewer wall", "p/authority.crt: found an empty file");
    // WHEN it is taken away, THEN a certificate without its key is none
    std::filesystem::remove(folder_ / "p/authority.key");
    EXPECT_EQ(vibrig("pki init --folder p --viewer wall"), 0) << error;
}

TEST_F(VibrigOptions, EachProgramSaysItsNameAndVersion) {
    for (const auto& [program, name] :
         {std::pair{VIBRIG, "vibrig"}, {VIBRIGD, "vibrigd"}, {VIBRIG_PLANT, "vibrig-plant"}}) {
        EXPECT_EQ(run(program, "--version"), 0) << error;
        EXPECT_THAT(out, testing::MatchesRegex(std::string(name) + " [0-9]+\\.[0-9]+\\.[0-9]+\n"));
    }
}

TEST_F(VibrigOptions, PkiSaysToMachinesWhatItMade) {
    // GIVEN an authority with a server and two people
    ASSERT_EQ(vibrig("pki init --json --folder p --host a.lab --viewer wall --operator ada"), 0);
    const auto made = nlohmann::json::parse(out);
    EXPECT_EQ(made["authority_is_new"], true);
    EXPECT_EQ(made["list"], "p/revoked.crl");
    EXPECT_FALSE(content("p/revoked.crl").empty());
    EXPECT_EQ(made["server"]["hosts"], nlohmann::json{"a.lab"});
    ASSERT_EQ(made["people"].size(), 2);
    EXPECT_EQ(made["people"][1]["name"], "ada");
    EXPECT_EQ(made["people"][1]["role"], "operator");
    // THEN each file that is named is there
    for (const auto& file : {made["authority"], made["server"]["key"], made["people"][0]["key"],
                             made["people"][0]["certificate"], made["people"][1]["browser"]})
        EXPECT_NE(content(file), "") << file;
    // AND of a second call only what is new
    ASSERT_EQ(vibrig("pki init --json --folder p --admin eve"), 0);
    const auto more = nlohmann::json::parse(out);
    EXPECT_EQ(more["authority_is_new"], false);
    EXPECT_TRUE(more["server"].is_null());
    EXPECT_EQ(more["people"].size(), 1);
    // AND of a revocation the list, and who is on it
    ASSERT_EQ(vibrig("pki revoke --json --folder p eve wall"), 0);
    const auto revoked = nlohmann::json::parse(out);
    EXPECT_EQ(revoked["revoked"], (nlohmann::json{"eve", "wall"}));
    EXPECT_THAT(content(revoked["list"]), testing::HasSubstr("X509 CRL"));
}

TEST_F(VibrigOptions, PkiLooksAtEveryNameBeforeItMakesAnything) {
    const std::string long_name(65, 'x');
    for (const auto& [arguments, words] :
         {std::pair<std::string, std::string>{"--host 'a b'", "--host: found \"a b\", expected"},
          {"--host rig.lab --host 'a,DNS:b'", "--host: found \"a,DNS:b\", expected"},
          {"--host rig.lab --operator '\xff'", R"(--operator: found "\xff", expected a name, one)"},
          {"--viewer 'a\nb'", R"(--viewer: found "a\nb", expected a name, one line)"},
          {"--operator server", "--operator: found \"server\", expected another name"},
          {"--admin ../x", "--admin: found \"../x\", expected a name without '/'"},
          {"--admin " + long_name, "expected a name of 64 characters at most"},
          {"--viewer ada --operator ada", "--operator: found \"ada\" a second time, expected"}}) {
        expect_refusal("pki init --folder p " + arguments, words);
        EXPECT_FALSE(std::filesystem::exists(folder_ / "p")) << arguments;
    }
    write("file", "");
    expect_refusal("pki init --folder file/p --viewer wall",
                   "--folder: found \"file/p\", expected");
    // AND a list of revoked ones is as careful
    EXPECT_EQ(vibrig("pki init --folder q"), 0) << error;
    expect_refusal("pki revoke --folder q '\xff'", R"(name: found "\xff", expected somebody's)");
    // AND neither a long host, nor an address, nor another script is in the way
    const std::string host = std::string(60, 'h') + ".a-long-name.lab";
    EXPECT_EQ(vibrig("pki init --folder p --host ::1 --host " + host + " --viewer 'Åsa Ek'"), 0)
        << error;
}

TEST_F(VibrigOptions, PkiLeavesTheServersCertificateAlone) {
    // GIVEN a server's certificate
    ASSERT_EQ(vibrig("pki init --folder p --host rig.lab --host 10.0.0.5"), 0) << error;
    const auto certificate = content("p/server.crt"), key = content("p/server.key");
    // WHEN people come later with hosts that it names THEN it stays
    ASSERT_EQ(vibrig("pki init --json --folder p --host 10.0.0.5 --viewer wall"), 0) << error;
    EXPECT_EQ(nlohmann::json::parse(out)["server"]["is_new"], false);
    // AND another host is refused, with nothing made
    for (const char* const host : {"10.0.0.6", "a.rig.lab"})
        expect_refusal(
            "pki init --folder p --operator ada --host rig.lab --host " + std::string(host),
            "does not name \"" + std::string(host) + "\"; nothing was changed");
    EXPECT_FALSE(std::filesystem::exists(folder_ / "p/ada.key"));
    EXPECT_EQ(content("p/server.crt"), certificate);
    EXPECT_EQ(content("p/server.key"), key);
    // AND neither is one without its key, or of another authority, replaced
    std::filesystem::rename(folder_ / "p/server.key", folder_ / "kept");
    expect_refusal("pki init --folder p --host rig.lab", "has no p/server.key beside it");
    ASSERT_EQ(vibrig("pki init --folder q"), 0);
    write("q/server.crt", certificate);
    write("q/server.key", key);
    expect_refusal("pki init --folder q --host rig.lab", "comes from another authority");
    // AND where it was moved away there is a new one
    std::filesystem::remove(folder_ / "p/server.crt");
    ASSERT_EQ(vibrig("pki init --folder p --host 10.0.0.6"), 0) << error;
    EXPECT_NE(content("p/server.crt"), certificate);
}

TEST_F(VibrigOptions, ACertificatesPaperIsHeldToDatesAndLimits) {
    // GIVEN a paper that is well but for one thing; no campaign: it is read before
    const std::string head = "number = \"C-1\"\nlaboratory.name = \"L\"\ncustomer.name = \"C\"\n";
    const std::string limit = "[[limit]]\ncoefficient = \"D_Fx\"\nhigh = 2\n";
    for (const auto& [more, words] :
         {std::pair<std::string, std::string>{
              "item.received = \"yesterday\"\n",
              "p.toml:4: received: found \"yesterday\", expected a date such as 20"},
          {"item.received = 9999-11-20\n",
           "p.toml:4: received: found 9999-11-20, expected none after the day of issue (UTC), 20"},
          {"item.received = 7\n", "p.toml:4: received: found 7, expected a date such as 20"},
          {limit + limit, "p.toml:7: limit: found coefficient \"D_Fx\" a second time, expected"},
          {"item.received = 2026-03-01\n" + limit, "nosuch"}}) {
        write("p.toml", head + more);
        expect_refusal("certificate nosuch --paper p.toml --by A --no-journal", words);
    }
    for (const char* const name : {"a\nb", "\xff"})
        expect_refusal(
            std::string("certificate nosuch --paper p.toml --no-journal --by '") + name + '\'',
            "expected a name, one line of UTF-8 without control characters");
}

TEST_F(VibrigOptions, CommissioningNamesWhatItCannotTake) {
    std::filesystem::create_directories(folder_ / "folder");
    expect_refusal("commission --by A --answers folder",
                   "vibrig commission: folder: cannot be read: Is a directory");
    expect_refusal("commission accept --bus --by A --second B --config folder",
                   "vibrig commission: folder: cannot be read: Is a directory");
    for (const char* const baud : {"0", "-5"})
        expect_refusal("commission registers --by A --device /dev/null --baud " + std::string(baud),
                       "--baud: Value " + std::string(baud) + " not in range 300 to 4000000");
}

TEST_F(VibrigOptions, CommissioningAcceptsInJson) {
    write("rig.toml",
          "[can]\nsample_rate_hz = 20\n[commission]\nfolder = \"" + folder_.string() + "\"\n");
    write("found.toml", "[can]\nsample_rate_hz = 40\n");
    const std::string command = "commission accept --bus --json --config rig.toml --by Ada";
    EXPECT_EQ(vibrig(command + " --second ada --yes"), 1);
    EXPECT_EQ(nlohmann::json::parse(out)["outcome"], "refused");
    ASSERT_EQ(vibrig(command + " --second Bo --yes"), 0) << error;
    // THEN people read at standard error what programs find in the outcome
    EXPECT_THAT(error, testing::HasSubstr("+ can.sample_rate_hz = 40"));
    const auto outcome = nlohmann::json::parse(out);
    EXPECT_EQ(outcome["outcome"], "accepted");
    EXPECT_EQ(outcome["configuration"], "rig.toml");
    ASSERT_EQ(outcome["changed"].size(), 1U);
    EXPECT_EQ(outcome["changed"][0]["key"], "can.sample_rate_hz");
    EXPECT_EQ(outcome["changed"][0]["is"], "40");
    EXPECT_THAT(content(std::filesystem::path(std::string(outcome["as_it_was"])).filename()),
                testing::HasSubstr("sample_rate_hz = 20"));
}

TEST_F(VibrigOptions, EachProgramSaysWhenNobodyCanReadWhatItPrints) {
    write("rig.toml",
          "clock.source = \"rig\"\ncan.port = \"seqpacket\"\ncan.path = \"@rig\"\n"
          "guard.socket = \"@guard\"\n");
    struct Program {
        const char* name;
        std::string file;
        std::vector<std::string> arguments;
    };
    for (const auto& [name, file, own] : std::vector<Program>{
             {"vibrigd",
              VIBRIGD,
              {"--config rig.toml --check", "--schema", "--init", "--print-proto"}},
             {"vibrig-guard", VIBRIG_GUARD, {"--config rig.toml --check"}},
             {"vibrig-plant", VIBRIG_PLANT, {"--print-dbc"}},
             {"vibrig", VIBRIG, {"identify --help"}}}) {
        std::vector<std::string> all{"--help", "--version", "--command-tree"};
        all.insert(all.end(), own.begin(), own.end());
        for (const std::string& arguments : all) {
            EXPECT_EQ(run(file, arguments), 0) << name << arguments << error;
            for (const char* const nowhere : {" >/dev/full", " >&-"}) {
                EXPECT_EQ(run(file, arguments + nowhere), 2) << name << arguments << nowhere;
                EXPECT_NE(error.find(std::string(name) + ": standard output: cannot be written"),
                          std::string::npos)
                    << arguments << nowhere << error;
            }
        }
    }
}

TEST_F(VibrigOptions, OfTwoThingsToPrintNoneIsPrinted) {
    EXPECT_EQ(run(VIBRIGD, "--init --check"), 2);
    EXPECT_EQ(error, "vibrigd: found --check with --init, expected one of them\n");
    EXPECT_EQ(run(VIBRIGD, "--print-dbc --print-proto"), 2);
    EXPECT_EQ(out, "");
}

TEST_F(VibrigOptions, ACheckSaysTheSameInJson) {
    const std::string rig =
        "clock.source = \"rig\"\ncan.port = \"seqpacket\"\ncan.path = \"@rig\"\n";
    write("rig.toml", rig);
    ASSERT_EQ(run(VIBRIGD, "--check --config rig.toml"), 0) << error;
    const std::string text = out, warned = error;
    ASSERT_EQ(run(VIBRIGD, "--check --json --config rig.toml"), 0) << error;
    const auto json = nlohmann::json::parse(out);
    EXPECT_EQ(error, warned);
    EXPECT_NE(text.find("# SHA-256 of what stands above: " + json["sha256"].get<std::string>()),
              std::string::npos);
    EXPECT_EQ(json["refusal"], "");
    EXPECT_FALSE(json["forecast"].empty());
    for (const auto& line : json["forecast"])
        EXPECT_NE(text.find("# " + line.get<std::string>()), std::string::npos) << line;
    EXPECT_GT(json["configuration"].size(), 200U);
    // AND what is refused says why in both
    write("rig.toml", rig + "[campaign]\npositions_deg = [[0, 0, 0]]\n");
    EXPECT_EQ(run(VIBRIGD, "--check --json --config rig.toml"), 2);
    EXPECT_NE(error.find(nlohmann::json::parse(out)["refusal"].get<std::string>()),
              std::string::npos);
    // AND it is of --check alone
    EXPECT_EQ(run(VIBRIGD, "--json --config rig.toml"), 2);
    EXPECT_EQ(error.substr(0, error.find('\n')), "--json requires --check");
}

TEST_F(VibrigOptions, JsonHasATextThatIsNoUtf8) {
    // GIVEN a folder whose name is Latin-1
    ASSERT_EQ(vibrig("pki init --json --folder 'caf\351'"), 0) << error;
    // THEN it is made, and a mark stands for what JSON cannot have
    EXPECT_NE(content("caf\351/authority.crt"), "");
    EXPECT_EQ(nlohmann::json::parse(out)["folder"], "caf\uFFFD");
}

}  // namespace
}  // namespace vibrig::test
