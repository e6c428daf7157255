#include "daemon/archive/outbox.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "tests/unit/daemon/archive/archived.hpp"

namespace vibrig::archive {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

/// With the `vibrig` beside this program.
class OutboxTest : public Archived {
  protected:
    void start(const Outbox::Unit& unit = {}) {
        configuration::ArchiveSettings settings;
        settings.folder = lab().string();
        settings.rig = "rig";
        outbox_ = std::make_unique<Outbox>(settings, recordings_.string(), unit,
                                           [this](Severity severity, const std::string& words) {
                                               const std::lock_guard lock(mutex_);
                                               if (severity == Severity::alarm)
                                                   alarms_.push_back(words);
                                           });
        outbox_->start();
    }
    std::vector<std::string> alarms() {
        const std::lock_guard lock(mutex_);
        return alarms_;
    }
    ArchiveStatus wait_for(const std::function<bool(const ArchiveStatus&)>& good) const {
        const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(60);
        ArchiveStatus status = outbox_->status();
        while (!good(status) && std::chrono::steady_clock::now() < end) {
            std::this_thread::sleep_for(std::chrono::milliseconds(20));
            status = outbox_->status();
        }
        return status;
    }
    static bool is_refused(const ArchiveStatus& status) { return status.refused == 1; }

    std::mutex mutex_;
    std::vector<std::string> alarms_;
    std::unique_ptr<Outbox> outbox_;
};

TEST_F(OutboxTest, PutsAsideWhatTheArchiveRefuses) {
    // GIVEN an archive that has the genuine campaign, and a changed one on the rig
    add();
    record_it(drivers::kSecond);
    start();
    // WHEN it is refused THEN it is put aside, which is shown, and alarms once
    auto status = wait_for(is_refused);
    EXPECT_EQ(status.refused, 1U);
    EXPECT_THAT(status.refused_note, HasSubstr("test-1: "));
    EXPECT_THAT(status.refused_note, HasSubstr("with the same beginning and end"));
    EXPECT_EQ(status.waiting, 0U);
    EXPECT_TRUE(status.good);
    EXPECT_THAT(alarms(), ElementsAre(HasSubstr("test-1 is refused by the archive and put aside")));
    outbox_->look();
    std::this_thread::sleep_for(std::chrono::milliseconds(700));
    EXPECT_EQ(outbox_->status().failures, 1U) << "and is not tried again";
    // after a restart neither
    outbox_.reset();
    start();
    status = wait_for(is_refused);
    EXPECT_EQ(status.refused, 1U);
    EXPECT_EQ(status.failures, 0U);
    EXPECT_EQ(alarms().size(), 1U);
    // WHEN its file has changed THEN it is
    fs::last_write_time(folder_ / "campaign.h5",
                        fs::last_write_time(folder_ / "campaign.h5") + std::chrono::seconds(1));
    outbox_->look();
    EXPECT_EQ(wait_for([](const ArchiveStatus& s) { return s.failures == 1; }).failures, 1U);
    // WHEN a person has put it right and says so THEN it is delivered
    outbox_.reset();
    fs::remove_all(lab() / "rig" / "test-1");
    Index(place().index, Database::Mode::write).forget("rig/test-1");
    EXPECT_EQ(try_again(folder_.string()), "");
    alarms_.clear();
    start();
    status = wait_for([](const ArchiveStatus& s) { return s.delivered == 1; });
    EXPECT_EQ(status.delivered, 1U);
    EXPECT_EQ(status.refused, 0U);
    EXPECT_EQ(status.refused_note, "");
    EXPECT_THAT(alarms(), IsEmpty());
}

TEST_F(OutboxTest, TakesNoSimulatedCampaignsForTheHistoryOfARealUnit) {
    const auto is_delivered = [](const ArchiveStatus& s) { return s.delivered == 1; };
    // GIVEN a unit of which the archive has a campaign on a simulated rig alone
    simulated_ = true;
    record_it(0);
    add();
    for (const bool real : {false, true}) {
        // WHEN it is run on a rig, which asks for its earlier campaigns before it delivers
        start({"0017", "", !real, 0});
        EXPECT_EQ(wait_for(is_delivered).delivered, 1U);
        // THEN a simulated rig shows it, a real one does not
        EXPECT_EQ(outbox_->history().empty(), real) << outbox_->history();
        outbox_.reset();
        fs::remove_all(recordings_ / ".outbox");
    }
}

}  // namespace
}  // namespace vibrig::archive
