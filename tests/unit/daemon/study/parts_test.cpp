#include "daemon/study/parts.hpp"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>

#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <random>

#include "daemon/study/merge.hpp"
#include "daemon/study/reduce.hpp"
#include "daemon/study/status.hpp"
#include "tests/unit/support/temporary_folder.hpp"

namespace vibrig::study {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::StartsWith;

/// A study of 40 tasks whose results are made up: what is tested is how they are kept.
class StudyParts : public ::testing::Test {
  protected:
    StudyParts() { plan("s", 1); }

    void plan(const std::string& name, int seed) {
        std::ofstream(top_ / "S.toml")
            << "[study]\nname = 'a'\nkind = 'campaigns'\nruns = 20\nseed = " << seed
            << "\n[grid]\n'campaign.dwell_s' = [10, 20]\n";
        folder_ = plan_study((top_ / "S.toml").string(), (top_ / name).string(), "baseline");
    }
    static std::string made_up(std::uint64_t index) {
        CampaignRecord record;
        if (index == 13) record.failed = "a reason";
        std::mt19937_64 random(index);
        std::normal_distribution<double> normal;
        for (std::size_t i = 0; i < record.u.size(); ++i) {
            record.u_a[i] = 0.9;
            record.u[i] = 1;
            record.error[i] = normal(random);
            record.nees += record.error[i] * record.error[i];
        }
        record.nees_a = record.nees / 0.81;
        record.reasons = index % 2 == 0 ? "code,other" : "";
        return encode(record);
    }
    /// A closed part with these tasks; its path.
    std::string write(const std::vector<std::uint64_t>& tasks, Shard shard = {}) {
        PartWriter writer(folder_.parts(), folder_.id, shard);
        for (const auto index : tasks) writer.append({{index, made_up(index)}});
        writer.close();
        return writer.path();
    }
    static std::vector<std::uint64_t> range(std::uint64_t begin, std::uint64_t end) {
        std::vector<std::uint64_t> tasks;
        for (auto i = begin; i < end; ++i) tasks.push_back(i);
        return tasks;
    }
    static std::string host_of(const std::string& path) {
        const std::string file = fs::path(path).filename().string();
        const auto begin = file.find('-') + 1, end = file.rfind('-', file.rfind('-') - 1);
        return file.substr(begin, end - begin);
    }
    std::string result() {
        Merged merged(folder_);
        Reduction reduction(folder_);
        for (TaskRecord record; merged.next(record);) reduction.add(record.index, record.bytes);
        return reduction.result(merged.found().missing_count).dump();
    }
    static std::string content(const fs::path& path) {
        std::ostringstream text;
        text << std::ifstream(path, std::ios::binary).rdbuf();
        return text.str();
    }

    TemporaryFolder top_;
    Folder folder_;
};

TEST_F(StudyParts, InAnyPiecesGiveOneResult) {
    write(range(0, 40));
    const std::string whole = result();
    EXPECT_THAT(whole, HasSubstr("\"done\":40,\"failed\":1,\"partial\":false"));
    for (const auto& part : parts_in(folder_.parts()))
        fs::remove(folder_.parts() + "/" + part.file);
    for (std::uint64_t shard = 7; shard-- > 0;) {
        const Shard of{shard, 7};
        write(range(of.begin(40), of.end(40)), of);
    }
    write({3, 9, 39});  // a duplicate is expected after a requeue
    EXPECT_EQ(result(), whole);
    EXPECT_EQ(status_of(folder_).found.duplicates, 3U);
    EXPECT_EQ(compact(folder_).parts, 8U);
    EXPECT_EQ(parts_in(folder_.parts()).size(), 1U);
    EXPECT_EQ(result(), whole);
}

TEST_F(StudyParts, CoverEveryTaskOnceForAnyNumberOfShards) {
    for (const std::uint64_t of : {1U, 2U, 3U, 7U, 39U, 40U, 41U, 64U}) {
        std::uint64_t next = 0;
        for (std::uint64_t number = 0; number < of; ++number) {
            EXPECT_EQ((Shard{number, of}.begin(40)), next);
            next = Shard{number, of}.end(40);
        }
        EXPECT_EQ(next, 40U);
    }
}

TEST_F(StudyParts, CutAnywhereLoseWhatIsBehindAndAreNamed) {
    const std::string path = write(range(0, 4));
    const std::string bytes = content(path);
    for (std::size_t size = 0; size < bytes.size(); size += 37) {
        std::ofstream(path, std::ios::binary) << bytes.substr(0, size);
        const Done done = done_in(folder_.parts(), folder_.id, 40, {});
        // 52 bytes of head, records of 16 bytes and what is kept.
        std::uint64_t whole = 0;
        for (std::size_t at = 52; whole < 4; ++whole) {
            at += 16 + made_up(whole).size();
            if (at > size) break;
        }
        EXPECT_EQ(done.count, whole) << size;
        const bool at_end = size == 52 || (size > 52 && done.damaged.empty());
        if (!at_end) {
            ASSERT_EQ(done.damaged.size(), 1U) << size;
            EXPECT_THAT(done.damaged[0], HasSubstr("torn")) << size;
        }
    }
}

TEST_F(StudyParts, WithAFlippedBitGiveNothingWrong) {
    const std::string path = write(range(0, 4));
    const std::string bytes = content(path);
    const std::uint64_t seed = 4;
    std::mt19937_64 random(seed);
    for (int times = 0; times < 300; ++times) {
        const std::size_t bit = random() % (8 * bytes.size());
        std::string bad = bytes;
        bad[bit / 8] = static_cast<char>(bad[bit / 8] ^ (1 << (bit % 8)));
        std::ofstream(path, std::ios::binary) << bad;
        Merged merged(folder_);
        for (TaskRecord record; merged.next(record);)
            EXPECT_EQ(record.bytes, made_up(record.index)) << "seed " << seed << ", bit " << bit;
        EXPECT_EQ(merged.found().damaged.size() + merged.found().foreign.size(), 1U) << bit;
    }
}

TEST_F(StudyParts, ThatContradictEachOtherAreNamed) {
    write(range(0, 20));
    PartWriter writer(folder_.parts(), folder_.id, {});
    std::string other = made_up(7);
    other[50] = static_cast<char>(other[50] ^ 1);
    writer.append({{7, other}, {8, made_up(8)}});
    writer.close();
    Merged merged(folder_);
    std::uint64_t count = 0;
    for (TaskRecord record; merged.next(record);) {
        EXPECT_NE(record.index, 7U);
        ++count;
    }
    EXPECT_EQ(count, 19U);
    ASSERT_EQ(merged.found().contradictions.size(), 1U);
    EXPECT_THAT(merged.found().contradictions[0], HasSubstr("task 7: "));
    EXPECT_THAT(merged.found().missing, ElementsAre(std::pair(7U, 7U), std::pair(20U, 39U)));
    EXPECT_THAT(compact(folder_).refused, HasSubstr("task 7: "));
    EXPECT_EQ(parts_in(folder_.parts()).size(), 2U);
}

TEST_F(StudyParts, OfAnotherStudyAreNamedAndLeftOut) {
    const std::string path = write(range(0, 40));
    const fs::path mine = path;
    plan("other", 2);
    fs::copy(mine, fs::path(folder_.parts()) / mine.filename());
    std::ofstream(fs::path(folder_.parts()) / "notes.txt") << "a file";
    Merged merged(folder_);
    TaskRecord record;
    EXPECT_FALSE(merged.next(record));
    ASSERT_EQ(merged.found().foreign.size(), 2U);
    EXPECT_THAT(merged.found().foreign[0], HasSubstr("a part of another study"));
    EXPECT_THAT(merged.found().foreign[1], HasSubstr("notes.txt: not a part"));
    EXPECT_EQ(merged.found().missing_count, 40U);
}

TEST_F(StudyParts, ThatAreDamagedOutliveTheCompaction) {
    write(range(0, 10));
    write(range(10, 15));
    const std::string path = write(range(15, 40));
    std::string bytes = content(path);
    const std::string whole = bytes;
    bytes[bytes.size() / 2] = static_cast<char>(bytes[bytes.size() / 2] ^ 1);
    std::ofstream(path, std::ios::binary) << bytes;
    const std::string before = result();
    const Compaction done = compact(folder_);
    EXPECT_EQ(done.parts, 2U);
    EXPECT_EQ(done.refused, "");
    ASSERT_EQ(done.kept.size(), 1U);
    EXPECT_THAT(done.kept[0], HasSubstr(fs::path(path).filename().string() + ": damaged"));
    EXPECT_EQ(content(path), bytes);
    EXPECT_EQ(result(), before);
    // Whoever can mend it loses nothing.
    std::ofstream(path, std::ios::binary) << whole;
    EXPECT_THAT(result(), HasSubstr("\"done\":40,"));
}

TEST_F(StudyParts, OfACompactionThatWasKilledDoNoHarm) {
    for (const auto& [begin, end] : {std::pair(0, 10), std::pair(10, 20), std::pair(20, 40)})
        write(range(static_cast<std::uint64_t>(begin), static_cast<std::uint64_t>(end)));
    const std::string before = result();
    // While it wrote: its process is no more, and its end is torn.
    const std::string whole = write(range(0, 40));
    const std::string torn = folder_.parts() + "/0of1-" + host_of(whole) + "-2147483646-0.part.tmp";
    const std::string bytes = content(whole);
    std::ofstream(torn, std::ios::binary) << bytes.substr(0, bytes.size() / 3);
    EXPECT_EQ(result(), before);
    EXPECT_THAT(Merged(folder_).found().damaged, IsEmpty());
    // Before it removed what it had read; and one of another machine, that may be at work.
    const std::string other = folder_.parts() + "/0of1-elsewhere-2147483646-0.part.tmp";
    std::ofstream(other, std::ios::binary) << bytes;
    const Compaction done = compact(folder_);
    EXPECT_EQ(done.parts, 5U);
    ASSERT_EQ(done.kept.size(), 1U);
    EXPECT_THAT(done.kept[0], HasSubstr("elsewhere"));
    EXPECT_FALSE(fs::exists(torn));
    EXPECT_EQ(parts_in(folder_.parts()).size(), 2U);
    EXPECT_EQ(result(), before);
    EXPECT_EQ(compact(folder_).parts, 0U);
}

TEST_F(StudyParts, ThatGetTheirFinalNameWhileTheyAreReadAreWhole) {
    const std::string path = write(range(0, 40));
    fs::rename(path, path + ".tmp");
    Merged merged(folder_);
    fs::rename(path + ".tmp", path);
    std::uint64_t count = 0;
    for (TaskRecord record; merged.next(record);) ++count;
    EXPECT_EQ(count, 40U);
    EXPECT_THAT(merged.found().damaged, IsEmpty());
}

TEST_F(StudyParts, OfAKilledProcessCountAsFarAsTheyGo) {
    const std::string path = write(range(0, 5));
    fs::rename(path, path + ".tmp");
    const StudyStatus status = status_of(folder_);
    EXPECT_EQ(status.done, 5U);
    EXPECT_THAT(status.found.damaged, IsEmpty());
    ASSERT_EQ(status.running.size(), 1U);
    EXPECT_EQ(status.running[0].records, 5U);
    EXPECT_EQ(status_of(folder_, 0).running.size(), 0U);
    EXPECT_EQ(done_in(folder_.parts(), folder_.id, 40, {0, 8}).count, 5U);
    EXPECT_EQ(done_in(folder_.parts(), folder_.id, 40, {1, 8}).count, 0U);
}

TEST_F(StudyParts, WrittenByAClockThatJumpsAreAllThere) {
    // GIVEN parts of two processes whose clock jumped a day ahead and back to 1970
    const fs::path ahead = write(range(0, 5)) + ".tmp", back = write(range(5, 9)) + ".tmp";
    fs::rename(fs::path(ahead).replace_extension(), ahead);
    fs::rename(fs::path(back).replace_extension(), back);
    fs::last_write_time(ahead, fs::file_time_type::clock::now() + std::chrono::hours(24));
    const timespec epoch[2] = {{0, 0}, {0, 0}};
    ASSERT_EQ(utimensat(AT_FDCWD, back.c_str(), epoch, 0), 0);
    // WHEN status looks and a run goes on
    const StudyStatus status = status_of(folder_);
    // THEN the one counts as written just now, the other as left, no age is negative, nothing lost
    EXPECT_EQ(status.done, 9U);
    EXPECT_THAT(status.found.damaged, IsEmpty());
    ASSERT_EQ(status.running.size(), 1U);
    EXPECT_EQ(status.running[0].age_s, 0);
    EXPECT_EQ(done_in(folder_.parts(), folder_.id, 40, {}).count, 9U);
    write(range(9, 40));
    EXPECT_EQ(status_of(folder_).found.missing_count, 0U);
}

TEST_F(StudyParts, ThatCannotBeWrittenSayWhy) {
    fs::remove_all(folder_.parts());
    PartWriter writer(folder_.parts(), folder_.id, {});
    EXPECT_THROW(writer.append({{0, made_up(0)}}), StudyError);
}

TEST_F(StudyParts, OfAPlanThatCannotBeWrittenAreNotBegun) {
    rlimit before{};
    ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &before), 0);
    const auto handler = std::signal(SIGXFSZ, SIG_IGN);
    rlimit narrow = before;
    narrow.rlim_cur = 200;
    ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &narrow), 0);
    std::string why;
    try {
        static_cast<void>(
            plan_study((top_ / "S.toml").string(), (top_ / "half").string(), "baseline"));
    } catch (const StudyError& error) {
        why = error.what();
    }
    setrlimit(RLIMIT_FSIZE, &before);
    std::signal(SIGXFSZ, handler);
    EXPECT_THAT(why, HasSubstr("study.json.tmp: cannot be written: File too large"));
    EXPECT_FALSE(fs::exists(top_ / "half"));
    // One that was killed leaves a folder that is no study.
    fs::create_directory(top_ / "half");
    try {
        plan("half", 1);
        ADD_FAILURE() << "planned";
    } catch (const StudyError& error) {
        EXPECT_THAT(error.what(), HasSubstr("half: is there already, without study.json"));
    }
}

TEST_F(StudyParts, OfAStudyThatCannotBeReadNameTheFile) {
    try {
        static_cast<void>(plan_study((top_ / "none.toml").string(), "x", "baseline"));
        ADD_FAILURE() << "planned";
    } catch (const StudyError& error) {
        EXPECT_THAT(error.what(), HasSubstr("none.toml: cannot be opened: No such file"));
    }
}

TEST_F(StudyParts, OfAPlanThatWasChangedAreNotTakenForAnothers) {
    const std::string path = folder_.path + "/study.json";
    std::ifstream file(path);
    const std::string good((std::istreambuf_iterator<char>(file)), {});
    const auto complaint = [&](const std::string& from, const std::string& to) -> std::string {
        const auto at = good.find(from);
        EXPECT_NE(at, std::string::npos) << from;
        std::ofstream(path) << std::string(good).replace(at, from.size(), to);
        try {
            static_cast<void>(open_study(folder_.path));
        } catch (const StudyError& error) {
            return error.what();
        }
        return "none";
    };
    // WHEN what STUDY.toml has stands otherwise in the plan THEN its place, both values are named
    EXPECT_EQ(complaint("\"seed\": 1", "\"seed\": 3"),
              path + ": seed: found 3, expected 1, as STUDY.toml has it");
    EXPECT_EQ(complaint("\"runs\": ", "\"rums\": ").substr(0, path.size() + 32),
              path + ": runs: found null, expected 20,");
    EXPECT_THAT(complaint("\"kind\": \"campaigns\"", "\"kind\": \"recordings\""),
                HasSubstr(path + ": recordings: found nothing, expected it, as"));
    // AND so is what it needs besides
    EXPECT_EQ(complaint("\"version\": \"", "\"version\": 1, \"was\": \""),
              path + ": version: found 1, expected a text, as `vibrig study plan` writes it");
    EXPECT_EQ(complaint("\"format\": 1", "\"format\": 2"), path + ": format: found 2, expected 1");
    EXPECT_THAT(complaint("{", "[{"), StartsWith(path + ": not JSON, expected what `vibrig study "
                                                        "plan` writes; line "));
    std::ofstream(path) << good;
    EXPECT_NO_THROW(static_cast<void>(open_study(folder_.path)));
}

TEST_F(StudyParts, BelongToAStudyThatIsAsPlanned) {
    const std::string path = folder_.path;
    EXPECT_NO_THROW(prepare_to_run(folder_));
    Folder other = folder_;
    other.version = "0.0.9";
    EXPECT_THROW(prepare_to_run(other), StudyError);
    other = folder_;
    other.arithmetic = "0000000000000000";
    EXPECT_THROW(prepare_to_run(other), StudyError);
    // AND with the configuration of today
    const auto complaint = [&]() -> std::string {
        try {
            prepare_to_run(other);
        } catch (const StudyError& error) {
            return error.what();
        }
        return "none";
    };
    other = folder_;
    auto& [key, value] = other.configuration.back();
    const std::string here = std::exchange(value, "42");
    EXPECT_EQ(complaint(), path + "/study.json: configuration: found " + key + " 42, expected " +
                               key + " " + here + ", as STUDY.toml gives it here: plan it anew");
    other.configuration.pop_back();
    EXPECT_THAT(complaint(), HasSubstr("configuration: found nothing, expected "));
    std::ofstream(path + "/STUDY.toml", std::ios::app) << "# a word\n";
    try {
        static_cast<void>(open_study(path));
        ADD_FAILURE() << "opened";
    } catch (const StudyError& error) {
        EXPECT_THAT(error.what(), HasSubstr("changed since it was planned"));
    }
    EXPECT_THROW(static_cast<void>(open_study(top_.string())), StudyError);
}

}  // namespace
}  // namespace vibrig::study
