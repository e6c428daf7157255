#pragma once

#include <cstddef>

namespace vibrig::estimator {

// Plain arrays only: files compiled for different instruction sets include this.

inline constexpr std::size_t kGyros = 3;

/// Axes of a gyro: input, output, spin.
enum GyroAxis : std::size_t { kInput, kOutput, kSpin };

/// What one of a gyro's coefficients multiplies: along `p` and `q` the specific force (order 2:
/// its second moment), by the order alone none or one.
struct CoefficientRow {
    const char* letters;  ///< IEEE Std 517: F fixed, I O S axes
    int order;            ///< of the specific force
    GyroAxis p, q;
    std::size_t place;  ///< among a gyro's coefficients as people see them
};

/// All coefficients of a gyro in the filter's order (Tang et al. 2009: input, *spin*, output).
inline constexpr CoefficientRow kCoefficientTable[] = {
    {"F", 0, kInput, kInput, 0},    {"I", 1, kInput, kInput, 1},  {"S", 1, kSpin, kSpin, 3},
    {"O", 1, kOutput, kOutput, 2},  {"II", 2, kInput, kInput, 4}, {"SS", 2, kSpin, kSpin, 6},
    {"OO", 2, kOutput, kOutput, 5}, {"IS", 2, kInput, kSpin, 8},  {"IO", 2, kInput, kOutput, 7},
    {"OS", 2, kSpin, kOutput, 9},
};

/// Names of its rows; the filter's index is 3 * group + gyro.
enum Group : std::size_t { kDt, kDi, kDs, kDo, kDii, kDss, kDoo, kDis, kDio, kDos };

inline constexpr std::size_t kGroups = sizeof(kCoefficientTable) / sizeof(kCoefficientTable[0]);
inline constexpr std::size_t kParameters = kGyros * kGroups;

}  // namespace vibrig::estimator
