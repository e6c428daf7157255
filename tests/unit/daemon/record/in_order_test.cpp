#include "daemon/record/in_order.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <random>
#include <stdexcept>
#include <string>

#include "daemon/record/raw_frames.hpp"
#include "daemon/record/raw_log.hpp"
#include "tests/unit/support/temporary_folder.hpp"

namespace vibrig::record {
namespace {

TEST(InOrder, GivesWhatSeveralThreadsMakeInTheOrderOfTheSource) {
    // GIVEN makers that take differently long
    constexpr int kAll = 300;
    constexpr unsigned kThreads = 4;
    int taken = 0;
    std::atomic<int> there{0}, most{0};
    InOrder<int, std::string> numbers(
        [&]() -> std::optional<int> {
            if (taken == kAll) return std::nullopt;
            most = std::max(most.load(), ++there);
            return taken++;
        },
        [](int number) {
            std::mt19937 random(static_cast<unsigned>(number));
            std::this_thread::sleep_for(std::chrono::microseconds(random() % 500));
            return std::to_string(number);
        },
        kThreads);
    // WHEN all are asked for
    for (int i = 0; i < kAll; ++i) {
        ASSERT_EQ(numbers.next(), std::to_string(i));
        --there;
    }
    // THEN they come in order, and no more were kept than threads and one, and the one in hand
    EXPECT_EQ(numbers.next(), std::nullopt);
    EXPECT_EQ(numbers.next(), std::nullopt) << "and it stays so";
    EXPECT_LE(most, static_cast<int>(kThreads) + 2);
}

TEST(InOrder, ThrowsInThePlaceOfWhatWasThrownFor) {
    int taken = 0;
    InOrder<int> numbers([&] { return std::optional(taken++); },
                         [](int number) {
                             if (number == 5) throw std::runtime_error("five");
                             return number;
                         },
                         3);
    for (int i = 0; i < 5; ++i) ASSERT_EQ(numbers.next(), i);
    EXPECT_THROW(static_cast<void>(numbers.next()), std::runtime_error);
}

TEST(InOrder, EndsWithoutBeingAskedForAll) {
    InOrder<int> numbers([] { return std::optional(1); }, std::identity(), 4);
    EXPECT_EQ(numbers.next(), 1);
}

class RawLogs : public testing::Test {
  protected:
    std::string write(const std::string& name, const std::string& text, bool packed) {
        std::string path = folder_ / name;
        std::ofstream(path, std::ios::binary) << text;
        if (!packed) return path;
        EXPECT_EQ(compress(path), "");
        return path + ".zst";
    }

    TemporaryFolder folder_;
};

/// A frame a millisecond, the time in its data; every third the daemon sent.
std::string log_of(int from, int to) {
    std::string text;
    for (int i = from; i < to; ++i) {
        std::array<char, 96> line{};
        std::snprintf(line.data(), line.size(), "(%d.%03d000) can0 101#%08X %c\n", i / 1000,
                      i % 1000, static_cast<unsigned>(i), i % 3 == 2 ? 'T' : 'R');
        text += line.data();
    }
    return text;
}

TEST_F(RawLogs, GiveTheirFramesInOrderWhateverIsReadAhead) {
    // GIVEN logs longer than what is read at once, packed and not, with words and a torn end
    constexpr int kEach = 42'000;
    const std::vector<std::string> logs{
        write("raw-0001.log", log_of(0, kEach), true),
        write("raw-0002.log", "# words\n" + log_of(kEach, 2 * kEach), false),
        write("raw-0003.log", "", false),
        write("raw-0004.log", std::string(kStartLine) + "\n" + log_of(2 * kEach, 3 * kEach) + "(12",
              true)};
    // WHEN they are read
    RawFrames frames(logs, 7);
    int expected = 0, starts = 0;
    while (const RawFrame* one = frames.next()) {
        if (one->start) {
            EXPECT_EQ(expected, 2 * kEach);
            ++starts;
            continue;
        }
        // THEN each frame that was received comes once, with its place
        ASSERT_EQ(one->frame.time, expected * drivers::kMillisecond - 7);
        const std::size_t log = static_cast<std::size_t>(expected / kEach);
        ASSERT_EQ(frames.path_of(*one), logs[log < 2 ? log : 3]);
        ASSERT_EQ(one->line, static_cast<std::size_t>(expected % kEach) + (log == 0 ? 1 : 2));
        expected += (expected + 1) % 3 == 2 ? 2 : 1;
    }
    EXPECT_EQ(expected, 3 * kEach);
    EXPECT_EQ(starts, 1);
}

TEST_F(RawLogs, NameALineThatIsNoneBehindTheFramesBeforeIt) {
    const std::string path = write("raw-0001.log", log_of(0, 2) + "(3.0) can0 xyz#\n", true);
    RawFrames frames({path}, 0);
    ASSERT_NE(frames.next(), nullptr);
    ASSERT_NE(frames.next(), nullptr);
    try {
        static_cast<void>(frames.next());
        FAIL() << "no error";
    } catch (const std::runtime_error& error) {
        EXPECT_EQ(std::string(error.what()).find(path + ":3: found 'xyz'"), 0U) << error.what();
    }
}

TEST_F(RawLogs, ThatAreDamagedInTheirCompressedTextSayWhich) {
    const std::string path = write("raw-0001.log", log_of(0, 60'000), true);
    std::fstream file(path, std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(static_cast<std::streamoff>(std::filesystem::file_size(path) / 2));
    file << "damaged";
    file.close();
    RawFrames frames({path}, 0);
    try {
        while (frames.next() != nullptr) {
        }
        FAIL() << "no error";
    } catch (const std::runtime_error& error) {
        EXPECT_TRUE(std::string(error.what()).starts_with(path)) << error.what();
    }
}

}  // namespace
}  // namespace vibrig::record
