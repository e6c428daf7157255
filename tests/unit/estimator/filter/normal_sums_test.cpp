#include "estimator/filter/normal_sums.hpp"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <cstdint>
#include <random>
#include <utility>

#include "tests/unit/estimator/filter/bits.hpp"

namespace vibrig::estimator::testing {
namespace {

constexpr std::size_t kColumns = NormalSums::kColumns, kRows = NormalSums::kRows;

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

}  // namespace
}  // namespace vibrig::estimator::testing
