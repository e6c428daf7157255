#include "daemon/study/merge.hpp"

#include <gtest/gtest.h>
#include <sys/resource.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "daemon/study/reduce.hpp"
#include "daemon/study/status.hpp"
#include "tests/unit/support/temporary_folder.hpp"

namespace vibrig::study {
namespace {

namespace fs = std::filesystem;

double processor_s() {
    rusage use{};
    getrusage(RUSAGE_SELF, &use);
    return static_cast<double>(use.ru_utime.tv_sec + use.ru_stime.tv_sec) +
           1e-6 * static_cast<double>(use.ru_utime.tv_usec + use.ru_stime.tv_usec);
}
double most_memory_mb() {
    rusage use{};
    getrusage(RUSAGE_SELF, &use);
    return static_cast<double>(use.ru_maxrss) / 1024;
}

/// `tasks` made-up records in 100 parts: what status and merge take.
void expect_cheap(std::uint64_t tasks) {
    const TemporaryFolder top;
    std::ofstream(top / "S.toml") << "[study]\nname = 'a'\nkind = 'campaigns'\nruns = " << tasks
                                  << "\n";
    const Folder folder = plan_study((top / "S.toml").string(), (top / "s").string(), "baseline");
    CampaignRecord record;
    record.u.fill(1);
    record.u_a.fill(1);
    constexpr std::uint64_t kShards = 100;
    for (std::uint64_t number = 0; number < kShards; ++number) {
        const Shard shard{number, kShards};
        PartWriter writer(folder.parts(), folder.id, shard);
        std::vector<TaskRecord> records;
        for (auto i = shard.begin(tasks); i < shard.end(tasks); ++i) {
            record.error.fill(static_cast<double>(i % 1000) * 1e-3);
            record.nees = static_cast<double>(i % 60);
            records.push_back({i, encode(record)});
        }
        writer.append(records);
        writer.close();
    }
    const double memory_before = most_memory_mb();
    double begin = processor_s();
    EXPECT_EQ(status_of(folder).done, tasks);
    const double status_s = processor_s() - begin;
    begin = processor_s();
    Merged merged(folder);
    Reduction reduction(folder);
    for (TaskRecord one; merged.next(one);) reduction.add(one.index, one.bytes);
    const auto result = reduction.result(merged.found().missing_count);
    const double merge_s = processor_s() - begin;
    const double growth_mb = most_memory_mb() - memory_before;
    std::cout << tasks << " records: status " << status_s << " s, merge " << merge_s
              << " s, memory grows by " << growth_mb << " MB\n";
    EXPECT_EQ(result["done"], tasks);
    // 10 s and 200 MB for a million; some room for what every call costs.
    EXPECT_LT(status_s, 0.5 + 1e-5 * static_cast<double>(tasks));
    EXPECT_LT(merge_s, 0.5 + 1e-5 * static_cast<double>(tasks));
    EXPECT_LT(growth_mb, 50);
}

TEST(StudyLarge, OfAHundredThousandTasksIsMergedInASecond) { expect_cheap(100'000); }
TEST(StudyLarge, SoakOfAMillionTasks) { expect_cheap(1'000'000); }

}  // namespace
}  // namespace vibrig::study
