// What a planned survey will know: the drift under a profile, averaged over resonances that may be.
#include <array>
#include <cmath>

#include "estimator/filter/drift_model.hpp"
#include "estimator/filter/linear_algebra.hpp"
#include "estimator/filter/mapped.hpp"
#include "estimator/spectrum/survey.hpp"
#include "estimator/spectrum/table.hpp"

namespace vibrig::estimator::spectrum {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

constexpr std::size_t kDraws = 24;
constexpr double kLeastBetter = 1e-6;
constexpr double kTypical = 0.03;  ///< of a quadratic coefficient, deg/h/g^2: shares are of it

struct Draw {
    Resonance resonance;
    double elastic_sigma = 0;
};

/// Of the prior, spread evenly and the same every time: frequencies in strata, the damping by a
/// sequence of low discrepancy.
std::vector<Draw> draws() {
    // Normal quantiles 1/12, 3/12 .. 11/12.
    constexpr std::array<double, 6> kNormal{-1.383, -0.674, -0.210, 0.210, 0.674, 1.383};
    std::vector<Draw> out;
    for (std::size_t k = 0; k < kDraws; ++k) {
        const double part = (static_cast<double>(k) + 0.5) / kDraws;
        const double hz = kLowestResonance * std::pow(kHighestResonance / kLowestResonance, part);
        out.push_back({{hz, kDamping * std::exp(kDampingSpread * kNormal[(5 * k) % 6])},
                       kElasticSizes[(k / 6 + k) % 2]});
    }
    return out;
}

Eigen::Matrix3d along_the_vertical(double peak_g) {
    Eigen::Matrix3d moment = Eigen::Matrix3d::Zero();
    moment(1, 1) = peak_g * peak_g / 2;
    return moment;
}

VectorXd columns_of(const Attitude& at, std::size_t gyro, double weight) {
    VectorXd x(kColumns);
    x << at.base[gyro], weight * at.vibration[gyro];
    return x;
}

/// Rows of the candidates for one resonance and gyro: [line][position]; the last line is rest.
class Design {
  public:
    Design(const SurveyTask& task, const std::vector<Situation>& situations, const Draw& draw,
           std::size_t gyro)
        : variance_(task.rate_variance) {
        for (const SurveyLine& line : task.lines)
            add(task, line.level_g, in_phase(line.hz, draw.resonance) - 1, gyro);
        add(task, 0, 0, gyro);
        wanted_.resize(kColumns, static_cast<Index>(situations.size()));
        for (Index k = 0; k < wanted_.cols(); ++k) {
            const Exposure at(task.settings, situations[static_cast<std::size_t>(k)]);
            wanted_.col(k) << at.base(gyro), at.elastic(gyro, draw.resonance);
        }
        prior_ = VectorXd::Ones(kColumns);
        prior_.head<4>().setConstant(0.01);
        prior_.tail<kElastic>().setConstant(1 / (draw.elastic_sigma * draw.elastic_sigma));
    }

    void begin(const SurveyPlaces& places) {
        MatrixXd information = prior_.asDiagonal();
        const auto add_all = [&](std::size_t line, const Places& at) {
            for (const std::size_t place : at)
                information += rows_[line].col(static_cast<Index>(place)) *
                               rows_[line].col(static_cast<Index>(place)).transpose() / variance_;
        };
        add_all(0, places.first);
        for (std::size_t k = 0; k < places.further.size(); ++k) add_all(k + 1, places.further[k]);
        add_all(rows_.size() - 1, places.rest);
        covariance_ = linear_algebra::positive_inverse(information);
    }
    /// Mean variance in the situations.
    [[nodiscard]] double value() const {
        return (wanted_.transpose() * covariance_ * wanted_).trace() /
               static_cast<double>(wanted_.cols());
    }
    /// With the dwell at one place of a line at another.
    [[nodiscard]] double value_if(std::size_t line, std::size_t from, std::size_t to) const {
        const VectorXd x = rows_[line].col(static_cast<Index>(from));
        const VectorXd y = rows_[line].col(static_cast<Index>(to));
        const VectorXd px = covariance_ * x, py = covariance_ * y;
        // One dwell out, and the other in.
        const double out = variance_ - x.dot(px), across = y.dot(px);
        if (!(out > 1e-12 * variance_)) return 1e300;
        const VectorXd left = py + px * (across / out);
        const double in = variance_ + y.dot(left);
        const double more = (wanted_.transpose() * px).squaredNorm() / out;
        const double less = (wanted_.transpose() * left).squaredNorm() / in;
        return value() + (more - less) / static_cast<double>(wanted_.cols());
    }

  private:
    void add(const SurveyTask& task, double level_g, double weight, std::size_t gyro) {
        MatrixXd rows(kColumns, static_cast<Index>(task.gimbal_rad.size()));
        for (Index i = 0; i < rows.cols(); ++i) {
            const auto at = attitude(task.settings, task.gimbal_rad[static_cast<std::size_t>(i)],
                                     along_the_vertical(level_g));
            rows.col(i) = columns_of(at, gyro, weight);
        }
        rows_.push_back(std::move(rows));
    }

    double variance_;
    std::vector<MatrixXd> rows_;
    MatrixXd wanted_, covariance_;
    VectorXd prior_;
};

std::vector<Design> designs(const SurveyTask& task, const SurveyPlaces& places,
                            const std::vector<Situation>& situations) {
    std::vector<Design> out;
    for (const Draw& draw : draws()) {
        for (std::size_t gyro = 0; gyro < kGyros; ++gyro) {
            out.emplace_back(task, situations, draw, gyro);
            out.back().begin(places);
        }
    }
    return out;
}

double mean_of(const std::vector<Design>& all) {
    double sum = 0;
    for (const Design& one : all) sum += one.value();
    return sum / static_cast<double>(all.size());
}

/// Six coefficients of a frequency from these positions alone.
bool determined(const SurveyTask& task, const Places& places) {
    MatrixXd rows(static_cast<Index>(places.size()), kElastic);
    for (Index i = 0; i < rows.rows(); ++i) {
        const auto at =
            attitude(task.settings, task.gimbal_rad[places[static_cast<std::size_t>(i)]],
                     along_the_vertical(1));
        rows.row(i) = at.vibration[0];
    }
    return linear_algebra::rank(rows, 1e-3) == kElastic;
}

}  // namespace

double predicted_u(const SurveyTask& task, const SurveyPlaces& places,
                   const std::vector<Situation>& situations) {
    return std::sqrt(mean_of(designs(task, places, situations)));
}

SurveyPlaces exchange_for(const SurveyTask& task, SurveyPlaces places,
                          const std::vector<Situation>& situations) {
    auto all = designs(task, places, situations);
    double now = mean_of(all);
    for (bool better = true; better;) {
        better = false;
        for (std::size_t line = 0; line < places.further.size(); ++line) {
            for (std::size_t& place : places.further[line]) {
                const std::size_t from = place;
                std::size_t best = from;
                double least = now * (1 - kLeastBetter);
                for (std::size_t to = 0; to < task.gimbal_rad.size(); ++to) {
                    if (to == from) continue;
                    double sum = 0;
                    for (const Design& one : all) sum += one.value_if(line + 1, from, to);
                    const double value = sum / static_cast<double>(all.size());
                    if (value >= least) continue;
                    place = to;
                    if (determined(task, places.further[line])) {
                        best = to;
                        least = value;
                    }
                }
                place = best;
                if (best == from) continue;
                for (Design& one : all) one.begin(places);
                now = mean_of(all);
                better = true;
            }
        }
    }
    return places;
}

Flatness planned_flatness(const SurveyTask& task, const SurveyPlaces& places) {
    std::vector<SpectralDwell> dwells;
    std::vector<Kind> kinds;
    const auto add = [&](const Places& at, const SurveyLine* line) {
        if (line != nullptr) kinds.push_back({"", {{line->hz, 1, 0}}});
        for (const std::size_t place : at) {
            SpectralDwell dwell;
            mapped(dwell.row.angles) = task.gimbal_rad[place];
            mapped(dwell.row.variance) = task.rate_variance * Eigen::Matrix3d::Identity();
            const Eigen::Matrix3d moment = along_the_vertical(line != nullptr ? line->level_g : 0);
            dwell.row.vibration.kappa = 1 + moment(1, 1);
            const auto seen = attitude(task.settings, task.gimbal_rad[place], moment);
            for (std::size_t j = 0; j < kGyros; ++j) mapped(dwell.row.regressors[j]) = seen.base[j];
            if (line != nullptr) dwell.kind = kinds.size() - 1;
            dwells.push_back(std::move(dwell));
        }
    };
    add(places.first, &task.lines.front());
    for (std::size_t k = 0; k < places.further.size(); ++k)
        add(places.further[k], &task.lines[k + 1]);
    add(places.rest, nullptr);
    const SpectralTable table(task.settings, dwells, kinds);
    const Index n = 3 * table.dwells();
    MatrixXd prior(kBase, 3);
    prior.topRows(1).setConstant(task.settings.prior_bias);
    prior.middleRows(1, 3).setConstant(task.settings.prior_linear);
    prior.bottomRows(kElastic).setConstant(task.settings.prior_quadratic);
    VectorXd rates(n);
    for (Index k = 0; k < table.dwells(); ++k) {
        for (Index j = 0; j < 3; ++j)
            rates[3 * k + j] =
                kTypical * table.base(static_cast<std::size_t>(j)).row(k).tail(kElastic).sum();
    }
    return test_flatness(table, rates, task.rate_variance * MatrixXd::Identity(n, n), prior, false);
}

}  // namespace vibrig::estimator::spectrum
