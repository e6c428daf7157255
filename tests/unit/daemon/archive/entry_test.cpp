#include "daemon/archive/entry.hpp"

#include <gtest/gtest.h>

#include <string>

namespace vibrig::archive {
namespace {

/// D_IIx of a result with this beside its value, and this at its end.
Coefficient square_of(const std::string& beside, const std::string& end = "") {
    Entry entry;
    take_result(R"({"parameters":[{"value":1,"sigma":1,"at_hz":0},{},{},{},{"value":1,"sigma":1)" +
                    beside + "}]" + end + "}",
                15, entry);
    EXPECT_FALSE(entry.coefficients[0]->at_hz) << "a bias knows no frequency";
    return *entry.coefficients[4];
}

TEST(ArchiveEntry, TakesOfWhichVibrationAQuadraticCoefficientIs) {
    EXPECT_EQ(square_of("").at_hz, 15.0) << "the configuration's, of a campaign at one";
    EXPECT_EQ(square_of(R"(,"at_hz":25.5)", R"(,"spectrum":{})").at_hz, 25.5);
    EXPECT_EQ(square_of(R"(,"at_hz":0)", R"(,"spectrum":{})").at_hz, 0.0) << "static";
    EXPECT_EQ(square_of(R"(,"at_hz":null)", R"(,"spectrum":{})").at_hz, kAtNoFrequency);
    EXPECT_EQ(square_of("", R"(,"spectrum":{})").at_hz, kAtNoFrequency) << "an early result";
}

TEST(ArchiveEntry, WhatNeverShookIsStatic) {
    EXPECT_EQ(square_of("", R"(,"dwell_rates":[{"level":0},{"level":0.0}])").at_hz, 0.0);
    EXPECT_EQ(square_of("", R"(,"dwell_rates":[{"level":0},{"level":9.1}])").at_hz, 15.0);
    EXPECT_EQ(square_of("", R"(,"dwell_rates":[])").at_hz, 15.0) << "nobody says";
}

}  // namespace
}  // namespace vibrig::archive
