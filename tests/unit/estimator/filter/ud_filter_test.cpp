#include "estimator/filter/ud_filter.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "estimator/filter/linear_algebra.hpp"

namespace vibrig::estimator::testing {
namespace {

#ifdef __SIZEOF_FLOAT128__
__extension__ typedef __float128 Real;  // 113 bits
#else
using Real = long double;
#endif
constexpr std::size_t kN = UdFilter::kStates;
constexpr double kNoGate = std::numeric_limits<double>::infinity();

/// Textbook covariance filter in Joseph form; slow and plain.
struct DenseFilter {
    std::vector<Real> x = std::vector<Real>(kN), p = std::vector<Real>(kN * kN);

    Real& at(std::size_t i, std::size_t j) { return p[i * kN + j]; }

    void start(const UdFilter::Vector3& z, Real r) {
        for (std::size_t k = 0; k < 3; ++k) {
            for (std::size_t i = 0; i < kN; ++i) at(k, i) = at(i, k) = 0;
            at(k, k) = r;
            x[k] = z[k];
        }
    }
    void predict(const UdFilter::Transition& t) {
        // Rows of the angles of the transition; the constants' rows are those of the unit matrix.
        std::array<std::array<Real, kN>, 3> f{}, fp{};
        for (std::size_t r = 0; r < 3; ++r) {
            x[r] += t.angle_increment[r];
            for (std::size_t c = 0; c < 3; ++c) f[r][c] = t.f[r][c];
            for (std::size_t i = 0; i < 30; ++i)
                f[r][3 + i] = static_cast<Real>(t.g[r][i % 3]) * t.h[i];
        }
        for (std::size_t r = 0; r < 3; ++r)
            for (std::size_t k = 0; k < kN; ++k)
                for (std::size_t j = 0; j < kN; ++j) fp[r][j] += f[r][k] * at(k, j);
        for (std::size_t r = 0; r < 3; ++r) {
            for (std::size_t j = 3; j < kN; ++j) at(r, j) = at(j, r) = fp[r][j];
        }
        for (std::size_t r = 0; r < 3; ++r) {
            for (std::size_t c = 0; c < 3; ++c) {
                Real sum = 0;
                for (std::size_t k = 0; k < kN; ++k) sum += fp[r][k] * f[c][k];
                for (std::size_t k = 0; k < 3; ++k)
                    sum += static_cast<Real>(t.noise_map[r][k]) * t.noise_map[c][k] * t.noise;
                at(r, c) = sum;
            }
        }
    }
    void update(const UdFilter::Vector3& z, Real r) {
        for (std::size_t m = 0; m < 3; ++m) {
            const Real pmm = at(m, m), s = pmm + r, nu = z[m] - x[m];
            std::array<Real, kN> gain{}, row{};
            for (std::size_t i = 0; i < kN; ++i) {
                row[i] = at(m, i);
                gain[i] = at(i, m) / s;
                x[i] += gain[i] * nu;
            }
            // Joseph form: (I - K H) P (I - K H)' + K r K'
            for (std::size_t i = 0; i < kN; ++i)
                for (std::size_t j = 0; j <= i; ++j)
                    at(j, i) = at(i, j) +=
                        -gain[i] * row[j] - row[i] * gain[j] + gain[i] * gain[j] * s;
        }
    }
};

/// Regressors of a gyro triad that sees gravity in a slowly turning direction: 1 = u_x^2 + u_y^2 +
/// u_z^2 is collinear.
UdFilter::Transition transition(int step, std::mt19937_64& random, double noise) {
    std::uniform_real_distribution<double> uniform(-1, 1);
    UdFilter::Transition t{};
    const double a = 0.9 * step, b = 0.5 * step;
    const std::array<double, 3> u{std::sin(a) * std::cos(b), std::cos(a) * std::cos(b),
                                  std::sin(b)};
    for (std::size_t j = 0; j < 3; ++j) {
        const double i = u[j], o = u[(j + 1) % 3], s = u[(j + 2) % 3], k = 19 - 8.1 * (step % 2);
        const std::array<double, 10> h{1,         i,         s,         o,         k * i * i,
                                       k * s * s, k * o * o, k * i * s, k * i * o, k * s * o};
        for (std::size_t g = 0; g < 10; ++g) t.h[3 * g + j] = h[g];
    }
    for (std::size_t r = 0; r < 3; ++r) {
        t.angle_increment[r] = uniform(random);
        for (std::size_t c = 0; c < 3; ++c) {
            t.f[r][c] = (r == c ? 1.0 : 0.0) + 1e-3 * uniform(random);
            t.g[r][c] = uniform(random);
            t.noise_map[r][c] = uniform(random);
        }
    }
    t.noise = noise;
    return t;
}

struct Difference {
    double mean_in_sigma = 0, sigma_ratio = 0;
};

/// Largest difference between the UD filter and the dense one, in standard deviations.
Difference compare(double prior, double r, double q, int steps, std::uint64_t seed) {
    std::mt19937_64 random(seed);
    std::normal_distribution<double> gauss;
    std::array<double, 30> sigma{};
    sigma.fill(prior);
    UdFilter ud(sigma);
    DenseFilter dense;
    for (std::size_t i = 3; i < kN; ++i) dense.at(i, i) = static_cast<Real>(prior) * prior;
    for (int n = 0; n < steps; ++n) {
        UdFilter::Vector3 z{gauss(random), gauss(random), gauss(random)};
        if (n % 25 == 0) {
            ud.start_angles(z, r);
            dense.start(z, r);
            continue;
        }
        const UdFilter::Transition t = transition(n, random, q);
        ud.predict(t);
        dense.predict(t);
        const UdFilter::Vector3 predicted = ud.angles();
        for (std::size_t k = 0; k < 3; ++k) z[k] = predicted[k] + std::sqrt(r) * z[k];
        ud.update(z, r, kNoGate);
        dense.update(z, r);
    }
    Difference d;
    std::array<double, 30> s{};
    ud.sigma(s);
    for (std::size_t i = 0; i < 30; ++i) {
        const double reference = std::sqrt(static_cast<double>(dense.at(3 + i, 3 + i)));
        d.sigma_ratio = std::max(d.sigma_ratio, std::abs(s[i] / reference - 1));
        const double mean = static_cast<double>(ud.constants()[i] - dense.x[3 + i]);
        d.mean_in_sigma = std::max(d.mean_in_sigma, std::abs(mean) / reference);
    }
    return d;
}

TEST(UdFilter, AgreesWithADenseFilterIn113BitArithmetic) {
    const Difference d = compare(10, 25, 1e-4, 120, 30);
    EXPECT_LT(d.mean_in_sigma, 1e-10);
    EXPECT_LT(d.sigma_ratio, 1e-10);
}

TEST(UdFilter, TheHardCaseIsWithinAThousandthOfASigmaOf113BitArithmetic) {
    // GIVEN a prior 9 orders of magnitude wider than a reading, hardly any noise and regressors
    // that are collinear but for their level, where covariance forms diverge
    // WHEN some hundred readings have been taken
    const Difference d = compare(1e2, 1e-14, 1e-18, 400, 31);
    // THEN
    EXPECT_LT(d.mean_in_sigma, 1e-3);
    EXPECT_LT(d.sigma_ratio, 1e-3);
}

TEST(UdFilter, NisIsThatOfTheFullInnovationCovariance) {
    std::mt19937_64 random(32);
    std::array<double, 30> sigma{};
    sigma.fill(3);
    UdFilter ud(sigma);
    DenseFilter dense;
    for (std::size_t i = 3; i < kN; ++i) dense.at(i, i) = 9;
    ud.start_angles({1, 2, 3}, 4);
    dense.start({1, 2, 3}, 4);
    const UdFilter::Transition t = transition(1, random, 0.1);
    ud.predict(t);
    dense.predict(t);
    const UdFilter::Vector3 x = ud.angles();
    const double r = 4;
    // s = p + r I, nis = n' s^-1 n by Cramer's rule
    using Matrix3 = std::array<std::array<double, 3>, 3>;
    Matrix3 s{};
    for (std::size_t i = 0; i < 3; ++i) {
        for (std::size_t k = 0; k < 3; ++k) s[i][k] = static_cast<double>(dense.at(i, k));
        s[i][i] += r;
    }
    const UdFilter::Vector3 n{3, -7, 11};
    const auto det = [](const Matrix3& m) {
        return m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) -
               m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0]) +
               m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0]);
    };
    double expected = 0;
    for (std::size_t k = 0; k < 3; ++k) {
        Matrix3 m = s;
        for (std::size_t i = 0; i < 3; ++i) m[i][k] = n[i];
        expected += n[k] * det(m) / det(s);
    }
    const UdFilter::Vector3 z{x[0] + n[0], x[1] + n[1], x[2] + n[2]};
    const UdFilter::Update refused = ud.update(z, r, 0.999 * expected);
    EXPECT_FALSE(refused.done);
    EXPECT_EQ(ud.angles(), x);
    const UdFilter::Update update = ud.update(z, r, 1.001 * expected);
    EXPECT_TRUE(update.done);
    EXPECT_NEAR(update.nis / expected, 1, 1e-9);
    EXPECT_EQ(refused.nis, update.nis);
}

TEST(UdFilter, FixedConstantsStayFixed) {
    std::mt19937_64 random(33);
    std::array<double, 30> sigma{};
    sigma.fill(1);
    sigma[18] = sigma[19] = sigma[20] = 0;
    UdFilter ud(sigma);
    ud.start_angles({0, 0, 0}, 25);
    for (int n = 1; n < 100; ++n) {
        ud.predict(transition(n, random, 1e-4));
        ud.update({1.0 * n, -2.0 * n, 0.5 * n}, 25, kNoGate);
    }
    std::array<double, 30> s{};
    ud.sigma(s);
    for (std::size_t i = 0; i < 30; ++i) {
        EXPECT_TRUE(std::isfinite(s[i]));
        if (i >= 18 && i <= 20) {
            EXPECT_EQ(s[i], 0.0);
            EXPECT_EQ(ud.constants()[i], 0.0);
        }
    }
}

TEST(UdFilter, ConstantsThatMovedHaveTheirVarianceMoreAndNothingElse) {
    // GIVEN a filter whose constants have come to depend on one another
    const std::uint64_t seed = 5;
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937_64 random(seed);
    std::normal_distribution<double> gauss;
    std::array<double, UdFilter::kConstants> sigma{};
    for (double& s : sigma) s = 1 + std::abs(gauss(random));
    UdFilter filter(sigma);
    filter.start_angles({}, 25);
    for (int n = 0; n < 200; ++n) {
        UdFilter::Transition t{};
        for (std::size_t r = 0; r < 3; ++r) {
            t.f[r][r] = 1;
            for (std::size_t c = 0; c < 3; ++c) t.g[r][c] = t.noise_map[r][c] = gauss(random);
        }
        t.noise = 0.1;
        for (std::size_t i = 0; i < UdFilter::kConstants; ++i) t.h[i] = gauss(random);
        filter.predict(t);
        static_cast<void>(filter.update({gauss(random), gauss(random), gauss(random)}, 25, 1e9));
    }
    Covariance before, after;
    filter.covariance(before.data());
    // WHEN the first three move
    filter.let_first_move(0.04);
    filter.covariance(after.data());
    // THEN it is as the dense matrices say
    Covariance expected = before;
    expected.diagonal().head<3>().array() += 0.04;
    EXPECT_LT((after - expected).cwiseAbs().maxCoeff(), 1e-13 * before.cwiseAbs().maxCoeff());
}

}  // namespace
}  // namespace vibrig::estimator::testing
