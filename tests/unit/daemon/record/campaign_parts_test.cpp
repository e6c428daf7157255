#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <random>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

#include "daemon/record/candump_campaign.hpp"
#include "daemon/record/dwells_csv.hpp"
#include "daemon/record/hdf5.hpp"
#include "daemon/record/index.hpp"
#include "daemon/record/raw_frames.hpp"
#include "daemon/record/raw_log.hpp"
#include "daemon/record/replay.hpp"
#include "estimator/filter/parameters.hpp"
#include "tests/unit/daemon/record/parts.hpp"

namespace vibrig::record {
namespace {

TEST_F(Parts, HaveTheRowsOfTheirDwellsInTheOrderOfTheCoefficients) {
    write(head(1), 10 * kSecond, {1, 2}, 2);
    const hdf5::File file =
        hdf5::File::open((folder_ / "campaign.h5").string(), hdf5::File::Mode::read);
    const auto rate = file.doubles("/dwells/rate"),
               regressors = file.doubles("/dwells/rate_regressors"),
               covariance = file.doubles("/dwells/rate_covariance"),
               ramp_sigma = file.doubles("/dwells/ramp_sigma"),
               gamma = file.doubles("/dwells/gamma"), middle = file.doubles("/dwells/middle_s");
    // the first was left out
    EXPECT_TRUE(std::isnan(middle.values.at(0)));
    EXPECT_TRUE(std::isnan(rate.values.at(2)));
    EXPECT_EQ(middle.values.at(1), 200);
    ASSERT_EQ(regressors.values.size(), 60U);
    const estimator::DwellRow row = row_of(2);
    for (std::size_t j = 0; j < 3; ++j) {
        EXPECT_EQ(rate.values.at(3 + j), row.rate[j]);
        EXPECT_EQ(covariance.values.at(9 + 3 * j + (j + 1) % 3), row.variance[j][(j + 1) % 3]);
        EXPECT_EQ(ramp_sigma.values.at(3 + j), std::sqrt(row.ramp_variance[j][j]));
        for (std::size_t t = 0; t < 10; ++t) {
            const std::size_t group = estimator::internal_of(10 * j + t) / estimator::kGyros;
            EXPECT_EQ(regressors.values.at(30 + 10 * j + t), row.regressors[j][group]);
        }
    }
    EXPECT_EQ(gamma.values.at(6 + 3), row.vibration.gamma[3]);
}

TEST_F(Parts, OfARestartTakeThePlaceOfWhatWasNotFinished) {
    // GIVEN a campaign that died in its third dwell, the second of them not in the journal either
    write(head(1), 10 * kSecond, {1, 2, 3}, 2, "running");
    // WHEN it went on after the first one, in the time of another boot
    Head after = head(2, true, 1);
    after.utc_offset_ns += 2000 * kSecond;
    write(after, 1 * kSecond, {2, 3}, 2);
    // THEN it reads as one campaign, each position once and in its times
    const Campaign campaign = read_campaign(folder_.string());
    EXPECT_EQ(campaign.samples.size(), 800U);
    EXPECT_TRUE(std::ranges::is_sorted(campaign.samples, {}, &drivers::Sample::time));
    ASSERT_EQ(campaign.dwells.size(), 3U);
    const auto dwells = recorded_dwells(campaign);
    ASSERT_EQ(dwells.size(), 3U);
    for (std::size_t i = 0; i < 3; ++i) {
        EXPECT_EQ(dwells[i].order->position, static_cast<int>(i) + 1);
        EXPECT_EQ(dwells[i].count, 100U);
    }
    EXPECT_EQ(dwells[1].first, 400U) << "the second of the new part";
    EXPECT_EQ(campaign.samples[400].time, 2001 * kSecond);
    EXPECT_EQ(campaign.restarted_at, 1U);
    EXPECT_EQ(campaign.state, "finished");
    EXPECT_TRUE(campaign.incomplete.empty()) << campaign.incomplete;
    ASSERT_EQ(campaign.gaps.size(), 1U);
    EXPECT_EQ(campaign.gaps[0].stream, "restart");
}

TEST_F(Parts, ThatLackWhatTheFilterHadAreNotReplayed) {
    write(head(1), 10 * kSecond, {1, 2}, 1, "running");
    write(head(2, true, 2), 100 * kSecond, {3}, 1);
    const Campaign campaign = read_campaign(folder_.string());
    EXPECT_NE(campaign.incomplete.find("found 1 dwells before the restart, expected 2"),
              std::string::npos)
        << campaign.incomplete;
    EXPECT_THROW(static_cast<void>(replay(campaign, {}, {})), std::runtime_error);
}

TEST_F(Parts, AfterADiskThatRefusedHoldWhatWasKeptOnce) {
    // GIVEN a file that was given up, and its next one with orders and samples of both
    write(head(1), 10 * kSecond, {1, 2}, 1, "continued");
    write(head(2), 10 * kSecond + 100 * kStep, {2, 3}, 2);
    // WHEN the order of the second dwell is in both
    const Campaign campaign = read_campaign(folder_.string());
    // THEN nothing is there twice
    EXPECT_EQ(campaign.samples.size(), 500U);
    EXPECT_TRUE(
        std::ranges::is_sorted(campaign.samples, std::less_equal{}, &drivers::Sample::time));
    EXPECT_EQ(recorded_dwells(campaign).size(), 3U);
}

TEST_F(Parts, AfterARestartAndADiskThatRefusedAreInOneTime) {
    // GIVEN a campaign that died, went on in the time of another boot, and had its disk refuse then
    write(head(1), 5000 * kSecond, {1}, 1, "running");
    Head after = head(2, true, 1);
    after.utc_offset_ns += 9000 * kSecond;
    write(after, 1 * kSecond, {2, 3}, 1, "continued");
    Head third = after;
    third.part = 3;
    third.restart = false;
    third.dwells_before = 0;
    write(third, 1 * kSecond + 400 * kStep, {4}, 1);
    // WHEN it is read
    const Campaign campaign = read_campaign(folder_.string());
    // THEN the newest file is not before the oldest, and nothing of it is taken for a copy
    EXPECT_EQ(campaign.samples.size(), 1200U);
    EXPECT_TRUE(std::ranges::is_sorted(campaign.samples, {}, &drivers::Sample::time));
    EXPECT_EQ(campaign.dwells.size(), 3U);
}

TEST_F(Parts, AreRefusedByNameWhenOneIsMissing) {
    for (const int part : {1, 2, 3})
        write(head(part), part * 100 * kSecond, {part}, 1, part == 3 ? "finished" : "continued");
    fs::remove(folder_ / "campaign-2.h5");
    EXPECT_NE(refusal().find("missing campaign-2.h5 of campaign test-1"), std::string::npos)
        << refusal();
    fs::rename(folder_ / "campaign-3.h5", folder_ / "campaign-2.h5");
    EXPECT_NE(refusal().find("found part 3 of campaign test-1, expected part 2"), std::string::npos)
        << refusal();
    fs::remove(folder_ / "campaign.h5");
    fs::rename(folder_ / "campaign-2.h5", folder_ / "other.h5");
    EXPECT_THROW(static_cast<void>(read_campaign((folder_ / "other.h5").string())),
                 std::runtime_error);
}

TEST_F(Parts, AreRefusedWhenTheLastOneIsMissing) {
    for (const int part : {1, 2})
        write(head(part), part * 100 * kSecond, {part}, 1, part == 2 ? "finished" : "continued");
    ASSERT_EQ(refusal(), "");
    fs::remove(folder_ / "campaign-2.h5");
    EXPECT_NE(refusal().find("missing campaign-2.h5 of campaign test-1, in which campaign.h5 says "
                             "that the campaign goes on"),
              std::string::npos)
        << refusal();
    // Put aside by somebody it stands for itself.
    fs::rename(folder_ / "campaign.h5", folder_ / "first.h5");
    EXPECT_EQ(read_campaign((folder_ / "first.h5").string()).state, kContinued);
}

/// Three segments of a raw log, a minute each, and another's log of the time between.
class RawSegments : public Parts {
  protected:
    RawSegments() {
        write(head(1), 10 * kSecond, {1}, 1);
        for (int n = 1; n <= 3; ++n) log(segment(n), 60 * n);
        std::ofstream(folder_ / "dwells.csv")
            << kDwellsHeader << "\n1,1,9,1700000070,1700000100,,0,0,0,0,0,0,0,0,0\n";
    }
    [[nodiscard]] std::string segment(int n) const {
        return (folder_ / ("raw-000" + std::to_string(n) + ".log")).string();
    }
    static void log(const std::string& path, int from_s) {
        std::ofstream file(path);
        for (int i = 0; i < 60; ++i)
            file << "(" << 1'700'000'000 + from_s + i << ".000000) vcan0 7FF#AB R\n";
    }
    /// Of frames that are no platform's: what comes before there is found no sample in them.
    [[nodiscard]] std::string refusal_of(const std::vector<std::string>& logs) const {
        try {
            static_cast<void>(
                campaign_from_candump(logs, (folder_ / "dwells.csv").string(), "", ""));
        } catch (const std::runtime_error& error) {
            return error.what();
        }
        return {};
    }
    [[nodiscard]] std::vector<std::string> missing() const {
        return missing_raw(folder_.string(), [](const std::string&) {});
    }
};

TEST_F(RawSegments, ThatAreMissingAreNamed) {
    const auto nothing = [](const std::string&) {};
    EXPECT_THAT(missing(), ::testing::IsEmpty());
    // WHEN one is gone
    fs::remove(segment(2));
    EXPECT_THAT(missing(), ::testing::ElementsAre("raw-0002.log"));
    EXPECT_THAT(recover(folder_.string(), nothing).at(0).missing_raw,
                ::testing::ElementsAre("raw-0002.log"));
    // WHEN it is the last one, THEN the index knows it
    log(segment(2), 120);
    Index(recordings_.string(), nothing).note(folder_.string());
    fs::remove(segment(3));
    EXPECT_THAT(missing(),
                ::testing::ElementsAre(::testing::HasSubstr("raw-0003.log, which the index has")));
    EXPECT_EQ(recover(folder_.string(), nothing).at(0).missing_raw.size(), 1U);
}

TEST_F(RawSegments, ThatAreCutOffAreNamed) {
    ASSERT_EQ(compress(segment(2)), "");
    EXPECT_THAT(missing(), ::testing::IsEmpty());
    // A concatenation of logs is one, too.
    std::ostringstream frame;
    frame << std::ifstream(segment(2) + ".zst", std::ios::binary).rdbuf();
    std::ofstream(segment(2) + ".zst", std::ios::app | std::ios::binary) << frame.str();
    const auto whole = fs::file_size(segment(2) + ".zst");
    EXPECT_FALSE(is_cut(segment(2) + ".zst"));
    // WHEN its last byte is gone, or all of them
    for (const auto size : {whole - 1, whole / 2 + 3, std::uintmax_t{3}, std::uintmax_t{0}}) {
        fs::resize_file(segment(2) + ".zst", size);
        EXPECT_THAT(missing(),
                    ::testing::ElementsAre("the end of raw-0002.log.zst: the file is cut off"))
            << size;
    }
    EXPECT_EQ(recover(folder_.string(), [](const auto&) {}).at(0).missing_raw.size(), 1U);
}

TEST_F(RawSegments, ThatAreCutOffAreReadUpToThere) {
    // GIVEN a log of more than one block of zstd
    std::mt19937 random(1);
    std::ofstream more(segment(2), std::ios::app);
    for (int i = 0; i < 40'000; ++i)
        more << "(1700000179.500000) vcan0 7FF#" << 10'000'000 + random() % 80'000'000 << " R\n";
    more.close();
    const auto text_of = [](const std::string& path) {
        std::string text;
        read_raw(path, [&](std::string_view piece) {
            text += piece;
            return true;
        });
        return text;
    };
    const std::string whole = text_of(segment(2));
    ASSERT_EQ(compress(segment(2)), "");
    const std::string packed = segment(2) + ".zst";
    ASSERT_EQ(text_of(packed), whole);
    // WHEN it is cut THEN what comes is what was there before, no less than a block below the cut
    const auto size = fs::file_size(packed);
    constexpr std::size_t kBlock = 128 * 1024;  // the most that zstd has in one
    for (const double part : {0.99, 0.5}) {
        fs::resize_file(packed, static_cast<std::uintmax_t>(static_cast<double>(size) * part));
        const std::string there = text_of(packed);
        EXPECT_TRUE(whole.starts_with(there));
        EXPECT_GT(there.size() + 3 * kBlock,
                  static_cast<std::size_t>(static_cast<double>(whole.size()) * part));
        EXPECT_TRUE(is_cut(packed));
        // the frames too, and those of the next log behind them
        RawFrames frames({packed, segment(3)}, 0);
        std::size_t count = 0, last = 0;
        while (const RawFrame* frame = frames.next()) {
            ++count;
            last = frame->log;
        }
        EXPECT_EQ(count, static_cast<std::size_t>(std::ranges::count(there, '\n')) + 60);
        EXPECT_EQ(last, 1U);
    }
    // WHEN nothing of it is left, or next to nothing
    for (const std::uintmax_t left : {std::uintmax_t{3}, std::uintmax_t{0}}) {
        fs::resize_file(packed, left);
        EXPECT_EQ(text_of(packed), "");
    }
}

TEST_F(RawSegments, ThatLieThereAreLeftOutAndNotMissing) {
    // GIVEN segments as an archive has them, and one that is gone
    ASSERT_EQ(compress(segment(1)) + compress(segment(3)), "");
    fs::remove(segment(2));
    // WHEN one is read THEN those that lie there are distinguished from the one that does not
    EXPECT_THAT(left_out(folder_.string(), {segment(3) + ".zst"}),
                ::testing::ElementsAre("raw-0001.log.zst"));
    EXPECT_THAT(missing(), ::testing::ElementsAre("raw-0002.log"));
    EXPECT_THAT(left_out(folder_.string(), raw_files(folder_.string())), ::testing::IsEmpty());
}

TEST_F(RawSegments, AreReadInOrderAndOnce) {
    EXPECT_THAT(in_order({segment(3), segment(1), segment(2)}),
                ::testing::ElementsAre(segment(1), segment(2), segment(3)));
    EXPECT_THAT(refusal_of({segment(2), segment(1)}), ::testing::HasSubstr("no sample in them"));
    EXPECT_THAT(refusal_of({segment(1), segment(2), segment(1)}),
                ::testing::HasSubstr("found it twice"));
    // AND of others the time must not go back
    const std::string other = (recordings_ / "other.log").string();
    log(other, 180);
    EXPECT_THAT(refusal_of({segment(2), other}), ::testing::HasSubstr("no sample in them"));
    EXPECT_THAT(refusal_of({segment(3), other}),
                ::testing::HasSubstr("other.log:1: found a time 59.000000 s before the end"));
}

TEST_F(RawSegments, AreNamedWhereTheFileBesideThemIsCutOff) {
    const auto nothing = [](const std::string&) {};
    const fs::path bad = recordings_ / "test-0", file = bad / "campaign.h5";
    fs::copy(folder_, bad);
    for (const std::uintmax_t size : {fs::file_size(file) / 2, std::uintmax_t{0}}) {
        // GIVEN a campaign's file that is cut off, beside a good campaign
        fs::resize_file(file, size);
        const std::string words = "vibrig replay " + bad.string() + "/raw-*";
        const auto hint = ::testing::ThrowsMessage<std::runtime_error>(
            ::testing::AllOf(::testing::HasSubstr(file.string()), ::testing::HasSubstr(words)));
        EXPECT_THAT([&] { static_cast<void>(recover(bad.string(), nothing)); }, hint);
        EXPECT_THAT([&] { static_cast<void>(read_campaign(bad.string())); }, hint);
        EXPECT_THAT([&] { static_cast<void>(read_campaign(file.string())); }, hint);
        // WHEN all are recovered, THEN the other one is, and the index has it
        const auto all = recover(recordings_.string(), nothing);
        ASSERT_EQ(all.size(), 2U);
        EXPECT_THAT(all[0].failed, ::testing::HasSubstr(words));
        EXPECT_EQ(all[1].failed, "");
        EXPECT_EQ(all[1].samples, 400U);
        const auto known = Index(recordings_.string(), nothing).campaigns();
        ASSERT_EQ(known.size(), 1U);
        EXPECT_EQ(known[0].key, "test-1");
    }
}

}  // namespace
}  // namespace vibrig::record
