#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <cstring>
#include <memory>
#include <random>

#include "estimator/filter/kinematics.hpp"
#include "estimator/filter/normal_sums.hpp"
#include "estimator/filter/product.hpp"
#include "estimator/filter/ud_kernel.hpp"

namespace vibrig::estimator::testing {
namespace {

constexpr std::size_t kColumns = NormalSums::kColumns, kRows = NormalSums::kRows;

template <typename Array>
void fill(Array& array, std::mt19937_64& random) {
    std::normal_distribution<double> normal;
    auto* const at = reinterpret_cast<double*>(&array);
    for (std::size_t i = 0; i < sizeof array / sizeof(double); ++i) at[i] = normal(random);
}

/// Of arrays of numbers: there is no padding in them.
template <typename Array>
bool same(const Array& a, const Array& b) {
    return std::memcmp(&a, &b, sizeof a) == 0;
}

struct Sums {
    alignas(64) NormalSums::Angles columns{};
    alignas(64) double block[kRows][kColumns]{};
    alignas(64) double sums[kColumns][kColumns]{};
};

TEST(SameBits, SumsOfProductsDoNotDependOnTheRegisters) {
    if (normal_sums_of(true) == nullptr) GTEST_SKIP() << "this processor has no wider registers";
    for (std::uint64_t seed = 1; seed <= 20; ++seed) {
        SCOPED_TRACE(seed);
        // GIVEN the same columns for both
        std::mt19937_64 random(seed);
        Sums narrow;
        fill(narrow, random);
        Sums wide = narrow;
        double scale[kColumns], m[3][3];
        NormalSums::Whitening by;
        fill(scale, random);
        fill(m, random);
        fill(by, random);
        // WHEN they are integrated, whitened and summed
        for (const auto& [kernel, data] :
             {std::pair(normal_sums_of(false), &narrow), std::pair(normal_sums_of(true), &wide)}) {
            kernel->integrate(data->columns, scale, m);
            kernel->whiten(data->columns, by, &data->block[9]);
            kernel->add_block(data->block, data->sums);
        }
        // THEN all is the same
        EXPECT_TRUE(same(narrow.columns, wide.columns));
        EXPECT_TRUE(same(narrow.block, wide.block));
        EXPECT_TRUE(same(narrow.sums, wide.sums));
    }
}

TEST(SameBits, SumsAreThoseOfEigenButForRounding) {
    using Block = Eigen::Matrix<double, kRows, 34>;
    using Square = Eigen::Matrix<double, 34, 34>;
    std::mt19937_64 random(3);
    Sums data;
    fill(data, random);
    Block block;
    Square expected;
    for (std::size_t k = 0; k < kRows; ++k) {
        for (std::size_t c = 0; c < 34; ++c)
            block(static_cast<int>(k), static_cast<int>(c)) = data.block[k][c];
    }
    for (std::size_t c = 0; c < 34; ++c) {
        for (std::size_t r = 0; r < 34; ++r)
            expected(static_cast<int>(r), static_cast<int>(c)) = data.sums[c][r];
    }
    expected.selfadjointView<Eigen::Lower>().rankUpdate(block.transpose());
    normal_sums().add_block(data.block, data.sums);
    for (std::size_t c = 0; c < 34; ++c) {
        // Another compiler or Eigen may add in another order.
        for (std::size_t r = c; r < 34; ++r)
            EXPECT_NEAR(data.sums[c][r], expected(static_cast<int>(r), static_cast<int>(c)), 1e-13);
    }
}

TEST(SameBits, AProductIsThatOfEigenButForRounding) {
    std::mt19937_64 random(4);
    for (int i = 0; i < 100; ++i) {
        Eigen::Matrix3d a, b;
        fill(a, random);
        fill(b, random);
        EXPECT_LT((product(a, b) - a * b).cwiseAbs().maxCoeff(), 1e-14);
    }
}

TEST(SameBits, AnAngleIsWrappedAsByRemainder) {
    for (int i = -100'000; i <= 100'000; ++i) {
        const double angle = 1.37e-4 * i;
        EXPECT_EQ(wrap(angle), std::abs(angle) <= estimator::kPi
                                   ? angle
                                   : std::remainder(angle, 2.0 * estimator::kPi));
    }
}

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
