#include <gtest/gtest.h>

#include <cmath>
#include <iostream>
#include <random>

#include "tests/unit/estimator/uncertainty/acceptance.hpp"

namespace vibrig::estimator::uncertainty {
namespace {

using RandomRigs = testing::Acceptance;

/// All declared inputs at their declared uncertainty, and motion across the vertical of 5 % rms.
class RandomRig {
  public:
    explicit RandomRig(std::uint64_t seed) : random_(seed) {}

    void operator()(plant::Truth& t) {
        constexpr double kArcsec = 1.0 / 3600;
        t.latitude_deg += 10 * kArcsec * gauss();
        t.azimuth_deg += 20 * kArcsec * gauss();
        for (double& zero : t.encoder_zero_deg) zero = 10 * kArcsec * gauss();
        for (double& skew : t.non_orthogonality_arcsec) skew = 5 * gauss();
        t.harmonic_1_arcsec = t.harmonic_2_arcsec = {5, 5, 5};
        t.harmonic_16_arcsec = {3, 3, 3};
        for (auto* phase :
             {&t.harmonic_1_phase_deg, &t.harmonic_2_phase_deg, &t.harmonic_16_phase_deg}) {
            for (double& one : *phase) one = 180 * even();
        }
        t.time_base = 1e-5 * std::sqrt(3.0) * even();
        t.vibration_gain = 1 + 0.005 * std::sqrt(3.0) * even();
        for (double& zero : t.zero_g) zero = 1e-4 * gauss();
        for (std::size_t i = 0; i < 3; ++i) {
            for (std::size_t k = 0; k < 3; ++k) {
                if (i != k) t.matrix[i][k] = 2.4e-4 * gauss();
            }
        }
        for (double& share : t.cross_axis) share = 0.05 * gauss();
    }

  private:
    double gauss() { return std::normal_distribution<double>()(random_); }
    double even() { return std::uniform_real_distribution<double>(-1, 1)(random_); }
    std::mt19937_64 random_;
};

TEST_F(RandomRigs, SoakOfErrorsThatAreWhatUSays) {
    constexpr int kRigs = 40;
    double rms = 0, within = 0, noise_only = 0;
    int not_valid = 0;
    for (int seed = 1; seed <= kRigs; ++seed) {
        const testing::FromSamples rig = simulated({}, testing::balanced_schedule(),
                                                   RandomRig(static_cast<std::uint64_t>(seed)));
        ASSERT_EQ(rig.result.rows.size(), 28U) << "seed " << seed;
        const Assessment a = assessed({}, rig, seed);
        not_valid += a.verdict.level == Level::not_valid ? 1 : 0;
        for (std::size_t i = 0; i < kParameters; ++i) {
            const auto& c = a.coefficients[i];
            const double error = c.value - rig.truth[i];
            rms += error * error / (c.u * c.u) / (kRigs * kParameters);
            noise_only += error * error / (c.sigma * c.sigma) / (kRigs * kParameters);
            within += std::abs(error) <= 2 * c.u ? 1.0 / (kRigs * kParameters) : 0;
        }
    }
    std::cout << "40 rigs at random, seeds 1 to 40: rms of error/u " << std::sqrt(rms)
              << ", within 2 u " << within << ", rms of error/sigma " << std::sqrt(noise_only)
              << ", not valid " << not_valid << '\n';
    EXPECT_GE(std::sqrt(rms), 0.85);
    EXPECT_LE(std::sqrt(rms), 1.1);
    EXPECT_GE(within, 0.94);
    EXPECT_LE(not_valid, 2);
}

}  // namespace
}  // namespace vibrig::estimator::uncertainty
