#include "estimator/spectrum/prediction.hpp"

#include <algorithm>
#include <cmath>

#include "estimator/filter/linear_algebra.hpp"
#include "estimator/uncertainty/distributions.hpp"

namespace vibrig::estimator::spectrum {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kLowerReach = 1.5;  ///< below the lowest frequency a resonance shows no more

/// What is the same for all hypotheses of a gyro.
struct Columns {
    std::vector<Exposure> at;

    /// m x (10 + 6 r).
    [[nodiscard]] MatrixXd of(std::size_t gyro, const std::vector<Resonance>& resonances) const {
        MatrixXd x(static_cast<Index>(at.size()),
                   kBase + kElastic * static_cast<Index>(resonances.size()));
        for (std::size_t k = 0; k < at.size(); ++k) {
            const auto row = static_cast<Index>(k);
            x.row(row).head(kBase) = at[k].base(gyro);
            for (std::size_t r = 0; r < resonances.size(); ++r)
                x.row(row).segment(kBase + kElastic * static_cast<Index>(r), kElastic) =
                    at[k].elastic(gyro, resonances[r]);
        }
        return x;
    }
};

double share_outside(const Model& model, const Situation& in) {
    double share = 0;
    for (const Band& band : in.bands) {
        if (band.hz > model.highest_hz || band.hz < model.lowest_hz / kLowerReach)
            share += band.share;
    }
    return share;
}

void add_blocks(MatrixXd& to, const MatrixXd& of, Index gyro) {
    for (Index a = 0; a < of.rows(); ++a) {
        for (Index b = 0; b < of.cols(); ++b) to(3 * a + gyro, 3 * b + gyro) += of(a, b);
    }
}

/// Over the hypotheses: mean, and covariance within and between them.
void average(const Model& model, const Columns& columns, std::size_t gyro, Prediction& out) {
    const auto j = static_cast<Index>(gyro);
    const auto m = static_cast<Index>(columns.at.size());
    MatrixXd within = MatrixXd::Zero(m, m), between = within;
    VectorXd mean = VectorXd::Zero(m);
    std::vector<VectorXd> values;
    for (const Hypothesis& one : model.mixture[gyro]) {
        const MatrixXd g =
            gradient(one, [&](const std::vector<Resonance>& at) { return columns.of(gyro, at); });
        values.emplace_back(g.leftCols(one.x.size()) * one.x);
        mean += one.weight * values.back();
        within += one.weight * g * one.covariance * g.transpose();
        for (Index k = 0; k < m; ++k)
            out.realisation(k, j) +=
                one.weight *
                columns.at[static_cast<std::size_t>(k)].realisation(
                    gyro, one.x.tail(one.x.size() - (kBase - kElastic)), one.resonances);
    }
    for (std::size_t h = 0; h < values.size(); ++h) {
        const VectorXd off = values[h] - mean;
        between += model.mixture[gyro][h].weight * off * off.transpose();
    }
    out.drift.col(j) = mean;
    out.coefficients.col(j) = within.diagonal().cwiseSqrt();
    out.resonance.col(j) = between.diagonal().cwiseSqrt();
    out.realisation.col(j) = out.realisation.col(j).cwiseSqrt().eval();
    add_blocks(out.covariance, within + between, j);
}

/// What each effect moves, 3 m: element 3 k + j.
std::vector<VectorXd> moved_by(const Model& model, const Columns& columns,
                               const PredictionOptions& options) {
    const auto m = static_cast<Index>(columns.at.size());
    std::array<MatrixXd, 3> x;
    for (std::size_t j = 0; j < 3; ++j) x[j] = columns.of(j, model.mixture[j].front().resonances);
    std::vector<VectorXd> list;
    for (const Effect& effect : model.effects) {
        VectorXd& moved = list.emplace_back(VectorXd::Zero(3 * m));
        // What scales the profile's level as it scaled the campaign's cancels.
        if (options.same_accelerometers && effect.input == "accelerometer_gain") continue;
        for (Index j = 0; j < 3; ++j) {
            const VectorXd of_gyro =
                x[static_cast<std::size_t>(j)] * effect.change[static_cast<std::size_t>(j)];
            for (Index k = 0; k < m; ++k) moved[3 * k + j] = of_gyro[k];
        }
    }
    return list;
}

void add_declared(const Model& model, const Columns& columns, const PredictionOptions& options,
                  Prediction& out) {
    const std::vector<VectorXd> moved = moved_by(model, columns, options);
    MatrixXd declared = MatrixXd::Zero(out.covariance.rows(), out.covariance.cols());
    for (const VectorXd& one : moved) declared += one * one.transpose();
    for (const uncertainty::Correlated& pair : model.correlated) {
        const MatrixXd shared =
            pair.value * moved.at(pair.first) * moved.at(pair.second).transpose();
        declared += shared + shared.transpose();
    }
    out.covariance += declared;
    for (Index i = 0; i < declared.rows(); ++i)
        out.gain(i / 3, i % 3) = std::sqrt(std::max(0.0, declared(i, i)));
}

void add_outside(const Model& model, const Columns& columns, const PredictionOptions& options,
                 Prediction& out) {
    for (std::size_t k = 0; k < columns.at.size(); ++k) {
        const auto row = static_cast<Index>(k);
        const Exposure& at = columns.at[k];
        out.power_outside = std::max(out.power_outside, share_outside(model, at.situation()));
        for (std::size_t j = 0; j < 3; ++j) {
            const Exposure::Row above = at.above(j, model.highest_hz);
            double still = 0, shaken = 0;
            for (const Hypothesis& one : model.mixture[j]) {
                const Exposure::Row own = one.x.segment<kElastic>(kBase - kElastic);
                still += one.weight * above.dot(own);
                double all = at.vibration(j).dot(own);
                for (std::size_t r = 0; r < one.resonances.size(); ++r)
                    all +=
                        at.elastic(j, one.resonances[r])
                            .dot(one.x.segment<kElastic>(kBase + kElastic * static_cast<Index>(r)));
                shaken += one.weight * all;
            }
            out.outside(row, static_cast<Index>(j)) =
                options.elastic_beyond * std::abs(still) / std::sqrt(3.0);
            out.vibration(row, static_cast<Index>(j)) = shaken;
        }
    }
}

}  // namespace

MatrixXd gradient(const Hypothesis& of,
                  const std::function<MatrixXd(const std::vector<Resonance>&)>& columns) {
    const MatrixXd x = columns(of.resonances);
    if (!of.linearised) return x;
    constexpr double kStep = 1e-5;
    const std::size_t count = of.resonances.size();
    MatrixXd out(x.rows(), x.cols() + 2 * static_cast<Index>(count));
    out.leftCols(x.cols()) = x;
    for (std::size_t i = 0; i < 2 * count; ++i) {
        const auto moved = [&](double step) {
            auto resonances = of.resonances;
            Resonance& one = resonances[i % count];
            (i < count ? one.hz : one.damping) *= std::exp(step);
            return VectorXd(columns(resonances) * of.x);
        };
        out.col(x.cols() + static_cast<Index>(i)) = (moved(kStep) - moved(-kStep)) / (2 * kStep);
    }
    return out;
}

AtFrequency at_frequency(const std::vector<Hypothesis>& mixture, Index term, double hz) {
    const auto row = [&](const std::vector<Resonance>& resonances) {
        const auto count = static_cast<Index>(resonances.size());
        MatrixXd out = MatrixXd::Zero(1, kBase + kElastic * count);
        out(0, kBase - kElastic + term) = 1;
        for (Index r = 0; r < count; ++r)
            out(0, kBase + kElastic * r + term) =
                in_phase(hz, resonances[static_cast<std::size_t>(r)]) - 1;
        return out;
    };
    double mean = 0, square = 0;
    for (const Hypothesis& one : mixture) {
        const MatrixXd g = gradient(one, row);
        const double value = g.row(0).head(one.x.size()).dot(one.x);
        mean += one.weight * value;
        square += one.weight * (g.row(0).dot(g.row(0) * one.covariance) + value * value);
    }
    return {mean, std::sqrt(std::max(0.0, square - mean * mean))};
}

double Prediction::u(Index situation, Index gyro) const {
    const Index at = 3 * situation + gyro;
    return std::sqrt(covariance(at, at));
}

Prediction predict(const Model& model, const std::vector<Situation>& situations,
                   const PredictionOptions& options) {
    Columns columns;
    for (const Situation& in : situations) columns.at.emplace_back(model.frame, in);
    const auto m = static_cast<Index>(situations.size());
    Prediction out;
    out.covariance = MatrixXd::Zero(3 * m, 3 * m);
    for (MatrixXd* part : {&out.drift, &out.coefficients, &out.resonance, &out.gain,
                           &out.realisation, &out.outside, &out.vibration})
        *part = MatrixXd::Zero(m, 3);
    for (std::size_t j = 0; j < 3; ++j) average(model, columns, j, out);
    add_declared(model, columns, options, out);
    add_outside(model, columns, options, out);
    for (Index k = 0; k < m; ++k) {
        for (Index j = 0; j < 3; ++j)
            out.covariance(3 * k + j, 3 * k + j) += out.realisation(k, j) * out.realisation(k, j) +
                                                    out.outside(k, j) * out.outside(k, j);
    }
    return out;
}

namespace {

/// The part of the budget that has to grow least until `off` is within two standard deviations.
void blame(const Prediction& of, double off, double variance, double noise, Verification& out) {
    const std::array<std::pair<const char*, double>, 6> parts{
        {{"coefficients", of.coefficients(out.dwell, out.gyro)},
         {"resonance", of.resonance(out.dwell, out.gyro)},
         {"gain", of.gain(out.dwell, out.gyro)},
         {"realisation", of.realisation(out.dwell, out.gyro)},
         {"outside", of.outside(out.dwell, out.gyro)},
         {"noise of the dwell", noise}}};
    const auto largest =
        std::max_element(parts.begin(), parts.end(),
                         [](const auto& a, const auto& b) { return a.second < b.second; });
    out.part = largest->first;
    const double lacking = std::max(0.0, off * off / 4 - variance);
    out.larger = std::sqrt(1 + lacking / (largest->second * largest->second));
}

}  // namespace

Verification verify(const Prediction& prediction, const MatrixXd& measured,
                    const std::vector<Eigen::Matrix3d>& variances,
                    const std::vector<double>& relative_errors, double tolerance) {
    const Index m = measured.rows();
    MatrixXd s = prediction.covariance;
    VectorXd d(3 * m);
    for (Index k = 0; k < m; ++k) {
        const auto i = static_cast<std::size_t>(k);
        const Eigen::Vector3d level = relative_errors[i] * prediction.vibration.row(k).transpose();
        s.block<3, 3>(3 * k, 3 * k) += variances[i] + level * level.transpose();
        d.segment<3>(3 * k) = (measured.row(k) - prediction.drift.row(k)).transpose();
    }
    Verification out;
    out.chi_square = linear_algebra::squared_distance(s, d);
    out.degrees = static_cast<int>(3 * m);
    out.p = uncertainty::chi_square_tail(out.chi_square, out.degrees);
    out.z.resize(m, 3);
    for (Index k = 0; k < m; ++k) {
        const Eigen::Vector3d own = d.segment<3>(3 * k);
        const Eigen::Matrix3d block = s.block<3, 3>(3 * k, 3 * k);
        out.least_p = std::min(out.least_p, uncertainty::chi_square_tail(
                                                linear_algebra::squared_distance(block, own), 3));
        for (Index j = 0; j < 3; ++j) {
            const double z = out.z(k, j) = own[j] / std::sqrt(block(j, j));
            out.tight &= !(tolerance > 0) || 2 * std::sqrt(block(j, j)) <= tolerance;
            if (std::abs(z) <= std::abs(out.largest_z)) continue;
            out.largest_z = z;
            out.dwell = k;
            out.gyro = j;
        }
    }
    out.confirmed = out.p >= 0.01 && out.least_p >= 1e-3;
    const Index at = 3 * out.dwell + out.gyro;
    const auto worst = static_cast<std::size_t>(out.dwell);
    blame(prediction, d[at], s(at, at), std::sqrt(variances[worst](out.gyro, out.gyro)), out);
    return out;
}

}  // namespace vibrig::estimator::spectrum
