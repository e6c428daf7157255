// A campaign's file whose writer ended at any of its writes: killed (what follows never comes to
// the disk), or by a disk that takes nothing more. This program stands before the calls that write,
// so it is a program of its own.
#include <dlfcn.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <climits>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "daemon/record/campaign_file.hpp"
#include "daemon/record/campaign_writer.hpp"
#include "tests/unit/support/temporary_folder.hpp"

namespace {

enum class End { killed, disk };

struct Disk {
    long left = LONG_MAX;  // writes to regular files that still come to the disk; then it is full
    long taken = 0;
    std::function<void(long)> before = {};  // each write: how many came before it
} disk;

/// What a write comes to; nothing: it goes on as ever.
bool taken(int file) {
    struct stat kind {};
    if (::fstat(file, &kind) != 0 || !S_ISREG(kind.st_mode)) return true;
    if (disk.left == 0) return false;
    if (const auto before = std::exchange(disk.before, {})) {  // it writes, too
        const long taken = disk.taken;
        before(taken);
        disk.taken = taken;
        disk.before = before;
    }
    --disk.left;
    ++disk.taken;
    return true;
}

ssize_t not_taken() {
    errno = EIO;
    return -1;
}

template <typename Function>
Function real(const char* name) {
    return reinterpret_cast<Function>(::dlsym(RTLD_NEXT, name));
}

}  // namespace

extern "C" {

ssize_t write(int file, const void* bytes, size_t size) {
    static const auto next = real<ssize_t (*)(int, const void*, size_t)>("write");
    return taken(file) ? next(file, bytes, size) : not_taken();
}

ssize_t pwrite(int file, const void* bytes, size_t size, off_t at) {
    static const auto next = real<ssize_t (*)(int, const void*, size_t, off_t)>("pwrite");
    return taken(file) ? next(file, bytes, size, at) : not_taken();
}

ssize_t pwrite64(int file, const void* bytes, size_t size, off64_t at) {
    static const auto next = real<ssize_t (*)(int, const void*, size_t, off64_t)>("pwrite64");
    return taken(file) ? next(file, bytes, size, at) : not_taken();
}

int ftruncate(int file, off_t size) noexcept {
    static const auto next = real<int (*)(int, off_t)>("ftruncate");
    return taken(file) ? next(file, size) : static_cast<int>(not_taken());
}

int ftruncate64(int file, off64_t size) noexcept {
    static const auto next = real<int (*)(int, off64_t)>("ftruncate64");
    return taken(file) ? next(file, size) : static_cast<int>(not_taken());
}
}

namespace vibrig::record {
namespace {

namespace fs = std::filesystem;
using drivers::kMillisecond;
using drivers::kSecond;
using drivers::Time;

constexpr int kSamplesEach = 200;  // more than a chunk of some tables comes together

/// A campaign in a folder of its own; after each commit the writes so far and the samples reported.
std::vector<std::pair<long, std::size_t>> write_campaign(const fs::path& folder, int commits) {
    std::vector<std::pair<long, std::size_t>> reported;
    Head head;
    head.name = "torn";
    head.started_by = "A. Person";
    head.utc_ns = head.utc_offset_ns = 1'700'000'000 * kSecond;
    head.clock = "real";
    head.campaign = folder.filename();
    try {
        CampaignWriter writer((folder / "campaign.h5").string(), head);
        reported.emplace_back(disk.taken, 0);
        std::size_t samples = 0;
        for (int commit = 0; commit < commits; ++commit) {
            for (int i = 0; i < kSamplesEach; ++i, ++samples) {
                drivers::Sample sample;
                sample.time = kSecond + static_cast<Time>(samples) * 25 * kMillisecond;
                sample.sequence = static_cast<std::uint32_t>(samples);
                sample.force = {0, 1, 0};
                writer.put(sample);
            }
            const Time now = kSecond + static_cast<Time>(samples) * 25 * kMillisecond;
            writer.put(Order{now, now, now + 5 * kSecond, 1, commit + 1, 9.0, false, {}, 0, {}});
            EstimateRow row;
            row.time = now;
            writer.put(row);
            if (commit % 3 == 1) {
                Dwell dwell;
                dwell.time = now;
                dwell.covariance.assign(30 * 30, 0.0);
                writer.put(dwell);
                EventRecord event;
                event.time = now;
                event.text = "something";
                writer.put(event);
                writer.put(Gap{now, now, "samples", 0, "a test"});
            }
            writer.commit();
            reported.emplace_back(disk.taken, samples);
        }
    } catch (const hdf5::Error&) {
        // the disk
    }
    return reported;
}

class TornFile : public ::testing::TestWithParam<std::pair<End, int>> {
  protected:
    ~TornFile() override { disk = {}; }
    TemporaryFolder folder_;
};

TEST_P(TornFile, IsMendedAndHasWhatWasCommitted) {
    const auto [how, commits] = GetParam();
    // GIVEN how many writes a campaign takes, and how far it is when
    const fs::path whole = folder_ / "whole";
    fs::create_directory(whole);
    disk = {};
    const auto keep = [&](long taken) {
        const fs::path left = folder_ / std::to_string(taken);
        fs::create_directory(left);
        for (const auto& file : fs::directory_iterator(whole)) fs::copy(file, left);
    };
    // What is there before a write is left of one who is killed before it.
    if (how == End::killed) disk.before = keep;
    const auto reported = write_campaign(whole, commits);
    disk.before = {};
    if (const long taken = disk.taken; how == End::killed) {
        keep(taken);
        disk.taken = taken;
    }
    ASSERT_EQ(reported.size(), static_cast<std::size_t>(commits) + 1);
    const long first = reported.front().first, last = disk.taken;
    ASSERT_GT(last, first + 100);
    int torn = 0;
    for (long end = first; end <= last; ++end, ++torn) {
        // WHEN the writer ends at this one
        const fs::path folder = folder_ / std::to_string(end);
        if (how == End::disk) {
            fs::create_directory(folder);
            disk = {end};
            static_cast<void>(write_campaign(folder, commits));
            disk = {};
        }
        // THEN what was committed before is there once it is mended
        std::size_t committed = 0;
        for (const auto& [writes, samples] : reported)
            if (writes <= end) committed = samples;
        try {
            static_cast<void>(recover(folder.string(), [](const std::string&) {}));
            const Campaign campaign = read_campaign(folder.string());
            EXPECT_GE(campaign.samples.size(), committed) << "writer ended at write " << end;
            for (std::size_t i = 0; i < committed && i < campaign.samples.size(); ++i)
                ASSERT_EQ(campaign.samples[i].sequence, i) << "writer ended at write " << end;
        } catch (const std::exception& error) {
            ADD_FAILURE() << "writer ended at write " << end << " of " << last << ", " << committed
                          << " samples committed: " << error.what();
        }
        fs::remove_all(folder);
    }
    RecordProperty("torn", torn);
}

std::string name_of(const ::testing::TestParamInfo<std::pair<End, int>>& each) {
    return each.param.first == End::killed ? "Killed" : "Disk";
}

// The time grows with the square of the commits; with five each table has been made and has grown.
INSTANTIATE_TEST_SUITE_P(Ends, TornFile,
                         ::testing::Values(std::pair(End::killed, 3), std::pair(End::disk, 3)),
                         name_of);
INSTANTIATE_TEST_SUITE_P(SoakEnds, TornFile,
                         ::testing::Values(std::pair(End::killed, 12), std::pair(End::disk, 12)),
                         name_of);

}  // namespace
}  // namespace vibrig::record
