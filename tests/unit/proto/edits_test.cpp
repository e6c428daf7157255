#include "proto/edits.hpp"

#include <gtest/gtest.h>

namespace vibrig::proto {
namespace {

TEST(Misspelt, IsOneLetterOrTwoAndNoWordMore) {
    for (const auto& [name, known] : {std::pair{"frequncy_hz", "frequency_hz"},
                                      {"Frequency_Hs", "frequency_hz"},
                                      {"frequency", "frequency_hz"},
                                      {"profil", "profile"},
                                      {"profiles", "profile"},
                                      {"simulatd", "simulated"},
                                      {"sigm", "sigma"},
                                      {"counts", "count"}})
        EXPECT_TRUE(misspelt(name, known)) << name;
    // Columns of a laboratory's own.
    for (const auto& [name, known] : {std::pair{"spin_frequency_hz", "frequency_hz"},
                                      {"motor_frequency_hz", "frequency_hz"},
                                      {"mains_frequency_hz", "frequency_hz"},
                                      {"frequency_error_hz", "frequency_hz"},
                                      {"profile_id", "profile"},
                                      {"profile_no", "profile"},
                                      {"simulation", "simulated"},
                                      {"signal", "sigma"},
                                      {"amount", "count"},
                                      {"temperature", "time_s"},
                                      {"x", "y"}})
        EXPECT_FALSE(misspelt(name, known)) << name;
}

}  // namespace
}  // namespace vibrig::proto
