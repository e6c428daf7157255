#include "proto/recording_csv.hpp"
#include "tests/unit/support/temporary_folder.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <random>

namespace vibrig::proto {
namespace {

constexpr const char* kHeader = "time_s,run,position,alpha_deg,beta_deg,gamma_deg,ax_g,ay_g,az_g\n";

std::vector<RecordingRow> read_recording(const std::string& path) {
    RecordingReader reader(path);
    std::vector<RecordingRow> rows;
    for (RecordingRow row; reader.next(row);) rows.push_back(row);
    EXPECT_EQ(reader.bytes(), std::filesystem::file_size(path));
    return rows;
}

class Recording : public testing::Test {
  protected:
    [[nodiscard]] std::string path() const { return (folder_ / "recording.csv").string(); }
    [[nodiscard]] std::string write(const std::string& text) const {
        std::ofstream(path(), std::ios::binary) << text;
        return path();
    }
    [[nodiscard]] std::vector<RecordingRow> read(const std::string& text) const {
        return read_recording(write(text));
    }
    /// The error without the path in front.
    [[nodiscard]] std::string error(const std::string& text) const {
        try {
            (void)read_recording(write(text));
        } catch (const RecordingError& failure) {
            const std::string what = failure.what();
            EXPECT_TRUE(what.starts_with(path())) << what;
            return what.substr(std::min(path().size(), what.size()));
        }
        return "no error";
    }
    [[nodiscard]] std::string row_error(const std::string& row) const {
        return error(std::string(kHeader) + "0,1,1,0,0,0,0,0,0\n" + row + "\n");
    }

  private:
    TemporaryFolder folder_;
};

TEST_F(Recording, ProfilesOfRandomDwellsByNameOrNumber) {
    std::string header = kHeader;
    header.back() = ',';
    header += "profile,level_db\n";
    const std::string text = header +
                             "0,1,1,0,0,0,0,1,0,road,-3.5\n"
                             "0,1,2,0,0,0,0,1,0,0,\n"
                             "0,1,3,0,0,0,0,1,0,,\n"
                             "0,1,4,0,0,0,0,1,0,7,0\n"
                             "0,1,5,0,0,0,0,1,0,\"road\",0\n";
    RecordingReader reader(write(text));
    EXPECT_TRUE(reader.has_profile());
    EXPECT_FALSE(reader.has_frequency());
    std::vector<RecordingRow> rows;
    for (RecordingRow row; reader.next(row);) rows.push_back(row);
    ASSERT_EQ(rows.size(), 5U);
    EXPECT_EQ(reader.profiles(), (std::vector<std::string>{"road", "7"}));
    std::vector<int> places;
    for (const auto& row : rows) places.push_back(row.profile);
    EXPECT_EQ(places, (std::vector{1, 0, 0, 2, 1}));
    EXPECT_EQ(rows[0].level_db, -3.5);
    EXPECT_EQ(rows[1].level_db, 0);
    EXPECT_FALSE(
        RecordingReader(write(std::string(kHeader) + "0,1,1,0,0,0,0,1,0\n")).has_profile());
    EXPECT_EQ(error(header + "0,1,1,0,0,0,0,1,0,road,loud\n"),
              ":2: column level_db: found 'loud', expected a finite number");
}

TEST_F(Recording, ProfilesAndRolesAreGivenBackAfterWriting) {
    std::vector<RecordingRow> rows(3);
    for (std::size_t i = 0; i < rows.size(); ++i) {
        rows[i].run = 1;
        rows[i].position = static_cast<int>(i) + 1;
        rows[i].frequency_hz = 0;
    }
    rows[0].frequency_hz = 15;
    rows[1].profile = 2;
    rows[1].level_db = -1.5;
    rows[2].profile = 1;
    rows[2].held_out = true;
    const std::vector<std::string> names{"road, wet", "broad"};
    for (const bool simulated : {false, true}) {
        write_recording(path(), rows, simulated, names);
        RecordingReader reader(path());
        EXPECT_EQ(reader.simulated(), simulated);
        EXPECT_TRUE(reader.has_profile() && reader.has_frequency());
        for (const RecordingRow& was : rows) {
            RecordingRow row;
            ASSERT_TRUE(reader.next(row));
            EXPECT_EQ(row.frequency_hz, was.frequency_hz);
            EXPECT_EQ(row.level_db, was.level_db);
            EXPECT_EQ(row.held_out, was.held_out);
            EXPECT_EQ(row.profile > 0, was.profile > 0);
            if (row.profile == 0) continue;
            EXPECT_EQ(reader.profiles().at(row.profile - 1U), names.at(was.profile - 1U));
        }
    }
}

TEST_F(Recording, GivesRowsInOrderWithTheirLines) {
    const auto rows =
        read(std::string(kHeader) + "0.025,1,2,10,20,30,0.1,-1,2e-3\n\n0.05,1,2,1,2,3,4,5,6");
    ASSERT_EQ(rows.size(), 2U);
    EXPECT_EQ(rows[0].time_s, 0.025);
    EXPECT_EQ(rows[0].run, 1);
    EXPECT_EQ(rows[0].position, 2);
    EXPECT_EQ(rows[0].angle_deg, (std::array<double, 3>{10, 20, 30}));
    EXPECT_EQ(rows[0].force_g, (std::array<double, 3>{0.1, -1, 2e-3}));
    EXPECT_EQ(rows[0].line, 2U);
    EXPECT_EQ(rows[1].line, 4U);
}

TEST_F(Recording, ToleratesAnyOrderExtraColumnsMarkQuotesBlanksAndCrLf) {
    const auto rows = read(
        "\xef\xbb\xbf\"az_g\", note ,ay_g,ax_g,gamma_deg,beta_deg,alpha_deg,position,run,time_s\r\n"
        " 1.5 ,\"warm, \"\"humming\"\"\",\"2\",3,4,5,6,7.0,8,+9\r\n");
    ASSERT_EQ(rows.size(), 1U);
    EXPECT_EQ(rows[0].force_g, (std::array<double, 3>{3, 2, 1.5}));
    EXPECT_EQ(rows[0].angle_deg, (std::array<double, 3>{6, 5, 4}));
    EXPECT_EQ(rows[0].position, 7);
    EXPECT_EQ(rows[0].run, 8);
    EXPECT_EQ(rows[0].time_s, 9);
}

TEST_F(Recording, IsGivenBackExactlyAfterWriting) {
    // GIVEN rows of arbitrary doubles
    const unsigned seed = 20260117;
    SCOPED_TRACE(testing::Message() << "seed " << seed);
    std::mt19937_64 random(seed);
    std::uniform_real_distribution<double> angle(-360, 360);
    std::uniform_real_distribution<double> force(-10, 10);
    std::vector<RecordingRow> rows(3000);
    for (std::size_t i = 0; i < rows.size(); ++i) {
        rows[i].time_s = static_cast<double>(i) / 40;
        rows[i].run = 1 + static_cast<int>(i / 1500);
        rows[i].position = 1 + static_cast<int>(i / 100 % 14);
        for (double& a : rows[i].angle_deg) a = angle(random);
        for (double& f : rows[i].force_g) f = force(random);
    }
    // WHEN they are written and read
    write_recording(path(), rows);
    EXPECT_FALSE(RecordingReader(path()).simulated());
    const auto plain = read_recording(path());
    ASSERT_EQ(plain.size(), rows.size());
    // WHEN they are a simulated rig's, which each row says
    write_recording(path(), rows, true);
    EXPECT_TRUE(RecordingReader(path()).simulated());
    const auto back = read_recording(path());
    // THEN no bit has changed
    ASSERT_EQ(back.size(), rows.size());
    for (std::size_t i = 0; i < rows.size(); ++i) {
        ASSERT_EQ(back[i].time_s, rows[i].time_s);
        ASSERT_EQ(back[i].run, rows[i].run);
        ASSERT_EQ(back[i].position, rows[i].position);
        ASSERT_EQ(back[i].angle_deg, rows[i].angle_deg);
        ASSERT_EQ(back[i].force_g, rows[i].force_g);
        ASSERT_EQ(back[i].line, i + 2);
    }
}

TEST_F(Recording, HasAFrequencyWhereItsRowsHaveOne) {
    std::vector<RecordingRow> rows(300);
    for (std::size_t i = 0; i < rows.size(); ++i) {
        rows[i].run = rows[i].position = 1;
        rows[i].time_s = static_cast<double>(i) / 40;
        rows[i].frequency_hz = 20 + 0.1 * static_cast<double>(i);
    }
    for (const bool simulated : {false, true}) {
        write_recording(path(), rows, simulated);
        EXPECT_TRUE(RecordingReader(path()).has_frequency());
        const auto back = read_recording(path());
        ASSERT_EQ(back.size(), rows.size());
        for (std::size_t i = 0; i < rows.size(); ++i)
            ASSERT_EQ(back[i].frequency_hz, rows[i].frequency_hz);
    }
    for (RecordingRow& row : rows) row.frequency_hz = -1;
    write_recording(path(), rows);
    EXPECT_FALSE(RecordingReader(path()).has_frequency());
}

TEST_F(Recording, ThatIsNotThereIsNamed) {
    try {
        (void)read_recording(path());
        FAIL() << "no error";
    } catch (const RecordingError& failure) {
        EXPECT_EQ(failure.what(), path() + ": cannot be opened: No such file or directory");
    }
    EXPECT_THROW((void)read_recording("/"), RecordingError);
}

TEST_F(Recording, ThatCannotBeWrittenIsNamed) {
    EXPECT_THROW(write_recording(path() + "/no/such/folder", {}), RecordingError);
    if (std::filesystem::exists("/dev/full")) {
        const std::vector<RecordingRow> rows(3);
        EXPECT_THROW(write_recording("/dev/full", rows), RecordingError);
    }
}

TEST_F(Recording, WithoutRowsIsRefused) {
    EXPECT_EQ(error(""), ": found an empty file, expected a header row");
    EXPECT_EQ(error(kHeader), ": found no row after the header, expected samples");
}

TEST_F(Recording, NamesAllMissingColumns) {
    EXPECT_EQ(error("time_s,run,alpha_deg,beta_deg,gamma_deg,ax_g,ay\n1,1,1,1,1,1,1\n"),
              ":1: found the header 'time_s,run,alpha_deg,beta_deg,gamma_deg,...', expected also "
              "the column(s) position, ay_g, az_g");
}

TEST_F(Recording, RefusesAColumnGivenTwice) {
    EXPECT_EQ(error("time_s,run,run,position\n"),
              ":1: column run: found twice in the header, expected once");
}

TEST_F(Recording, RefusesRowsWithTooFewOrTooManyFields) {
    EXPECT_EQ(row_error("1,1,1,0,0,0,0,0"), ":3: found 8 fields, expected 9 as in the header");
    EXPECT_EQ(row_error("1,1,1,0,0,0,0,0,0,5"), ":3: found 10 fields, expected 9 as in the header");
    EXPECT_EQ(read(std::string(kHeader) + "1,1,1,0,0,0,0,0,0,\n").size(), 1U);
}

TEST_F(Recording, NamesLineColumnAndValueOfWhatIsNoNumber) {
    EXPECT_EQ(row_error("1,1,1,0,0,0,0,0,abc"),
              ":3: column az_g: found 'abc', expected a finite number");
    EXPECT_EQ(row_error("1,1,1,0,0,0,0,nan,0"),
              ":3: column ay_g: found 'nan', expected a finite number");
    EXPECT_EQ(row_error("inf,1,1,0,0,0,0,0,0"),
              ":3: column time_s: found 'inf', expected a finite number");
    EXPECT_EQ(row_error("1,1,1,,0,0,0,0,0"),
              ":3: column alpha_deg: found nothing, expected a finite number");
    EXPECT_EQ(row_error("1,1,1,0,1e999,0,0,0,0"),
              ":3: column beta_deg: found '1e999', expected a finite number");
    EXPECT_EQ(row_error("1,1,1,0,0,1.5x,0,0,0"),
              ":3: column gamma_deg: found '1.5x', expected a finite number");
    EXPECT_EQ(row_error("1,1,1,0,0,+-1,0,0,0"),
              ":3: column gamma_deg: found '+-1', expected a finite number");
}

TEST_F(Recording, RefusesAbsurdValues) {
    EXPECT_EQ(row_error("1,1,1,10001,0,0,0,0,0"),
              ":3: column alpha_deg: found '10001', expected at most 10000 deg either way");
    EXPECT_EQ(row_error("1,1,1,0,0,0,0,0,-1001"),
              ":3: column az_g: found '-1001', expected at most 1000 g either way");
}

TEST_F(Recording, RefusesRunsAndPositionsThatAreNoPositiveIntegers) {
    for (const std::string value : {"0", "-1", "1.5", "x", "", "3000000000", "nan", "1e300"}) {
        const std::string found = value.empty() ? "nothing" : "'" + value + "'";
        EXPECT_EQ(row_error("1," + value + ",1,0,0,0,0,0,0"),
                  ":3: column run: found " + found + ", expected a whole number from 1");
        EXPECT_EQ(row_error("1,1," + value + ",0,0,0,0,0,0"),
                  ":3: column position: found " + found + ", expected a whole number from 1");
    }
}

TEST_F(Recording, RefusesTimeThatDoesNotGrowWithinADwell) {
    const std::string expected = ", expected more than 0, the time before it in run 1, position 1";
    EXPECT_EQ(row_error("0,1,1,0,0,0,0,0,0"), ":3: column time_s: found '0'" + expected);
    EXPECT_EQ(row_error("-5,1,1,0,0,0,0,0,0"), ":3: column time_s: found '-5'" + expected);
}

TEST_F(Recording, MayStartTimeAnewInANewDwell) {
    EXPECT_EQ(
        read(std::string(kHeader) + "5,1,1,0,0,0,0,0,0\n0,1,2,0,0,0,0,0,0\n0,2,1,0,0,0,0,0,0\n")
            .size(),
        3U);
}

TEST_F(Recording, BeginsANewDwellWhereAPairComesBack) {
    const std::string text = std::string(kHeader) + "5,1,1,0,0,0,0,0,0\n6,1,2,0,0,0,0,0,0\n";
    EXPECT_EQ(read(text + "7,1,1,0,0,0,0,0,0\n").size(), 3U);
    EXPECT_EQ(read(text + "4,1,1,0,0,0,0,0,0\n").size(), 3U);
}

TEST_F(Recording, RefusesADwellThatIsThereTwice) {
    // GIVEN two dwells of 100 rows, the second with times that begin anew
    const auto dwell = [](int position, double noise, std::size_t rows, double from_s = 0) {
        std::string text;
        for (std::size_t i = 0; i < rows; ++i)
            text += std::to_string(from_s + 0.025 * static_cast<double>(i)) + ",1," +
                    std::to_string(position) + ",0,0,0," +
                    std::to_string(noise * std::sin(static_cast<double>(i))) + ",1,0\n";
        return text;
    };
    const std::string two = kHeader + dwell(1, 0.1, 100) + dwell(2, 0.2, 100);
    EXPECT_EQ(read(two).size(), 200U);
    // WHEN the first comes again, cut short, or under another position, THEN both are named
    EXPECT_EQ(error(two + dwell(1, 0.1, 60)),
              ":202: found run 1, position 1 with the samples of the dwell of line 2, "
              "expected each dwell once");
    EXPECT_EQ(error(two + dwell(3, 0.2, 100)),
              ":202: found run 1, position 3 with the samples of the dwell of line 102, "
              "expected each dwell once");
    // Moved in time it is one all the same.
    EXPECT_EQ(error(two + dwell(3, 0.2, 100, 1e4)),
              ":202: found run 1, position 3 with the samples of the dwell of line 102, expected "
              "each dwell once");
    // Other noise at the same times is another dwell.
    EXPECT_EQ(read(two + dwell(1, 0.11, 100)).size(), 300U);
    // Of instruments too coarse for their noise one dwell is like another, whatever was measured.
    const std::string coarse = dwell(1, 0, 100);
    EXPECT_EQ(read(kHeader + coarse + dwell(2, 0.2, 100) + coarse).size(), 300U);
}

TEST_F(Recording, RefusesADwellThatWasCutOutOnceMoreAtAnotherRow) {
    // GIVEN dwells of 15 s each, with noise of their own
    const auto dwell = [](int position, unsigned seed, int from, int to) {
        std::mt19937 random(seed);
        std::normal_distribution<double> noise(0, 1e-3);
        std::string text;
        for (int i = 0; i < to; ++i) {
            const double x = noise(random);
            if (i >= from)
                text += std::to_string(0.025 * i) + ",1," + std::to_string(position) + ",0,0,0," +
                        std::to_string(x) + ",1,0\n";
        }
        return text;
    };
    std::string all = kHeader;
    for (int p = 1; p <= 20; ++p) all += dwell(p, static_cast<unsigned>(p), 0, 600);
    EXPECT_EQ(read(all).size(), 12'000U);
    int found = 0;
    for (int p = 1; p <= 20; ++p) {
        const std::string what = error(all + dwell(20 + p, static_cast<unsigned>(p), p, 600 - p));
        found += what.find("with the samples of the dwell of line " +
                           std::to_string(2 + 600 * (p - 1))) != std::string::npos
                     ? 1
                     : 0;
    }
    // One row in 64 tells: of 540 or more no one does once in 4000 dwells.
    EXPECT_GE(found, 19);
}

TEST_F(Recording, KnowsTwoRolesAndOneForADwell) {
    const std::string header =
        "time_s,run,position,alpha_deg,beta_deg,gamma_deg,ax_g,ay_g,az_g,role\n";
    const auto rows = read(header +
                           "0,1,1,0,0,0,0,1,0,\n0,1,2,0,0,0,0,1,0,Verify\n"
                           "0,1,3,0,0,0,0,1,0,identify\n");
    ASSERT_EQ(rows.size(), 3U);
    EXPECT_FALSE(rows[0].held_out);
    EXPECT_TRUE(rows[1].held_out);
    EXPECT_FALSE(rows[2].held_out);
    EXPECT_EQ(error(header + "0,1,1,0,0,0,0,1,0,verfy\n"),
              ":2: column role: found 'verfy', expected \"identify\" or \"verify\"");
    EXPECT_EQ(error(header + "0,1,1,0,0,0,0,1,0,verify\n1,1,1,0,0,0,0,1,0,identify\n"),
              ":3: column role: found another role within run 1, position 1, expected one for all "
              "of a dwell");
}

TEST_F(Recording, IgnoresARoleThatIsSomebodyElses) {
    const std::string header =
        "time_s,run,position,alpha_deg,beta_deg,gamma_deg,ax_g,ay_g,az_g,role";
    const auto rows = read(header +
                           "\n0,1,1,0,0,0,0,1,0,operator\n1,1,1,0,0,0,0,1,0,observer\n"
                           "0,1,2,0,0,0,0,1,0,\n");
    ASSERT_EQ(rows.size(), 3U);
    for (const RecordingRow& row : rows) EXPECT_FALSE(row.held_out);
    // Beside a word that is known, whichever comes first, it is one that is wrong.
    const std::string refusal =
        ": column role: found 'operator', expected \"identify\" or "
        "\"verify\"";
    EXPECT_EQ(error(header + "\n0,1,1,0,0,0,0,1,0,operator\n0,1,2,0,0,0,0,1,0,\n"
                             "0,1,3,0,0,0,0,1,0,verify\n"),
              ":2" + refusal);
    EXPECT_EQ(error(header + "\n0,1,1,0,0,0,0,1,0,identify\n0,1,2,0,0,0,0,1,0,operator\n"),
              ":3" + refusal);
    // The file says what shook: then it has this column, too.
    EXPECT_EQ(error(header + ",frequency_hz\n0,1,1,0,0,0,0,1,0,operator,15\n"), ":2" + refusal);
    EXPECT_EQ(error(header + ",profile\n0,1,1,0,0,0,0,1,0,operator,road\n"), ":2" + refusal);
}

TEST_F(Recording, IgnoresALevelWithoutAProfile) {
    const auto rows = read(
        "time_s,run,position,alpha_deg,beta_deg,gamma_deg,ax_g,ay_g,az_g,level_db\n"
        "0,1,1,0,0,0,0,1,0,loud\n1,1,1,0,0,0,0,1,0,-3\n");
    ASSERT_EQ(rows.size(), 2U);
    EXPECT_EQ(rows[1].level_db, 0);
}

TEST_F(Recording, AtRestMayHaveAnEmptyFrequency) {
    const auto rows = read(
        "time_s,run,position,alpha_deg,beta_deg,gamma_deg,ax_g,ay_g,az_g,frequency_hz\n"
        "0,1,1,0,0,0,0,1,0,15\n0,1,2,0,0,0,0,1,0,\n0,1,3,0,0,0,0,1,0,0\n");
    ASSERT_EQ(rows.size(), 3U);
    EXPECT_EQ(rows[0].frequency_hz, 15);
    EXPECT_EQ(rows[1].frequency_hz, 0);
    EXPECT_EQ(rows[2].frequency_hz, 0);
}

TEST_F(Recording, ReadsOtherSeparatorsAndDecimalCommasWhereTheyAreUnambiguous) {
    const std::string header = "Time_s;run;position;alpha_deg;beta_deg;gamma_deg;ax_g;ay_g;az_g\n";
    const auto rows = read("# written by a spreadsheet\n" + header + "0,5;1;2;10,25;0;-3;0;1;0\n");
    ASSERT_EQ(rows.size(), 1U);
    EXPECT_EQ(rows[0].time_s, 0.5);
    EXPECT_EQ(rows[0].angle_deg, (std::array<double, 3>{10.25, 0, -3}));
    EXPECT_EQ(rows[0].line, 3U);
    std::string tabs = header + "0.5;1;2;10.25;0;-3;0;1;0\n";
    std::replace(tabs.begin(), tabs.end(), ';', '\t');
    EXPECT_EQ(read(tabs)[0].angle_deg, rows[0].angle_deg);
}

TEST_F(Recording, NamesDecimalCommasAmongCommasAndLinesThatEndInACarriageReturn) {
    EXPECT_EQ(row_error("0,5,1,2,10,25,0,0,-3,0,0,0,1,0,0,0"),
              ":3: found 16 fields, expected 9 as in the header (decimal commas want ';' or a tab "
              "between the fields)");
    const std::string row = "0,1,1,0,0,0,0,0,0\n";
    std::string many = std::string(kHeader);
    while (many.size() < std::size_t{3} << 20) many += row;
    for (std::string text : {kHeader + row, std::string("# a comment\n") + kHeader + row, many}) {
        std::replace(text.begin(), text.end(), '\n', '\r');
        EXPECT_EQ(error(text),
                  ":1: found lines that end in a carriage return only, expected LF or CR LF");
    }
}

TEST_F(Recording, RefusesWhatIsNoText) {
    EXPECT_EQ(error("\x1f\x8b\x08packed\rlines\n"),
              ":1: found a file packed by gzip, expected text in UTF-8");
    EXPECT_EQ(row_error(std::string("1,1,1,0,0,0,0,0,\0", 17)),
              ":3: found a NUL byte, expected text in UTF-8");
    EXPECT_EQ(row_error(std::string((std::size_t{1} << 20) + 1, '1')),
              ":3: found a line of more than 1048576 bytes, expected a shorter one");
    EXPECT_EQ(row_error(std::string(std::size_t{5} << 20, '1')),
              ":3: found a line of more than 1048576 bytes, expected a shorter one");
    EXPECT_EQ(row_error("\"1,1,1,0,0,0,0,0,0"),
              ":3: found an opening quote only, expected a closing one on the same line");
    EXPECT_EQ(row_error("\"1\"2,1,1,0,0,0,0,0,0"),
              ":3: found '2,1,1,0,0,0,0,0,0' after a closing quote, expected ','");
    EXPECT_EQ(row_error("1,1,1,0,0,0,0,0,\xff\x1b[2J"),
              ":3: column az_g: found '\\xff\\x1b[2J', expected a finite number");
}

TEST_F(Recording, WithoutAnEndIsToldAndRefusedWhereItIsCut) {
    const auto warning = [&](const std::string& text) {
        RecordingReader reader(write(text));
        for (RecordingRow row; reader.next(row);) continue;
        return reader.warning();
    };
    const std::string whole = std::string(kHeader) + "0,1,1,0,0,0,0,0,0.01234\n";
    EXPECT_EQ(warning(whole), "");
    EXPECT_EQ(warning(whole.substr(0, whole.size() - 4)),
              path() +
                  ":2: found no end of line behind '0.01', expected one: the file may have "
                  "been cut, within this field even");
    EXPECT_EQ(error(whole + "1,1,1,0,0"),
              ":3: found 5 fields and no end of line, expected 9: the file was cut");
    // Of rest `frequency_hz` may be empty, where the line ends.
    const std::string sine =
        std::string(kHeader).substr(0, std::string(kHeader).size() - 1) + ",frequency_hz\n";
    EXPECT_EQ(warning(sine + "0,1,1,0,0,0,0,0,0,\n"), "");
    EXPECT_EQ(error(sine + "0,1,1,0,0,0,0,0,0,"),
              ":2: found nothing in the last field and no end of line, expected both: the file "
              "was cut");
    EXPECT_NE(warning(sine + "0,1,1,0,0,0,0,0,0,1"), "") << "of 15 Hz";
}

TEST_F(Recording, RefusesWhatIsHardlyAnythingButAMisspeltColumn) {
    const auto named = [&](const std::string& name) {
        const std::string header = kHeader;
        return error(header.substr(0, header.size() - 1) + ',' + name + "\n0,1,1,0,0,0,0,0,0,15\n");
    };
    EXPECT_EQ(named("Freqency_Hz"),
              ":1: column Freqency_Hz: found an unknown name, perhaps for frequency_hz, expected "
              "one of time_s, run, position, alpha_deg, beta_deg, gamma_deg, ax_g, ay_g, az_g, "
              "frequency_hz, profile, level_db, role, simulated, or one that is unlike them");
    EXPECT_NE(named("simulatd"), "no error");
    for (const char* const other : {"roll", "level_dB", "note", " FREQUENCY_HZ ", "temperature_c"})
        EXPECT_EQ(named(other), "no error") << other;
}

TEST_F(Recording, ReadsLinesAcrossItsBufferUnchanged) {
    // GIVEN more text than the reader holds at a time, in lines that its buffer's end cuts
    std::string text = kHeader;
    std::size_t count = 0;
    while (text.size() < (std::size_t{5} << 20)) {
        text += std::to_string(count) + ",1,1,1,2,3,0.1,0.2,0.3\n";
        ++count;
    }
    // WHEN it is read THEN every row is there in order
    const auto rows = read(text);
    ASSERT_EQ(rows.size(), count);
    for (std::size_t i = 0; i < count; ++i) ASSERT_EQ(rows[i].time_s, static_cast<double>(i));
}

}  // namespace
}  // namespace vibrig::proto
