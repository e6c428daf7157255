#include "daemon/archive/verify.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "daemon/journal/database.hpp"
#include "daemon/record/hdf5.hpp"
#include "daemon/record/index.hpp"
#include "tests/unit/daemon/archive/archived.hpp"

namespace vibrig::archive {
namespace {

using ::testing::AnyOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class Verify : public Archived {
  protected:
    [[nodiscard]] std::vector<std::string> found(bool quick = false) const {
        std::vector<std::string> texts;
        for (const auto& one : verify(place(), "", "", quick, {}).findings)
            texts.push_back(one.what + ": " + one.text);
        return texts;
    }
    void edit(const char* sql) const { journal::Database(place().index).execute(sql); }
};

TEST_F(Verify, WhatWasChangedInTheArchiveIsNotRegisteredAnew) {
    // GIVEN a campaign in the archive, of which somebody changes the result there
    add();
    const fs::path folder = lab() / "rig" / "test-1";
    {
        auto file = record::hdf5::File::open((folder / "campaign.h5").string(),
                                             record::hdf5::File::Mode::write);
        file.set("/", "state", "finisheD");  // of the same length
        file.close();
    }
    EXPECT_THAT(found(), Contains(AnyOf(HasSubstr("different"), HasSubstr("long, found"))));
    // WHEN the archive's own folder is added, as after the loss of its index
    const auto again = [&] { static_cast<void>(deliver(folder.string(), place(), "rig", {})); };
    try {
        again();
        ADD_FAILURE() << "registered";
    } catch (const Refused& error) {
        EXPECT_THAT(error.what(), HasSubstr("was damaged or changed in the archive"));
    }
    fs::remove(place().index);
    EXPECT_THROW(again(), Refused);
    // THEN it is not the genuine one; and the rig's own mends it
    add();
    EXPECT_THAT(found(), IsEmpty());
}

TEST_F(Verify, ComparesTheIndexWithWhatTheRecordingsSay) {
    add();
    EXPECT_THAT(found(), IsEmpty());
    const std::string file = place().index, folder = (lab() / "rig" / "test-1").string();
    // WHEN somebody edits one value of the index, THEN file, column and both values are named
    const auto differs = [&](const char* edit_it, const std::string& words) {
        edit(edit_it);
        EXPECT_THAT(found(), Contains("index differs: " + file + ": " + words + " of " + folder))
            << edit_it;
        EXPECT_THAT(found(true), IsEmpty()) << "of lengths alone";
        static_cast<void>(deliver(folder, place(), "rig", {}));  // mends it
        EXPECT_THAT(found(), IsEmpty()) << edit_it;
    };
    differs("UPDATE coefficient SET value = 3 WHERE position = 0",
            "coefficient.value of D_Fx of rig/test-1: found \"3\", expected \"2.5\"");
    differs("DELETE FROM coefficient WHERE position = 1",
            std::string("coefficient.expanded of ") + estimator::parameter_names()[1] +
                " of rig/test-1: found nothing, expected \"0.4\"");
    differs("UPDATE coefficient SET at_hz = 15 WHERE position = 4",
            "coefficient.at_hz of D_IIx of rig/test-1: found \"15\", expected \"25\"");
    differs("UPDATE result SET verdict = 'doubtful'",
            "result.verdict of rig/test-1: found \"doubtful\", expected \"valid\"");
    differs("UPDATE result SET unit_serial = '0018'",
            "result.unit_serial of rig/test-1: found \"0018\", expected \"0017\"");
    differs("UPDATE campaign SET started_utc_ns = started_utc_ns + 1",
            "campaign.started_utc_ns of rig/test-1: found \"1700001000000000001\", expected "
            "\"1700001000000000000\"");
}

TEST_F(Verify, FindsNothingWrongWithARigsOwnRecordings) {
    // GIVEN a rig's own index: the recorder's, which has no dwells.csv, and results noted by a list
    std::ofstream(folder_ / "dwells.csv") << "run,position\n";
    record::Index(recordings_.string(), [](const std::string&) {
    }).note_file((folder_ / "campaign.h5").string());
    const Place own{recordings_.string(), index_in(recordings_.string())};
    {
        Index index(own.index, Database::Mode::write);
        read_results(index, own.folder, "rig",
                     [](const std::string& words) { ADD_FAILURE() << words; }, {});
    }
    const auto words = [&own] {
        std::string all;
        for (const auto& one : verify(own, "", "", false, {}).findings) all += one.text + '\n';
        return all;
    };
    EXPECT_EQ(words(), "");
    // WHEN a file that it does not have is changed, THEN it is no longer what was listed
    std::ofstream(folder_ / "dwells.csv") << "run,position,other\n";
    EXPECT_THAT(words(), HasSubstr("result.hash of test-1"));
}

TEST_F(Verify, NamesACampaignThatCountsNowhereThoughNothingWentOnFromIt) {
    add();
    edit("UPDATE result SET superseded = 1");
    const std::string words =
        "index differs: " + place().index + ": result.superseded of rig/test-1: ";
    EXPECT_THAT(found(true), ElementsAre(words + "found 1, expected 0: no later delivery of the "
                                                 "campaign is in the index"));
    static_cast<void>(deliver((lab() / "rig" / "test-1").string(), place(), "rig", {}));
    EXPECT_THAT(found(), IsEmpty());
}

TEST_F(Verify, SaysOnceOfWhichCampaignTheVibrationIsNotNoted) {
    add();
    edit("UPDATE coefficient SET at_hz = NULL");
    const std::string folder = (lab() / "rig" / "test-1").string();
    EXPECT_THAT(found(), ElementsAre("not in the index: of which vibration its quadratic "
                                     "coefficients are is not noted: vibrig archive add " +
                                     folder));
    EXPECT_THAT(found(true), IsEmpty()) << "of lengths alone";
    // What the finding says to do notes it.
    static_cast<void>(deliver(folder, place(), "rig", {}));
    EXPECT_THAT(found(), IsEmpty());
}

}  // namespace
}  // namespace vibrig::archive
