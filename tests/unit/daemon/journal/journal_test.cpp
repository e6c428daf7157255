#include "daemon/journal/journal.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>
#include <zlib.h>

#include <bit>
#include <cmath>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <functional>
#include <limits>
#include <numbers>
#include <random>
#include <thread>

#include "daemon/dwells/dwell_book.hpp"
#include "daemon/journal/database.hpp"
#include "daemon/journal/verify.hpp"
#include "estimator/identification/result.hpp"
#include "tests/unit/support/temporary_folder.hpp"

namespace vibrig::journal {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

constexpr std::uint64_t kHash = 0x1234;

dwells::DwellBook fresh_book() {
    return dwells::DwellBook(estimator::Settings{}, [](Severity, const std::string&) {});
}

std::string replayed(std::vector<DwellCheckpoint>& dwells, double dwell_s) {
    auto book = fresh_book();
    return replay(dwells, book, drivers::from_seconds(dwell_s));
}

/// A folder of its own, gone afterwards.
struct JournalTest : testing::Test {
    TemporaryFolder folder;
    std::string path = (folder / "journal.sqlite3").string();

    /// At rest and level, the platform drifting a little: `seconds` at 40 Hz through the filter.
    static DwellCheckpoint dwell(estimator::Identification& filter, int position,
                                 double seconds = 20) {
        DwellCheckpoint checkpoint;
        checkpoint.info = {1, position, 9};
        filter.begin_dwell(checkpoint.info);
        for (int n = 0; n < seconds * 40; ++n) {
            estimator::Measurement m;
            m.time_s = n * 0.025;
            const double a = 6 * std::sin(2 * std::numbers::pi * 15 * m.time_s);
            m.angle_rad = {1e-6 * n, 2e-6 * std::sin(n), 0.5 * position + 2e-6 * std::cos(2 * n)};
            m.force_g = {0, 1 + a, 1e-4 * std::cos(n)};
            m.angles_good = n % 97 != 0;
            filter.add(m);
            checkpoint.measurements.push_back(m);
        }
        checkpoint.summary = filter.end_dwell();
        return checkpoint;
    }

    static void feed(Journal& journal, const DwellCheckpoint& dwell) {
        bool first = true;
        for (const auto& m : dwell.measurements) {
            ASSERT_TRUE(journal.fed().try_push(
                {m, dwell.info.run, dwell.info.position, std::exchange(first, false), 0}));
        }
        journal.dwell_done(dwell.info, dwell.summary, dwell.stop);
    }

    /// A campaign of two positions that nobody ended.
    void leave_unfinished(int positions = 2) {
        estimator::Identification filter{estimator::Settings{}};
        Journal journal(path, kHash);
        journal.start();
        journal.campaign_begun("night", "Ada");
        for (int p = 1; p <= positions; ++p) feed(journal, dwell(filter, p));
        journal.stop();
    }
    /// As if the daemon had kept these bytes.
    void keep_checkpoint(std::int64_t position, std::string_view bytes) const {
        ChainedFile file(path, {});
        ASSERT_THAT(file.open(), IsEmpty());
        file.begin();
        file.database().run("UPDATE dwell SET checkpoint = ? WHERE position = ?",
                            {Blob{bytes}, position});
        const auto row =
            file.database().ask("SELECT rowid FROM dwell WHERE position = ?", {position});
        file.chained("dwell", row.at(0).numbers.at(0));
        file.commit();
    }
    [[nodiscard]] std::vector<Row> ask(const char* sql) const { return Database(path).ask(sql); }
};

TEST_F(JournalTest, GivesBackTheFilterToTheLastBit) {
    // GIVEN a filter that has seen two positions, and a journal of them that was not ended
    leave_unfinished();
    estimator::Identification filter{estimator::Settings{}};
    for (int p = 1; p <= 2; ++p) dwell(filter, p);
    // WHEN the journal is opened again and its dwells are fed to a fresh filter
    Journal journal(path, kHash);
    EXPECT_THAT(journal.recovery().refused, IsEmpty());
    ASSERT_TRUE(journal.recovery().campaign);
    auto& campaign = *journal.recovery().campaign;
    EXPECT_EQ(campaign.started_by, "Ada");
    ASSERT_THAT(campaign.dwells, SizeIs(2));
    auto fresh = fresh_book();
    EXPECT_EQ(replay(campaign.dwells, fresh, 20 * drivers::kSecond), "");
    auto& again = fresh.identification();
    // THEN both say the same to the last bit, now and after one more position
    for (int p = 3; p <= 4; ++p) {
        const auto left = filter.result(), right = again.result();
        for (std::size_t i = 0; i < estimator::kParameters; ++i) {
            EXPECT_EQ(std::bit_cast<std::uint64_t>(left.value[i]),
                      std::bit_cast<std::uint64_t>(right.value[i]))
                << i;
            EXPECT_EQ(std::bit_cast<std::uint64_t>(left.sigma[i]),
                      std::bit_cast<std::uint64_t>(right.sigma[i]))
                << i;
        }
        EXPECT_EQ(left.samples, right.samples);
        dwell(filter, p);
        dwell(again, p);
    }
}

TEST_F(JournalTest, GivesBackWhatAnAdaptiveCampaignHasChosenInItsOrder) {
    // GIVEN levels in turn, a repeated position, and the time that each end came at
    estimator::Identification filter{estimator::Settings{}};
    {
        Journal journal(path, kHash);
        journal.start();
        journal.campaign_begun("night", "Ada");
        for (int p = 1; p <= 3; ++p) {
            DwellCheckpoint one = dwell(filter, p);
            one.info.run = one.summary.run = p % 2 == 0 ? 2 : 1;
            one.stop = {{1.5 * p, 0, -90}, p % 2 == 0 ? 0.0 : 9.0, p == 3 ? 1 : 0, 100.5 * p};
            feed(journal, one);
        }
        journal.stop();
    }
    // WHEN it is opened again THEN all of that is there, in the order in which it was done
    Journal journal(path, kHash);
    ASSERT_TRUE(journal.recovery().campaign);
    const auto& dwells = journal.recovery().campaign->dwells;
    ASSERT_THAT(dwells, SizeIs(3));
    for (int p = 1; p <= 3; ++p) {
        const auto& stop = dwells[static_cast<std::size_t>(p - 1)].stop;
        EXPECT_EQ(dwells[static_cast<std::size_t>(p - 1)].info.position, p);
        EXPECT_EQ(stop.position_deg, (std::array<double, 3>{1.5 * p, 0, -90}));
        EXPECT_EQ(stop.table_g, p % 2 == 0 ? 0 : 9);
        EXPECT_EQ(stop.repeats, p == 3 ? 1 : 0);
        EXPECT_EQ(stop.used_s, 100.5 * p);
    }
}

TEST_F(JournalTest, OffersNothingThatWasEndedOrIsOfAnotherConfiguration) {
    leave_unfinished();
    {
        Journal other(path, kHash + 1);
        EXPECT_FALSE(other.recovery().campaign);
        ASSERT_THAT(other.recovery().refused, SizeIs(1));
        EXPECT_THAT(other.recovery().refused[0], HasSubstr("of another configuration: cold start"));
    }
    {
        Journal journal(path, kHash);
        journal.start();
        journal.campaign_resumed(journal.recovery().campaign->id, "Grace");
        const auto ended = journal.campaign_ended("finished", "", "{}");
        journal.stop();
        EXPECT_TRUE(parse_head(journal.head_with(ended).value_or("")));
        EXPECT_FALSE(journal.head_with(ended + 1)) << "it has no such entry yet";
    }
    Journal journal(path, kHash);
    EXPECT_FALSE(journal.recovery().campaign);
    EXPECT_THAT(journal.recovery().refused, IsEmpty());
    EXPECT_EQ(ask("SELECT state, result_json FROM campaign").at(0).texts,
              (std::vector<std::string>{"finished", "{}"}));
}

TEST_F(JournalTest, KeepsEventsAndWhoCommandedWhat) {
    {
        Journal journal(path, kHash);
        journal.start();
        journal.event({1, 5, 6, Severity::alarm, "can", "bus off"});
        journal.command({CommandRequest::Kind::arm, "Ada", ""}, {false, "tripped"}, 7);
        journal.stop();
        EXPECT_EQ(journal.status().written, 2U);
    }
    const auto event = ask("SELECT utc_ns, time_ns, severity, source, text FROM event").at(0);
    EXPECT_EQ(event.numbers[0], 5);
    EXPECT_EQ(event.texts[2] + event.texts[3] + event.texts[4], "alarmcanbus off");
    const auto command = ask("SELECT kind, person, accepted, answer FROM command").at(0);
    EXPECT_EQ(command.texts[0] + command.texts[1] + command.texts[3], "armAdatripped");
    EXPECT_EQ(command.numbers[2], 0);
}

TEST_F(JournalTest, KnowsAfterARestartWhichCertificatesWereIssued) {
    {
        Journal journal(path, kHash);
        EXPECT_THAT(journal.recovery().certificates, IsEmpty());
        journal.start();
        const auto issue = [&journal](const char* argument, bool accepted) {
            EXPECT_NE(journal.command({CommandRequest::Kind::certificate, "Ada", argument},
                                      {accepted, ""}, 7),
                      0U);
        };
        issue(R"({"number":"C-17 \"a\"","pdf_sha256":"00"})", true);
        issue(R"({"number":"C-18"})", false);
        issue("no JSON", false);
        journal.command({CommandRequest::Kind::arm, "Ada", ""}, {true, ""}, 7);
        journal.stop();
    }
    // THEN the refused ones are free, and each is an entry of the signed chain
    EXPECT_THAT(Journal(path, kHash).recovery().certificates, testing::ElementsAre("C-17 \"a\""));
    EXPECT_THAT(verify_file(path).found, IsEmpty());
    static_cast<void>(
        ask("UPDATE command SET argument = replace(argument, '00', '01') WHERE id = 1"));
    EXPECT_THAT(verify_file(path).found, testing::Contains(testing::HasSubstr("command 1")));
}

TEST_F(JournalTest, KeepsTheVerdictOfTheNewestLoopCheck) {
    const auto after = [this](const std::vector<std::string>& verdicts) {
        Journal journal(path, kHash);
        const std::string before = journal.recovery().out_of_band;
        journal.start();
        for (const auto& verdict : verdicts) journal.loop_checked("Ada", verdict);
        journal.stop();
        return before;
    };
    EXPECT_EQ(after({}), "") << "none was made";
    EXPECT_EQ(after({"", "distortion 0.3, expected 0 to 0.05"}), "");
    EXPECT_EQ(after({}), "distortion 0.3, expected 0 to 0.05");
    EXPECT_EQ(after({""}), "distortion 0.3, expected 0 to 0.05") << "whatever did not check it";
    EXPECT_EQ(after({}), "") << "another one was in band";
}

/// With what was read of its frequency, so that its blocks can be made again.
TEST_F(JournalTest, KeepsWhatAControllerPlayed) {
    estimator::Identification filter{estimator::Settings{}};
    DwellCheckpoint random = dwell(filter, 1, 3);
    random.info.random = {1, 100, 0.01, 120, 4, -3};
    using Word = estimator::PlayedRandom::Word;
    random.info.played = {Word::good, {1.1, 90, 0.01, 118, 4, -3}, {0.9, 0.001}, 2};
    random.stop.psd = {{20, 0.01}, {120, 0.02}};
    DwellCheckpoint out;
    ASSERT_EQ(decode(encode(random, kHash), kHash, out), "");
    ASSERT_TRUE(out.info.played);
    EXPECT_EQ(out.info.played->word, Word::good);
    EXPECT_EQ(out.info.played->random.mean_square_g2, 1.1);
    EXPECT_EQ(out.info.played->random.profile, 4);
    EXPECT_EQ(out.info.played->seen.share, 0.9);
    EXPECT_EQ(out.info.played->place, 2U);
    EXPECT_EQ(out.stop.psd, random.stop.psd);
    // A lie may be any number; what was taken may not.
    random.info.played->word = Word::refused;
    random.stop.psd[1][1] = std::nan("");
    ASSERT_EQ(decode(encode(random, kHash), kHash, out), "");
    EXPECT_EQ(out.info.played->word, Word::refused);
    random.info.played->random.bandwidth_hz = std::nan("");
    EXPECT_EQ(decode(encode(random, kHash), kHash, out), "corrupt: what was played");
    random.info.played.reset();
    ASSERT_EQ(decode(encode(random, kHash), kHash, out), "");
    EXPECT_FALSE(out.info.played);
    EXPECT_TRUE(out.stop.psd.empty());
}

TEST_F(JournalTest, KeepsASweepWithItsFrequencies) {
    estimator::Identification filter{estimator::Settings{}};
    DwellCheckpoint swept = dwell(filter, 1, 3);
    swept.info.sweep = {20, 120, 300};
    swept.stop.swept_hz = {{-1, 20}, {2.5, 20.25}, {300, 120}};
    const std::string bytes = encode(swept, kHash);
    DwellCheckpoint out;
    ASSERT_EQ(decode(bytes, kHash, out), "");
    EXPECT_EQ(out.info.sweep, swept.info.sweep);
    EXPECT_EQ(out.stop.swept_hz, swept.stop.swept_hz);
    EXPECT_EQ(out.stop.sweep_from_hz, 20);
    EXPECT_EQ(out.stop.sweep_to_hz, 120);
    EXPECT_EQ(out.measurements.size(), swept.measurements.size());
    // What cannot be a frequency is none.
    for (const double hz : {0.0, -3.0, std::nan("")}) {
        swept.stop.swept_hz[1][1] = hz;
        EXPECT_EQ(decode(encode(swept, kHash), kHash, out), "corrupt: sweep") << hz;
    }
    swept.stop.swept_hz.clear();
    swept.info.sweep.from_hz = -20;
    EXPECT_EQ(decode(encode(swept, kHash), kHash, out), "corrupt: sweep");
}

TEST_F(JournalTest, StartsColdAndSaysWhyFromABadCheckpoint) {
    // GIVEN good bytes of a checkpoint
    estimator::Identification filter{estimator::Settings{}};
    const std::string good = encode(dwell(filter, 1, 3), kHash);
    DwellCheckpoint out;
    EXPECT_EQ(decode(good, kHash, out), "");
    struct Case {
        std::string bytes;
        const char* says;
    };
    std::string newer = good, foreign = good;
    newer[8] = 10;
    foreign[0] = 'X';
    std::vector<Case> cases{{"", "truncated: 0 bytes"},
                            {good.substr(0, 11), "truncated"},
                            {foreign, "not a checkpoint"},
                            {newer, "version 10, newer than 9"}};
    // any cut and any flipped bit
    for (std::size_t at = 12; at < good.size(); at += good.size() / 50) {
        cases.push_back({good.substr(0, at), ""});
        std::string flipped = good;
        flipped[at] = static_cast<char>(flipped[at] ^ 0x10);
        cases.push_back({flipped, "corrupt"});
    }
    for (const Case& c : cases) {
        const std::string why = decode(c.bytes, kHash, out);
        EXPECT_NE(why, "");
        EXPECT_THAT(why, HasSubstr(c.says));
    }
    EXPECT_EQ(decode(good, kHash + 1, out), "of another configuration");
    // WHEN one such stands in the journal
    leave_unfinished();
    keep_checkpoint(2, std::string_view(good).substr(0, 500));
    // THEN nothing is offered, with the place and the reason
    Journal journal(path, kHash);
    EXPECT_FALSE(journal.recovery().campaign);
    ASSERT_THAT(journal.recovery().refused, SizeIs(1));
    EXPECT_THAT(journal.recovery().refused[0],
                HasSubstr("checkpoint of run 1 position 2: corrupt: the checksum does not match: "
                          "cold start"));
}

TEST_F(JournalTest, TakesNoCheckpointThatDoesNotComeOutAsItDid) {
    estimator::Identification filter{estimator::Settings{}};
    std::vector<DwellCheckpoint> dwells{dwell(filter, 1)};
    dwells[0].measurements[100].angle_rad[0] += 1e-6;
    EXPECT_EQ(replayed(dwells, 20), "run 1 position 1 does not come out as it did");
}

/// The steps of a dwell's end, written anew.
struct Estimating {
    estimator::Identification filter{estimator::Settings{}};
    noise::NoiseMonitor noise{estimator::Settings{}, [](Severity, const std::string&) {}};

    estimator::DwellSummary operator()(const DwellCheckpoint& checkpoint) {
        rt::Ring<rt::BlockRecord> blocks{256};
        rt::AngleBlocks averager(blocks);
        averager.begin(checkpoint.info, 40 * drivers::kSecond);
        filter.begin_dwell(checkpoint.info);
        for (const auto& m : checkpoint.measurements) {
            if (filter.add(m).outcome == estimator::StepOutcome::used)
                averager.add(m.time_s, m.angle_rad);
        }
        auto summary = filter.end_dwell();
        averager.end();
        blocks.consume([&](const rt::BlockRecord& block) { noise.add(block); }, 256);
        noise.conclude(summary, filter);
        return summary;
    }
};

/// Dwells that `take` comes to a summary of, the platform's gyros `walk` deg/sqrt(h) noisy.
std::vector<DwellCheckpoint> noisy_dwells(
    const std::function<estimator::DwellSummary(const DwellCheckpoint&)>& take, int dwells,
    double walk, int first = 1) {
    constexpr double kArcsec = std::numbers::pi / 180 / 3600;
    std::mt19937_64 generator(911);
    std::normal_distribution<double> normal;
    std::vector<DwellCheckpoint> done;
    for (int p = 1; p < first + dwells; ++p) {
        DwellCheckpoint checkpoint;
        checkpoint.info = {1, p, 9};
        std::array<double, 3> drift{};
        for (int n = 0; n < 40 * 40; ++n) {
            estimator::Measurement m;
            m.time_s = n * 0.025;
            m.force_g = {0, 1 + 6 * std::sin(2 * std::numbers::pi * 15 * m.time_s), 0};
            for (std::size_t k = 0; k < 3; ++k) {
                drift[k] += 60 * walk * std::sqrt(0.025) * normal(generator);
                m.angle_rad[k] = (drift[k] + 5 * normal(generator)) * kArcsec;
            }
            checkpoint.measurements.push_back(m);
        }
        if (p < first) continue;  // the same noise, whoever saw its beginning
        checkpoint.summary = take(checkpoint);
        done.push_back(std::move(checkpoint));
    }
    return done;
}

TEST_F(JournalTest, GoesOnWithTheNoiseLevelsThatTheMonitorHadCameTo) {
    // GIVEN a campaign whose monitor has changed the filter's N
    Estimating uninterrupted;
    std::vector<DwellCheckpoint> dwells = noisy_dwells(std::ref(uninterrupted), 12, 8e-3);
    const auto& first = dwells.front().summary.noise;
    const auto& last = dwells.back().summary.noise;
    ASSERT_GT(last.gyro_random_walk_deg_per_rt_h[0], 1.5 * first.gyro_random_walk_deg_per_rt_h[0])
        << "seed 911";
    // WHEN its checkpoints come back from bytes and are fed again
    for (auto& dwell : dwells) {
        DwellCheckpoint read;
        ASSERT_EQ(decode(encode(dwell, kHash), kHash, read), "");
        EXPECT_TRUE(read.noise_known);
        dwell = read;
    }
    auto resumed = fresh_book();
    EXPECT_EQ(replay(dwells, resumed, 40 * drivers::kSecond), "");
    // THEN filter and monitor go on as the ones that were never interrupted
    noisy_dwells(std::ref(uninterrupted), 3, 8e-3, 13);
    noisy_dwells(
        [&](const DwellCheckpoint& dwell) {
            return resumed.take_again({dwell.info, 40 * drivers::kSecond, dwell.measurements, {}});
        },
        3, 8e-3, 13);
    EXPECT_EQ(uninterrupted.filter.noise().gyro_random_walk_deg_per_rt_h,
              resumed.identification().noise().gyro_random_walk_deg_per_rt_h);
    estimator::Estimate left, right;
    uninterrupted.filter.estimate(left);
    resumed.identification().estimate(right);
    EXPECT_EQ(left.value, right.value);
    EXPECT_EQ(uninterrupted.filter.covariance(), resumed.identification().covariance());
    EXPECT_EQ(uninterrupted.noise.status().dwells, resumed.noise().status().dwells);

    // and levels that are not those it comes to again are refused
    dwells.back().summary.noise.gyro_random_walk_deg_per_rt_h[2] *= 1.001;
    EXPECT_THAT(replayed(dwells, 40), HasSubstr("run 1 position 12 was filtered with"));
    // unless they were not kept
    dwells.back().noise_known = false;
    EXPECT_EQ(replayed(dwells, 40), "");
}

TEST_F(JournalTest, TakesNoImpossibleNoiseLevels) {
    estimator::Identification filter{estimator::Settings{}};
    const DwellCheckpoint good = dwell(filter, 1, 3);
    for (const double bad : {0.0, -1.0, std::nan(""), std::numeric_limits<double>::infinity()}) {
        DwellCheckpoint spoilt = good, out;
        spoilt.summary.noise.angle_arcsec = bad;
        EXPECT_THAT(decode(encode(spoilt, kHash), kHash, out), HasSubstr("corrupt: noise levels"))
            << bad;
        spoilt = good;
        spoilt.summary.noise.gyro_random_walk_deg_per_rt_h[1] = bad;
        EXPECT_THAT(decode(encode(spoilt, kHash), kHash, out),
                    HasSubstr(bad == 0 ? "" : "noise levels"));
    }
}

/// As version 1 wrote it: without the four noise levels, position, repeats, time used, times of
/// the beginning, whether power was lost, frequency, whether it was held out, random vibration.
std::string version_1(const DwellCheckpoint& dwell) {
    std::string bytes = encode(dwell, kHash);
    const std::size_t numbers = 8 + 4 + 8 + 16 + 6 * 4 + 6 * 8 + 1;
    bytes.erase(numbers, (4 + 7 + 5 + 3) * sizeof(double) + sizeof(std::int32_t) +
                             sizeof(std::int64_t) + 3 + sizeof(std::uint16_t) +
                             sizeof(std::uint32_t));
    bytes[8] = 1;
    bytes.resize(bytes.size() - 4);
    const auto sum = static_cast<std::uint32_t>(::crc32_z(
        ::crc32_z(0, nullptr, 0), reinterpret_cast<const Bytef*>(bytes.data()), bytes.size()));
    bytes.append(reinterpret_cast<const char*>(&sum), sizeof sum);
    return bytes;
}

TEST_F(JournalTest, KnowsAfterWhichRestartThePowerWasLost) {
    estimator::Identification filter{estimator::Settings{}};
    for (const bool lost : {false, true}) {
        DwellCheckpoint one = dwell(filter, 1), read;
        one.info.power_lost = lost;
        ASSERT_EQ(decode(encode(one, kHash), kHash, read), "");
        EXPECT_EQ(read.info.power_lost, lost);
    }
}

TEST_F(JournalTest, KnowsFrequencyAndRoleOfADwell) {
    estimator::Identification filter{estimator::Settings{}};
    DwellCheckpoint one = dwell(filter, 1), read;
    one.info.frequency_hz = 25.1;
    one.info.held_out = true;
    ASSERT_EQ(decode(encode(one, kHash), kHash, read), "");
    EXPECT_EQ(read.info.frequency_hz, 25.1);
    EXPECT_TRUE(read.info.held_out);
    EXPECT_EQ(read.stop.frequency_hz, 25.1);
    one.info.frequency_hz = -1;
    EXPECT_EQ(decode(encode(one, kHash), kHash, read), "corrupt: frequency");
}

TEST_F(JournalTest, KnowsTheRandomVibrationOfADwell) {
    estimator::Identification filter{estimator::Settings{}};
    DwellCheckpoint one = dwell(filter, 1), read;
    one.info.random = {1.5, 100, 0.01, 500, 4, -1.5};
    ASSERT_EQ(decode(encode(one, kHash), kHash, read), "");
    EXPECT_EQ(read.info.random.mean_square_g2, 1.5);
    EXPECT_EQ(read.info.random.bandwidth_hz, 100);
    EXPECT_EQ(read.info.random.gain_error, 0.01);
    EXPECT_EQ(read.info.random.highest_hz, 500);
    EXPECT_EQ(read.info.random.profile, 4);
    EXPECT_EQ(read.info.random.level_db, -1.5);
    EXPECT_EQ(read.stop.profile, 4);
    one.info.random.mean_square_g2 = -1;
    EXPECT_EQ(decode(encode(one, kHash), kHash, read), "corrupt: random vibration");
}

TEST_F(JournalTest, ReadsCheckpointsOfVersion1AndSaysWhatItAssumes) {
    leave_unfinished();
    estimator::Identification filter{estimator::Settings{}};
    for (int p = 1; p <= 2; ++p) keep_checkpoint(p, version_1(dwell(filter, p)));
    Journal journal(path, kHash);
    ASSERT_TRUE(journal.recovery().campaign);
    EXPECT_THAT(journal.recovery().assumed, HasSubstr("2 checkpoints of version 1"));
    EXPECT_FALSE(journal.recovery().campaign->dwells[0].stop_known);
    EXPECT_EQ(replayed(journal.recovery().campaign->dwells, 20), "");
}

TEST_F(JournalTest, PutsADamagedOrNewerFileAside) {
    leave_unfinished();
    Database(path).execute("PRAGMA user_version = 7");
    {
        Journal journal(path, kHash);
        EXPECT_FALSE(journal.recovery().campaign);
        ASSERT_THAT(journal.recovery().refused, SizeIs(1));
        EXPECT_THAT(journal.recovery().refused[0], HasSubstr("version 7, newer than 2"));
        EXPECT_THAT(journal.recovery().refused[0], HasSubstr("put aside as " + path + ".aside."));
        ASSERT_THAT(journal.recovery().latches, SizeIs(1));
        EXPECT_EQ(journal.recovery().latches[0].name, kJournalLatch);
    }
    std::ofstream(path, std::ios::trunc) << std::string(10'000, 'x');
    Journal journal(path, kHash);
    EXPECT_FALSE(journal.recovery().campaign);
    ASSERT_THAT(journal.recovery().refused, SizeIs(1));
    EXPECT_THAT(journal.recovery().refused[0], HasSubstr("cold start"));
    journal.start();
    journal.event({});
    journal.stop();
    EXPECT_TRUE(journal.status().running) << journal.status().note;
}

TEST_F(JournalTest, RefusesAPlaceWhereNothingCanBeKept) {
    EXPECT_THROW(Journal((folder / "missing" / "journal.sqlite3").string(), kHash), DatabaseError);
}

TEST_F(JournalTest, DoesNotKeepACheckpointWithMeasurementsMissing) {
    estimator::Identification filter{estimator::Settings{}};
    {
        Journal journal(path, kHash);
        journal.start();
        journal.campaign_begun("night", "Ada");
        auto short_of_one = dwell(filter, 1);
        short_of_one.measurements.pop_back();
        feed(journal, short_of_one);
        journal.stop();
    }
    Journal journal(path, kHash);
    EXPECT_FALSE(journal.recovery().campaign);
    ASSERT_THAT(journal.recovery().refused, SizeIs(1));
}

TEST_F(JournalTest, WaitsForADiskThatRefusesAndLosesNothing) {
    // GIVEN a journal whose files may not grow
    Journal journal(path, kHash);
    journal.start();
    journal.event({1, 1, 1, Severity::info, "a", "before"});
    const auto eventually = [](const auto& done) {
        for (int n = 0; n < 1000 && !done(); ++n)
            std::this_thread::sleep_for(std::chrono::milliseconds(10));
        return done();
    };
    ASSERT_TRUE(eventually([&] { return journal.status().written == 1; }));
    std::signal(SIGXFSZ, SIG_IGN);
    rlimit was{};
    ::getrlimit(RLIMIT_FSIZE, &was);
    const rlimit small{4096, was.rlim_max};
    ::setrlimit(RLIMIT_FSIZE, &small);
    // WHEN events come
    for (int n = 0; n < 200; ++n)
        journal.event({2, 2, 2, Severity::info, "b", std::string(1000, 'x')});
    const bool refused = eventually([&] { return !journal.status().running; });
    EXPECT_FALSE(journal.status().note.empty());
    ::setrlimit(RLIMIT_FSIZE, &was);
    ASSERT_TRUE(refused);
    // THEN they are on disk once it has room again
    EXPECT_TRUE(eventually([&] { return journal.status().running; }));
    journal.stop();
    EXPECT_EQ(journal.status().written, 201U);
    EXPECT_EQ(ask("SELECT count(*) FROM event").at(0).numbers[0], 201);
}

}  // namespace
}  // namespace vibrig::journal
