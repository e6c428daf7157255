#include "estimator/filter/ud_kernel.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <memory>
#include <random>

#include "tests/unit/estimator/filter/bits.hpp"

namespace vibrig::estimator::testing {
namespace {

#ifdef VIBRIG_X86_KERNELS
TEST(SameBits, TheBaselineFilterDoesNotDependOnTheRegisters) {
    if (!__builtin_cpu_supports("avx2")) GTEST_SKIP() << "this processor has no wider registers";
    for (std::uint64_t seed = 1; seed <= 20; ++seed) {
        SCOPED_TRACE(seed);
        // GIVEN two filters that know nothing yet
        std::mt19937_64 random(seed);
        std::normal_distribution<double> normal;
        auto narrow = std::make_unique<UdMemory>();
        std::memset(narrow.get(), 0, sizeof *narrow);
        for (int c = 0; c < kUdConstants; ++c) {
            narrow->column[c][c] = 1;
            narrow->d_constant[c] = std::abs(normal(random));
        }
        for (std::size_t k = 0; k < 3; ++k) {
            narrow->angle_block[k][k] = 1;
            narrow->d_angle[k] = 25;
        }
        auto wide = std::make_unique<UdMemory>(*narrow);
        for (int n = 0; n < 500; ++n) {
            UdTransition t{};
            fill(t.h, random);
            for (int i = kUdConstants; i < kUdPadded; ++i) t.h[i] = 0;
            for (std::size_t r = 0; r < 3; ++r) {
                t.angle_increment[r] = normal(random);
                for (std::size_t c = 0; c < 3; ++c) {
                    t.f[r][c] = (r == c ? 1 : 0) + 1e-5 * normal(random);
                    t.g[r][c] = 0.025 * normal(random);
                    t.noise_map[r][c] = normal(random);
                }
            }
            t.noise = 1e-4;
            const double measured[3] = {normal(random), normal(random), normal(random)};
            // WHEN both take the same steps, of which the gate stops some
            double nis[2] = {};
            kUdKernelBaseline.predict(*narrow, t);
            kUdKernelBaselineWide.predict(*wide, t);
            const double gate = n % 7 == 0 ? 1.0 : 1e6;
            const bool done = kUdKernelBaseline.update(*narrow, measured, 25, gate, &nis[0]);
            ASSERT_EQ(kUdKernelBaselineWide.update(*wide, measured, 25, gate, &nis[1]), done);
            ASSERT_EQ(nis[0], nis[1]);
        }
        // THEN they are the same to the last bit
        EXPECT_TRUE(same(narrow->column, wide->column));
        EXPECT_TRUE(same(narrow->angle_row, wide->angle_row));
        EXPECT_TRUE(same(narrow->d_constant, wide->d_constant));
        EXPECT_TRUE(same(narrow->x_constant, wide->x_constant));
        EXPECT_TRUE(same(narrow->angle_block, wide->angle_block));
        EXPECT_TRUE(same(narrow->d_angle, wide->d_angle));
        EXPECT_TRUE(same(narrow->x_angle, wide->x_angle));
    }
}
#endif

}  // namespace
}  // namespace vibrig::estimator::testing
