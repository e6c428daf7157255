// What an adaptive campaign saves that starts from its unit's type, and whether it stays honest:
// units that scatter by 10 % of the coefficients, an archive of a hundred of them, targets of 6.5 %
// of the coefficients. Dwells are their rates: linear in the coefficients, with the noise that the
// plan counts on; how rates come from samples is another study's.
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/LU>
#include <array>
#include <cmath>
#include <cstdio>
#include <random>

#include "daemon/plan/adaptive.hpp"
#include "estimator/filter/encoder_angles.hpp"
#include "estimator/filter/parameters.hpp"
#include "estimator/identification/crlb.hpp"
#include "estimator/uncertainty/population.hpp"

namespace vibrig::plan {
namespace {

namespace uncertainty = estimator::uncertainty;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr auto kSize = static_cast<Index>(estimator::kParameters);
constexpr double kPeriod_s = 0.025, kDwell_s = 12;
constexpr double kScatter = 0.1, kTarget = 0.07;  // of a coefficient
constexpr std::size_t kKnownUnits = 100, kMostDwells = 120;

/// Of Tang et al. 2009, in magnitude.
double nominal(Index i) { return i % 10 < 4 ? 1 : 0.03; }

class Study {
  public:
    explicit Study(std::uint64_t seed) : random_(seed), plan_(settings_, adaptive()) {
        nothing_ = MatrixXd::Zero(kSize, kSize);
        const auto prior = estimator::prior_sigma(settings_);
        for (std::size_t i = 0; i < estimator::kParameters; ++i)
            nothing_(static_cast<Index>(i), static_cast<Index>(i)) =
                1 / std::pow(prior[estimator::internal_of(i)], 2);
    }

    struct Dwells {
        std::vector<MatrixXd> rows;  ///< sensitivities over standard errors
        MatrixXd information;
        double shaker_s = 0;
    };
    /// Until the targets are met, together with `type` (null: alone), after what there is already.
    Dwells dwells(const uncertainty::Population* type, Dwells after) const {
        if (after.rows.empty()) after.information = nothing_;
        const MatrixXd known = type == nullptr ? MatrixXd(MatrixXd::Zero(kSize, kSize))
                                               : MatrixXd(type->predicted.inverse());
        std::array<double, 3> here{};
        while (after.rows.size() < kMostDwells) {
            const MatrixXd covariance = (after.information + known).inverse();
            const auto next = plan_.next({covariance.data(), covariance.data() + kSize * kSize},
                                         here, 0, after.rows.size());
            if (next.verdict != AdaptivePlan::Verdict::go_on) break;
            here = next.run.position_deg;
            add_dwell(after, here, next.run.level_g, kDwell_s);
            const planning::Timing timing;
            if (next.run.table_g > 0)
                after.shaker_s += kDwell_s + timing.settle_s + 2 * timing.ramp_s;
        }
        return after;
    }

    /// As the archive's units were measured: every direction at 9 g and at rest, 47 minutes as 28
    /// dwells of 100 s are.
    Dwells ordinary() const {
        Dwells out;
        out.information = nothing_;
        for (const auto& direction : planning::cube_directions()) {
            const auto position = planning::position_for(settings_, direction, {});
            if (!position) continue;
            for (const double table_g : {9.0, 0.0})
                add_dwell(out, *position, table_g * settings_.transmission, 54);
        }
        return out;
    }

    VectorXd unit() {
        VectorXd out(kSize);
        for (Index i = 0; i < kSize; ++i) out(i) = nominal(i) * (1 + kScatter * normal_(random_));
        return out;
    }
    uncertainty::Found measure(const VectorXd& truth, const Dwells& dwells) {
        VectorXd sum = VectorXd::Zero(kSize);
        for (const MatrixXd& rows : dwells.rows) {
            VectorXd rates = rows * truth;
            for (double& rate : rates) rate += normal_(random_);
            sum += rows.transpose() * rates;
        }
        const MatrixXd covariance = dwells.information.inverse();
        return {covariance * sum, covariance};
    }
    uncertainty::Population archive(const Dwells& ordinary) {
        std::vector<std::vector<uncertainty::Found>> units;
        for (std::size_t i = 0; i < kKnownUnits; ++i) units.push_back({measure(unit(), ordinary)});
        return uncertainty::population_of(units);
    }

  private:
    void add_dwell(Dwells& to, const std::array<double, 3>& position_deg, double level_g,
                   double dwell_s) const {
        const auto rows = estimator::rate_rows(
            settings_,
            {estimator::gimbal_deg(settings_, position_deg), planning::kappa_of(level_g), dwell_s},
            {}, kPeriod_s);
        using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
        to.rows.emplace_back(
            Eigen::Map<const Rows>(rows.data(), static_cast<Index>(rows.size()) / kSize, kSize));
        to.information += to.rows.back().transpose() * to.rows.back();
    }
    static AdaptiveSettings adaptive() {
        AdaptiveSettings settings;
        settings.period_s = kPeriod_s;
        settings.timing.dwell_s = kDwell_s;
        settings.table_g = {9, 0};
        settings.target = {kTarget * nominal(0), kTarget * nominal(1), kTarget * nominal(4)};
        return settings;
    }
    estimator::Settings settings_;
    std::mt19937_64 random_;
    std::normal_distribution<double> normal_;
    AdaptivePlan plan_;
    MatrixXd nothing_;
};

struct Outcome {
    double covered = 0, squares = 0, shaker_s = 0, outside = 0;
};

void add(Outcome& to, const uncertainty::Found& found, const VectorXd& truth, double share) {
    for (Index i = 0; i < kSize; ++i) {
        const double error = found.value(i) - truth(i), u = std::sqrt(found.covariance(i, i));
        to.covered += std::abs(error) < 1.96 * u ? share / kSize : 0;
        to.squares += share / kSize * std::pow(error / (kTarget * nominal(i)), 2);
    }
}

/// `archives` of them, `units` units for each.
void run(std::uint64_t seed, int archives, int units) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Study study(seed);
    const auto alone = study.dwells(nullptr, {}), ordinary = study.ordinary();
    const double share = 1.0 / (archives * units);
    Outcome with, without;
    int found_strangers = 0, strangers = 0;
    for (int a = 0; a < archives; ++a) {
        const auto type = study.archive(ordinary);
        const auto shorter = study.dwells(&type, {});
        const auto longer = study.dwells(nullptr, shorter);
        for (int n = 0; n < units; ++n) {
            const VectorXd truth = study.unit();
            add(without, study.measure(truth, alone), truth, share);
            without.shaker_s += share * alone.shaker_s;
            auto found = study.measure(truth, shorter);
            // Whoever does not pass for one of the type is measured until the targets are met.
            const bool outside = uncertainty::distance(type, found).outside();
            found = outside ? study.measure(truth, longer) : uncertainty::with_type(type, found);
            with.outside += outside ? share : 0;
            with.shaker_s += share * (outside ? longer : shorter).shaker_s;
            add(with, found, truth, share);
            if (n % 10 != 0) continue;
            // A stranger: another gyro lies in the place of the first.
            VectorXd stranger = truth;
            stranger.head(10) *= 2;
            ++strangers;
            found_strangers +=
                uncertainty::distance(type, study.measure(stranger, shorter)).outside() ? 1 : 0;
        }
    }
    std::printf(
        "shaker time with the type %.0f s, without %.0f s: %.3f; rms error over target "
        "%.3f, without %.3f; coverage %.4f, without %.4f; outside %.4f; strangers found "
        "%d of %d\n",
        with.shaker_s, without.shaker_s, with.shaker_s / without.shaker_s, std::sqrt(with.squares),
        std::sqrt(without.squares), with.covered, without.covered, with.outside, found_strangers,
        strangers);
    // A third is saved
    EXPECT_LT(with.shaker_s / without.shaker_s, 2.0 / 3);
    // at equal accuracy,
    EXPECT_LT(std::sqrt(with.squares), 1);
    // and the interval holds what it says. Half of the values count as independent.
    const double slack = 4 * std::sqrt(0.95 * 0.05 / (archives * units * kSize / 2.0));
    EXPECT_NEAR(with.covered, 0.95, 0.015 + (archives * units < 2000 ? slack : 0));
    EXPECT_LT(with.outside, 2 * uncertainty::kOutsider + 4 * std::sqrt(0.01 * share));
    EXPECT_EQ(found_strangers, strangers);
}

TEST(TypePriorSeeds, SavesAThirdOfTheShakerTimeAndStaysHonest) { run(31, 1, 400); }
TEST(TypePriorSoak, TwoThousandUnits) { run(32, 10, 200); }

}  // namespace
}  // namespace vibrig::plan
