#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <vector>

#include "estimator/plan/evaluation.hpp"
#include "estimator/plan/exact.hpp"
#include "estimator/plan/optimum.hpp"
#include "estimator/plan/positions.hpp"

namespace vibrig::estimator::plan {
namespace {

/// Every plan of ten runs for ten coefficients, branch and bound. In coordinates in which the
/// information of the optimal design is the identity, the determinant of ten runs is the product of
/// the squares of what each run adds across the ones before it, and what the best of those left can
/// still add bounds it (Hadamard). Runs that are done with, and by the cube's symmetry all that are
/// equivalent to them, are left out from there on.
class EveryPlanOfTen {
  public:
    explicit EveryPlanOfTen(const Problem& problem) {
        const Effort share = d_optimum(problem).share;
        std::array<std::array<double, kTerms>, kTerms> m{};
        for (std::size_t i = 0; i < problem.size(); ++i) {
            const Row& f = problem.points[i].f;
            for (std::size_t a = 0; a < kTerms; ++a) {
                for (std::size_t b = 0; b < kTerms; ++b) m[a][b] += share[i] * f[a] * f[b];
            }
        }
        for (std::size_t a = 0; a < kTerms; ++a) {  // Cholesky, lower
            for (std::size_t b = 0; b <= a; ++b) {
                double rest = m[a][b];
                for (std::size_t k = 0; k < b; ++k) rest -= m[a][k] * m[b][k];
                m[a][b] = a == b ? std::sqrt(rest) : rest / m[b][b];
            }
        }
        for (const Point& point : problem.points) {
            Row g = point.f;
            for (std::size_t a = 0; a < kTerms; ++a) {
                for (std::size_t k = 0; k < a; ++k) g[a] -= m[a][k] * g[k];
                g[a] /= m[a][a];
            }
            rows_.push_back({g, dot(g, g)});
            // By the symmetry of directions (sums of squares of pairs tell faces, edges, vertices)
            // and level.
            double kind = 0;
            for (std::size_t k = 7; k < 10; ++k) kind += std::abs(point.f[k]);
            kind_.push_back(
                std::lround(1e6 * (kind + 1000 * (point.f[4] + point.f[5] + point.f[6]))));
        }
    }

    /// D-efficiency of the best plan above `floor`; 0: there is none.
    double best(double floor) {
        found_ = 0;
        nodes_ = 0;
        target_ = std::pow(kTerms * floor, kTerms);
        std::vector<Candidate> left = rows_;
        std::vector<long> kind = kind_;
        while (!left.empty()) {
            const auto first = static_cast<std::size_t>(
                std::max_element(left.begin(), left.end(), shorter) - left.begin());
            const long done = kind[first];
            go_on(across(left, left[first], first), kTerms - 1, left[first].square);
            for (std::size_t i = left.size(); i-- > 0;) {
                if (kind[i] != done) continue;
                left.erase(left.begin() + static_cast<long>(i));
                kind.erase(kind.begin() + static_cast<long>(i));
            }
        }
        return found_ > 0 ? std::pow(found_, 1.0 / kTerms) / kTerms : 0;
    }
    [[nodiscard]] long nodes() const { return nodes_; }

  private:
    struct Candidate {
        Row g{};
        double square = 0;
    };
    static double dot(const Row& a, const Row& b) {
        double sum = 0;
        for (std::size_t k = 0; k < kTerms; ++k) sum += a[k] * b[k];
        return sum;
    }
    static bool shorter(const Candidate& a, const Candidate& b) { return a.square < b.square; }
    /// What the candidates but number `but`, and those before `from`, add across `taken`.
    static std::vector<Candidate> across(const std::vector<Candidate>& all, const Candidate& taken,
                                         std::size_t but, std::size_t from = 0) {
        std::vector<Candidate> left;
        left.reserve(all.size());
        for (std::size_t i = from; i < all.size(); ++i) {
            if (i == but) continue;
            Candidate c = all[i];
            const double part = dot(c.g, taken.g) / taken.square;
            for (std::size_t k = 0; k < kTerms; ++k) c.g[k] -= part * taken.g[k];
            c.square = dot(c.g, c.g);
            if (c.square > 1e-9) left.push_back(c);
        }
        return left;
    }
    void go_on(std::vector<Candidate> left, std::size_t runs, double product) {
        ++nodes_;
        std::sort(left.rbegin(), left.rend(), shorter);
        for (std::size_t first = 0; first + runs <= left.size(); ++first) {
            double bound = product;
            for (std::size_t k = 0; k < runs; ++k) bound *= left[first + k].square;
            if (bound <= target_) return;
            if (runs == 1) {
                found_ = bound;
                target_ = bound * (1 + 1e-9);
                return;
            }
            go_on(across(left, left[first], first, first), runs - 1, product * left[first].square);
        }
    }

    std::vector<Candidate> rows_;
    std::vector<long> kind_;
    double target_ = 0, found_ = 0;
    long nodes_ = 0;
};

TEST(Plan, NoPlanOfTenRunsIsBetterThanTheOneThatIsFound) {
    // GIVEN 26 directions at 0, 2, 4, 4.667 and 6 g, and the exact plan of ten runs
    Problem problem;
    for (const double level : {0.0, 2.0, 4.0, 4.667, 6.0}) {
        for (const Vec3& u : cube_directions()) problem.points.push_back({vibration_row(u, level)});
    }
    const Effort plan = effort_of(exact_design(problem, kTerms, {}));
    const double efficiency = d_efficiency(evaluate(problem, plan), d_optimum(problem).log_det);
    // WHEN all plans of ten of the 130 runs are gone through
    EveryPlanOfTen search(problem);
    const double best = search.best(0.85);
    // THEN none is better: 0.864 in three digits is what ten runs can have
    std::printf("ten runs: D-efficiency %.7f, the best of all plans %.7f (%ld branches)\n",
                efficiency, best, search.nodes());
    EXPECT_NEAR(best, 0.8637, 5e-5);
    EXPECT_GE(efficiency, best - 1e-6);
    EXPECT_EQ(search.best(best + 1e-6), 0);
}

}  // namespace
}  // namespace vibrig::estimator::plan
