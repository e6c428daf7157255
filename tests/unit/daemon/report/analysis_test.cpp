// What a report says of recordings at several sample rates, against formulas that know nothing of
// the estimator: the simulated rig's geometry, least squares, the noise of samples.
#include "daemon/report/analysis.hpp"

#include <gtest/gtest.h>
#include <spdlog/fmt/fmt.h>

#include <Eigen/Dense>
#include <array>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <numbers>
#include <regex>
#include <string>
#include <vector>

#include "daemon/record/campaign_writer.hpp"
#include "daemon/report/report.hpp"
#include "tests/plant/platform_model.hpp"
#include "tests/plant/recording.hpp"
#include "tests/unit/support/temporary_folder.hpp"

namespace vibrig::report {
namespace {

namespace fs = std::filesystem;
using plant::operator*;

constexpr double kRadian = std::numbers::pi / 180;
constexpr double kDwell_s = 20;
constexpr std::array<double, 2> kTable_g{9, 0};
constexpr std::size_t kDwells = 28;

/// Variance of a rate, (arcsec/s)^2, which is (deg/h)^2, from readings of an angle with white noise
/// and a random walk: by generalised least squares over the differences of neighbours, whose
/// covariance has three diagonals.
double rate_variance(std::size_t readings, double period_s, double white_arcsec,
                     double walk_arcsec_rt_s) {
    const std::size_t n = readings - 1;
    const double white = white_arcsec * white_arcsec;
    const double on = walk_arcsec_rt_s * walk_arcsec_rt_s * period_s + 2 * white;
    std::vector<double> ratio(n), sum(n);  // of Thomas' elimination, right side all 1
    for (std::size_t i = 0; i < n; ++i) {
        const double pivot = i == 0 ? on : on + white * ratio[i - 1];
        ratio[i] = -white / pivot;
        sum[i] = (1 + (i == 0 ? 0 : white * sum[i - 1])) / pivot;
    }
    double total = 0, solved = 0;
    for (std::size_t i = n; i-- > 0;) {
        solved = sum[i] - ratio[i] * solved;
        total += solved;
    }
    return 1 / (total * period_s * period_s);
}

/// Cells behind the one that is `first`, as they are printed.
std::vector<std::string> row_of(const std::string& page, const std::string& first) {
    const auto section = page.find("id=\"coefficients\"");
    const auto begin = page.find("<td>" + first + "</td>", section);
    if (begin == std::string::npos) return {};
    const std::string row = page.substr(begin, page.find("</tr>", begin) - begin);
    std::vector<std::string> cells;
    const std::regex cell("<td[^>]*>([^<]*)</td>");
    for (std::sregex_iterator at(row.begin(), row.end(), cell), end; at != end; ++at)
        cells.push_back((*at)[1]);
    return cells;
}

/// A campaign of the simulated rig at the positions of Table 1, at 6 g and at rest.
class ReportAtARate : public ::testing::TestWithParam<double> {
  protected:
    ReportAtARate() {
        truth_.seed = 7;
        truth_.sample_rate_hz = GetParam();
        plan_.table_g = {kTable_g[0], kTable_g[1]};
        plan_.dwell_s = kDwell_s;
        record();
    }

    void record() const {
        record::Head head;
        head.name = head.campaign = "rate";
        head.clock = "rig";
        head.configuration = "noise.resolver_arcsec = 5.0\n";
        record::CampaignWriter writer((folder_ / "campaign.h5").string(), head);
        record::Order order;
        const drivers::Time period = drivers::from_seconds(1 / GetParam());
        drivers::Sample last;
        const auto put_one_behind = [&] {  // samples come between dwells, too
            last.time += period;
            writer.put(last);
        };
        plant::simulate(truth_, plan_, [&](const plant::PlannedSample& from) {
            drivers::Sample sample;
            sample.time = drivers::from_seconds(from.time_s);
            for (std::size_t k = 0; k < 3; ++k) {
                sample.angle[k] = from.readings.encoder_deg[k] * kRadian;
                sample.force[k] = from.readings.raw_g[k];
            }
            const auto run = static_cast<int>(from.run), position = static_cast<int>(from.position);
            if (run != order.run || position != order.position) {
                if (order.run > 0) put_one_behind();
                order.announced = order.from = sample.time;
                order.to = sample.time + drivers::from_seconds(kDwell_s);
                order.run = run;
                order.position = position;
                order.table_g = plan_.table_g[from.run - 1];
                order.noise = estimator::noise_levels({});
                writer.put(order);
            }
            writer.put(sample);
            last = sample;
        });
        put_one_behind();
        writer.end({"finished", "", "", "{}", head.utc_ns});
    }

    [[nodiscard]] std::size_t readings() const {
        return static_cast<std::size_t>(std::lround(kDwell_s * GetParam()));
    }
    /// Of one reading, the steps of the resolver in it.
    [[nodiscard]] double white_arcsec() const {
        const double step = 360.0 * 3600 / std::pow(2, truth_.resolver_bits);
        return std::hypot(truth_.resolver_arcsec, step / std::sqrt(12.0));
    }
    /// A deg is 3600 arcsec, an hour 3600 s.
    [[nodiscard]] double walk_arcsec_rt_s() const {
        return truth_.gyro_random_walk_deg_per_rt_h * 3600 / 60;
    }
    /// Cramer-Rao bounds by the rig's own geometry. At inner angles of 0 the gimbals' axes are
    /// square, and so what one gyro shows has nothing to do with the others' readings.
    [[nodiscard]] std::array<double, estimator::kParameters> bounds() const {
        const double variance =
            rate_variance(readings(), 1 / GetParam(), white_arcsec(), walk_arcsec_rt_s());
        std::array<double, estimator::kParameters> sigma{};
        plant::PlatformModel rig(truth_);
        for (std::size_t gyro = 0; gyro < 3; ++gyro) {
            Eigen::Matrix<double, plant::kTerms, plant::kTerms> information;
            information.setZero();
            for (const double table_g : kTable_g) {
                for (const plant::Vec3& angles_deg : plan_.positions_deg) {
                    EXPECT_EQ(angles_deg[1], 0);
                    const plant::Vec3 up = rig.up_at(kRadian * angles_deg);
                    Eigen::Matrix<double, plant::kTerms, 1> row;
                    for (std::size_t term = 0; term < plant::kTerms; ++term)
                        row[static_cast<Eigen::Index>(term)] =
                            mean_drift(rig, gyro, term, up, truth_.transmission * table_g);
                    information += row * row.transpose() / variance;
                }
            }
            const auto covariance = information.inverse().eval();
            for (std::size_t term = 0; term < plant::kTerms; ++term) {
                const auto t = static_cast<Eigen::Index>(term);
                sigma[plant::kTerms * gyro + term] = std::sqrt(covariance(t, t));
            }
        }
        return sigma;
    }

    static void expect_lengths_and_vibration_of(const estimator::DwellSummary& s, double peak_g,
                                                double hz, std::size_t readings) {
        SCOPED_TRACE(fmt::format("run {} position {}", s.run, s.position));
        EXPECT_EQ(s.samples, readings);
        EXPECT_LT(s.rejected, 0.001 * static_cast<double>(readings));
        EXPECT_NEAR(s.frequency_hz, hz, 0.002);
        EXPECT_NEAR(s.amplitude_g, peak_g, 0.002);
        EXPECT_NEAR(s.kappa, 1 + peak_g * peak_g / 2, 0.002 * peak_g + 1e-4);
        // chi-square with 3 n degrees of freedom
        EXPECT_NEAR(s.nis_per_dof, 1, 5 * std::sqrt(2.0 / (3.0 * s.used)));
    }
    void expect_lengths_and_vibration(const record::Campaign& campaign, const Analysis& a) const {
        const std::size_t samples = kDwells * (readings() + 1);
        ASSERT_EQ(campaign.samples.size(), samples);
        EXPECT_EQ(a.replayed.samples, samples);
        EXPECT_NEAR(a.replayed.recorded_s,
                    drivers::to_seconds(campaign.samples.back().time - campaign.samples[0].time),
                    1e-9);
        EXPECT_GT(a.replayed.recorded_s, kDwells * (kDwell_s + plan_.ramp_s + plan_.settle_s));
        ASSERT_EQ(a.replayed.dwells.size(), kDwells);
        for (std::size_t d = 0; d < kDwells; ++d) {
            const bool shakes = d < kDwells / 2;
            expect_lengths_and_vibration_of(a.replayed.dwells[d].summary,
                                            shakes ? truth_.transmission * kTable_g[0] : 0,
                                            shakes ? truth_.frequency_hz : 0, readings());
        }
        // Those of the first 2 s of a dwell wait for its level.
        EXPECT_NEAR(static_cast<double>(a.innovations.count), kDwells * (kDwell_s - 2) * GetParam(),
                    0.005 * static_cast<double>(samples));
        for (const double deviation : a.innovations.deviation_arcsec)
            EXPECT_NEAR(deviation, white_arcsec(), 0.02 * white_arcsec());
    }
    using Bounds = std::array<double, estimator::kParameters>;
    /// Forecast, the filter's sigma, and where the truth lies.
    void expect_uncertainty(const Analysis& a, const Bounds& bound) const {
        for (std::size_t i = 0; i < estimator::kParameters; ++i) {
            const char* name = estimator::parameter_names()[i];
            EXPECT_NEAR(a.expected_sigma[i] / bound[i], 1, 0.02) << name;
            EXPECT_NEAR(a.coefficients.sigma[i] / bound[i], 1, 0.05) << name;
            const double truth = truth_.coefficients[i / plant::kTerms][i % plant::kTerms];
            EXPECT_LT(std::abs(a.coefficients.value[i] - truth), 5 * bound[i]) << name;
        }
    }
    /// Of means over a second: each has the noise of so many readings, and of the random walk W
    /// between means m seconds apart V(m) = N^2 (m - 1/3); of its second difference 4 V(m) - V(2
    /// m).
    void expect_allan_deviation(const Analysis& a) const {
        const double mean = white_arcsec() * white_arcsec() / GetParam();
        const double walk = walk_arcsec_rt_s() * walk_arcsec_rt_s();
        for (std::size_t gyro = 0; gyro < 3; ++gyro) {
            const auto& points = a.allan[gyro];
            ASSERT_EQ(points.size(), 3U) << "1, 2 and 4 s of 19 differences";
            for (std::size_t j = 0; j < points.size(); ++j) {
                const double m = std::pow(2, j);
                EXPECT_EQ(points[j].tau, m);
                const double expected = (6 * mean + walk * (2 * m - 1)) / (2 * m * m);
                // Independent pairs only: fewer than there are.
                const double pairs = static_cast<double>(kDwells) * (kDwell_s - 1) / (2 * m);
                EXPECT_NEAR(points[j].dev * points[j].dev / expected, 1, 4 * std::sqrt(2 / pairs))
                    << "gyro " << gyro << ", " << m << " s";
            }
        }
    }
    void expect_held_out(const Analysis& a) const {
        ASSERT_EQ(a.held_out.size(), kDwells);
        double squares = 0, count = 0;
        const double variance =
            rate_variance(readings(), 1 / GetParam(), white_arcsec(), walk_arcsec_rt_s());
        for (const HeldOut& one : a.held_out) {
            for (std::size_t k = 0; k < 3 && one.determined; ++k) {
                squares += std::pow(one.after_dph[k] / one.sigma_dph[k], 2);
                // No line through a dwell is surer than its readings let it be.
                EXPECT_GT(one.sigma_dph[k] * one.sigma_dph[k], 0.98 * variance);
                ++count;
            }
        }
        ASSERT_GT(count, 60);
        // Sigma holds what is declared of the rig, too, and this rig is ideal.
        EXPECT_LT(squares / count, 1 + 4 * std::sqrt(2 / count));
        EXPECT_GT(squares / count, 0.2);
    }
    void expect_printed(const std::string& page, const Bounds& bound, const Analysis& a) const {
        EXPECT_NE(
            page.find(fmt::format("{} dwells, {} samples", kDwells, kDwells * (readings() + 1))),
            std::string::npos);
        for (std::size_t i = 0; i < estimator::kParameters; ++i) {
            const auto cells = row_of(page, estimator::parameter_names()[i]);
            ASSERT_GT(cells.size(), 6U) << estimator::parameter_names()[i];
            // Value and interval are those of the result, not of the noise alone.
            const auto& c = a.assessed.coefficients[i];
            EXPECT_NEAR(std::stod(cells[1]), c.value, 1e-6) << cells[0];
            EXPECT_NEAR(std::stod(cells[3]), c.value - c.expanded, 1e-6) << cells[0];
            EXPECT_NEAR(std::stod(cells[4]), c.value + c.expanded, 1e-6) << cells[0];
            EXPECT_NEAR(std::stod(cells[2]), bound[i], 0.05 * bound[i] + 1e-6) << cells[0];
            EXPECT_NEAR(std::stod(cells[6]), bound[i], 0.02 * bound[i] + 1e-6) << cells[0];
        }
    }

    TemporaryFolder folder_;
    plant::Truth truth_;
    plant::CampaignPlan plan_;

  private:
    /// Of a gyro that has this one coefficient, 1, over a period of the vibration.
    static double mean_drift(plant::PlatformModel& rig, std::size_t gyro, std::size_t term,
                             const plant::Vec3& up, double peak_g) {
        std::array<plant::GyroCoefficients, 3> only{};
        only[gyro][term] = 1;
        rig.set_coefficients(only);
        constexpr int kSteps = 16;
        double sum = 0;
        for (int i = 0; i < kSteps; ++i)
            sum += rig.gyro_drift(up, peak_g * std::sin(2 * std::numbers::pi * i / kSteps))[gyro];
        return sum / kSteps;
    }
};

TEST_P(ReportAtARate, SaysWhatIsRightAtThatRate) {
    const auto campaign = record::read_campaign(folder_.string());
    Analysis analysis = analyse(campaign, {}, [](double) {});
    expect_lengths_and_vibration(campaign, analysis);
    const auto bound = bounds();
    expect_uncertainty(analysis, bound);
    expect_allan_deviation(analysis);
    expect_held_out(analysis);
    const std::string page = make_page(campaign, analysis, {});
    expect_printed(page, bound, analysis);
    EXPECT_EQ(page.find("identified anew"), std::string::npos);
    EXPECT_NE(page.find("probability of about 95 %"), std::string::npos);
    // Where the recording's own result is another, it says so in place of how the dwells are.
    EXPECT_NE(page.find("no dwell to compare"), std::string::npos);
    analysis.not_as_recorded = "/result: parameters D_Fx value: found 1, the replay gives 2";
    const std::string altered = make_page(campaign, analysis, {});
    EXPECT_NE(altered.find("is not that of its dwells: " + analysis.not_as_recorded),
              std::string::npos);
    EXPECT_EQ(altered.find("no dwell to compare"), std::string::npos);
    // Identified with other settings, it says with which, and has their coverage.
    analysis.anew_with = "other.toml";
    analysis.settings.uncertainty.coverage = 0.5;
    const std::string anew = make_page(campaign, analysis, {});
    EXPECT_NE(anew.find("identified anew with other.toml, not as recorded"), std::string::npos);
    EXPECT_NE(anew.find("probability of about 50 %"), std::string::npos);
    EXPECT_NE(anew.find("<th>50 % from</th>"), std::string::npos);
    // Without an assessment the interval is the filter's, and the page says so.
    analysis.assessed.done = false;
    EXPECT_NE(make_page(campaign, analysis, {}).find("the filter's, of noise alone"),
              std::string::npos);
}

INSTANTIATE_TEST_SUITE_P(Hz, ReportAtARate, ::testing::Values(40.0, 100.0, 1000.0),
                         [](const auto& of) { return std::to_string(static_cast<int>(of.param)); });

}  // namespace
}  // namespace vibrig::report
