#include <algorithm>

#include "tests/unit/daemon/tool/analysis/predict_fixture.hpp"

namespace vibrig::tool {
namespace {

using ::testing::HasSubstr;

/// A recording with other frequencies in its column, each by run.
std::string with_frequencies(const std::string& csv, const std::map<int, std::string>& of_run) {
    std::istringstream lines(csv);
    std::string line, out;
    std::size_t run = 0, hz = 0;
    while (std::getline(lines, line)) {
        std::vector<std::string> fields{""};
        for (const char c : line) {
            if (c == ',')
                fields.emplace_back();
            else
                fields.back().push_back(c);
        }
        const auto place = [&](const char* name) {
            return static_cast<std::size_t>(std::ranges::find(fields, name) - fields.begin());
        };
        if (out.empty()) {
            run = place("run");
            hz = place("frequency_hz");
        } else if (const auto set = of_run.find(std::stoi(fields.at(run))); set != of_run.end()) {
            fields.at(hz) = set->second;
        }
        for (std::size_t i = 0; i < fields.size(); ++i) out += (i > 0 ? "," : "") + fields[i];
        out += '\n';
    }
    return out;
}

TEST_F(Predict, ASetPointOfADwellAtRestIsRest) {
    ASSERT_EQ(plant("--truth truth.json --seed 5 --dwell 10 --table-g 6,0,6 --frequency 15,15,35 "
                    "-o zero.csv")
                  .exit_code,
              0);
    const Ended zero = run("identify zero.csv --json");
    ASSERT_NE(zero.exit_code, 2) << zero.error;
    // WHEN the table stood at 0 g with a frequency set, of the filter or another, or with none
    for (const char* hz : {"15", "35", "45", ""}) {
        SCOPED_TRACE(hz);
        write("set.csv", with_frequencies(content("zero.csv"), {{2, hz}}));
        const Ended set = run("identify set.csv --json");
        ASSERT_NE(set.exit_code, 2) << set.error;
        // THEN it is as if there were none, with a word about it
        PredictJson now = set.json();
        const std::string told = now["warnings"].dump();
        EXPECT_EQ(told.find("in 14 dwells in which nothing vibrates") != std::string::npos,
                  *hz != '\0')
            << told;
        now["warnings"] = zero.json()["warnings"];
        EXPECT_EQ(now, zero.json());
    }
    // But accelerometers that see a part alone may not have seen it.
    write("slow.toml", "[accelerometer]\nbandwidth_hz = 100.0\n");
    write("set.csv", with_frequencies(content("zero.csv"), {{2, "15"}}));
    const Ended slow = run("identify set.csv --config slow.toml");
    EXPECT_EQ(slow.exit_code, 2) << slow.out;
    EXPECT_THAT(slow.error, HasSubstr("found a dwell in which nothing vibrates, expected 15 Hz"));
    // And what vibrates is not at rest.
    write("none.csv", with_frequencies(content("zero.csv"), {{3, ""}}));
    EXPECT_THAT(run("identify none.csv").error, HasSubstr("found a dwell at rest that vibrates"));
}

TEST_F(Predict, SpectraNeedNotListAllDwells) {
    ASSERT_EQ(plant("--truth truth.json --seed 5 --dwell 10 --table-g 6,0 -o plain.csv").exit_code,
              0);
    const std::string all = spectra_of("[[15, 6]]");
    std::string with_rest = all.substr(0, all.size() - 1);
    for (int p = 1; p <= 14; ++p)
        with_rest += R"(, {"run": 2, "position": )" + std::to_string(p) + R"(, "lines": []})";
    write("spectra.json", with_rest + "]");
    const Ended listed = run("identify plain.csv --spectra spectra.json --json");
    ASSERT_NE(listed.exit_code, 2) << listed.error;
    // WHEN only one is listed, THEN the others have the configuration's frequency, or are at rest
    for (const std::string& spectra :
         {all, std::string(R"([{"run": 1, "position": 1, "lines": [[15, 6]]}])")}) {
        write("spectra.json", spectra);
        const Ended ended = run("identify plain.csv --spectra spectra.json --json");
        ASSERT_NE(ended.exit_code, 2) << ended.error;
        EXPECT_EQ(ended.json(), listed.json()) << spectra;
    }
}

/// Else the dwell that was meant has the configuration's frequency, without a word.
TEST_F(Predict, SpectraListDwellsThatTheRecordingHas) {
    ASSERT_EQ(plant("--truth truth.json --seed 5 --dwell 5 --table-g 6,0 -o plain.csv").exit_code,
              0);
    const auto refused = [&](const std::string& list, const std::string& with) {
        write("spectra.json", "[" + list + "]");
        const Ended ended = run("identify plain.csv --spectra spectra.json");
        EXPECT_EQ(ended.exit_code, 2) << list;
        EXPECT_THAT(ended.error, HasSubstr(with));
    };
    const std::string good = R"({"run": 1, "position": 1, "lines": [[15, 6]]}, )";
    refused(good + R"({"run": 1, "position": 15, "lines": [[15, 6]]})",
            "spectra.json: [1].run: found run 1, position 15, of which there is no dwell, expected "
            "one of plain.csv");
    refused(good + R"({"run": 3, "position": 1, "lines": [[15, 6]]})",
            "spectra.json: [1].run: found run 3, position 1, of which");
    refused(good + R"({"run": 1, "position": 2, "profile": "truck", "leveldb": -3})",
            "spectra.json: [1].leveldb: found an unknown key, expected a known one, perhaps "
            "level_db");
    // Of a recording that was cut short the plan's whole list will do: the dwells at 0 g stand in
    // none.
    std::string all;
    for (int position = 1; position <= 14; ++position)
        all +=
            R"({"run": 1, "position": )" + std::to_string(position) + R"(, "lines": [[15, 6]]}, )";
    const auto identified = [&](const std::string& more) {
        write("spectra.json", "[" + all + more + "]");
        return run("identify plain.csv --spectra spectra.json --json");
    };
    const Ended cut_short = identified(R"({"run": 3, "position": 1, "lines": [[15, 6]]})");
    ASSERT_NE(cut_short.exit_code, 2) << cut_short.error;
    EXPECT_EQ(cut_short.json(),
              identified(R"({"run": 1, "position": 15, "lines": [[15, 6]]})").json());
}

}  // namespace
}  // namespace vibrig::tool
