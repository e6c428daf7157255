#include "estimator/spectrum/sweep_plan.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <string>

#include "estimator/filter/linear_algebra.hpp"
#include "estimator/spectrum/sweep_blocks.hpp"

namespace vibrig::estimator::spectrum {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Products = Eigen::Matrix<double, 1, 6>;

constexpr std::array<const char*, 6> kProductNames{"xx", "yy", "zz", "xy", "xz", "yz"};
/// Of a product that is 0 but for rounding, and of a determinant that is.
constexpr double kNoPart = 1e-9;
constexpr std::size_t kMostSwept = 200;  ///< all threes of them are looked at: a second

Products products(const plan::Vec3& u) {
    Products row;
    row << u[0] * u[0], u[1] * u[1], u[2] * u[2], u[0] * u[1], u[0] * u[2], u[1] * u[2];
    return row;
}

/// What is maximised: log of the product of what three see of each coefficient; with a penalty
/// where they see the same combination of them.
double merit(const std::vector<Products>& rows, const std::array<std::size_t, 3>& at) {
    Products seen = Products::Zero();
    Eigen::Matrix<double, 3, 6> of;
    for (std::size_t k = 0; k < at.size(); ++k) {
        seen += rows[at[k]].cwiseAbs2();
        of.row(static_cast<Index>(k)) = rows[at[k]];
    }
    constexpr double kPenalty = -1e3;
    const bool apart = (of * of.transpose()).determinant() > kNoPart;
    return (seen.array() + kNoPart).log().sum() + (apart ? 0 : kPenalty);
}

}  // namespace

UsableBlocks usable_blocks(const SweptSine& sweep, double sample_hz) {
    UsableBlocks out;
    out.blocks = static_cast<std::size_t>(sweep.seconds / SweepBlocks::kBlock_s);
    const auto hz_at = [&](double s) {
        return sweep.from_hz * std::pow(sweep.to_hz / sweep.from_hz, s / sweep.seconds);
    };
    bool before = false;
    for (std::size_t k = 0; k < out.blocks; ++k) {
        const double begin_s = static_cast<double>(k) * SweepBlocks::kBlock_s;
        const bool known =
            clear_of_samples(hz_at(begin_s), hz_at(begin_s + SweepBlocks::kBlock_s), sample_hz);
        if (known) ++out.known;
        if (known && before) ++out.rates;
        before = known;
    }
    return out;
}

std::array<double, 6> products_seen(const std::vector<plan::Vec3>& ups, const Places& places) {
    Products seen = Products::Zero();
    for (const std::size_t place : places) seen += products(ups[place]).cwiseAbs2();
    std::array<double, 6> out{};
    std::ranges::copy(seen, out.begin());
    return out;
}

Places sweep_places(const std::vector<plan::Vec3>& ups) {
    std::vector<Products> rows;
    for (const plan::Vec3& up : ups) rows.push_back(products(up));
    if (rows.size() > kMostSwept)
        throw plan::PlanError("--sweeps: found " + std::to_string(rows.size()) +
                              " positions to choose from, expected " + std::to_string(kMostSwept) +
                              " at most");
    Places best;
    double most = 0;
    for (std::size_t a = 0; a < rows.size(); ++a) {
        for (std::size_t b = a + 1; b < rows.size(); ++b) {
            for (std::size_t c = b + 1; c < rows.size(); ++c) {
                const double value = merit(rows, {a, b, c});
                if (!best.empty() && value <= most + kNoPart) continue;
                most = value;
                best = {a, b, c};
            }
        }
    }
    const std::string expected =
        ", expected three positions that see all six quadratic "
        "coefficients of every gyro: more, or other, positions";
    if (best.empty())
        throw plan::PlanError("--sweeps: found " + std::to_string(rows.size()) + " positions" +
                              expected);
    const auto seen = products_seen(ups, best);
    for (std::size_t k = 0; k < seen.size(); ++k) {
        if (!(seen[k] > kNoPart))
            throw plan::PlanError("--sweeps: found no positions in which " +
                                  std::string(kProductNames[k]) + " (platform axes) is shaken" +
                                  expected);
    }
    MatrixXd of(static_cast<Index>(kSweptPositions), 6);
    for (std::size_t k = 0; k < best.size(); ++k) of.row(static_cast<Index>(k)) = rows[best[k]];
    const auto rank = linear_algebra::rank(of * of.transpose(), kNoPart);
    if (rank < static_cast<Index>(kSweptPositions))
        throw plan::PlanError("--sweeps: found positions of rank " + std::to_string(rank) +
                              expected);
    return best;
}

}  // namespace vibrig::estimator::spectrum
