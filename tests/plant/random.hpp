#pragma once

#include <cmath>
#include <cstdint>
#include <random>

namespace vibrig::plant {

/// Gaussian and uniform numbers that are the same with every standard library (the distributions of
/// <random> are not). Each source of noise has a stream of its own, so that a change in one leaves
/// the others as they were.
class Random {
  public:
    Random(std::uint64_t seed, std::uint64_t stream)
        : engine_(mix(seed + 0x9e3779b97f4a7c15ULL * (stream + 1))) {}

    /// In [0, 1).
    [[nodiscard]] double uniform() { return static_cast<double>(engine_() >> 11) * 0x1p-53; }

    /// Standard normal, Marsaglia's polar method.
    [[nodiscard]] double normal() {
        if (has_spare_) {
            has_spare_ = false;
            return spare_;
        }
        double x = 0;
        double y = 0;
        double s = 0;
        do {
            x = 2 * uniform() - 1;
            y = 2 * uniform() - 1;
            s = x * x + y * y;
        } while (s >= 1 || s == 0);
        const double k = std::sqrt(-2 * std::log(s) / s);
        spare_ = k * y;
        has_spare_ = true;
        return k * x;
    }

  private:
    [[nodiscard]] static std::uint64_t mix(std::uint64_t z) {  // splitmix64: near seeds, far states
        z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ULL;
        z = (z ^ (z >> 27)) * 0x94d049bb133111ebULL;
        return z ^ (z >> 31);
    }

    std::mt19937_64 engine_;
    double spare_ = 0;
    bool has_spare_ = false;
};

}  // namespace vibrig::plant
