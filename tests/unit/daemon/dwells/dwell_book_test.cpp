#include "daemon/dwells/dwell_book.hpp"

#include <gtest/gtest.h>
#include <spdlog/fmt/fmt.h>
#include <spdlog/fmt/ranges.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <numbers>
#include <random>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "daemon/dwells/anew.hpp"
#include "daemon/journal/journal.hpp"
#include "daemon/record/campaign_file.hpp"
#include "daemon/record/campaign_writer.hpp"
#include "daemon/record/replay.hpp"
#include "daemon/rt/real_clock.hpp"
#include "estimator/identification/result.hpp"
#include "estimator/spectrum/read_sweep.hpp"
#include "tests/plant/recording.hpp"
#include "tests/unit/support/temporary_folder.hpp"

namespace vibrig::dwells {
namespace {

namespace fs = std::filesystem;
using drivers::kSecond;
using drivers::Time;

constexpr std::uint64_t kHash = 0x1234;
constexpr unsigned kSeed = 911;
constexpr double kWalk = 5e-3;  // deg/sqrt(h); 1e-3 is configured
constexpr Time kPeriod = 25 * drivers::kMillisecond, kDwell = 40 * kSecond;

/// A dwell as the rig has it, and what a person or a controller adds to it.
struct Measured {
    estimator::DwellInfo info;
    Time from = 0;
    std::array<double, 3> zero_g{};
    std::vector<drivers::Sample> samples;  ///< between the dwells, too
    StopDone stop;
    std::optional<estimator::PlayedRandom> played;
};

/// At rest in attitude, shaken vertically: what the simulated rig has no dwell of.
class Synthetic {
  public:
    [[nodiscard]] std::vector<drivers::Sample> random() {
        return dwell([this](double) { return 2 * normal_(generator_); });
    }
    [[nodiscard]] std::vector<drivers::Sample> swept() {
        double phase = 0;
        return dwell([phase](double time_s) mutable {
            phase += 2 * std::numbers::pi * hz_of(time_s) * drivers::to_seconds(kPeriod);
            return 6 * std::sin(phase);
        });
    }
    [[nodiscard]] static double hz_of(double time_s) {
        return kFrom_hz * std::pow(kTo_hz / kFrom_hz, time_s / drivers::to_seconds(kDwell));
    }
    /// More of the gyros' noise, `walk` deg/sqrt(h).
    void add_walk(std::vector<drivers::Sample>& samples, double walk) {
        std::array<double, 3> drift{};
        for (auto& sample : samples) {
            for (std::size_t k = 0; k < 3; ++k) {
                drift[k] += 60 * walk * std::sqrt(drivers::to_seconds(kPeriod)) * kArcsec *
                            normal_(generator_);
                sample.angle[k] += drift[k];
            }
        }
    }

    static constexpr double kFrom_hz = 4, kTo_hz = 9;

  private:
    static constexpr double kArcsec = std::numbers::pi / 180 / 3600;

    std::vector<drivers::Sample> dwell(const auto& shake) {
        std::vector<drivers::Sample> out;
        auto next = shake;
        for (Time t = 0; t < kDwell; t += kPeriod) {
            drivers::Sample& sample = out.emplace_back();
            for (double& angle : sample.angle) angle = 5 * kArcsec * normal_(generator_);
            sample.force = {2e-4 * normal_(generator_), 1 + next(drivers::to_seconds(t)),
                            2e-4 * normal_(generator_)};
        }
        add_walk(out, kWalk);
        return out;
    }

    std::mt19937_64 generator_{kSeed};
    std::normal_distribution<double> normal_;
};

/// Those of the simulated rig, its gyros five times as noisy as configured.
std::vector<Measured> planned() {
    plant::CampaignPlan plan;
    plan.dwell_s = drivers::to_seconds(kDwell);
    plan.order = plant::parse_order(
        "1.9,2.11,1.5,2.3,2.7,1.14,2.12,1.13,2.6,1.2,1.3,2.4,1.1,2.2,1.10,2.9,1.12,2.1,2.14,1.7,"
        "1.8,2.5,1.6,2.8,1.4,2.13,1.11,2.10");
    for (auto& [run, position] : plan.order) std::swap(run, position);
    plant::Truth truth;
    truth.gyro_random_walk_deg_per_rt_h = kWalk;
    truth.seed = kSeed;
    std::vector<Measured> out(1);
    plant::simulate(
        truth, plan,
        [&](const plant::PlannedSample& p) {
            Measured& dwell = out.back();
            if (dwell.samples.empty()) dwell.info.table_g = plan.table_g[p.run - 1];
            drivers::Sample& sample = dwell.samples.emplace_back();
            for (std::size_t k = 0; k < 3; ++k) {
                sample.angle[k] = p.readings.encoder_deg[k] * (std::numbers::pi / 180);
                sample.force[k] = p.readings.raw_g[k];
            }
        },
        [&](std::size_t, std::size_t) { out.emplace_back(); });
    out.pop_back();
    return out;
}

/// A campaign that has dwells of each kind: with angles that were lost, one three times as noisy as
/// the others, one that no sample came of, one held out, one under random vibration whose PSD the
/// controller reported, one whose PSD was refused, and a sweep.
std::vector<Measured> measured() {
    constexpr std::size_t kNoisy = 12, kSilent = 14, kHeldOut = 16, kReported = 18, kRefused = 19,
                          kSwept = 20;
    using Word = estimator::PlayedRandom::Word;
    Synthetic synthetic;
    std::vector<Measured> out = planned();
    Time now = 100 * kSecond;
    for (std::size_t i = 0; i < out.size(); ++i) {
        Measured& dwell = out[i];
        now += kDwell + 5 * kSecond;
        dwell.from = now;
        if (i == kNoisy) synthetic.add_walk(dwell.samples, 3 * kWalk);
        if (i == kSilent) dwell.samples.clear();
        dwell.info.held_out = dwell.stop.held_out = i == kHeldOut;
        if (i == kReported || i == kRefused) {
            dwell.samples = synthetic.random();
            dwell.info.random = {4, 100, 0.02, 200, 1, 0};
            dwell.stop.profile = 1;
            dwell.played.emplace();
            dwell.played->word = i == kReported ? Word::good : Word::refused;
        }
        if (i == kReported) {
            dwell.played->random = {4.2, 95, 0.01, 200, 1, 0};
            dwell.played->place = 1;
            dwell.stop.psd = {{10, 0.021}, {200, 0.021}};
        }
        if (i == kSwept) {
            dwell.samples = synthetic.swept();
            dwell.info.sweep = {Synthetic::kFrom_hz, Synthetic::kTo_hz,
                                drivers::to_seconds(kDwell)};
            dwell.stop.sweep_from_hz = dwell.info.sweep.from_hz;
            dwell.stop.sweep_to_hz = dwell.info.sweep.to_hz;
            for (Time at = 0; at <= kDwell; at += kSecond) {
                const double s = drivers::to_seconds(at);
                dwell.stop.swept_hz.push_back({s, Synthetic::hz_of(s)});
            }
        }
        dwell.info.run = 1;
        dwell.info.position = static_cast<int>(i) + 1;
        dwell.info.begin_s = dwell.stop.begin_s = drivers::to_seconds(now - out[0].from);
        dwell.zero_g = {1e-4 * static_cast<double>(i), -2e-4, 3e-4};
        // Two seconds of nothing behind it.
        if (!dwell.samples.empty())
            dwell.samples.resize(dwell.samples.size() + 80, dwell.samples.back());
        for (std::size_t n = 0; n < dwell.samples.size(); ++n) {
            drivers::Sample& sample = dwell.samples[n];
            sample.time = now + static_cast<Time>(n) * kPeriod;
            for (std::size_t k = 0; k < 3; ++k) sample.force[k] += dwell.zero_g[k];
            if (n % 211 == 7) sample.quality[0] = drivers::Quality::stale;
        }
    }
    return out;
}

std::string of(const estimator::DwellSummary& s) {
    return fmt::format(
        "{} {}: {} {} {} {} {:a} {} {:a} {:a} {:a} {:a} {:a} {:a} {} \"{}\" {:a} {} "
        "{} {}\n",
        s.run, s.position, s.samples, s.used, s.rejected, s.reinitialised, s.kappa, s.gamma,
        s.amplitude_g, s.frequency_hz, s.relative_error, s.mean_force_g, s.nis_per_dof,
        s.innovation_correlation, s.flagged, s.reason, s.noise.angle_arcsec,
        s.noise.gyro_random_walk_deg_per_rt_h, s.followed, s.left_out);
}

std::string of(const estimator::DwellRow& row) {
    std::string text =
        fmt::format("{} {} at {:a} for {:a} s, {:a} Hz, {} {} {} {} psd {} {:a}:", row.run,
                    row.position, row.middle_s, row.duration_s, row.frequency_hz, row.held_out,
                    row.random, row.apart, row.flagged, row.psd, row.relative_error);
    for (const double value : row.rate) text += fmt::format(" {:a}", value);
    for (const auto& of_gyro : row.variance)
        for (const double value : of_gyro) text += fmt::format(" {:a}", value);
    for (const auto& of_gyro : row.regressors)
        for (const double value : of_gyro) text += fmt::format(" {:a}", value);
    for (const double value : row.ramp) text += fmt::format(" {:a}", value);
    return text + "\n";
}

std::string of(const estimator::spectrum::Sweep& sweep) {
    std::string text = fmt::format("sweep in {} {}:\n", sweep.run, sweep.position);
    for (const auto& block : sweep.blocks) {
        text += fmt::format("{:a} {:a} {:a} {}", block.time_s, block.from_hz, block.to_hz,
                            block.samples);
        for (const double value : block.angle_rad) text += fmt::format(" {:a}", value);
        if (block.moment)
            for (const auto& row : *block.moment)
                for (const double value : row) text += fmt::format(" {:a}", value);
        text += "\n";
    }
    return text;
}

/// The state of a book to the last bit, but for what the monitor shows to people.
std::string of(const DwellBook& book) {
    const auto& identification = book.identification();
    std::string text;
    const auto put = [&text](const auto& values) {
        for (const double value : values) text += fmt::format("{:a} ", value);
        text += "\n";
    };
    estimator::Estimate estimate;
    identification.estimate(estimate);
    put(estimate.value);
    put(estimate.sigma);
    identification.solved(estimate);
    put(estimate.value);
    put(estimate.sigma);
    put(identification.covariance());
    put(identification.covariance_now());
    put(identification.noise().gyro_random_walk_deg_per_rt_h);
    put(std::array{identification.noise().angle_arcsec});
    for (const auto& row : identification.rows()) text += of(row);
    for (const auto& dwell : identification.result().dwells) text += of(dwell);
    const auto& noise = book.noise().status();
    text += fmt::format("{} dwells, {} left out, {} alarms\n", noise.dwells, noise.dwells_left_out,
                        noise.alarms_total);
    for (const auto& gyro : noise.gyros) put(std::array{gyro.in_force, gyro.terms[1].value});
    if (const auto found = book.noise().found()) {
        put(found->levels.gyro_random_walk_deg_per_rt_h);
        put(std::array{found->levels.angle_arcsec, found->dof});
    }
    for (const auto& sweep : book.spectrum().sweeps) text += of(sweep);
    return text;
}

/// Somebody looks at the noise, as in the daemon; nobody has to hear of it.
DwellBook watched_book() {
    return DwellBook(estimator::Settings{}, [](Severity, const std::string&) {});
}

/// The daemon's estimator thread with a book, and what its control thread does at each end.
class Live {
  public:
    /// `journal`: gets what was fed and what came of it. `recording`: likewise.
    Live(DwellBook& book, journal::Journal* journal, record::CampaignWriter* recording)
        : book_(book), journal_(journal), recording_(recording) {
        if (journal_) stage_.feed_to(journal_->fed());
        thread_ = std::thread([this] { stage_.run(); });
    }
    ~Live() {
        stage_.stop();
        thread_.join();
    }
    Live(const Live&) = delete;
    Live& operator=(const Live&) = delete;

    void take(const Measured& dwell) {
        rt::DwellOrder order;
        order.from = dwell.from;
        order.to = dwell.from + kDwell;
        order.zero_g = dwell.zero_g;
        order.dwell = dwell.info;
        ASSERT_TRUE(book_.order(stage_, order));
        record(dwell);
        if (!dwell.samples.empty()) announce(dwell.from);
        for (const auto& sample : dwell.samples) push(sample);
        if (dwell.samples.empty()) cancel();
        rt::DwellDone done;
        wait_until([&] { return book_.take_done(stage_, done); });
        EXPECT_TRUE(book_.free());
        auto info = dwell.info;
        if (info.sweep.any()) book_.spectrum().sweeps.push_back(sweep_of(dwell));
        if (dwell.played) {
            info.played = dwell.played;
            book_.played(*dwell.played, done.summary);
        }
        summaries_ += of(done.summary);
        if (journal_) {
            journal_->dwell_done(info, done.summary, dwell.stop);
            // A dwell is over in no time here, and the disk has to follow.
            const auto fed = journal_->fed().counts().pushed;
            wait_until([&] { return journal_->fed().counts().popped >= fed; });
        }
        if (recording_) record(dwell, done.summary);
    }
    [[nodiscard]] const std::string& summaries() const { return summaries_; }

  private:
    static void wait_until(const auto& is) {
        while (!is()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    void push(const drivers::Sample& sample) {
        wait_until([&] { return ring_.try_push(sample); });
        self_->notify();
    }
    /// An order comes ahead of its samples: a round of the stage that ends after it is waited for.
    void announce(Time from) {
        drivers::Sample before;
        before.time = from - kSecond;
        push(before);
        wait_until([&] { return stage_.view().sample_time == before.time; });
    }
    void cancel() {
        rt::DwellOrder order;
        order.cancel = true;
        ASSERT_TRUE(book_.order(stage_, order));
    }
    /// As a dwell's stage makes it, while the samples come.
    [[nodiscard]] static estimator::spectrum::Sweep sweep_of(const Measured& dwell) {
        estimator::spectrum::ReadSweep sweep({}, dwell.info.run, dwell.info.position);
        std::size_t next_reading = 0;
        for (const auto& sample : dwell.samples) {
            if (sample.time >= dwell.from + kDwell) break;
            const auto measurement = rt::measurement_of(sample, dwell.from, dwell.zero_g);
            while (next_reading < dwell.stop.swept_hz.size() &&
                   dwell.stop.swept_hz[next_reading][0] <= measurement.time_s) {
                sweep.frequency(dwell.stop.swept_hz[next_reading][0],
                                dwell.stop.swept_hz[next_reading][1]);
                ++next_reading;
            }
            sweep.add(measurement);
        }
        for (; next_reading < dwell.stop.swept_hz.size(); ++next_reading)
            sweep.frequency(dwell.stop.swept_hz[next_reading][0],
                            dwell.stop.swept_hz[next_reading][1]);
        return sweep.finish();
    }
    void record(const Measured& dwell) {
        if (!recording_) return;
        record::Order order;
        order.announced = dwell.from - kSecond;
        order.from = dwell.from;
        order.to = dwell.from + kDwell;
        order.run = dwell.info.run;
        order.position = dwell.info.position;
        order.table_g = dwell.info.table_g;
        order.zero_g = dwell.zero_g;
        order.noise = book_.identification().noise();
        order.begin_s = dwell.info.begin_s;
        order.held_out = dwell.info.held_out;
        order.random = dwell.info.random;
        order.sweep = dwell.info.sweep;
        recording_->put(order);
        if (dwell.samples.empty()) {
            record::Order cancelled;
            cancelled.announced = dwell.from;
            cancelled.cancel = true;
            recording_->put(cancelled);
        }
        for (const auto& sample : dwell.samples) recording_->put(sample);
    }
    void record(const Measured& dwell, const estimator::DwellSummary& summary) {
        const int run = summary.run, position = summary.position;
        record::Swept swept;
        for (const auto& [time_s, hz] : dwell.stop.swept_hz)
            swept.push_back({dwell.from + drivers::from_seconds(time_s), run, position, hz});
        if (!swept.empty()) recording_->put(swept);
        if (dwell.played)
            recording_->put(
                record::Played{dwell.from, run, position, *dwell.played, dwell.stop.psd});
        estimator::Estimate estimate;
        book_.identification().solved(estimate);
        record::Dwell done;
        done.time = dwell.from + kDwell;
        done.summary = summary;
        done.reason = summary.reason;
        done.value = estimate.value;
        done.sigma = estimate.sigma;
        done.observable = estimate.observable;
        done.covariance = book_.identification().covariance();
        done.numbers = record::numbers_after(book_.identification(), summary);
        recording_->put(done);
    }

    DwellBook& book_;
    journal::Journal* journal_;
    record::CampaignWriter* recording_;
    rt::RealClock clock_;
    std::unique_ptr<drivers::Waiter> self_ = clock_.make_waiter(), control_ = clock_.make_waiter();
    rt::Ring<drivers::Sample> ring_{4096};
    rt::EstimatorStage stage_{ring_, *self_, *control_, book_.identification()};
    std::thread thread_;
    std::string summaries_;
};

/// One campaign live, with its journal and its recording on disk.
class DwellBookTest : public ::testing::Test {
  protected:
    DwellBookTest() {
        journal::Journal journal(path(), kHash);
        journal.start();
        journal.campaign_begun("night", "Ada");
        record::Head head;
        head.name = "night";
        head.clock = "real";
        record::CampaignWriter recording((folder_ / "campaign.h5").string(), head);
        {
            Live live(live_, &journal, &recording);
            for (const auto& dwell : measured_) live.take(dwell);
            summaries_ = live.summaries();
        }
        recording.end({"finished", "", "", "", 1});
        journal.stop();  // nobody has ended the campaign
    }
    [[nodiscard]] std::string path() const { return (folder_ / "journal.sqlite3").string(); }

    TemporaryFolder folder_;
    const std::vector<Measured> measured_ = measured();
    DwellBook live_ = watched_book();
    std::string summaries_;
};

TEST_F(DwellBookTest, TheDwellsHaveOfEachKindOne) {
    const auto dwells = live_.identification().result().dwells;
    const auto count = [&](const auto& is) { return std::ranges::count_if(dwells, is); };
    SCOPED_TRACE("seed " + std::to_string(kSeed) + "\n" + summaries_);
    EXPECT_EQ(measured_.size(), dwells.size() + 1);  // of one the filter has never heard
    EXPECT_NE(summaries_.find("no samples"), std::string::npos);
    EXPECT_NE(summaries_.find("noise is not that of the earlier dwells"), std::string::npos);
    EXPECT_GT(count([](const auto& d) { return d.rejected > 0; }), 0);
    const auto& first = dwells.front().noise.gyro_random_walk_deg_per_rt_h;
    EXPECT_GT(live_.identification().noise().gyro_random_walk_deg_per_rt_h[0], 1.5 * first[0]);
    EXPECT_TRUE(live_.noise().found());
    const auto& rows = live_.identification().rows();
    EXPECT_TRUE(std::ranges::any_of(rows, [](const auto& r) { return r.random && r.psd == 1; }));
    EXPECT_TRUE(std::ranges::any_of(rows, [](const auto& r) { return r.held_out; }));
    ASSERT_EQ(live_.spectrum().sweeps.size(), 1U);
    EXPECT_GE(live_.spectrum().sweeps[0].known(), 20U);
}

TEST_F(DwellBookTest, ResumedAfterAnyOfItsDwellsItComesToTheLiveState) {
    journal::Journal journal(path(), kHash);
    ASSERT_TRUE(journal.recovery().refused.empty()) << journal.recovery().refused.front();
    ASSERT_TRUE(journal.recovery().campaign);
    const auto& kept = journal.recovery().campaign->dwells;
    ASSERT_EQ(kept.size(), measured_.size());
    const std::string expected = of(live_);
    // Before and after each of those that are unlike the others, and a few more.
    for (const std::size_t interrupted :
         std::array<std::size_t, 14>{0, 1, 8, 12, 13, 14, 15, 16, 17, 18, 19, 20, 21, 28}) {
        SCOPED_TRACE(fmt::format("interrupted after {} dwells, seed {}", interrupted, kSeed));
        // GIVEN the dwells in the journal up to there, in a fresh book
        std::vector<journal::DwellCheckpoint> before(kept.begin(),
                                                     kept.begin() + std::ptrdiff_t(interrupted));
        auto again = watched_book();
        ASSERT_EQ(journal::replay(before, again, kDwell), "");
        std::string summaries;
        for (const auto& dwell : before) summaries += of(dwell.summary);
        // WHEN a book that has had another campaign goes on from it, live
        auto resumed = watched_book();
        {
            Live live(resumed, nullptr, nullptr);
            live.take(measured_.back());
        }
        resumed.continue_from(std::move(again), measured_.size());
        {
            Live live(resumed, nullptr, nullptr);
            for (std::size_t i = interrupted; i < measured_.size(); ++i) live.take(measured_[i]);
            summaries += live.summaries();
        }
        // THEN it is the campaign that was never interrupted
        ASSERT_EQ(of(resumed), expected);
        ASSERT_EQ(summaries, summaries_);
    }
}

TEST_F(DwellBookTest, ReplayedItComesToTheLiveState) {
    auto campaign = record::read_campaign(folder_.string());
    record::place_played(campaign);
    for (const bool noise_known : {true, false}) {
        SCOPED_TRACE(noise_known ? "with the noise recorded" : "with the monitor's noise again");
        if (!noise_known) record::forget_noise(campaign);
        const auto replayed = record::replay(campaign, estimator::Settings{}, {});
        EXPECT_EQ(replayed.compared, measured_.size());
        EXPECT_EQ(replayed.different, 0U) << replayed.first_difference;
        std::string summaries;
        for (auto dwell : replayed.dwells) {
            // What the monitor says of a dwell is the recording's own where it is left alone.
            if (noise_known) dwell.summary.reason = dwell.reason.c_str();
            summaries += of(dwell.summary);
        }
        EXPECT_EQ(summaries, summaries_);
        EXPECT_EQ(replayed.found.has_value(), !noise_known);
        const auto& result = noise_known ? replayed.result : replayed.live;
        const auto live = live_.identification().result();
        EXPECT_EQ(result.value, live.value);  // and none is NaN
        EXPECT_EQ(result.sigma, live.sigma);
        std::string rows, live_rows;
        for (const auto& row : result.rows) rows += of(row);
        for (const auto& row : live.rows) live_rows += of(row);
        EXPECT_EQ(rows, live_rows);
    }
    // and of the sweep's samples and readings the same blocks
    std::string swept;
    for (const auto& dwell : record::recorded_dwells(campaign)) {
        if (dwell.order->sweep.any())
            swept += of(record::sweep_of(campaign, estimator::Settings{}, dwell).finish());
    }
    EXPECT_EQ(swept, of(live_.spectrum().sweeps.at(0)));
}

TEST_F(DwellBookTest, IdentifiedAnewFromJournalAndRecordingItIsTheSame) {
    const auto found = live_.noise().found();
    ASSERT_TRUE(found);
    journal::Journal journal(path(), kHash);
    ASSERT_TRUE(journal.recovery().campaign);
    const auto& dwells = journal.recovery().campaign->dwells;
    Anew of_journal(estimator::Settings{}, *found, dwells.size());
    for (const auto& dwell : dwells) {
        const auto& all = dwell.measurements;
        feed(
            of_journal.identification(), dwell.info, all.size(),
            [&all](std::size_t n) { return all[n]; }, false,
            [](std::size_t, const estimator::StepResult&) {});
    }
    auto campaign = record::read_campaign(folder_.string());
    record::place_played(campaign);
    const auto of_recording = record::anew(campaign, estimator::Settings{}, *found);
    const auto left = of_journal.result(), right = of_recording.result();
    EXPECT_EQ(left.value, right.value);
    EXPECT_EQ(left.sigma, right.sigma);
    EXPECT_EQ(left.warnings, right.warnings);
    const auto live = live_.identification().result();
    EXPECT_NE(left.value, live.value);
}

TEST_F(DwellBookTest, ALastBitMoreInAKeptSampleIsSeen) {
    journal::Journal journal(path(), kHash);
    ASSERT_TRUE(journal.recovery().campaign);
    auto dwells = journal.recovery().campaign->dwells;
    double& angle = dwells[4].measurements[100].angle_rad[1];
    angle = std::nextafter(angle, 10.0);
    auto book = watched_book();
    EXPECT_NE(journal::replay(dwells, book, kDwell), "");
}

}  // namespace
}  // namespace vibrig::dwells
