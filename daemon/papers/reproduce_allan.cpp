#include <array>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <string>
#include <vector>

#include "daemon/allan/analysis.hpp"
#include "daemon/papers/reproduce.hpp"
#include "daemon/results/progress.hpp"
#include "daemon/results/text_line.hpp"
#include "estimator/allan/deviation.hpp"
#include "estimator/allan/dynamic.hpp"
#include "estimator/allan/synthetic.hpp"

namespace vibrig::tool {

namespace {

constexpr std::size_t kSeeds = 40;
constexpr std::size_t kRecord = 36000;  // 10 h at 1 Hz
constexpr std::size_t kWindow = 3600;
constexpr std::uint64_t kFirstSeed = 1;

double seven_digits(const std::vector<double>& rate, allan::Statistic statistic, std::size_t m) {
    const auto points = allan::deviations(allan::Series::from_rate(rate, 1.0), statistic,
                                          std::vector<std::size_t>{m});
    return points.at(0).dev;
}

struct Published {
    allan::Statistic statistic;
    std::array<const char*, 2> nine;      ///< m = 1, 2
    std::array<const char*, 3> thousand;  ///< m = 1, 10, 100
};
using enum allan::Statistic;
// NIST SP 1065, section 12.4, tables 30 and 31 (non-overlapping Hadamard: Riley's test suite).
constexpr std::array<Published, 7> kHandbook{
    {{adev, {"91.22945", "115.8082"}, {"2.922319e-01", "9.965736e-02", "3.897804e-02"}},
     {oadev, {"91.22945", "85.95287"}, {"2.922319e-01", "9.159953e-02", "3.241343e-02"}},
     {mdev, {"91.22945", "74.78849"}, {"2.922319e-01", "6.172376e-02", "2.170921e-02"}},
     {tdev, {"52.67135", "86.35831"}, {"1.687202e-01", "3.563623e-01", "1.253382e+00"}},
     {hdev, {"70.80607", "116.7980"}, {"2.943883e-01", "1.052754e-01", "3.910861e-02"}},
     {ohdev, {"70.80607", "85.61487"}, {"2.943883e-01", "9.581083e-02", "3.237638e-02"}},
     {totdev, {"91.22945", "93.90379"}, {"2.922319e-01", "9.134743e-02", "3.406530e-02"}}}};

void add_handbook(Reproduction& table) {
    const std::vector<double> nine{892, 809, 823, 798, 671, 644, 883, 903, 677};
    std::vector<double> thousand;
    constexpr std::int64_t kModulus = 2147483647;
    std::int64_t n = 1234567890;
    for (int i = 0; i < 1000; ++i) {
        thousand.push_back(static_cast<double>(n) / static_cast<double>(kModulus));
        n = 16807 * n % kModulus;
    }
    const auto add = [&](const std::string& item, std::string published, const std::string& value) {
        table.add(item, published, value, published == value);
    };
    for (const Published& row : kHandbook) {
        for (std::size_t k = 0; k < row.nine.size(); ++k) {
            const std::size_t m = k + 1;
            add(printed("SP 1065, 9 points, %s, m = %zu", allan::name_of(row.statistic), m),
                row.nine[k], printed("%#.7g", seven_digits(nine, row.statistic, m)));
        }
        std::size_t m = 1;
        for (const char* published : row.thousand) {
            add(printed("SP 1065, 1000 points, %s, m = %zu", allan::name_of(row.statistic), m),
                published, printed("%.6e", seven_digits(thousand, row.statistic, m)));
            m *= 10;
        }
    }
}

void add_multipliers(Reproduction& table) {
    std::string computed;
    for (const int power : {-2, -1, 0, 1, 2}) {
        computed +=
            printed("%s%g", computed.empty() ? "" : " ", allan::allan_multiplier(power) + 0.0);
    }
    table.add("multipliers a4 a3 a0 a1 a2", "1.5 1 0 -2 -6", computed, computed == "1.5 1 0 -2 -6");
}

allan::DynamicSummary windows(const std::vector<double>& rate, allan::MeanMode mode) {
    allan::DynamicSettings settings;
    settings.window = kWindow;
    settings.mode = mode;
    settings.fits = false;  // the mean of the windows is fitted
    allan::DynamicAllan dynamic(settings);
    std::vector<allan::WindowRow> rows;
    for (const double y : rate) {
        if (dynamic.add(y)) {
            rows.push_back(dynamic.row());
        }
    }
    return allan::summarise(dynamic, rows);
}

allan::Fit whole_record(const std::vector<double>& rate) {
    const allan::Series series = allan::Series::from_rate(rate, 1.0);
    std::vector<allan::VariancePoint> curve;
    for (const allan::Point& p :
         allan::deviations(series, oadev, allan::log_factors(series.rates() / 2, 30))) {
        curve.push_back({p.tau, p.m, p.dev * p.dev, 1.0});
    }
    return allan::fit_noise(curve, series.phase.size(), 1.0);
}

struct Statistics {
    std::vector<double> values;
    void add(double value) { values.push_back(value); }
    [[nodiscard]] double mean() const {
        return std::accumulate(values.begin(), values.end(), 0.0) /
               static_cast<double>(values.size());
    }
    [[nodiscard]] double deviation() const {
        double sum = 0;
        for (const double v : values) {
            sum += (v - mean()) * (v - mean());
        }
        return std::sqrt(sum / static_cast<double>(values.size() - 1));
    }
    [[nodiscard]] double rms_error(double truth) const {
        double sum = 0;
        for (const double v : values) {
            sum += (v / truth - 1) * (v / truth - 1);
        }
        return 100 * std::sqrt(sum / static_cast<double>(values.size()));
    }
};

/// A negative square, and a term that was not found, count as zero.
double or_zero(double value) { return std::isnan(value) ? 0 : value; }

std::size_t at(allan::Term term) { return static_cast<std::size_t>(term); }

void add_gauss_markov(Reproduction& table, std::size_t seeds, Progress& progress) {
    constexpr double kS = 0.02;
    constexpr double kTm = 1.5 * 3600;
    Statistics root_a0;
    Statistics paper_k;
    Statistics paper_r;
    Statistics corrected_k;
    Statistics direct_k;
    for (std::size_t i = 0; i < seeds; ++i) {
        progress.show(i, 2 * seeds);
        std::vector<double> rate =
            allan::synthetic_rate({0.1, 0.001, 0, 0, 0}, kRecord, 1.0, kFirstSeed + i);
        allan::add_gauss_markov(rate, 1.0, kS, kTm, kFirstSeed + seeds + i);
        const auto paper = windows(rate, allan::MeanMode::window_mean).classical;
        root_a0.add(or_zero(std::sqrt(paper.a[0])));
        paper_k.add(or_zero(paper.terms[at(allan::Term::K)]));
        paper_r.add(or_zero(paper.terms[at(allan::Term::R)]));
        corrected_k.add(
            or_zero(windows(rate, allan::MeanMode::corrected).classical.terms[at(allan::Term::K)]));
        direct_k.add(whole_record(rate).values()[at(allan::Term::K)]);
    }
    const double k = kS * std::sqrt(2 / 1.5);
    const auto row = [&](const char* item, const std::string& expected, const Statistics& s) {
        table.add(std::string("slow Gauss-Markov, ") + item, "-",
                  printed("%.4f +- %.4f", s.mean(), s.deviation()), {}, expected,
                  {{"mean", s.mean()}, {"deviation", s.deviation()}});
    };
    row("sqrt(a0), window mean", printed("0.0084 (true %.4f)", kS), root_a0);
    row("K, window mean", printed("0.029 (true %.4f)", k), paper_k);
    row("R, window mean (none is there)", "false R", paper_r);
    row("K, corrected", printed("0.0200 +- 0.0023 (true %.4f)", k), corrected_k);
    row("K, Allan fit", printed("0.0221 +- 0.0021 (true %.4f)", k), direct_k);
}

void add_synthetic(Reproduction& table, std::size_t seeds, Progress& progress) {
    constexpr allan::Terms kTruth{0.1, 0.001, 0.01, 0.02, 0.02};
    // Largest rms errors that count as agreement, percent.
    constexpr allan::Terms kLimit{2, 3, 10, 60, 60};
    constexpr std::array<const char*, allan::kTerms> kDirect{"0.7 %", "1.5 %", "5.2 %", "48 %",
                                                             "48 %"};
    constexpr std::array<const char*, allan::kTerms> kPaper{"1.3 %", "6.7 %", "127 %", "286 %",
                                                            "100 %"};
    std::array<Statistics, allan::kTerms> direct;
    std::array<Statistics, allan::kTerms> paper;
    for (std::size_t i = 0; i < seeds; ++i) {
        progress.show(seeds + i, 2 * seeds);
        const std::vector<double> rate =
            allan::synthetic_rate(kTruth, kRecord, 1.0, kFirstSeed + i);
        const allan::Terms found = whole_record(rate).values();
        const allan::Terms mapped = windows(rate, allan::MeanMode::window_mean).classical.terms;
        for (std::size_t j = 0; j < allan::kTerms; ++j) {
            direct[j].add(found[j]);
            paper[j].add(or_zero(mapped[j]));
        }
    }
    for (std::size_t j = 0; j < allan::kTerms; ++j) {
        const double rms = direct[j].rms_error(kTruth[j]);
        table.add(printed("rms error of %s, direct fit", allan::kTermNames[j]), "-",
                  printed("%.2g %%", rms), rms <= kLimit[j], kDirect[j], {{"rms_percent", rms}});
    }
    for (std::size_t j = 0; j < allan::kTerms; ++j) {
        table.add(printed("rms error of %s, window mean (paper's way)", allan::kTermNames[j]), "-",
                  printed("%.3g %%", paper[j].rms_error(kTruth[j])), {}, kPaper[j],
                  {{"rms_percent", paper[j].rms_error(kTruth[j])}});
    }
}

/// A record whose noise changes: from half time on N is doubled and the rate rises as a gyro's does
/// that warms. Surface, traces and the mean curve, as the paper's Figures 4, 5 and 7 show theirs.
void add_charts(Reproduction& table) {
    constexpr double kRise = 0.05;  // deg/h per hour
    AllanAnalysis shown;
    shown.request.file = "simulated gyro, N doubled and warming from 5 h on";
    shown.request.tau0 = 1;
    shown.request.window_s = kWindow;
    std::vector<double> rate =
        allan::synthetic_rate({0.1, 0.001, 0.002, 0, 0}, kRecord, 1.0, kFirstSeed);
    const std::vector<double> later =
        allan::synthetic_rate({0.1, 0.002, 0.002, 0, 0}, kRecord, 1.0, kFirstSeed);
    for (std::size_t i = kRecord / 2; i < kRecord; ++i) {
        rate[i] = later[i] + kRise * static_cast<double>(i - kRecord / 2) / 3600;
    }
    allan::DynamicSettings settings;
    settings.window = kWindow;
    allan::DynamicAllan dynamic(settings);
    allan::StationarityMonitor monitor({}, dynamic);
    for (const double y : rate) {
        if (!dynamic.add(y)) continue;
        const allan::WindowRow row = dynamic.row();
        shown.windows.push_back({row, monitor.check(row)});
    }
    shown.factors = dynamic.factors();
    shown.points = allan::deviations(allan::Series::from_rate(rate, 1.0), oadev,
                                     allan::log_factors(kRecord / 2, 30));
    shown.fit = whole_record(rate);
    table.charts = {{"surface", surface_chart(shown)},
                    {"coefficients", traces_chart(shown)},
                    {"deviation", deviation_chart(shown)}};
}

}  // namespace

Reproduction reproduce_allan(const ReproduceOptions& options) {
    const std::size_t seeds = options.seeds > 0 ? options.seeds : kSeeds;
    Reproduction table{"allan", "Allan statistics, classical and dynamic Allan variance"};
    Progress progress("reproducing allan");
    add_handbook(table);
    add_multipliers(table);
    add_gauss_markov(table, seeds, progress);
    add_synthetic(table, seeds, progress);
    if (!options.plot.empty()) add_charts(table);
    table.notes.push_back(printed(
        "Monte-Carlo rows: %zu runs, seeds from %d; 10 h at 1 Hz, windows of 3600 s; Q 0.1 arcsec, "
        "N 0.001 deg/rt-h, and s = 0.02 deg/h, tm = 1.5 h or B 0.01, K 0.02, R 0.02",
        seeds, static_cast<int>(kFirstSeed)));
    table.notes.emplace_back(
        "the direct fit agrees when its rms errors are at most Q 2, N 3, B 10, K 60, R 60 %; "
        "errors of the estimates, those below detection too");
    table.notes.emplace_back(
        "slow Gauss-Markov, K corrected and K Allan fit, are not compared: their expected values "
        "are "
        "those of fits of the terms that are there (100 seeds: a1, a3, a4 of overlapping averages "
        "0.0200 +- 0.0028; Q, N, K of the windows' mean 0.0224 +- 0.0025), the rows those of all "
        "terms");
    table.notes.emplace_back("the paper's own laser gyro data and its Table 1 are not available");
    return table;
}

}  // namespace vibrig::tool
