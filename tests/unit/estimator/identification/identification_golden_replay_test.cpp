#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <map>
#include <string>
#include <vector>

#include "estimator/filter/instruction_set.hpp"
#include "estimator/identification/identification.hpp"

// A committed recording and what was once identified from it: when the numbers move, the review
// shows it. golden_estimates.txt is with constant biases, golden_walking.txt with biases that walk
// from dwell to dwell, the default. To write them anew: VIBRIG_WRITE_GOLDEN=FOLDER estimator_test
// --gtest_filter=GoldenReplay.*

namespace vibrig::estimator::testing {
namespace {

const std::string kData = VIBRIG_TEST_DATA;

struct Biases {
    uncertainty::BiasModel model;
    const char* file;
    friend std::ostream& operator<<(std::ostream& out, const Biases& b) { return out << b.file; }
};

struct GoldenReplay : ::testing::TestWithParam<Biases> {
    ~GoldenReplay() override { static_cast<void>(force_instruction_set("auto")); }
};
INSTANTIATE_TEST_SUITE_P(
    , GoldenReplay,
    ::testing::Values(Biases{uncertainty::BiasModel::constant, "/golden_estimates.txt"},
                      Biases{uncertainty::BiasModel::automatic, "/golden_walking.txt"}),
    [](const auto& tested) {
        return tested.param.model == uncertainty::BiasModel::constant ? "Constant" : "Walking";
    });

/// The 14 positions at 9 and 7 g at the table, 2 s each; vibrig-plant record --seed 11 --dwell 2.
Estimate replay(std::string_view set, uncertainty::BiasModel biases) {
    EXPECT_TRUE(force_instruction_set(set));
    Settings settings;
    settings.drift.model = biases;
    Identification identification(settings);
    std::ifstream in(kData + "/golden_recording.csv");
    std::string line;
    std::getline(in, line);
    DwellInfo present{0, 0, -1};
    int rows = 0;
    while (std::getline(in, line)) {
        DwellInfo dwell;
        Measurement m;
        std::array<double, 3> deg{};
        if (std::sscanf(line.c_str(), "%lf,%d,%d,%lf,%lf,%lf,%lf,%lf,%lf", &m.time_s, &dwell.run,
                        &dwell.position, &deg[0], &deg[1], &deg[2], &m.force_g[0], &m.force_g[1],
                        &m.force_g[2]) != 9) {
            ADD_FAILURE() << line;
            break;
        }
        for (std::size_t k = 0; k < 3; ++k)
            m.angle_rad[k] = deg[k] * (3.14159265358979323846 / 180);
        if (dwell.run != present.run || dwell.position != present.position) {
            present = dwell;
            identification.begin_dwell(dwell);
        }
        identification.add(m);
        ++rows;
    }
    identification.end_dwell();
    EXPECT_EQ(rows, 2 * 14 * 80);
    Estimate estimate;
    identification.estimate(estimate);
    return estimate;
}

struct Golden30 {
    std::array<double, kParameters> value{}, sigma{};
};

/// First line: the compiler. Then instruction set, coefficient, value, sigma; hexadecimal.
std::map<std::string, Golden30> golden(const char* file, std::string& made_by) {
    std::map<std::string, Golden30> all;
    std::ifstream in(kData + file);
    std::getline(in, made_by);
    std::string set, name, value, sigma;
    while (in >> set >> name >> value >> sigma) {
        for (std::size_t i = 0; i < kParameters; ++i) {
            if (name != parameter_names()[i]) continue;
            all[set].value[i] = std::strtod(value.c_str(), nullptr);
            all[set].sigma[i] = std::strtod(sigma.c_str(), nullptr);
        }
    }
    return all;
}

#ifndef VIBRIG_SANITIZED  // instrumented code is other code: it may round otherwise
void write_golden(const std::string& folder, const Biases& biases) {
    std::ofstream out(folder + biases.file);
    out << compiler() << '\n';
    for (const std::string_view set : instruction_sets()) {
        const Estimate estimate = replay(set, biases.model);
        for (std::size_t i = 0; i < kParameters; ++i) {
            std::array<char, 160> line{};
            std::snprintf(line.data(), line.size(), "%s %s %a %a\n", std::string(set).c_str(),
                          parameter_names()[i], estimate.value[i], estimate.sigma[i]);
            out << line.data();
        }
    }
}

TEST_P(GoldenReplay, IsBitIdenticalWithTheSameCompilerAndInstructionSet) {
    if (const char* folder = std::getenv("VIBRIG_WRITE_GOLDEN")) write_golden(folder, GetParam());
    std::string made_by;
    const auto all = golden(GetParam().file, made_by);
    ASSERT_FALSE(all.empty());
    if (made_by != compiler()) {
        GTEST_SKIP() << "made by " << made_by << ", this is " << compiler();
    }
    // Sines and cosines come from the C library, which has two versions: with and without FMA.
    const std::vector<std::string_view> sets = instruction_sets();
    if (all.contains("avx2") && sets.size() == 1) GTEST_SKIP() << "this processor has no FMA";
    for (const std::string_view set : sets) {
        const auto found = all.find(std::string(set));
        if (found == all.end()) continue;
        SCOPED_TRACE(std::string(set));
        const Estimate estimate = replay(set, GetParam().model);
        for (std::size_t i = 0; i < kParameters; ++i) {
            EXPECT_EQ(estimate.value[i], found->second.value[i]) << parameter_names()[i];
            EXPECT_EQ(estimate.sigma[i], found->second.sigma[i]) << parameter_names()[i];
        }
    }
}
#endif

TEST_P(GoldenReplay, IsWithinABillionthOfASigmaWithAnyCompilerAndInstructionSet) {
    std::string made_by;
    for (const auto& [made_with, expected] : golden(GetParam().file, made_by)) {
        for (const std::string_view set : instruction_sets()) {
            SCOPED_TRACE(made_with + " against " + std::string(set));
            const Estimate estimate = replay(set, GetParam().model);
            for (std::size_t i = 0; i < kParameters; ++i) {
                EXPECT_LT(std::abs(estimate.value[i] - expected.value[i]), 1e-9 * expected.sigma[i])
                    << parameter_names()[i];
                EXPECT_LT(std::abs(estimate.sigma[i] / expected.sigma[i] - 1), 1e-9)
                    << parameter_names()[i];
            }
        }
    }
}

}  // namespace
}  // namespace vibrig::estimator::testing
