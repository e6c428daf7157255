#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>

#include "estimator/allan/deviation.hpp"

namespace {

using namespace vibrig::estimator::allan;

// NIST SP 1065, section 12.4: the nine frequencies of NBS Monograph 140, annex 8.E.
const std::vector<double> kNine{892, 809, 823, 798, 671, 644, 883, 903, 677};

/// SP 1065, section 12.4: prime modulus generator, 1000 points in [0, 1].
std::vector<double> thousand() {
    constexpr std::int64_t kModulus = 2147483647;
    std::vector<double> values;
    std::int64_t n = 1234567890;
    for (int i = 0; i < 1000; ++i) {
        values.push_back(static_cast<double>(n) / static_cast<double>(kModulus));
        n = 16807 * n % kModulus;
    }
    return values;
}

double deviation(const Series& series, Statistic statistic, std::size_t m) {
    const std::vector<Point> points = deviations(series, statistic, std::array{m});
    return points.empty() ? -1 : points[0].dev;
}

/// As the handbook prints it: seven significant digits.
std::string printed(double value, const char* format) {
    std::array<char, 32> text{};
    std::snprintf(text.data(), text.size(), format, value);
    return text.data();
}

TEST(Handbook, PrintsTheNinePointTableToEveryDigit) {
    // GIVEN the nine values at 1 s
    const Series series = Series::from_rate(kNine, 1.0);
    struct Row {
        Statistic statistic;
        const char* one;
        const char* two;
    };
    const std::array<Row, 7> table{{{Statistic::adev, "91.22945", "115.8082"},
                                    {Statistic::oadev, "91.22945", "85.95287"},
                                    {Statistic::mdev, "91.22945", "74.78849"},
                                    {Statistic::tdev, "52.67135", "86.35831"},
                                    {Statistic::hdev, "70.80607", "116.7980"},
                                    {Statistic::ohdev, "70.80607", "85.61487"},
                                    {Statistic::totdev, "91.22945", "93.90379"}}};
    // WHEN each statistic is taken at 1 and 2 s THEN all seven digits agree
    for (const Row& row : table) {
        EXPECT_EQ(printed(deviation(series, row.statistic, 1), "%#.7g"), row.one)
            << name_of(row.statistic);
        EXPECT_EQ(printed(deviation(series, row.statistic, 2), "%#.7g"), row.two)
            << name_of(row.statistic);
    }
}

TEST(Handbook, PrintsTheThousandPointTableToEveryDigit) {
    // GIVEN the handbook's generator, whose first values it prints
    const std::vector<double> rate = thousand();
    EXPECT_EQ(std::llround(rate[1] * 2147483647), 395529916);
    EXPECT_EQ(std::llround(rate[2] * 2147483647), 1209410747);
    EXPECT_EQ(std::llround(rate[3] * 2147483647), 633705974);
    const Series series = Series::from_rate(rate, 1.0);
    struct Row {
        Statistic statistic;
        std::array<const char*, 3> dev;
    };
    const std::array<Row, 7> table{
        {{Statistic::adev, {"2.922319e-01", "9.965736e-02", "3.897804e-02"}},
         {Statistic::oadev, {"2.922319e-01", "9.159953e-02", "3.241343e-02"}},
         {Statistic::mdev, {"2.922319e-01", "6.172376e-02", "2.170921e-02"}},
         {Statistic::tdev, {"1.687202e-01", "3.563623e-01", "1.253382e+00"}},
         {Statistic::hdev, {"2.943883e-01", "1.052754e-01", "3.910861e-02"}},
         {Statistic::ohdev, {"2.943883e-01", "9.581083e-02", "3.237638e-02"}},
         {Statistic::totdev, {"2.922319e-01", "9.134743e-02", "3.406530e-02"}}}};
    // WHEN each statistic is taken at 1, 10 and 100 s THEN all seven digits agree
    const std::array<std::size_t, 3> factors{1, 10, 100};
    for (const Row& row : table) {
        for (std::size_t k = 0; k < factors.size(); ++k) {
            EXPECT_EQ(printed(deviation(series, row.statistic, factors[k]), "%.6e"), row.dev[k])
                << name_of(row.statistic) << " at " << factors[k] << " s";
        }
    }
}

TEST(Handbook, RateAndPhaseGiveTheSame) {
    // GIVEN the same record as rate and as phase
    const std::vector<double> rate = thousand();
    std::vector<double> phase{0.0};
    for (const double y : rate) {
        phase.push_back(phase.back() + y * 0.5);
    }
    const Series from_rate = Series::from_rate(rate, 0.5);
    const Series from_phase = Series::from_phase(phase, 0.5);
    // WHEN, THEN every statistic agrees to rounding
    for (const Statistic statistic :
         {Statistic::adev, Statistic::oadev, Statistic::mdev, Statistic::hdev, Statistic::ohdev,
          Statistic::tdev, Statistic::totdev}) {
        const double expected = deviation(from_rate, statistic, 16);
        EXPECT_NEAR(deviation(from_phase, statistic, 16), expected, 1e-11 * expected)
            << name_of(statistic);
    }
}

}  // namespace
