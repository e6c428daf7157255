#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "daemon/journal/journal.hpp"
#include "tests/unit/daemon/commission/commissioned.hpp"
#include "tests/unit/support/temporary_folder.hpp"

namespace vibrig::commission {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;

constexpr std::uint64_t kRigs = 20;

class Torqued : public Commissioned {
  protected:
    /// The same rig, and people who say that the torquers have the names of the platform's axes.
    void torqued_rig(std::uint64_t seed, const Eigen::Vector3d& diagonal) {
        torqued_by(seed, diagonal.asDiagonal());
    }
    void torqued_by(std::uint64_t seed, const Eigen::Matrix3d& response) {
        torquers = response;
        rig_of(seed);
        torque = {};
        most_torque = 0;
        asked.clear();
    }
    /// Whose torque the next daemon ends, where the journal has this one's notes up to `count`.
    [[nodiscard]] std::string torqued_by(std::size_t count) const {
        const TemporaryFolder folder;
        const std::string path = (folder / "journal.sqlite3").string();
        {
            journal::Journal journal(path, 1);
            journal.start();
            for (std::size_t n = 0; n < count; ++n)
                journal.commissioned({notes[n].part, notes[n].step, notes[n].by, "uid 0",
                                      notes[n].what, notes[n].data.dump(), 9});
            journal.stop();
        }
        return journal::Journal(path, 1).recovery().torqued_by;
    }
    /// Up to where it drifts under the first torque.
    void to_the_first_torque() {
        procedure->begin("Ada", false, now);
        run_until([this] { return torque != Vec3{}; });
    }
};

TEST_F(Torqued, SignAndScaleAreFoundAndNoTorqueIsLeft) {
    int decided = 0;
    for (std::uint64_t seed = 1; seed <= kRigs; ++seed) {
        SCOPED_TRACE("seed " + std::to_string(seed));
        torqued_rig(seed, {1, -1.02, seed % 2 == 0 ? -1.0 : 1.0});
        answers["names"] = "torquers";
        const Time began = now;
        const Json result = run()["result"];
        EXPECT_LE(drivers::to_seconds(now - began), 15 * 60);
        EXPECT_EQ(torque, Vec3{});
        if (result["outcome"] != "decided") {  // no parity, no torque
            EXPECT_EQ(most_torque, 0);
            continue;
        }
        ++decided;
        EXPECT_DOUBLE_EQ(most_torque, 60);
        const Json torquers_found = result["evidence"]["torquers"];
        EXPECT_NEAR(torquers_found["scale"][1].get<double>(), 1.02, 5e-3);
        // Names of axes are conventions but for an even number of signs.
        const auto sign = result["found"]["levelling.torque_sign"].get<std::array<int, 3>>();
        EXPECT_EQ(sign[0] * sign[1] * sign[2], seed % 2 == 0 ? 1 : -1);
        EXPECT_THAT(result["corrections"], ::testing::Not(Contains(HasSubstr("TorqueCommand"))));
    }
    EXPECT_GE(decided, 18);
}

TEST_F(Torqued, AnEncoderMayEndItsTurnWhileItIsTorquedOrDrifts) {
    int decided = 0;
    for (std::uint64_t seed = 1; seed <= kRigs; ++seed) {
        // GIVEN encoders that wrap within what one torque, or the drift, turns
        const double ahead_deg = seed % 2 == 0 ? 0.05 : -0.05;
        SCOPED_TRACE("seed " + std::to_string(seed));
        torqued_rig(seed, {1, 1, 1});
        ends_ahead_deg = ahead_deg;
        answers["names"] = "torquers";
        const Json result = run()["result"];
        // THEN no torque is askew for it
        if (most_torque == 0) continue;  // no parity
        ASSERT_EQ(result["outcome"], "decided") << result["why"];
        ++decided;
        for (const double scale : result["evidence"]["torquers"]["scale"])
            EXPECT_NEAR(scale, 1, 5e-3);
        EXPECT_NEAR(result["found"]["site.elevation_deg"], 0, 2) << "not from a wrong rate";
    }
    EXPECT_GE(decided, 18);
}

/// Where the bus has the gyros' increments, their own signs are measured, too.
TEST_F(Torqued, GyrosThatCountAreNamedWithTheirOwnSigns) {
    int decided = 0;
    for (std::uint64_t seed = 1; seed <= 8; ++seed) {
        SCOPED_TRACE("seed " + std::to_string(seed));
        counts = std::array{1, seed % 2 == 0 ? -1 : 1, -1};
        torqued_rig(seed, {1, 1, 1});
        counting_slews = 0;
        answers["names"] = "torquers";
        answers["permit.turns"] = "yes";
        const Json result = run()["result"];
        if (most_torque == 0) continue;  // no parity
        ASSERT_EQ(result["outcome"], "decided") << result["why"];
        ++decided;
        EXPECT_EQ(counting_slews, 3);
        const Json found = result["evidence"]["increments"];
        const auto sign = found["sign"].get<std::array<int, 3>>();
        const auto torquer = result["evidence"]["torquers"]["sign"].get<std::array<int, 3>>();
        for (std::size_t k = 0; k < 3; ++k) {
            // Which end of an axis is which, gravity leaves open for two of three: of both alike.
            EXPECT_EQ(sign[k] * torquer[k], (*counts)[k]);
            EXPECT_NEAR(found["scale"][k].get<double>(), 1, 0.02);
        }
    }
    EXPECT_GE(decided, 4);
}

TEST_F(Torqued, GyrosUnderAWrongSignsFactorAreRefusedAndWithoutPermissionNotCounted) {
    counts = std::array{1, 0, 1};  // one counts nothing
    torqued_rig(3, {1, 1, 1});
    answers["names"] = "torquers";
    answers["permit.turns"] = "yes";
    Json result = run()["result"];
    EXPECT_EQ(result["outcome"], "refused");
    EXPECT_THAT(result["why"].get<std::string>(), HasSubstr("gyro increments Y count 0.000"));
    EXPECT_EQ(result["suspects"][0], "zeroing.gyro_message");
    torqued_rig(3, {1, 1, 1});
    counting_slews = 0;
    answers["permit.turns"] = "no";
    result = run()["result"];
    EXPECT_EQ(result["outcome"], "decided") << result["why"];
    EXPECT_FALSE(result["evidence"].contains("increments"));
    EXPECT_EQ(counting_slews, 0);
}

TEST_F(Torqued, ADeadOneEndsItAndIsNamed) {
    for (const std::size_t dead : {0U, 1U, 2U}) {
        Eigen::Vector3d response(1, 1, 1);
        response[static_cast<int>(dead)] = 0;
        torqued_rig(3, response);
        const Json result = run()["result"];
        EXPECT_EQ(result["outcome"], "refused");
        EXPECT_THAT(result["why"].get<std::string>(),
                    HasSubstr(std::string("torque command ") + "XYZ"[dead] + " turns nothing"));
        EXPECT_TRUE(result["found"].empty());
        EXPECT_EQ(torque, Vec3{});
    }
}

TEST_F(Torqued, OnesThatAreExchangedAreAskedOfAndNeverGuessed) {
    int misnamed = 0;
    for (std::uint64_t seed = 1; seed <= kRigs; ++seed) {
        SCOPED_TRACE("seed " + std::to_string(seed));
        // Nobody knows the drawing.
        torqued_rig(seed, {1, 1, 1});
        answers["names"] = "-";
        const Json unknown = run()["result"];
        if (std::ranges::find(asked, "names") == asked.end()) continue;
        ++misnamed;
        EXPECT_EQ(unknown["outcome"], "undecided");
        EXPECT_THAT(unknown["why"].get<std::string>(), HasSubstr("the maker's drawing"));
        EXPECT_TRUE(unknown["found"].empty());
        // The accelerometers are right: the DBC's torques are exchanged.
        torqued_rig(seed, {1, 1, 1});
        answers["names"] = "accelerometers";
        const Json exchanged = run()["result"];
        EXPECT_EQ(exchanged["outcome"], "decided");
        EXPECT_THAT(exchanged["corrections"], Contains(HasSubstr("TorqueCommand: its X turns "
                                                                 "platform axis y, expected x")));
        EXPECT_FALSE(exchanged["found"].contains("levelling.torque_sign"));
    }
    EXPECT_GE(misnamed, 4) << "half of all wirings";
    // Z is the azimuth axis, whatever the others are called.
    Eigen::Matrix3d swap;
    swap << 0, 0, 1, 0, 1, 0, 1, 0, 0;
    torqued_by(3, swap);
    const Json result = run()["result"];
    EXPECT_THAT(asked, ::testing::Not(Contains("names")));
    EXPECT_THAT(result["corrections"], Contains(HasSubstr("TorqueCommand: its Z turns platform")));
}

TEST_F(Torqued, APersonMayLeaveThemOutAndWithoutTorquersNobodyIsAsked) {
    torqued_rig(3, {1, 1, 1});
    answers["permit.torque"] = "no";
    Json result = run()["result"];
    EXPECT_EQ(result["outcome"], "decided");
    EXPECT_FALSE(result["found"].contains("levelling.torque_sign"));
    EXPECT_EQ(most_torque, 0);
    torquers.reset();
    torqued_rig(3, {1, 1, 1});
    torquers.reset();
    rig_of(3);
    result = run()["result"];
    EXPECT_EQ(result["outcome"], "decided");
    EXPECT_THAT(asked, ::testing::Not(Contains("permit.torque")));
}

TEST_F(Torqued, ARunawayIsStoppedWithinADegree) {
    torqued_rig(3, {100, 1, 1});  // 1.7 deg/s
    const Json result = run()["result"];
    EXPECT_EQ(result["outcome"], "refused");
    EXPECT_THAT(result["why"].get<std::string>(), HasSubstr("torque command X of 60 deg/h: "));
    EXPECT_EQ(torque, Vec3{});
    EXPECT_EQ(drifting_since, 0) << "held";
    const std::string why = result["why"];
    const double turned = std::stod(why.substr(why.find("turned by ") + 10));
    EXPECT_LT(turned, 1.4) << "a degree, and a tenth of a second more";
}

TEST_F(Torqued, NobodyAtTheToolIsNoTorqueAndItGoesOnWithTheSameResult) {
    torqued_rig(3, {1, -1, 1});
    answers["names"] = "torquers";
    to_the_first_torque();
    ASSERT_NE(torque, Vec3{});
    pass(2.3, "");  // the socket is closed
    EXPECT_EQ(question(), "go_on");
    EXPECT_EQ(torque, Vec3{});
    EXPECT_EQ(drifting_since, 0) << "held";
    pass(30);
    EXPECT_EQ(torque, Vec3{}) << "not before a new permission";
    const Json stopped = run()["result"];
    EXPECT_EQ(stopped["outcome"], "decided");
    torqued_rig(3, {1, -1, 1});
    const Json whole = run()["result"];
    EXPECT_EQ(stopped["found"]["levelling.torque_sign"], whole["found"]["levelling.torque_sign"]);
    for (std::size_t k = 0; k < 3; ++k)
        EXPECT_NEAR(stopped["evidence"]["torquers"]["scale"][k].get<double>(),
                    whole["evidence"]["torquers"]["scale"][k].get<double>(), 5e-3);
}

TEST_F(Torqued, AChannelThatIsSilentIsNoTorque) {
    torqued_rig(3, {1, 1, 1});
    to_the_first_torque();
    good = false;
    pass(0.2);
    EXPECT_EQ(question(), "go_on");
    EXPECT_EQ(torque, Vec3{});
}

/// Killed, a daemon leaves the platform torqued; the next one ends that, from what is on disk.
TEST_F(Torqued, TheNextDaemonEndsWhatOneThatDiedMayHaveLeft) {
    torqued_rig(3, {1, -1, 1});
    answers["names"] = "torquers";
    // GIVEN a rig of which nobody has permitted torques yet: nothing is sent
    to_the_first_torque();
    const auto permission = std::ranges::find_if(notes, [](const Note& note) {
        return note.what == "permission" && note.data.value("id", "") == "permit.torque";
    });
    const auto before = static_cast<std::size_t>(permission - notes.begin());
    EXPECT_EQ(torqued_by(before), "");
    // WHEN it dies from then on, at the first torque too, of which the journal has no row yet
    EXPECT_EQ(torqued_by(before + 1), "Ada");
    EXPECT_EQ(torqued_by(notes.size() - 1), "Ada");
    // at any later one, and while it is stopped and may go on
    EXPECT_EQ(torqued_by(notes.size()), "Ada");
    pass(2.3, "");
    ASSERT_EQ(question(), "go_on");
    EXPECT_EQ(torqued_by(notes.size()), "Ada");
    run_until([this] { return torque[2] < 0; });
    EXPECT_EQ(torqued_by(notes.size()), "Ada");
    // THEN not once zero was commanded, nor after the end
    run_until([this] { return torque == Vec3{}; });
    EXPECT_EQ(torqued_by(notes.size()), "");
    ASSERT_EQ(run()["result"]["outcome"], "decided");
    EXPECT_EQ(torqued_by(notes.size()), "");
    // AND not of one that a person ended while it was torqued
    torqued_rig(3, {1, -1, 1});
    notes.clear();
    to_the_first_torque();
    procedure->halt("ended by Ada", now);
    EXPECT_EQ(torque, Vec3{});
    EXPECT_EQ(torqued_by(notes.size()), "");
}

TEST_F(Torqued, AfterTheDaemonsEndNothingIsTorquedBeforeANewPermission) {
    torqued_rig(3, {1, -1, 1});
    answers["names"] = "torquers";
    to_the_first_torque();
    const Json log = kept;
    // Another daemon; the platform is still torqued, as the last frame said.
    procedure = std::make_unique<Procedure>(names(), Stated{0, 2, true}, wired, wired);
    const Vec3 left = torque;
    const int before = torques;
    procedure->attend("Ada", now);
    procedure->begin_again("Ada", false, {log, "", ""}, now);
    EXPECT_EQ(question(), "permit.resume");
    pass(1);
    EXPECT_NE(left, Vec3{});
    EXPECT_EQ(torque, Vec3{}) << "zero is sent";
    EXPECT_GT(torques, before);
    const Json result = run()["result"];
    EXPECT_EQ(result["outcome"], "decided") << result.dump(1);
    EXPECT_EQ(result["evidence"]["torquers"]["sign"].size(), 3U);
    EXPECT_EQ(torque, Vec3{});
}

}  // namespace
}  // namespace vibrig::commission
