#include "estimator/uncertainty/assessment.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <span>
#include <utility>

#include "estimator/filter/mapped.hpp"
#include "estimator/filter/median.hpp"
#include "estimator/filter/parameters.hpp"
#include "estimator/level/coning.hpp"
#include "estimator/uncertainty/balanced_order.hpp"
#include "estimator/uncertainty/beside_drift.hpp"
#include "estimator/uncertainty/breaks.hpp"
#include "estimator/uncertainty/coverage.hpp"
#include "estimator/uncertainty/distributions.hpp"
#include "estimator/uncertainty/doubtful_levels.hpp"
#include "estimator/uncertainty/verdict.hpp"

namespace vibrig::estimator::uncertainty {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr auto kAll = static_cast<Index>(kParameters);
constexpr auto kOfGyro = static_cast<Index>(kGroups);

Index index(std::size_t i) { return static_cast<Index>(i); }

VectorXd prior_information(const Settings& settings) {
    const ParameterArray sigma = prior_sigma(settings);
    VectorXd information(kAll);
    for (std::size_t i = 0; i < kParameters; ++i) information[index(i)] = 1 / (sigma[i] * sigma[i]);
    return information;
}

std::array<GyroRates, 3> gyros_of(const DwellTable& table, const Settings& settings) {
    const VectorXd prior = prior_information(settings);
    std::array<GyroRates, 3> gyros;
    for (std::size_t j = 0; j < kGyros; ++j) {
        GyroRates& gyro = gyros[j];
        const Index n = table.dwells();
        gyro.time_h = table.time_h;
        gyro.rate.resize(n);
        gyro.variance.resize(n);
        gyro.regressors.resize(n, kOfGyro);
        for (Index k = 0; k < n; ++k) {
            const DwellRow& row = table.rows[static_cast<std::size_t>(k)];
            gyro.rate[k] = row.rate[j];
            gyro.variance[k] = row.variance[j][j];
            gyro.regressors.row(k) = mapped(row.regressors[j]);
        }
        gyro.prior_information.resize(kOfGyro);
        for (Index g = 0; g < kOfGyro; ++g) gyro.prior_information[g] = prior[3 * g + index(j)];
        gyro.breaks = breaks_of(table, settings.drift);
    }
    return gyros;
}

/// The three gyros put together, filter order.
struct Together {
    VectorXd value = VectorXd::Zero(kAll);
    MatrixXd covariance = MatrixXd::Zero(kAll, kAll), gain;
};

Together join(const std::array<DriftAverage, 3>& gyros, const NullFit& fit, Index dwells) {
    Together all;
    all.gain = MatrixXd::Zero(kAll, 3 * dwells);
    for (Index j = 0; j < 3; ++j) {
        const DriftAverage& gyro = gyros[static_cast<std::size_t>(j)];
        for (Index a = 0; a < kOfGyro; ++a) {
            all.value[3 * a + j] = gyro.value[a];
            for (Index k = 0; k < dwells; ++k) all.gain(3 * a + j, 3 * k + j) = gyro.gain(a, k);
            for (Index b = 0; b < kOfGyro; ++b)
                all.covariance(3 * a + j, 3 * b + j) = gyro.covariance(a, b);
        }
    }
    // Between the gyros: as with a constant bias, on the scale of what each has now.
    const VectorXd widening =
        (all.covariance.diagonal().array() / fit.covariance().diagonal().array()).sqrt();
    for (Index a = 0; a < kAll; ++a) {
        for (Index b = 0; b < kAll; ++b) {
            if (a % 3 != b % 3)
                all.covariance(a, b) = fit.covariance()(a, b) * widening[a] * widening[b];
        }
    }
    return all;
}

/// Of a constant bias alone: as wide as the scatter of the dwells asks for.
void widen_constant(const Settings& settings, const Assessment& out, Together& all) {
    if (settings.drift.model != BiasModel::constant || out.degrees <= 0) return;
    if (chi_square_tail(out.chi_square, out.degrees) > 0.05 || out.birge <= 1) return;
    all.covariance *= out.birge * out.birge;
}

/// What the dwells say when each gyro's bias may have moved.
struct Averaged {
    std::array<GyroRates, 3> gyros;
    std::array<DriftAverage, 3> drift;
    ParameterArray coefficients{};
};

Averaged averaged(const DwellTable& table, const Settings& settings) {
    Averaged out{gyros_of(table, settings), {}, {}};
    for (std::size_t j = 0; j < 3; ++j) {
        out.drift[j] = average_drift(out.gyros[j], settings.drift);
        for (std::size_t g = 0; g < kGroups; ++g)
            out.coefficients[internal_index(g, j)] = out.drift[j].value[index(g)];
    }
    return out;
}

/// Columns by which the rates may differ from the model, for each gyro.
void declare(const MatrixXd& columns, std::array<GyroRates, 3>& gyros) {
    for (Index k = 0; k < columns.rows(); ++k) {
        MatrixXd& of_gyro = gyros[static_cast<std::size_t>(k % 3)].declared;
        if (k < 3) of_gyro.resize(columns.rows() / 3, columns.cols());
        of_gyro.row(k / 3) = columns.row(k);
    }
}

/// What the tests of fit work on.
struct Tested {
    DwellTable table;
    std::array<GyroRates, 3> gyros;
    NullFit fit;
};

Tested tested_with(const Settings& settings, DwellTable table, std::span<const DwellRow> rows,
                   const MatrixXd& declared, const VectorXd& prior, const Freed& freed) {
    table.rows = rows;
    auto gyros = gyros_of(table, settings);
    declare(declared, gyros);
    return {table, std::move(gyros), NullFit(table, declared, prior, freed.determined)};
}

void take_fit(const Settings& settings, const NullFit& fit, Assessment& out) {
    out.chi_square = fit.chi_square();
    out.degrees = fit.degrees();
    if (out.degrees <= 0) return;
    const double mean = out.chi_square / out.degrees;
    out.birge = std::sqrt(mean);
    // Noise that is known to a relative r: 1/2 (1/r)^2 degrees of freedom.
    if (out.degrees >= 9) out.p = f_tail(mean, out.degrees, settings.uncertainty.noise_dof);
}

bool names_a_drift(const std::vector<Evidence>& evidence) {
    return !evidence.empty() && evidence.front().named() &&
           !is_structural(evidence.front().pattern);
}

struct TypeB {
    MatrixXd sensitivity;  ///< 30 x m: G z
    MatrixXd covariance;   ///< 30 x 30
    std::vector<Correlated> correlated;
};

TypeB propagate(const Settings& settings, const Together& all, const MatrixXd& rates,
                const MatrixXd& u, double sync_bound) {
    TypeB b;
    b.sensitivity.resize(kAll, rates.cols());
    for (Index i = 0; i < rates.cols(); ++i) b.sensitivity.col(i) = all.gain * rates.col(i);
    b.covariance = b.sensitivity * u * b.sensitivity.transpose() +
                   unseen_covariance(settings.uncertainty, all.value, sync_bound);
    b.correlated = correlated(u);
    return b;
}

std::vector<Contribution> contributions(Index i, double u_a, const TypeB& b,
                                        const std::vector<InputSignature>& inputs) {
    std::vector<Contribution> list;
    list.push_back({"noise and drift states", "", 1, u_a, u_a, Shape::normal,
                    std::numeric_limits<double>::infinity(), true});
    for (std::size_t p = 0; p < inputs.size(); ++p) {
        const Declared& d = inputs[p].declared;
        const double c = b.sensitivity(i, index(p));
        list.push_back({inputs[p].input, inputs[p].element, c, d.u, std::abs(c) * d.u, d.shape,
                        d.dof, d.declared});
    }
    return list;
}

double worst_step(const std::array<GyroRates, 3>& gyros) {
    double worst = 1;
    for (const GyroRates& gyro : gyros) worst = std::max(worst, step_inflation(gyro));
    return worst;
}

void tell_cross_axis(const DwellTable& table, Assessment& out) {
    std::map<int, std::pair<int, LevelTensor>> runs;
    for (const DwellRow& row : table.rows) {
        if (!(row.vibration.kappa > 1)) continue;
        auto& [count, sum] = runs.try_emplace(row.run, 0, LevelTensor{}).first->second;
        ++count;
        for (std::size_t k = 0; k < sum.size(); ++k) sum[k] += row.vibration.gamma[k];
    }
    for (auto& [run, of] : runs) {
        for (double& one : of.second) one /= of.first;
        out.cross_axis.push_back({run, of.second});
    }
}

void tell_rates(const DwellTable& table, const VectorXd& residual, const VectorXd& variance,
                Assessment& out) {
    for (std::size_t k = 0; k < table.rows.size(); ++k) {
        DwellRate rate = rate_of(table.rows[k], table.time_h[index(k)]);
        for (std::size_t j = 0; j < 3; ++j) {
            rate.residual[j] = residual[index(3 * k + j)];
            rate.residual_sigma[j] = std::sqrt(variance[index(3 * k + j)]);
        }
        out.rates.push_back(rate);
    }
}

void tell_combinations(const Result& result, const VectorXd& value, const MatrixXd& combined,
                       Assessment& out) {
    for (const Combination& one : result.combinations) {
        VectorXd w = VectorXd::Zero(kAll);
        for (const auto& [name, weight] : one.weights)
            for (std::size_t i = 0; i < kParameters; ++i)
                if (name == parameter_names()[i]) w[index(internal_of(i))] = weight;
        out.combinations.push_back({w.dot(value), std::sqrt(w.dot(combined * w))});
    }
}

void tell_coefficients(const Settings& settings, const Result& result, const DwellTable& table,
                       const NullFit& fit, const Together& all, const TypeB& b, Assessment& out) {
    const MatrixXd combined = all.covariance + b.covariance;
    out.covariance_a.resize(kAll, kAll);
    out.covariance_combined.resize(kAll, kAll);
    for (std::size_t i = 0; i < kParameters; ++i) {
        for (std::size_t j = 0; j < kParameters; ++j) {
            const bool both = result.observable[i] && result.observable[j];
            const auto a = index(internal_of(i)), c = index(internal_of(j));
            out.covariance_a(index(i), index(j)) = both ? all.covariance(a, c) : kNone;
            out.covariance_combined(index(i), index(j)) = both ? combined(a, c) : kNone;
        }
    }
    tell_combinations(result, all.value, combined, out);
    std::vector<double> widening;
    for (std::size_t i = 0; i < kParameters; ++i) {
        const std::size_t internal = internal_of(i);
        const auto a = index(internal);
        Coefficient& c = out.coefficients[i];
        if (!result.observable[i]) continue;
        c.value = all.value[a];
        c.value_constant = fit.value()[a];
        c.sigma = std::sqrt(fit.covariance()(a, a));
        c.u_a = std::sqrt(all.covariance(a, a));
        c.noise = std::min(c.sigma, c.u_a);
        c.u_b = std::sqrt(std::max(0.0, b.covariance(a, a)));
        c.u = std::hypot(c.u_a, c.u_b);
        c.budget = contributions(a, c.u_a, b, out.inputs);
        add_correlations(b.correlated, c);
        add_unseen(settings.uncertainty, all.value, out.sync_bound, internal, c.budget);
        expand(settings.uncertainty, internal, static_cast<double>(table.dwells() - kOfGyro),
               growth_in_dwell(out.ramps.mean[internal % kGyros], table.rows), c);
        widening.push_back(c.u_a / c.sigma);
    }
    out.widening = widening.empty() ? 1 : median(widening);
}

}  // namespace

DwellRate rate_of(const DwellRow& row, double time_h) {
    DwellRate rate;
    rate.run = row.run;
    rate.position = row.position;
    rate.level_g = std::sqrt(2 * std::max(0.0, row.vibration.kappa - 1));
    rate.time_h = time_h;
    rate.rate = row.rate;
    for (std::size_t j = 0; j < 3; ++j) rate.sigma[j] = std::sqrt(row.variance[j][j]);
    return rate;
}

const char* word_of(Level level) noexcept {
    return level == Level::valid ? "valid" : level == Level::doubtful ? "doubtful" : "not valid";
}

void take_sync(std::span<const DwellRow> rows, Assessment& to) {
    const auto peak_square = [](const DwellRow& row) {
        return row.frequency_hz > 0 ? 2 * (row.vibration.kappa - 1) : 0.0;
    };
    double strongest = 0;
    for (const DwellRow& row : rows)
        if (!row.apart) strongest = std::max(strongest, peak_square(row));
    for (const DwellRow& row : rows) {
        if (!(peak_square(row) > 0)) continue;
        // Coefficients of one frequency follow from its strongest vibration: a drift beside a weak
        // one, were it but the noise of the angles, moves them by what it is beside that.
        const double a0_square = row.apart ? peak_square(row) : strongest;
        to.sync_arcsec = std::max(to.sync_arcsec, row.sync_arcsec);
        to.sync_bound =
            std::max(to.sync_bound, coning_bound(row.frequency_hz, row.sync_arcsec, a0_square));
    }
}

Assessment assess(const Settings& settings, const Result& result, Stage stage) {
    Assessment out;
    DwellTable table = dwell_table(result.rows);
    if (table.dwells() >= 2 && settings.method == Method::joint) {
        out.done = true;
        out.model = settings.drift.model;
        out.times_assumed = table.times_assumed;
        const VectorXd prior = prior_information(settings);
        Averaged of = averaged(table, settings);
        const Freed freed = determine_freed(settings, table, of.coefficients, prior);
        if (!freed.list.empty()) {
            table.rows = freed.rows;
            of = averaged(table, settings);
        }
        out.freed = freed.list;
        out.freed_settled = freed.list.empty() || freed.settled;
        out.drift = of.drift;
        const ForwardModel model(settings, of.coefficients);
        const Inputs declared = without(settings.uncertainty, settings.free);
        InputSignatures inputs = input_signatures(declared, settings.drift, table, model);
        add_skew(table, model, inputs);
        out.inputs = std::move(inputs.list);
        const MatrixXd u = input_covariance(declared, out.inputs);
        MatrixXd scaled(inputs.rates.rows(), inputs.rates.cols() + freed.prior.cols());
        scaled << inputs.rates * linear_algebra::padded_root(u), freed.prior;
        declare(scaled, of.gyros);
        const NullFit fit(table, scaled, prior, freed.determined);
        const auto in_doubt = with_doubtful_levels(settings, table, model);
        const Tested tested = in_doubt.empty()
                                  ? Tested{table, of.gyros, fit}
                                  : tested_with(settings, table, in_doubt, scaled, prior, freed);
        take_fit(settings, tested.fit, out);
        Together all = join(out.drift, fit, table.dwells());
        widen_constant(settings, out, all);
        freed.put_into(all.gain, all.covariance);
        out.gain = all.gain;
        out.covariance_type_a = all.covariance;
        out.ramps = fit_ramps(table, all.value);
        take_sync(table.rows, out);
        tell_cross_axis(table, out);
        out.worst_step = worst_step(of.gyros);
        tell_rates(table, fit.residual(all.value), fit.residual_variance(inputs.rates.cols()), out);
        if (out.degrees >= 9)
            out.evidence = weigh_patterns(tested.table, tested.fit, out.ramps, model, tested.gyros);
        if (names_a_drift(out.evidence)) {
            out.beside_drift = weigh_beside_drift({tested.table, of.gyros, out.drift,
                                                   settings.drift, scaled, prior, freed.determined},
                                                  model);
            for (Evidence& e : out.beside_drift) e.change = out.gain * e.rates;
        }
        const TypeB b = propagate(settings, all, inputs.rates, u, out.sync_bound);
        out.sensitivity = b.sensitivity;
        tell_coefficients(settings, result, table, fit, all, b, out);
    }
    out.verdict = judge(settings, result, out, stage);
    return out;
}

}  // namespace vibrig::estimator::uncertainty
