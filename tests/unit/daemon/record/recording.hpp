#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "daemon/record/campaign_writer.hpp"
#include "tests/unit/support/temporary_folder.hpp"

namespace vibrig::record {

namespace fs = std::filesystem;
using drivers::Time;

inline constexpr Time kPeriod = 25 * drivers::kMillisecond;

/// In a folder of its own.
class Recording : public ::testing::Test {
  protected:
    static Head head() {
        Head head;
        head.name = "test";
        head.started_by = "A. Person";
        head.utc_ns = 1'767'225'600 * drivers::kSecond;
        head.utc_offset_ns = head.utc_ns - 5 * drivers::kSecond;
        head.clock = "real";
        head.version = "0";
        head.configuration = "site.latitude_deg = 45.75 # deg\nnoise.resolver_arcsec = 5.0\n";
        head.interface = "vcan0";
        return head;
    }
    /// A platform that drifts slowly on a shaking table.
    static std::vector<drivers::Sample> samples(std::size_t count, Time from, unsigned seed = 1) {
        std::mt19937 random(seed);
        std::normal_distribution<double> noise;
        std::vector<drivers::Sample> made(count);
        for (std::size_t i = 0; i < count; ++i) {
            drivers::Sample& s = made[i];
            s.time = from + static_cast<Time>(i) * kPeriod;
            s.sequence = static_cast<std::uint32_t>(i);
            const double t = drivers::to_seconds(s.time - from);
            for (std::size_t k = 0; k < 3; ++k)
                s.angle[k] = 0.1 + 1e-5 * t + 2.4e-5 * noise(random);
            const double shake = 6 * std::sin(2 * std::numbers::pi * 15 * t);
            s.force = {1e-4 * noise(random), 1 + shake, 1e-4 * noise(random)};
            s.table_accel = 1.5 * shake;
        }
        return made;
    }
    static void put_order(CampaignWriter& writer, int position, Time from, Time to) {
        writer.put(Order{from - drivers::kSecond, from, to, 1, position, 9.0, false});
    }
    static std::string file(const fs::path& path) {
        std::ifstream in(path, std::ios::binary);
        return {std::istreambuf_iterator<char>(in), {}};
    }

    TemporaryFolder folder_;
};

inline FrameRecord frame(std::uint32_t id, Time time, bool sent = false) {
    FrameRecord record;
    record.frame.can_id = id;
    record.frame.len = 2;
    record.frame.data[0] = 0xab;
    record.frame.data[1] = static_cast<std::uint8_t>(id);
    record.time = time;
    record.sent = sent;
    return record;
}

}  // namespace vibrig::record
