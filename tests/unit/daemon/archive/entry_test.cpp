#include "daemon/archive/entry.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <string>
#include <utility>

#include "tests/unit/daemon/archive/archived.hpp"

namespace vibrig::archive {
namespace {

/// D_IIx of a result with this beside its value, and this at its end.
Coefficient square_of(const std::string& beside, const std::string& end = "") {
    Entry entry;
    take_result(R"({"parameters":[{"value":1,"sigma":1,"at_hz":0},{},{},{},{"value":1,"sigma":1)" +
                    beside + "}]" + end + "}",
                15, entry);
    EXPECT_FALSE(entry.coefficients[0]->at_hz) << "a bias knows no frequency";
    return *entry.coefficients[4];
}

TEST(ArchiveEntry, TakesOfWhichVibrationAQuadraticCoefficientIs) {
    EXPECT_EQ(square_of("").at_hz, 15.0) << "the configuration's, of a campaign at one";
    EXPECT_EQ(square_of(R"(,"at_hz":25.5)", R"(,"spectrum":{})").at_hz, 25.5);
    EXPECT_EQ(square_of(R"(,"at_hz":0)", R"(,"spectrum":{})").at_hz, 0.0) << "static";
    EXPECT_EQ(square_of(R"(,"at_hz":null)", R"(,"spectrum":{})").at_hz, kAtNoFrequency);
    EXPECT_EQ(square_of("", R"(,"spectrum":{})").at_hz, kAtNoFrequency) << "an early result";
}

TEST(ArchiveEntry, WhatNeverShookIsStatic) {
    EXPECT_EQ(square_of("", R"(,"dwell_rates":[{"level":0},{"level":0.0}])").at_hz, 0.0);
    EXPECT_EQ(square_of("", R"(,"dwell_rates":[{"level":0},{"level":9.1}])").at_hz, 15.0);
    EXPECT_EQ(square_of("", R"(,"dwell_rates":[])").at_hz, 15.0) << "nobody says";
}

TEST(ArchiveEntry, WhatIsNoResultIsNamedInOurWords) {
    for (const auto& [result, words] :
         {std::pair{"[1]", "/result: found [1], expected the JSON of a result"},
          std::pair{"{}", "/result: expected a result of vibrigd: key 'parameters' not found"},
          std::pair{R"({"parameters":[],"verdict":{"word":[]}})",
                    "/result: expected a result of vibrigd: type must be string, but is array"}}) {
        Entry entry;
        try {
            take_result(result, 15, entry);
            ADD_FAILURE() << result;
        } catch (const ArchiveError& error) {
            EXPECT_STREQ(error.what(), words);
        }
    }
}

TEST_F(Archived, WhatLacksAPartOrItsResultIsRefused) {
    // GIVEN a campaign in three files
    std::filesystem::remove(folder_ / "campaign.h5");
    for (const int part : {1, 2, 3})
        write(head(part), part * 100 * record::kSecond, {part}, 1,
              part == 3 ? "finished" : record::kContinued);
    ASSERT_EQ(read_entry(folder_.string()).dwells, 3);
    const auto refused = [&](const std::string& words) {
        try {
            add();
            ADD_FAILURE() << words;
        } catch (const std::runtime_error& error) {
            EXPECT_NE(std::string(error.what()).find(words), std::string::npos) << error.what();
        }
    };
    // WHEN one of them is not there, it is not archived
    std::filesystem::rename(folder_ / "campaign-2.h5", recordings_ / "aside.h5");
    refused("missing campaign-2.h5");
    std::filesystem::rename(recordings_ / "aside.h5", folder_ / "campaign-2.h5");
    std::filesystem::remove(folder_ / "campaign-3.h5");
    refused("missing campaign-3.h5");
    // Nor one that ended without a result
    result_.clear();
    write(head(3), 300 * record::kSecond, {3}, 1);
    refused("campaign-3.h5: /result: found nothing");
}

}  // namespace
}  // namespace vibrig::archive
