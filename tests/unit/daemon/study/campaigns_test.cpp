#include "daemon/study/campaigns.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <condition_variable>
#include <filesystem>
#include <fstream>
#include <functional>
#include <mutex>
#include <new>
#include <nlohmann/json.hpp>
#include <system_error>

#include "daemon/study/merge.hpp"
#include "daemon/study/reduce.hpp"
#include "daemon/study/run.hpp"
#include "estimator/uncertainty/assessment.hpp"
#include "tests/plant/recording.hpp"
#include "tests/unit/support/temporary_folder.hpp"

namespace vibrig::study {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

// Short dwells at few positions: many tasks, nothing determined.
constexpr const char* kShort = R"([study]
name = "short"
kind = "campaigns"
seed = 5
runs = 6
[campaign]
positions_deg = [[0, 0, 0], [90, 0, 0]]
dwell_s = 2
settle_s = 2
identify = "what-it-can"
[rig]
platform.slew_deg_per_s = 90
"noise.resolver_arcsec" = { rectangular = [4, 6] }
"accelerometer.misalignment_arcsec" = { normal = [0, 20] }
[grid]
"isolator.cross_axis" = [[0, 0], [0.05, 0]]
)";

class StudyRun : public ::testing::Test {
  protected:
    StudyRun() { std::ofstream(top_ / "S.toml") << kShort; }
    Folder planned(const std::string& name) {
        return plan_study((top_ / "S.toml").string(), (top_ / name).string(), "baseline");
    }
    static std::string result(const Folder& folder) {
        Merged merged(folder);
        Reduction reduction(folder);
        for (TaskRecord record; merged.next(record);) reduction.add(record.index, record.bytes);
        EXPECT_EQ(merged.found().missing_count, 0U);
        return reduction.result(0).dump();
    }

    TemporaryFolder top_;
};

TEST_F(StudyRun, GivesTheSameForAnyThreadsAndShards) {
    const Folder once = planned("once");
    RunOptions options;
    EXPECT_TRUE(run_study(once, options).complete());
    const std::string expected = result(once);
    EXPECT_THAT(expected, HasSubstr("\"done\":12,\"failed\":0"));

    const Folder threads = planned("threads");
    options.threads = 3;
    options.chunk_s = 0;
    std::uint64_t done = 0;
    options.progress = [&](const RunProgress& p) { done = p.done; };
    EXPECT_TRUE(run_study(threads, options).complete());
    EXPECT_EQ(done, 12U);
    EXPECT_EQ(result(threads), expected);

    for (const std::uint64_t of : {3U, 7U}) {
        const Folder shards = planned("shards" + std::to_string(of));
        RunOptions one;
        for (std::uint64_t number = of; number-- > 0;) {
            one.shard = {number, of};
            EXPECT_TRUE(run_study(shards, one).complete());
        }
        EXPECT_EQ(result(shards), expected);
        one.shard = {};
        const RunReport again = run_study(shards, one);
        EXPECT_EQ(again.before, 12U);
        EXPECT_EQ(again.now, 0U);
    }
}

/// Tasks that wait until somebody lets them go on.
class Gate {
  public:
    void open(std::uint64_t tasks) {
        const std::scoped_lock lock(mutex_);
        open_ = std::max(open_, tasks);
        changed_.notify_all();
    }
    void pass() {
        std::unique_lock lock(mutex_);
        changed_.wait(lock, [this] { return passed_ < open_; });
        ++passed_;
    }

  private:
    std::mutex mutex_;
    std::condition_variable changed_;
    std::uint64_t open_ = 0, passed_ = 0;
};

class FakeWorker : public Worker {
  public:
    explicit FakeWorker(std::function<void(std::uint64_t)> before) : before_(std::move(before)) {}
    std::string run(std::uint64_t index) override {
        before_(index);
        return failed_record("task " + std::to_string(index));
    }

  private:
    std::function<void(std::uint64_t)> before_;
};

TEST_F(StudyRun, GoesOnWhereItWasStopped) {
    const Folder folder = planned("s");
    Gate gate;
    gate.open(3);
    RunOptions options;
    std::atomic<bool> stop{false};
    options.stop = &stop;
    options.worker = [&] {
        return std::make_unique<FakeWorker>([&](std::uint64_t) { gate.pass(); });
    };
    // The fourth task waits until it is stopped, and is done yet.
    options.progress = [&](const RunProgress& p) {
        if (stop) gate.open(12);
        if (p.done == 3) stop = true;
    };
    const RunReport first = run_study(folder, options);
    EXPECT_EQ(first.before, 0U);
    EXPECT_EQ(first.now, 4U);
    EXPECT_FALSE(first.complete());
    options.stop = nullptr;
    const RunReport second = run_study(folder, options);
    EXPECT_EQ(second.before, 4U);
    EXPECT_EQ(second.now, 8U);
    EXPECT_TRUE(second.complete());
}

TEST_F(StudyRun, StoresNothingOfWhatPasses) {
    const std::vector<std::pair<std::function<void()>, std::string>> troubles{
        {[] { throw std::bad_alloc(); }, "not enough memory"},
        {[] { throw std::system_error(EAGAIN, std::generic_category()); },
         "Resource temporarily unavailable"}};
    for (const auto& [trouble, words] : troubles) {
        const Folder folder = planned(words.substr(0, 3));
        RunOptions options;
        options.threads = 2;
        bool broken = true;
        const std::function<void()>& raise = trouble;
        options.worker = [&broken, &raise] {
            return std::make_unique<FakeWorker>([&broken, &raise](std::uint64_t index) {
                if (broken && index == 5) raise();
            });
        };
        try {
            static_cast<void>(run_study(folder, options));
            ADD_FAILURE() << words;
        } catch (const StudyError& error) {
            EXPECT_THAT(error.what(), HasSubstr("stopped at task 5: " + words));
            EXPECT_THAT(error.what(), HasSubstr("run it again and it goes on"));
        }
        const Done done = done_in(folder.parts(), folder.id, 12, {});
        EXPECT_GE(done.count, 5U);
        EXPECT_FALSE(done.tasks[5]);
        broken = false;
        const RunReport again = run_study(folder, options);
        EXPECT_TRUE(again.complete());
        EXPECT_EQ(again.before, done.count);
    }
}

TEST(StudyRecord, OfAFailureIsAlwaysUtf8) {
    // Cut within a character, which begins at byte 999.
    const std::string cut = failed_record(std::string(999, 'x') + "\u00e4\u00e4");
    EXPECT_EQ(decode(cut).failed, std::string(999, 'x'));
    EXPECT_EQ(decode(failed_record("\xe4")).failed, "\u00e4");
    EXPECT_EQ(decode(failed_record("")).failed, "no reason given");
    CampaignSums sums;
    sums.add(decode(failed_record(std::string(2000, '\xff'))));
    EXPECT_NO_THROW(static_cast<void>(sums.json().dump()));
}

TEST(StudyCampaigns, ThatThrowAreResultsThatSayWhy) {
    // An amplitude that the simulated shaker refuses.
    const Study study = parse_study(
        "[study]\nname='a'\nkind='campaigns'\n[campaign]\ndwell_s=2\ntable_g=[9, 7]\n[rig]\n"
        "\"shaker.limit_g\" = 5\n",
        "S.toml");
    const auto sequences = check_campaigns(study, "S.toml");
    CampaignWorker worker(study, sequences);
    EXPECT_THAT(decode(worker.run(0)).failed, HasSubstr("shaker"));
}

/// The same campaign by the same parts, put together here by hand.
TEST(StudyCampaigns, AreWhatTheEstimatorMakesOfTheSimulatedRig) {
    const Study study = parse_study(
        "[study]\nname='a'\nkind='campaigns'\nseed=3\n[campaign]\ndwell_s=5\n", "S.toml");
    const auto sequences = check_campaigns(study, "S.toml");
    CampaignWorker worker(study, sequences);
    const CampaignRecord record = decode(worker.run(0));
    ASSERT_EQ(record.failed, "");

    plant::Truth truth;
    truth.seed = Draws(3, 0, "noise").bits();
    plant::CampaignPlan plan;
    plan.dwell_s = 5;
    for (const std::size_t at : sequences[0]) plan.order.emplace_back(at / 14 + 1, at % 14 + 1);
    estimator::Identification identification({});
    bool in_dwell = false;
    double begin_s = 0;
    plant::simulate(
        truth, plan,
        [&](const plant::PlannedSample& sample) {
            if (!in_dwell) {
                begin_s = sample.time_s;
                identification.begin_dwell({static_cast<int>(sample.run),
                                            static_cast<int>(sample.position),
                                            plan.table_g[sample.run - 1], begin_s});
            }
            in_dwell = true;
            estimator::Measurement m;
            m.time_s = sample.time_s - begin_s;
            for (std::size_t k = 0; k < 3; ++k) {
                m.angle_rad[k] = sample.readings.encoder_deg[k] * (std::numbers::pi / 180);
                m.force_g[k] = sample.readings.raw_g[k];
            }
            static_cast<void>(identification.add(m));
        },
        [&](std::size_t, std::size_t) {
            static_cast<void>(identification.end_dwell());
            in_dwell = false;
        });
    const auto assessed = estimator::uncertainty::assess({}, identification.result());
    for (std::size_t i = 0; i < estimator::kParameters; ++i) {
        const double expected = assessed.coefficients[i].value - truth.coefficients[i / 10][i % 10];
        EXPECT_NEAR(record.error[i], expected, 1e-3 * record.u_a[i]) << i;
        EXPECT_NEAR(record.u[i], assessed.coefficients[i].u, 1e-3 * record.u[i]) << i;
    }
    EXPECT_EQ(record.verdict, static_cast<std::uint8_t>(assessed.verdict.level));
    EXPECT_GT(record.nees_a, 8);  // chi-square 30: outside once in 10^5
    EXPECT_LT(record.nees_a, 71);
}

TEST(StudyCampaigns, SampleAsTheConfigurationSays) {
    const auto run = [](const std::string& more) {
        const Study study = parse_study(
            "[study]\nname='a'\nkind='campaigns'\nseed=3\n[campaign]\ndwell_s=5\n" + more,
            "S.toml");
        const auto sequences = check_campaigns(study, "S.toml");
        CampaignWorker worker(study, sequences);
        const CampaignRecord record = decode(worker.run(0));
        EXPECT_EQ(record.failed, "");
        return record.error;
    };
    const std::string configured = "[identify]\ncan.sample_rate_hz=100\n";
    const auto error = run(configured);
    EXPECT_EQ(error, run(configured + "[rig]\nplatform.sample_rate_hz=100\n"));
    EXPECT_NE(error, run(""));
    // What is stated of the rig is so, whatever the configuration believes
    EXPECT_EQ(run("[rig]\nplatform.sample_rate_hz=40\n"), run(""));
}

TEST(StudyCampaigns, ThatContradictTheirConfigurationAreNotValid) {
    const auto run = [](const std::string& rig) {
        const Study study = parse_study(
            "[study]\nname='a'\nkind='campaigns'\nseed=3\n[campaign]\ndwell_s=5\n" + rig, "S.toml");
        const auto sequences = check_campaigns(study, "S.toml");
        CampaignWorker worker(study, sequences);
        return decode(worker.run(0));
    };
    EXPECT_THAT(run("").reasons, Not(HasSubstr("configuration")));
    // An accelerometer's zero of 0.86 deg, which the configuration does not know.
    const CampaignRecord wrong = run("[rig]\n'accelerometer.zero_g' = [0.015, 0, 0]\n");
    EXPECT_EQ(wrong.failed, "");
    EXPECT_EQ(wrong.verdict, static_cast<std::uint8_t>(estimator::uncertainty::Level::not_valid));
    EXPECT_THAT(wrong.reasons, StartsWith("configuration"));
}

/// As in a live campaign: the filter takes the angles' noise from the dwells before.
TEST(StudyCampaigns, LearnTheNoiseFromTheDwellsBefore) {
    const auto u_with = [](const std::string& noise) {
        const Study study = parse_study(
            "[study]\nname='a'\nkind='campaigns'\nseed=3\n[campaign]\ndwell_s=40\n[rig]\n"
            "'noise.resolver_arcsec' = " +
                noise + "\n",
            "S.toml");
        const auto sequences = check_campaigns(study, "S.toml");
        CampaignWorker worker(study, sequences);
        return decode(worker.run(0)).u_a;
    };
    const auto quiet = u_with("5"), noisy = u_with("7");
    // Angles that are 1.4 times as noisy, and the filter knows from the ninth dwell on: then every
    // coefficient is less certain, while fit and drift model alone widen some and others hardly.
    for (std::size_t i = 0; i < quiet.size(); ++i) EXPECT_GT(noisy[i], 1.08 * quiet[i]) << i;
}

TEST(StudyCampaigns, SayWhatTheyTake) {
    const auto expected = [](const std::string& text) {
        const Study study = parse_study("[study]\nname='a'\nkind='campaigns'\n" + text, "S.toml");
        return expected_task_s(study, check_campaigns(study, "S.toml"));
    };
    const double base_s = expected("[campaign]\ndwell_s=10\n");
    EXPECT_NEAR(expected("[campaign]\ndwell_s=100\n"), 10 * base_s, 1e-9);
    EXPECT_NEAR(expected("[grid]\n'campaign.dwell_s'=[10, 30]\n"), 2 * base_s, 1e-9);
    EXPECT_NEAR(expected("[campaign]\ndwell_s=10\n[rig]\n'platform.sample_rate_hz'=80\n"),
                2 * base_s, 1e-9);
}

TEST(StudyCampaigns, ArithmeticIsTheSameEveryTime) { EXPECT_EQ(arithmetic(), arithmetic()); }

}  // namespace
}  // namespace vibrig::study
