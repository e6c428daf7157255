#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <vector>

#include "daemon/record/campaign_file.hpp"
#include "daemon/record/campaign_writer.hpp"
#include "estimator/identification/dwell_row.hpp"
#include "tests/unit/support/temporary_folder.hpp"

namespace vibrig::record {

namespace fs = std::filesystem;
using drivers::kSecond;
using drivers::Time;

inline constexpr Time kStep = 25 * drivers::kMillisecond;

/// Every number another one.
inline estimator::DwellRow row_of(int position) {
    estimator::DwellRow row;
    row.run = 1;
    row.position = position;
    row.middle_s = 100.0 * position;
    for (std::size_t j = 0; j < 3; ++j) {
        row.rate[j] = 1.0 + static_cast<double>(j);
        row.ramp_variance[j][j] = 4.0 + static_cast<double>(j);
        for (std::size_t k = 0; k < 3; ++k)
            row.variance[j][k] = 10.0 + static_cast<double>(3 * j + k);
        for (std::size_t t = 0; t < 10; ++t)
            row.regressors[j][t] = 100.0 + static_cast<double>(10 * j + t);
    }
    row.vibration.gamma = {0.1, 1, 0.2, 0.3, 0.4, 0.5};
    return row;
}

/// Campaigns in recordings/test-1: files with samples, and dwells of 100 samples.
class Parts : public ::testing::Test {
  protected:
    Parts() { fs::create_directory(folder_); }

    static Head head(int part, bool restart = false, std::size_t before = 0) {
        Head head;
        head.name = "test";
        head.started_by = "A. Person";
        head.utc_ns = (1'700'000'000 + 1000 * part) * kSecond;
        head.utc_offset_ns = 1'700'000'000 * kSecond;
        head.clock = "real";
        head.campaign = "test-1";
        head.part = part;
        head.restart = restart;
        head.dwells_before = before;
        return head;
    }
    /// `orders`: positions, each 100 samples from the next hundred on; the first `done` are done.
    void write(const Head& head, Time from, const std::vector<int>& orders, std::size_t done,
               const char* state = "finished") {
        CampaignWriter writer((folder_ / part_name(head.part)).string(), head);
        for (int i = 0; i < 400; ++i) {
            drivers::Sample sample;
            sample.time = from + i * kStep;
            sample.sequence = static_cast<std::uint32_t>(i);
            sample.force = {0, 1, 0};
            writer.put(sample);
        }
        for (std::size_t i = 0; i < orders.size(); ++i) {
            const Time at = from + static_cast<Time>(i) * 100 * kStep;
            writer.put(Order{at,
                             at,
                             at + 100 * kStep,
                             1,
                             orders[i],
                             9.0,
                             false,
                             {},
                             0,
                             {5.0, {1e-3, 1e-3, 1e-3}}});
            if (i >= done) continue;
            Dwell dwell;
            dwell.time = at + 100 * kStep;
            dwell.summary.run = 1;
            dwell.summary.position = orders[i];
            dwell.summary.samples = 100;
            if (i > 0) dwell.numbers = numbers_of(row_of(orders[i]));
            writer.put(dwell);
        }
        writer.end({state, "", "", result_, head.utc_ns + kSecond});
    }
    std::string refusal() const {
        try {
            static_cast<void>(read_campaign(folder_.string()));
        } catch (const std::runtime_error& error) {
            return error.what();
        }
        return {};
    }

    TemporaryFolder recordings_;
    const fs::path folder_ = recordings_ / "test-1";
    std::string result_ = "{}";
};

}  // namespace vibrig::record
