#include "daemon/archive/vibration.hpp"

#include <gtest/gtest.h>

#include <filesystem>

#include "daemon/journal/database.hpp"
#include "tests/unit/daemon/archive/archived.hpp"

namespace vibrig::archive {
namespace {

namespace fs = std::filesystem;

TEST(Vibration, IsTheSameWithinTwoPercentAsForTheCoefficientsOfACampaign) {
    EXPECT_TRUE(same_vibration(15.29, 15.0));
    EXPECT_TRUE(same_vibration(14.71, 15.0));
    EXPECT_FALSE(same_vibration(15.31, 15.0));
    EXPECT_FALSE(same_vibration(14.69, 15.0));
    EXPECT_TRUE(same_vibration(0.0, 0.0));
    EXPECT_FALSE(same_vibration(0.0, kAtNoFrequency));
    EXPECT_FALSE(same_vibration(kAtNoFrequency, kAtNoFrequency))
        << "each is of the shares in its own campaign";
    const std::optional<double> not_noted;
    EXPECT_TRUE(same_vibration(not_noted, not_noted));
    EXPECT_FALSE(same_vibration(not_noted, 0.0));
    EXPECT_EQ(vibration_text(0.0), "static");
    EXPECT_EQ(vibration_text(kAtNoFrequency), "at no single frequency");
}

class OldIndex : public Archived {
  protected:
    OldIndex() {
        add();
        journal::Database(place().index).execute("UPDATE coefficient SET at_hz = NULL");
    }
    [[nodiscard]] std::optional<double> noted() const {
        return Index(place().index, Database::Mode::read).results({}).at(0).coefficients[4]->at_hz;
    }
};

TEST_F(OldIndex, IsCompletedFromTheRecordingsByWhoeverMayWrite) {
    // Whoever may only read has it for this once.
    for (const auto mode : {Database::Mode::read, Database::Mode::write}) {
        EXPECT_FALSE(noted());
        Index index(place().index, mode);
        auto campaigns = index.results({});
        read_vibrations(index, place().folder, campaigns);
        EXPECT_EQ(campaigns.at(0).coefficients[4]->at_hz, 25.0);
        EXPECT_FALSE(campaigns.at(0).coefficients[0]->at_hz);
    }
    EXPECT_EQ(noted(), 25.0);
}

TEST_F(OldIndex, StaysAsItIsWithoutARecording) {
    fs::remove_all(lab() / "rig" / "test-1");
    Index index(place().index, Database::Mode::write);
    auto campaigns = index.results({});
    read_vibrations(index, place().folder, campaigns);
    EXPECT_FALSE(vibration_noted(campaigns.at(0).coefficients));
    EXPECT_FALSE(noted());
}

}  // namespace
}  // namespace vibrig::archive
