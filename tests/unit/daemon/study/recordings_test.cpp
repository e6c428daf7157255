#include "daemon/study/recordings.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "daemon/record/campaign_writer.hpp"
#include "daemon/study/identified_recording.hpp"
#include "daemon/study/merge.hpp"
#include "daemon/study/reduce.hpp"
#include "daemon/study/run.hpp"
#include "estimator/filter/parameters.hpp"
#include "tests/plant/recording.hpp"
#include "tests/unit/support/temporary_folder.hpp"

namespace vibrig::study {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr double kDwell_s = 10;
constexpr std::int64_t kDay_ns = 86'400'000'000'000;
constexpr std::int64_t kFirst_utc_ns = 20'454 * kDay_ns;  // 2026-01-01

/// Recordings of the simulated rig below lab/, at 9 and 7 g.
class StudyRecordings : public ::testing::Test {
  protected:
    /// The day counts from 2026-01-01.
    void record(const std::string& name, const std::string& serial, int day,
                const std::string& result = "{}") {
        const fs::path folder = top_ / "lab" / name;
        fs::create_directories(folder);
        fs::remove(folder / "campaign.h5");
        record::Head head;
        head.name = name;
        head.utc_ns = kFirst_utc_ns + day * kDay_ns;
        head.clock = "rig";
        head.campaign = name;
        head.configuration = "noise.resolver_arcsec = 5.0\nunit.serial = \"" + serial + "\"\n";
        record::CampaignWriter writer((folder / "campaign.h5").string(), head);
        plant::Truth truth;
        truth.seed = static_cast<unsigned char>(name[0]);
        plant::CampaignPlan plan;
        plan.dwell_s = kDwell_s;
        std::size_t run = 0, position = 0;
        plant::simulate(truth, plan, [&](const plant::PlannedSample& from) {
            drivers::Sample sample;
            sample.time = drivers::from_seconds(from.time_s);
            for (std::size_t k = 0; k < 3; ++k) {
                sample.angle[k] = from.readings.encoder_deg[k] * (std::numbers::pi / 180);
                sample.force[k] = from.readings.raw_g[k];
            }
            if (from.run != run || from.position != position) {
                record::Order order;
                order.announced = order.from = sample.time;
                order.to = sample.time + drivers::from_seconds(kDwell_s);
                order.run = static_cast<int>(run = from.run);
                order.position = static_cast<int>(position = from.position);
                order.table_g = plan.table_g[run - 1];
                writer.put(order);
            }
            writer.put(sample);
        });
        writer.end({"finished", "", "", result, head.utc_ns});
    }
    Folder plan(const std::string& name, const std::string& rest = "") {
        std::ofstream(top_ / (name + ".toml"))
            << "[study]\nname = 'again'\nkind = 'recordings'\nfolders = ['lab']\n"
            << rest;
        return plan_study((top_ / (name + ".toml")).string(), (top_ / name).string(), "baseline");
    }
    static Json result(const Folder& folder) {
        Merged merged(folder);
        Reduction reduction(folder);
        for (TaskRecord record; merged.next(record);) reduction.add(record.index, record.bytes);
        return reduction.result(merged.found().missing_count);
    }
    static Json run(const Folder& folder, unsigned threads = 1) {
        RunOptions options;
        options.threads = threads;
        EXPECT_TRUE(run_study(folder, options).complete());
        return result(folder);
    }
    /// Of "lab/a".
    Json prove(const std::string& name, const std::string& rest, unsigned threads = 1) {
        std::ofstream(top_ / (name + ".toml"))
            << "[study]\nname = 'proof'\nkind = 'uncertainty'\nrecording = 'lab/a'\nseed = 4\n"
            << rest;
        return run(
            plan_study((top_ / (name + ".toml")).string(), (top_ / name).string(), "baseline"),
            threads);
    }
    /// What vibrigd would have written of such a result, `shift` u beside it.
    static std::string as_recorded(const Json& now, double shift) {
        Json out{{"parameters", Json::array()}, {"verdict", {{"word", "doubtful"}}}};
        for (std::size_t i = 0; i < estimator::kParameters; ++i) {
            const double u = now["u"][i];
            out["parameters"].push_back({{"name", estimator::parameter_names()[i]},
                                         {"value", now["value"][i].get<double>() - shift * u},
                                         {"u", u},
                                         {"expanded", now["expanded"][i]}});
        }
        return out.dump();
    }
    template <typename Body>
    static std::string complaint(Body&& body) {
        try {
            body();
        } catch (const StudyError& error) {
            return error.what();
        }
        return "none";
    }

    TemporaryFolder top_;
};

TEST_F(StudyRecordings, AreComparedWithWhatTheySaidThenThoseThatDifferMostFirst) {
    record("a", "17", 0);
    const Json first = run(plan("first"))["recordings"][0];
    EXPECT_TRUE(first["old"].is_null());
    EXPECT_TRUE(first["largest_e_n"].is_null());
    const plant::Truth truth;
    for (std::size_t i = 0; i < estimator::kParameters; ++i) {
        const double error =
            first["new"]["value"][i].get<double>() - truth.coefficients[i / 10][i % 10];
        EXPECT_LT(std::abs(error), 5 * first["new"]["u"][i].get<double>()) << i;
    }
    // The same again, and what differs by 3 u.
    record("a", "17", 0, as_recorded(first["new"], 0));
    record("b", "17", 0, "{}");
    const Json other = run(plan("second"))["recordings"];
    for (const Json& one : other) {
        if (one["name"] == "b") record("b", "17", 0, as_recorded(one["new"], 3));
    }
    const Folder folder = plan("third");
    const Json both = run(folder, 2);
    EXPECT_EQ(both["done"], 2);
    ASSERT_EQ(both["recordings"].size(), 2U);
    const Json &b = both["recordings"][0], &a = both["recordings"][1];
    EXPECT_EQ(b["name"], "b");
    EXPECT_EQ(a["largest_e_n"], 0.0);
    EXPECT_EQ(a["old"]["verdict"], "doubtful");
    for (std::size_t i = 0; i < estimator::kParameters; ++i) {
        EXPECT_NEAR(b["difference_sigma"][i].get<double>(), 3, 1e-9);
        const double u = b["new"]["u"][i], expanded = b["new"]["expanded"][i];
        EXPECT_NEAR(b["e_n"][i].get<double>(), 3 * u / (std::sqrt(2) * expanded), 1e-9);
    }
    // In pieces it is the same.
    const Folder pieces = plan("third-again");
    for (const std::uint64_t shard : {1U, 0U}) {
        RunOptions options;
        options.shard = {shard, 2};
        EXPECT_TRUE(run_study(pieces, options).complete());
    }
    Json again = result(pieces);
    EXPECT_EQ(again["recordings"].dump(), both["recordings"].dump());
}

TEST_F(StudyRecordings, AreIdentifiedWithTheStudysSettings) {
    record("a", "17", 0);
    const Json before = run(plan("before"))["recordings"][0]["new"];
    const Json after =
        run(plan("after", "[identify]\nsite.latitude_deg = 60\n"))["recordings"][0]["new"];
    EXPECT_NE(before["value"], after["value"]);
    EXPECT_EQ(settings_of_recording("a.b = 1\nnoise.resolver_arcsec = 5 # a word\nsite.x = 2\n",
                                    {{"noise.resolver_arcsec", "7", ""}}),
              "site.x = 2\nnoise.resolver_arcsec = 7\n");
    EXPECT_THAT(complaint([&] { plan("wrong", "[identify]\nsite.latitude_deg = 100\n"); }),
                HasSubstr("wrong.toml:6:21: site.latitude_deg: found 100"));
}

TEST_F(StudyRecordings, ThatContradictTheirConfigurationAreNotValid) {
    record("a", "17", 0);
    const auto contradicts = [&](const Folder& folder) {
        const Study& study = folder.study;
        const auto found = identify_recording(study.recordings.at(0), study.configuration);
        return std::ranges::any_of(found.assessed.verdict.reasons, [](const auto& reason) {
            return reason.code == "configuration";
        });
    };
    EXPECT_FALSE(contradicts(plan("fits")));
    // An accelerometer's zero of 0.86 deg, which the rig does not have.
    const Folder wrong = plan("wrong", "[identify]\naccelerometer.zero_g = [0.015, 0, 0]\n");
    EXPECT_TRUE(contradicts(wrong));
    EXPECT_EQ(run(wrong)["recordings"][0]["new"]["verdict"], "not valid");
    // Nor is anything proved of their budget.
    EXPECT_THAT(complaint([&] {
                    prove("drawn",
                          "trials = 10000\n[identify]\naccelerometer.zero_g = [0.015, 0, 0]\n");
                }),
                HasSubstr("lab/a: the configuration does not fit the recording: "));
}

TEST_F(StudyRecordings, AreSelectedBySerialAndDay) {
    record("a", "17", 0);
    record("b", "18", 1);
    record("deep/er/c", "17", 2);
    const auto names = [&](const std::string& name, const std::string& select) {
        std::vector<std::string> found;
        for (const Recording& one : plan(name, "select = " + select + "\n").study.recordings)
            found.push_back(fs::path(one.folder).filename().string());
        return found;
    };
    EXPECT_THAT(names("s1", "{ serial = '17' }"), ElementsAre("a", "c"));
    EXPECT_THAT(names("s2", "{ since = 2026-01-02 }"), ElementsAre("b", "c"));
    EXPECT_THAT(names("s3", "{ serial = '17', since = 2026-01-02 }"), ElementsAre("c"));
    EXPECT_THAT(complaint([&] { names("s4", "{ serial = '19' }"); }),
                HasSubstr("found 3 recorded campaigns, none of them selected"));
    EXPECT_THAT(complaint([&] { names("s5", "{ since = 'then' }"); }),
                HasSubstr("s5.toml:5:20: study.select.since: found \"then\""));
    fs::remove_all(top_ / "lab");
    EXPECT_THAT(complaint([&] { names("s6", "{}"); }), HasSubstr("study.folders: found lab: "));
}

TEST_F(StudyRecordings, ThatHaveMovedOrChangedStopTheRun) {
    record("a", "17", 0);
    record("b", "17", 0);
    const Folder folder = plan("s");
    EXPECT_NO_THROW(prepare_to_run(folder));
    fs::rename(top_ / "lab" / "a", top_ / "lab" / "moved");
    EXPECT_THAT(complaint([&] { prepare_to_run(folder); }),
                HasSubstr("lab/a/campaign.h5: No such file or directory: has it moved?"));
    fs::rename(top_ / "lab" / "moved", top_ / "lab" / "a");
    const std::string path = (top_ / "lab" / "b" / "campaign.h5").string();
    std::fstream file(path, std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(3000);
    file.put('x');
    file.close();
    EXPECT_NO_THROW(prepare_to_run(folder));  // it is as long as before
    EXPECT_THAT(complaint([&] { static_cast<void>(run_study(folder, {})); }),
                HasSubstr("lab/b/campaign.h5: changed since it was planned"));
    const Done done = done_in(folder.parts(), folder.id, 2, {});
    EXPECT_THAT(done.tasks, ElementsAre(true, false));
}

TEST_F(StudyRecordings, ProveTheirBudgetsByDrawing) {
    record("a", "17", 0);
    // Three digits are not to be had of two blocks, whoever draws them.
    const Json few = prove("f", "trials = 20000\ndigits = 3\n", 1);
    EXPECT_EQ(few["verdict"], "not stable yet");
    EXPECT_EQ(few["trials"], 20'000);
    EXPECT_EQ(prove("g", "trials = 20000\ndigits = 3\n", 2)["coefficients"].dump(),
              few["coefficients"].dump());
    EXPECT_THAT(complaint([&] { prove("w", "trials = 12345\n", 1); }),
                HasSubstr("w.toml:6:10: study.trials: found 12345, expected a"));
    // One block tells nothing of how far it is off; what all studies may have is no fault.
    const Json one = prove("n", "trials = 10000\nruns = 3\n", 1);
    EXPECT_EQ(one["trials"], 10'000);
    EXPECT_EQ(one["verdict"], "not stable yet");
    fs::rename(top_ / "lab" / "a", top_ / "lab" / "b");
    EXPECT_THAT(complaint([&] { prove("h", "", 1); }), HasSubstr("study.recording: "));
}

TEST_F(StudyRecordings, MonteCarloProvesTheirBudgets) {
    record("a", "17", 0);
    const Json drawn = prove("d", "", 2);
    EXPECT_TRUE(drawn["stable"]);
    const auto trials = drawn["trials"].get<double>();
    EXPECT_LT(trials, 500'000);  // the first blocks suffice
    for (const Json& c : drawn["coefficients"]) {
        const double value = c["value"], u = c["gum"]["u"];
        // Five standard deviations of the mean and of the variance of so many draws.
        EXPECT_NEAR(c["mean"].get<double>(), value, 5 * u / std::sqrt(trials)) << c["name"];
        EXPECT_NEAR(c["u"].get<double>(), u, 5 * u / std::sqrt(2 * trials)) << c["name"];
        const double low = c["symmetric"][0], high = c["symmetric"][1];
        // Ends of 95 % have a standard error of sqrt(0.95 0.05 / n) / density, 0.117 at 1.96 u.
        const double end = 5 * u * std::sqrt(0.025 * 0.975 / trials) / 0.0584;
        EXPECT_NEAR(low, value - 1.96 * u, end + 0.01 * u) << c["name"];
        EXPECT_NEAR(high, value + 1.96 * u, end + 0.01 * u) << c["name"];
        const double shortest_low = c["shortest"][0], shortest_high = c["shortest"][1];
        EXPECT_LE(shortest_high - shortest_low, high - low) << c["name"];
        EXPECT_EQ(c["validated"], c["difference"] <= c["tolerance"]) << c["name"];
        // JCGM 101, 8.2
        for (const auto& [what, error] : c["standard_error"].items())
            EXPECT_LE(2 * error.get<double>(), c["tolerance"].get<double>() / 5)
                << c["name"] << what;
    }
    // The blocks that were more than needed changed nothing.
    const Json enough = prove("e", "trials = " + drawn["trials"].dump() + "\n", 1);
    EXPECT_TRUE(enough["stable"]);
    EXPECT_EQ(enough["coefficients"].dump(), drawn["coefficients"].dump());
    // A rectangular input that outweighs all others: the budget's k does not fit.
    const Json flat = prove("r",
                            "trials = 400000\n[identify]\nuncertainty.latitude_arcsec = { "
                            "half_width = 60000, shape = \"rectangular\" }\n",
                            1);
    EXPECT_EQ(flat["verdict"], "not validated");
}

TEST_F(StudyRecordings, ThatCannotBeReadAreResultsThatSayWhy) {
    record("a", "17", 0);
    fs::create_directories(top_ / "lab" / "z");
    std::ofstream(top_ / "lab" / "z" / "campaign.h5") << "no HDF5";
    const Json both = run(plan("s", "select = { serial = '17' }\n"));
    EXPECT_EQ(both["failed"], 1);
    EXPECT_THAT(both["recordings"][0]["recording"].get<std::string>(), HasSubstr("lab/z"));
    EXPECT_THAT(both["recordings"][0]["failed"].get<std::string>(), HasSubstr("campaign.h5"));
}

}  // namespace
}  // namespace vibrig::study
