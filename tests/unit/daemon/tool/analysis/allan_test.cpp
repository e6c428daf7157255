#include <gtest/gtest.h>
#include <zlib.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <regex>
#include <sstream>

#include "tests/unit/estimator/allan/support.hpp"
#include "tests/unit/support/vibrig_command.hpp"

namespace {

using Json = nlohmann::json;

class AllanCommand : public vibrig::test::VibrigCommand {
  protected:
    void write(const std::string& name, const std::string& text) {
        std::ofstream(folder_ / name, std::ios::binary) << text;
    }
    /// White noise, one value a line.
    void write_noise(const std::string& name, std::size_t n, double sigma = 1) {
        write(name, noise(n, sigma));
    }
    static std::string noise(std::size_t n, double sigma) {
        std::ostringstream text;
        text.precision(17);
        for (const double y : vibrig::test::white(n, sigma, 42)) {
            text << y << '\n';
        }
        return text.str();
    }
    /// Bad input: exit code 2 and a message with these words.
    void expect_refusal(const std::string& arguments, const std::vector<std::string>& words) {
        EXPECT_EQ(vibrig(arguments), 2) << arguments << "\n" << out << error;
        for (const std::string& word : words) {
            EXPECT_NE(error.find(word), std::string::npos) << word << " not in: " << error;
        }
    }
};

TEST_F(AllanCommand, PrintsTheHandbookNumbersAsJson) {
    write("nine.txt", "892\n809\n823\n798\n671\n644\n883\n903\n677\n");
    ASSERT_EQ(vibrig("allan nine.txt --tau0 1 --taus 1,2 --json"), 0) << error;
    const Json result = Json::parse(out);
    EXPECT_EQ(result["type"], "oadev");
    EXPECT_EQ(result["tau0"], 1.0);
    ASSERT_EQ(result["points"].size(), 2U);
    EXPECT_NEAR(result["points"][0]["dev"], 91.22945, 5e-6);
    EXPECT_NEAR(result["points"][1]["dev"], 85.95287, 5e-6);
    for (const char* key : {"m", "tau", "lo", "hi", "edf", "n"}) {
        EXPECT_TRUE(result["points"][1].contains(key)) << key;
    }
}

TEST_F(AllanCommand, ALastLineWithoutAnEndIsToldOrRefused) {
    const std::string plain = noise(500, 1);
    std::string csv = "Time_s,Rate\n";
    std::istringstream lines(plain);
    std::size_t i = 0;
    for (std::string line; std::getline(lines, line); ++i)
        csv += std::to_string(static_cast<double>(i) * 0.5) + ',' + line + '\n';
    write("whole.csv", csv);
    ASSERT_EQ(vibrig("allan whole.csv --column rate --time TIME_S --json"), 0) << error;
    EXPECT_EQ(error, "");
    const auto warnings = Json::parse(out)["warnings"].size();
    write("cut.csv", csv.substr(0, csv.size() - 3));
    ASSERT_EQ(vibrig("allan cut.csv --column rate --time time_s --json"), 0) << error;
    EXPECT_NE(error.find("warning: cut.csv:501: found no end of line behind '"), std::string::npos)
        << error;
    ASSERT_EQ(Json::parse(out)["warnings"].size(), warnings + 1) << out;
    EXPECT_NE(std::string(Json::parse(out)["warnings"][0]).find("no end of line"),
              std::string::npos);
    write("fields.csv", csv + "250.5");
    EXPECT_EQ(vibrig("allan fields.csv --column rate --tau0 0.5"), 2);
    EXPECT_NE(error.find("fields.csv:502: found 1 fields and no end of line, expected 2"),
              std::string::npos)
        << error;
    write("empty.csv", csv + "250.5,");
    EXPECT_EQ(vibrig("allan empty.csv --column rate --tau0 0.5"), 2) << "missing, or cut off";
}

TEST_F(AllanCommand, EveryFormOfInputGivesTheSame) {
    // GIVEN one record as text, CSV with names, semicolons, CRLF, blanks, and gzip
    const std::string plain = noise(500, 1);
    write("plain.txt", plain);
    std::string csv = "\xEF\xBB\xBF\"time_s\",rate,flag\r\n# comment\r\n";
    std::string blanks;
    std::istringstream lines(plain);
    std::size_t i = 0;
    for (std::string line; std::getline(lines, line); ++i) {
        csv += std::to_string(static_cast<double>(i) * 0.5) + "," + line + ",x\r\n";
        blanks += "  " + std::to_string(i) + " \t " + line + "\n\n";
    }
    write("named.csv", csv);
    write("blanks.txt", blanks);
    gzFile file = gzopen((folder_ / "plain.gz").c_str(), "wb");
    ASSERT_NE(file, nullptr);
    gzwrite(file, plain.data(), static_cast<unsigned>(plain.size()));
    gzclose(file);
    ASSERT_EQ(vibrig("allan plain.txt --tau0 0.5 --json"), 0) << error;
    const std::string expected = out;
    // WHEN, THEN
    for (const std::string arguments :
         {"plain.gz --tau0 0.5", "named.csv --column rate --tau0 0.5",
          "named.csv --column 2 --tau0 0.5", "named.csv --column rate --time time_s",
          "blanks.txt --column 2 --tau0 0.5", "- --tau0 0.5 <plain.gz"}) {
        EXPECT_EQ(vibrig("allan --json " + arguments), 0) << arguments << error;
        EXPECT_EQ(out, expected) << arguments;
    }
}

TEST_F(AllanCommand, OfAPackedRecordNothingIsLostWithoutAWord) {
    // GIVEN a record that a logger packed in two goes
    const auto packed = [this](const std::string& text) {
        const std::string path = (folder_ / "part.gz").string();
        gzFile file = gzopen(path.c_str(), "wb");
        gzwrite(file, text.data(), static_cast<unsigned>(text.size()));
        gzclose(file);
        std::ifstream in(path, std::ios::binary);
        return std::string(std::istreambuf_iterator<char>(in), {});
    };
    const std::string first = packed(noise(300, 1)), second = packed(noise(200, 2));
    write("two.gz", first + second + std::string(512, '\0'));
    ASSERT_EQ(vibrig("allan two.gz --tau0 0.5 --json"), 0) << error;
    EXPECT_NE(out.find("\"samples\":500,"), std::string::npos) << out;
    // WHEN the second is damaged, wherever it is THEN it is refused, not shortened
    for (const std::size_t at :
         {std::size_t{0}, std::size_t{1}, second.size() / 2, second.size() - 6}) {
        std::string damaged = second;
        damaged[at] = static_cast<char>(damaged[at] ^ 1);
        write("damaged.gz", first + damaged);
        expect_refusal("allan damaged.gz --tau0 0.5", {"damaged.gz: cannot be read: "});
    }
    write("other.gz", first + "12.5\n");
    expect_refusal("allan other.gz --tau0 0.5",
                   {"other.gz: cannot be read: found at byte " + std::to_string(first.size()) +
                    " what is no compressed data, expected more of them or the end"});
    write("cut.gz", first + second.substr(0, second.size() - 9));
    expect_refusal("allan cut.gz --tau0 0.5",
                   {"cut.gz: cannot be read: compressed data end too early"});
}

TEST_F(AllanCommand, MissingSamplesAreFoundByNanByEmptyFieldAndByTime) {
    std::string nan;
    std::string time = "t,y\n";
    std::string empty = "y,z\n";
    int i = 0;
    for (const double y : vibrig::test::white(200, 1, 7)) {
        const bool gone = i == 50 || i == 51;
        nan += gone ? "nan\n" : std::to_string(y) + "\n";
        empty += gone ? ",1\n" : std::to_string(y) + ",1\n";
        time += gone ? "" : std::to_string(i * 0.25) + "," + std::to_string(y) + "\n";
        ++i;
    }
    write("nan.txt", nan);
    std::string blank = "\n\n" + std::regex_replace(nan, std::regex("nan"), "") + "\n\n";
    write("blank.txt", blank);
    write("quoted.csv", "y\r\n" + std::regex_replace(nan, std::regex("nan"), "\"\""));
    write("empty.csv", empty);
    write("time.csv", time);
    ASSERT_EQ(vibrig("allan nan.txt --tau0 0.25 --json"), 0) << error;
    const std::string expected = out;
    EXPECT_EQ(Json::parse(out)["missing"], 2);
    EXPECT_NE(out.find("the first is sample 51, longest gap 2"), std::string::npos) << out;
    for (const std::string name : {"blank.txt", "quoted.csv"}) {
        EXPECT_EQ(vibrig("allan " + name + " --tau0 0.25 --json"), 0) << error;
        EXPECT_EQ(out, expected) << name;
    }
    EXPECT_EQ(vibrig("allan empty.csv --column y --tau0 0.25 --json"), 0) << error;
    EXPECT_EQ(out, expected);
    EXPECT_EQ(vibrig("allan time.csv --column y --time t --json"), 0) << error;
    EXPECT_EQ(out, expected);
}

TEST_F(AllanCommand, FitNamesWhatIsNotDetected) {
    write_noise("white.txt", 20000, 0.06);
    ASSERT_EQ(vibrig("allan white.txt --tau0 1 --fit --json --plot plot.svg"), 0) << error;
    const Json fit = Json::parse(out)["fit"];
    EXPECT_NEAR(fit["N"]["value"], 0.001, 5e-5);
    EXPECT_TRUE(fit["Q"]["value"].is_null() || fit["Q"]["value"] < 0.02) << fit.dump();
    EXPECT_EQ(content("plot.svg").substr(0, 4), "<svg");
    // The same record in rad/s
    ASSERT_EQ(vibrig("allan white.txt --tau0 1 --fit --json --unit rad/s"), 0) << error;
    EXPECT_NEAR(Json::parse(out)["fit"]["N"]["value"], 0.001 * 206264.806, 11);
    ASSERT_EQ(vibrig("allan white.txt --tau0 1 --fit"), 0) << error;
    EXPECT_NE(out.find("not detected, below"), std::string::npos) << out;
}

TEST_F(AllanCommand, DynamicAlarmsMakeTheExitCodeOne) {
    write("louder.txt", noise(6000, 0.06) + noise(2000, 0.12));
    ASSERT_EQ(vibrig("allan louder.txt --tau0 1 --dynamic 500 --json --plot charts"), 1) << error;
    const Json dynamic = Json::parse(out)["dynamic"];
    EXPECT_EQ(dynamic["rows"].size(), 31U);
    EXPECT_EQ(dynamic["rows"][0]["alarms"].size(), 0U);
    EXPECT_GT(dynamic["rows"][30]["alarms"].size(), 0U);
    EXPECT_EQ(dynamic["summary"]["recomputation_faults"], 0);
    for (const char* name : {"deviation.svg", "surface.svg", "coefficients.svg"}) {
        EXPECT_TRUE(std::filesystem::exists(folder_ / "charts" / name)) << name;
    }
    EXPECT_EQ(vibrig("allan louder.txt --tau0 1 --dynamic 500"), 1);
    EXPECT_NE(out.find("alarm since"), std::string::npos);
}

TEST_F(AllanCommand, TheClassSumsOfTheClassicalModelArePrinted) {
    write_noise("white.txt", 2000, 1);
    const std::string command =
        "allan white.txt --tau0 1 --dynamic 500 --mean known-mean "
        "--known-mean 0 --reference 0,0.0167,0,0,0";
    ASSERT_LE(vibrig(command + " --json"), 1) << error;
    const Json dynamic = Json::parse(out)["dynamic"];
    const Json& classical = dynamic["summary"]["classical"];
    const Json& sums = classical["class_sums"];
    ASSERT_EQ(sums["slow"].size(), dynamic["taus"].size());
    EXPECT_TRUE(sums["a0_known"]);
    for (std::size_t k = 0; k < dynamic["taus"].size(); ++k) {
        const double tau = dynamic["taus"][k];
        const auto a = [&](const char* name) { return classical["a"][name].get<double>(); };
        EXPECT_NEAR(sums["slow"][k], a("a0") + a("a1") * tau + a("a2") * tau * tau, 1e-9);
        EXPECT_NEAR(sums["fast"][k], a("a3") / tau + a("a4") / tau / tau, 1e-9);
    }
    ASSERT_LE(vibrig(command), 1) << error;
    EXPECT_NE(out.find("class sums [(deg/h)^2], slow and fast: tau 1 s"), std::string::npos) << out;
}

TEST_F(AllanCommand, BadInputNamesFileLineAndValue) {
    write_noise("ok.txt", 100);
    write("word.txt", "1\n2\nthree\n4\n");
    write("inf.txt", "1\n2\ninf\n4\n");
    write("two.csv", "a,b\n1,2\n");
    write("short.csv", "a,b\n1,2\n3\n");
    write("empty.txt", "");
    write("stuck.txt", "5\n5\n5\n5\n5\n5\n5\n5\n5\n5\n");
    write("back.csv", "t,y\n0,1\n1,2\n0.5,3\n");
    write("uneven.csv", "t,y\n0,1\n1,2\n2.2,3\n3.2,4\n4.2,1\n5.2,1\n6.2,3\n7.2,1\n8.2,2\n9.2,3\n");
    write("broken.gz", std::string("\x1f\x8b\x08\x00\x00\x00\x00\x00\x00\x03\x33", 11));
    write("long.txt", std::string(200000, '1'));
    expect_refusal("allan none.txt --tau0 1", {"none.txt", "No such file"});
    expect_refusal("allan . --tau0 1", {"folder"});
    expect_refusal("allan word.txt --tau0 1",
                   {"word.txt:3", "\"three\"", "expected a finite number"});
    expect_refusal("allan inf.txt --tau0 1", {"inf.txt:3", "\"inf\""});
    expect_refusal("allan two.csv --tau0 1", {"two.csv:1", "a, b", "--column"});
    expect_refusal("allan two.csv --tau0 1 --column c", {"no column \"c\"", "a, b"});
    expect_refusal("allan short.csv --tau0 1 --column b", {"short.csv:3", "1 columns found"});
    expect_refusal("allan empty.txt --tau0 1", {"empty.txt", "no data"});
    expect_refusal("allan stuck.txt --tau0 1", {"stuck.txt", "variance is zero", "5"});
    expect_refusal("allan back.csv --column y --time t", {"back.csv", "0.5 s follows 1 s"});
    expect_refusal("allan uneven.csv --column y --time t", {"sample 3", "20 %", "1 %"});
    expect_refusal("allan broken.gz --tau0 1", {"broken.gz"});
    expect_refusal("allan long.txt --tau0 1", {"long.txt"});
    expect_refusal("allan ok.txt", {"--tau0"});
    expect_refusal("allan ok.txt --tau0 0", {"--tau0"});
    expect_refusal("allan ok.txt --tau0 nan", {"--tau0"});
    expect_refusal("allan ok.txt --tau0 1 --taus 1,x", {"--taus", "\"x\""});
    expect_refusal("allan ok.txt --tau0 1 --taus 1.5", {"1.5 s", "multiple"});
    expect_refusal("allan ok.txt --tau0 1 --taus 1,2,1", {"--taus: 1 s found twice"});
    expect_refusal("allan ok.txt --tau0 1 --taus 1,2,", {"--taus: \"\" found"});
    expect_refusal("allan ok.txt --tau0 1 --taus 60", {"60 s", "at most 50 s"});
    expect_refusal("allan ok.txt --tau0 1 --type avar", {"--type: ", "avar", "oadev"});
    expect_refusal("allan ok.txt --tau0 1 --unit mph", {"mph", "deg/h"});
    expect_refusal("allan ok.txt --tau0 1 --dynamic 500", {"500 samples", "100"});
    expect_refusal("allan ok.txt --tau0 1 --dynamic 5", {"at least 9"});
    write("large.txt", "1\n2\n1e308\n-1e308\n4\n5\n1\n2\n3\n4\n");
    expect_refusal("allan large.txt --tau0 1", {"large.txt: sample 3", "1e+308", "1e+60"});
    const std::string one = "allan ok.txt --tau0 1 ";
    expect_refusal(one + "--taus ''", {"--taus", "nothing", "octave"});
    expect_refusal(one + "--confidence nan", {"--confidence", "nan", "from 0.01 up to 0.9999"});
    for (const std::string tau0 : {"1e300", "1e-300", "inf", "-1"}) {
        expect_refusal("allan ok.txt --tau0 " + tau0, {"--tau0", tau0, "from 1e-09 up to 1e+09"});
    }
    const std::string window = one + "--dynamic 20 ";
    expect_refusal(window + "--overlap nan", {"--overlap", "nan"});
    expect_refusal(window + "--alpha nan", {"--alpha", "nan"});
    expect_refusal(window + "--reference 0,nan,0,0,0", {"--reference", "nan", "from 0 up to"});
    expect_refusal(window + "--reference 0,1,-1,0,0", {"--reference", "-1", "from 0 up to"});
    expect_refusal(window + "--reference 0,0,0,0,0", {"--reference", "five zeros"});
    expect_refusal(window + "--known-mean nan", {"--known-mean", "nan"});
    expect_refusal(window + "--mean known-mean", {"--mean", "without --known-mean"});
    expect_refusal(window + "--known-mean 3", {"--known-mean", "without --mean known-mean"});
    for (const char* const of_windows : {"--overlap 0.3", "--shape hann", "--mean corrected",
                                         "--alpha 0.1", "--reference 0,1,0,0,0"})
        expect_refusal(one + of_windows, {"--dynamic"});
    expect_refusal("allan ok.txt --tau0 1 --plot none/x.svg", {"none/x.svg"});
}

TEST_F(AllanCommand, ChartAndWordsSayTheSame) {
    // GIVEN white noise of .06 deg/h with random walks from none to one that rules
    for (const double step : {0.0, 4e-4, 2e-3, 1e-2}) {
        std::ostringstream text;
        const auto white = vibrig::test::white(4000, 0.06, 7);
        const auto steps = vibrig::test::white(4000, step > 0 ? step : 1, 8);
        double walk = 0;
        for (std::size_t i = 0; i < white.size(); ++i) {
            walk += step > 0 ? steps[i] : 0;
            text << white[i] + walk << '\n';
        }
        write("walk.txt", text.str());
        ASSERT_EQ(vibrig("allan walk.txt --tau0 1 --fit --json --plot plot.svg"), 0) << error;
        const Json result = Json::parse(out);
        const std::string chart = content("plot.svg");
        ASSERT_EQ(vibrig("allan walk.txt --tau0 1 --fit"), 0) << error;
        const Json& slow = result["slow_noise"];
        if (step == 0 || step > 1e-3) {
            EXPECT_EQ(slow["found"].get<bool>(), step > 0) << step << " " << slow;
        }
        // WHEN the verdict says something THEN table and chart do
        const auto verdict = slow["verdict"].get<std::string>();
        EXPECT_NE(out.find(verdict), std::string::npos) << out;
        EXPECT_NE(chart.find(verdict), std::string::npos) << verdict;
        const bool undetermined = slow["found"] && !slow["kind_determined"];
        EXPECT_EQ(chart.find(">slow noise<") != std::string::npos, undetermined) << slow;
        // AND a term has a line of its own where the words give it a value
        for (const auto& [name, term] : result["fit"].items()) {
            const bool detected = !term["value"].is_null();
            EXPECT_EQ(chart.find(">" + name + " = ") != std::string::npos, detected) << name;
            EXPECT_EQ(out.find("  " + name + "  not detected") == std::string::npos, detected)
                << name << "\n"
                << out;
        }
    }
}

TEST_F(AllanCommand, WindowsSayNothingOfWhatGapsLeaveNothingOf) {
    // GIVEN 24 windows, the 13th and 14th without any sample, the last with a gap each 20 s
    std::string text;
    std::size_t i = 0;
    for (const double y : vibrig::test::white(12000, 0.06, 42)) {
        const bool gone = (i >= 6000 && i < 7000) || (i >= 11500 && i % 20 == 0);
        text += gone ? "nan\n" : std::to_string(15 + y) + "\n";
        ++i;
    }
    write("holes.txt", text);
    const std::string options = " --tau0 1 --dynamic 500 --overlap 0";
    ASSERT_EQ(vibrig("allan holes.txt --json" + options), 1) << error;
    const Json dynamic = Json::parse(out)["dynamic"];
    const Json& rows = dynamic["rows"];
    ASSERT_EQ(rows.size(), 24U);
    // THEN nothing is there of nothing
    for (const std::size_t k : {12U, 13U}) {
        EXPECT_TRUE(rows[k]["mean"].is_null()) << rows[k]["mean"];
        EXPECT_TRUE(rows[k]["refused"]);
        for (const Json& dev : rows[k]["dev"]) EXPECT_TRUE(dev.is_null()) << dev;
    }
    // AND it is no alarm, nor a fault of the sums
    EXPECT_TRUE(rows[23]["dev"].back().is_null()) << rows[23]["dev"];
    EXPECT_GT(rows[23]["dev"][0], 0);
    EXPECT_FALSE(rows[23]["refused"]);
    for (const Json& row : rows) EXPECT_EQ(row["alarms"].size(), 0U) << row["alarms"];
    EXPECT_EQ(dynamic["summary"]["recomputation_faults"], 0);
    ASSERT_EQ(vibrig("allan holes.txt" + options), 1) << error;
    EXPECT_NE(out.find("                 -  refused: 500 samples missing"), std::string::npos)
        << out;
    EXPECT_EQ(out.find("nan"), std::string::npos) << out;
    ASSERT_EQ(vibrig("allan - --live" + options + " <holes.txt"), 1) << error;
    EXPECT_NE(out.find("6250 s  mean             - deg/h  refused"), std::string::npos) << out;
    ASSERT_EQ(vibrig("allan - --live --json" + options + " <holes.txt"), 1) << error;
    EXPECT_NE(out.find("\"refused\":true,\"dev\":[null"), std::string::npos) << out;
}

TEST_F(AllanCommand, LiveReadsWhatAFileMayHave) {
    // GIVEN a mark of the byte order, a name, comments, blanks, signs and what is missing
    std::string text = "\xEF\xBB\xBF# of gyro 1\n\n\"rate\"\r\n% still none\n";
    int i = 0;
    for (const double y : vibrig::test::white(1000, 0.06, 9)) {
        const char* const missing[] = {"nan", "NaN", "NAN", "NA", "null", ""};
        if (i % 100 == 50) text += std::string(missing[i / 100 % 6]) + '\n';
        text += (y > 0 ? "+" : "") + std::to_string(y) + "\r\n";
        text += i % 300 == 100 ? "# later\n" : "";
        ++i;
    }
    write("all.txt", text);
    const std::string options = " --tau0 1 --dynamic 500 --json";
    // THEN its windows are those of the file
    ASSERT_EQ(vibrig("allan all.txt" + options), 0) << error;
    const Json whole = Json::parse(out)["dynamic"]["rows"];
    ASSERT_EQ(vibrig("allan - --live" + options + " <all.txt"), 0) << error;
    std::istringstream lines(out);
    std::size_t rows = 0;
    for (std::string line; std::getline(lines, line); ++rows) {
        const Json row = Json::parse(line);
        for (const char* key : {"t", "mean", "missing", "dev", "fit", "alarms"})
            EXPECT_EQ(row[key], whole.at(rows)[key]) << key;
        EXPECT_NEAR(row["fit"]["N"]["value"], 0.001, 2e-4) << "as the text shows";
    }
    EXPECT_EQ(rows, whole.size());
    // AND what is neither is refused with its line
    write("two.txt", "time,rate\n1,2\n");
    expect_refusal("allan - --live" + options + " <two.txt", {"standard input:1", "'time,rate'"});
    write("word.txt", "rate\n1\nrate\n");
    expect_refusal("allan - --live" + options + " <word.txt", {"standard input:3", "'rate'"});
    write("broken.txt", "1.2.3\n1\n");
    expect_refusal("allan - --live" + options + " <broken.txt", {"standard input:1", "'1.2.3'"});
}

TEST_F(AllanCommand, LivePrintsWindowsAsTheyComplete) {
    write("louder.txt", noise(6000, 0.06) + noise(2000, 0.12));
    for (const std::string unit : {"", " --unit deg/s"}) {
        const std::string options = " --tau0 1 --dynamic 500 --json" + unit;
        ASSERT_EQ(vibrig("allan -" + options + " --live <louder.txt"), 1) << error;
        std::istringstream lines(out);
        std::vector<Json> rows;
        for (std::string line; std::getline(lines, line);) rows.push_back(Json::parse(line));
        // The same windows as from a file
        ASSERT_EQ(vibrig("allan louder.txt" + options), 1) << error;
        const Json whole = Json::parse(out)["dynamic"]["rows"];
        ASSERT_EQ(rows.size(), whole.size());
        for (std::size_t i = 0; i < rows.size(); ++i) {
            EXPECT_EQ(rows[i]["dev"], whole[i]["dev"]) << unit;
            EXPECT_EQ(rows[i]["mean"], whole[i]["mean"]) << unit;
            EXPECT_EQ(rows[i]["alarms"], whole[i]["alarms"]) << unit;
        }
    }
    EXPECT_EQ(vibrig("allan - --tau0 1 --dynamic 500 --live --shape hann <louder.txt"), 1);
    // As jq prints what a status does not have: a missing sample, not a wrong one
    write("absent.txt", noise(499, 0.06) + "null\n");
    EXPECT_EQ(vibrig("allan - --tau0 1 --dynamic 500 --live <absent.txt"), 0) << error;
    write("word.txt", "1\n2\nthree\n");
    expect_refusal("allan - --tau0 1 --dynamic 500 --live <word.txt",
                   {"standard input:3", "'three'", "expected a number"});
    expect_refusal("allan - --tau0 1 --dynamic 500 --live", {"0 samples came", "500"});
    expect_refusal("allan - --tau0 0.5 --dynamic 1e9 --live",
                   {"--dynamic: found 1e+09 s, 2e+09 samples", "at most 10000000"});
    expect_refusal("allan - --tau0 1 --dynamic 500 --live --confidence 0.9",
                   {"--live", "--confidence"});
    expect_refusal("allan word.txt --tau0 1 --dynamic 500 --live", {"--live", "standard input"});
    expect_refusal("allan - --tau0 1 --dynamic 500 --shape square --live", {"--shape", "square"});
    expect_refusal("allan - --tau0 1 --dynamic 500 --live --plot x.svg", {"x.svg", ".html"});
    expect_refusal("allan - --tau0 1 --dynamic 500 --live --plot no/x.html <louder.txt",
                   {"no/x.html"});
}

TEST_F(AllanCommand, LiveShowsTheSurfaceOnAPage) {
    // WHEN three windows have come
    write("quiet.txt", noise(1000, 0.06));
    ASSERT_EQ(vibrig("allan - --tau0 1 --dynamic 500 --live --plot live.html <quiet.txt"), 0)
        << error;
    // THEN there is a page with surface and coefficients, which loads itself again
    const std::string page = content("live.html");
    for (const char* part : {"http-equiv=\"refresh\"", "Dynamic Allan deviation", "</html>"})
        EXPECT_NE(page.find(part), std::string::npos) << part;
    std::size_t charts = 0;
    for (std::size_t at = page.find("<svg"); at != std::string::npos;
         at = page.find("<svg", at + 1))
        ++charts;
    EXPECT_EQ(charts, 2U);
}

TEST_F(AllanCommand, ReproducesThePublishedTable) {
    ASSERT_EQ(vibrig("reproduce allan --seeds 4 --json"), 0) << out << error;
    const Json table = Json::parse(out)["reproductions"][0];
    std::size_t compared = 0;
    for (const Json& row : table["rows"]) {
        compared += row["agrees"].is_boolean() ? 1U : 0U;
    }
    EXPECT_EQ(table["name"], "allan");
    EXPECT_EQ(compared, 7U * 5 + 1 + 5);
    EXPECT_EQ(vibrig("reproduce nothing"), 2);
}

}  // namespace
