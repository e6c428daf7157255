#include "estimator/spectrum/analysis.hpp"

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>

#include "estimator/filter/linear_algebra.hpp"
#include "estimator/filter/mapped.hpp"
#include "estimator/filter/parameters.hpp"
#include "estimator/spectrum/declared_rates.hpp"
#include "estimator/uncertainty/breaks.hpp"
#include "estimator/uncertainty/distributions.hpp"
#include "estimator/uncertainty/drift_states.hpp"
#include "estimator/uncertainty/fit.hpp"
#include "estimator/uncertainty/signatures.hpp"

namespace vibrig::estimator::spectrum {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr Index kFewestForTwo = 40;
constexpr double kOneFrequencyReach = 1.5;
constexpr double kUsualHz =
    60;  ///< a second resonance is looked for beside it where none is likely

MatrixXd prior_sigmas(const Settings& settings) {
    const ParameterArray sigma = prior_sigma(settings);
    MatrixXd out(kBase, 3);
    for (std::size_t g = 0; g < kGroups; ++g) {
        for (std::size_t j = 0; j < kGyros; ++j)
            out(static_cast<Index>(g), static_cast<Index>(j)) = sigma[internal_index(g, j)];
    }
    return out;
}

/// Of gyro j's rate; `shaken`: its part due to the vibration.
double variance_of(const SpectralDwell& dwell, std::size_t j, double shaken) {
    const double level = dwell.relative_error * shaken;
    return dwell.row.variance[j][j] + level * level;
}

/// What the gains, kBase x n for each gyro, let through of the rates' noise, and that of the rates.
void put_noise(const SpectralTable& table, const std::array<MatrixXd, 3>& gains,
               const MatrixXd& declared, Analysis& out) {
    const Index n = table.dwells();
    out.noise.resize(3 * kBase);
    out.rate_sigma.resize(n, 3);
    VectorXd variance(n);
    for (std::size_t j = 0; j < 3; ++j) {
        const auto g = static_cast<Index>(j);
        for (Index k = 0; k < n; ++k) {
            const SpectralDwell& dwell = table.list()[static_cast<std::size_t>(k)];
            variance[k] = variance_of(dwell, j, out.vibration_rates(k, g));
            out.rate_sigma(k, g) = std::sqrt(variance[k] + declared.row(3 * k + g).squaredNorm());
        }
        for (Index a = 0; a < kBase; ++a)
            out.noise[3 * a + g] = std::sqrt(gains[j].row(a).cwiseAbs2().dot(variance));
    }
}

/// The rates of a gyro with the groups model, what is not known of their vibration in the noise.
uncertainty::GyroRates rates_of(const SpectralTable& table, const uncertainty::DwellTable& times,
                                const VectorXd& prior, std::size_t j, const MatrixXd& shaken) {
    uncertainty::GyroRates gyro;
    const Index n = table.dwells(), g = static_cast<Index>(j);
    gyro.time_h = times.time_h;
    gyro.rate = gyro.variance = VectorXd::Zero(n);
    for (Index k = 0; k < n; ++k) {
        const SpectralDwell& dwell = table.list()[static_cast<std::size_t>(k)];
        gyro.rate[k] = dwell.row.rate[j];
        gyro.variance[k] = variance_of(dwell, j, shaken(k, g));
    }
    gyro.regressors = table.grouped(j);
    gyro.prior_information = prior.array().square().inverse();
    return gyro;
}

/// Drift of all dwells due to their vibration, by the groups' coefficients of a gyro.
VectorXd vibration_part(const SpectralTable& table, std::size_t j, const VectorXd& groups) {
    VectorXd out = VectorXd::Zero(table.dwells());
    for (Index k = 0; k < table.dwells(); ++k) {
        const auto& kind = table.list()[static_cast<std::size_t>(k)].kind;
        if (!kind) continue;
        const Index begin = kBase - kElastic + kElastic * static_cast<Index>(*kind);
        out[k] = table.vibration(j).row(k).dot(groups.segment(begin, kElastic));
    }
    return out;
}

/// Rows of gyro j out of those of all.
MatrixXd of_gyro(const MatrixXd& all, Index j) {
    MatrixXd out(all.rows() / 3, all.cols());
    for (Index k = 0; k < out.rows(); ++k) out.row(k) = all.row(3 * k + j);
    return out;
}

/// Of all rates: the gyros' own, what the encoders and levels have in common, what is declared.
MatrixXd joint_covariance(const SpectralTable& table, const std::array<MatrixXd, 3>& gyros,
                          const MatrixXd& shaken, const MatrixXd& declared) {
    MatrixXd out = declared * declared.transpose();
    for (Index k = 0; k < table.dwells(); ++k) {
        const SpectralDwell& dwell = table.list()[static_cast<std::size_t>(k)];
        const auto variance = mapped(dwell.row.variance);
        const double error = dwell.relative_error;
        for (Index a = 0; a < 3; ++a) {
            for (Index b = 0; b < 3; ++b) {
                if (a == b) continue;
                out(3 * k + a, 3 * k + b) +=
                    variance(a, b) + error * error * shaken(k, a) * shaken(k, b);
            }
        }
        for (Index i = 0; i < table.dwells(); ++i) {
            for (Index j = 0; j < 3; ++j)
                out(3 * k + j, 3 * i + j) += gyros[static_cast<std::size_t>(j)](k, i);
        }
    }
    return out;
}

/// One gyro's form: none, one or two resonances, as asked for and as the rates need.
void settle(const SpectralTable& table, std::size_t j, const GyroProblem& problem, Form form,
            Analysis& out) {
    Mixture& mixture = out.gyros[j];
    const bool at_one = table.kinds().size() < 2 && problem.swept.empty();
    if (form == Form::flat || form == Form::groups || at_one) {
        mixture.list = {without_resonance(table, j, problem)};
        return;
    }
    mixture = one_resonance(table, j, problem);
    if (form == Form::resonance && mixture.list.size() > 1)
        std::erase_if(mixture.list, [](const Hypothesis& one) { return one.resonances.empty(); });
    double all = 0;
    for (const Hypothesis& one : mixture.list) all += one.weight;
    for (Hypothesis& one : mixture.list) one.weight /= all;
    // What is declared is no lack of fit.
    const MatrixXd null = problem.covariance + problem.declared * problem.declared.transpose();
    const auto tail = [&](const Mixture& of) {
        const Hypothesis& best = of.list.front();
        const VectorXd left = problem.rate - design(table, j, best.resonances) * best.x;
        return uncertainty::chi_square_tail(linear_algebra::squared_distance(null, left),
                                            std::max(1, of.degrees));
    };
    out.lack_of_fit[j] = tail(mixture);
    if (out.lack_of_fit[j] >= kAlarm || table.dwells() < kFewestForTwo) return;
    const auto likeliest = std::ranges::find_if(
        mixture.list, [](const Hypothesis& one) { return !one.resonances.empty(); });
    Mixture two =
        two_resonances(table, j, problem,
                       likeliest == mixture.list.end() ? kUsualHz : likeliest->resonances[0].hz);
    // What neither model explains is no reason to leave the likelier one.
    if (!mixture.resonant() && tail(two) < kAlarm) return;
    two.log_odds = mixture.log_odds;
    mixture = std::move(two);
    out.second[j] = true;
    out.lack_of_fit[j] = tail(mixture);
}

/// From a hypothesis' coefficients to the ten static ones, or, where no resonance is the likelier,
/// to what they are under `bands`: 10 x the covariance's columns.
MatrixXd to_ten(const Hypothesis& one, bool resonant, std::span<const Band> bands) {
    MatrixXd out = MatrixXd::Identity(kBase, one.covariance.cols());
    if (resonant) return out;
    for (std::size_t r = 0; r < one.resonances.size(); ++r)
        out.block<kElastic, kElastic>(kBase - kElastic, kBase + kElastic * static_cast<Index>(r)) =
            elastic_weight(bands, one.resonances[r]) *
            Eigen::Matrix<double, kElastic, kElastic>::Identity();
    return out;
}

/// Of the groups: what is static, and the quadratic coefficients of the lowest kind of vibration.
void put_groups(const std::array<uncertainty::DriftAverage, 3>& groups,
                const MatrixXd& declared_effect, Analysis& out) {
    const auto all = static_cast<Index>(kParameters);
    out.value = VectorXd::Zero(all);
    out.covariance_a = MatrixXd::Zero(all, all);
    for (Index j = 0; j < 3; ++j) {
        const uncertainty::DriftAverage& gyro = groups[static_cast<std::size_t>(j)];
        for (Index a = 0; a < kBase; ++a) {
            out.value[3 * a + j] = gyro.value[a];
            for (Index b = 0; b < kBase; ++b)
                out.covariance_a(3 * a + j, 3 * b + j) = gyro.covariance(a, b);
        }
    }
    out.covariance = out.covariance_a + declared_effect * declared_effect.transpose();
}

/// Mean and covariance of the ten coefficients over a mixture.
void put_together(const SpectralTable& table, const MatrixXd& declared_effect, Analysis& out) {
    const std::span<const Band> lowest =
        table.kinds().empty() ? std::span<const Band>() : table.kinds().front().bands;
    const auto all = static_cast<Index>(kParameters);
    out.value = VectorXd::Zero(all);
    out.covariance_a = MatrixXd::Zero(all, all);
    for (Index j = 0; j < 3; ++j) {
        const Mixture& gyro = out.gyros[static_cast<std::size_t>(j)];
        VectorXd mean = VectorXd::Zero(kBase);
        MatrixXd square = MatrixXd::Zero(kBase, kBase);
        for (const Hypothesis& one : gyro.list) {
            const MatrixXd ten = to_ten(one, gyro.resonant(), lowest);
            const VectorXd x = ten.leftCols(one.x.size()) * one.x;
            mean += one.weight * x;
            square += one.weight * (ten * one.covariance * ten.transpose() + x * x.transpose());
        }
        square -= mean * mean.transpose();
        for (Index a = 0; a < kBase; ++a) {
            out.value[3 * a + j] = mean[a];
            for (Index b = 0; b < kBase; ++b) out.covariance_a(3 * a + j, 3 * b + j) = square(a, b);
        }
    }
    out.covariance = out.covariance_a + declared_effect * declared_effect.transpose();
}

/// Sets what each declared input does to each gyro's coefficients; a root of the 30's covariance.
MatrixXd add_effects(const std::array<MatrixXd, 3>& gains, const DeclaredRates& declared,
                     Analysis& out) {
    const Index m = declared.rates.cols();
    MatrixXd on_all = MatrixXd::Zero(static_cast<Index>(kParameters), m);
    out.model.effects = declared.effects;
    out.model.correlated = declared.correlated;
    for (std::size_t j = 0; j < 3; ++j) {
        const auto g = static_cast<Index>(j);
        const MatrixXd moved = gains[j] * of_gyro(declared.rates, g),
                       root = gains[j] * of_gyro(declared.root, g);
        for (Index i = 0; i < m; ++i) {
            out.model.effects[static_cast<std::size_t>(i)].change[j] = moved.col(i);
            for (Index a = 0; a < kBase; ++a) on_all(3 * a + g, i) = root(a, i);
        }
    }
    return on_all;
}

std::string lack_of_fit_text(const Mixture& gyro, bool second, Index dwells) {
    if (second) return "more than two resonances";
    const std::string one = gyro.resonant()
                                ? "one resonance does not fit"
                                : "flat coefficients do not fit, one resonance is no likelier";
    if (dwells >= kFewestForTwo) return one + ", and two do not fit either";
    return one + ", and there are too few dwells for two (" + std::to_string(dwells) + ", " +
           std::to_string(kFewestForTwo) + " are needed)";
}

/// Every gyro that does not fit and why; empty: all fit.
std::string lack_of_fit_text(const Analysis& of, Index dwells) {
    std::vector<std::pair<std::string, std::string>> why;  // why, and whose
    for (std::size_t j = 0; j < 3; ++j) {
        if (!(of.lack_of_fit[j] < kAlarm)) continue;
        const std::string text = lack_of_fit_text(of.gyros[j], of.second[j], dwells);
        const auto known =
            std::ranges::find(why, text, &std::pair<std::string, std::string>::first);
        if (known == why.end())
            why.emplace_back(text, std::string(1, "xyz"[j]));
        else
            known->second += std::string(", ") + "xyz"[j];
    }
    std::string out;
    for (const auto& [text, whose] : why)
        out += (out.empty() ? "gyro " : "; gyro ") + whose + ": " + text;
    return out;
}

void set_reach(const Settings& settings, const SpectralTable& table, Analysis& out) {
    Model& model = out.model;
    model.frame = settings;
    for (std::size_t j = 0; j < 3; ++j) model.mixture[j] = out.gyros[j].list;
    if (!table.kinds().empty()) {
        const auto by_hz = [](const Band& a, const Band& b) { return a.hz < b.hz; };
        const auto& first = table.kinds().front().bands;
        model.lowest_hz = std::min_element(first.begin(), first.end(), by_hz)->hz;
        const double alone = std::max_element(first.begin(), first.end(), by_hz)->hz;
        model.highest_hz = std::max(out.flat.highest_hz, kOneFrequencyReach * alone);
        if (table.kinds().size() > 1) model.highest_hz = std::max(out.flat.highest_hz, alone);
    }
    model.refusal = lack_of_fit_text(out, table.dwells());
    if (out.form == Form::groups)
        model.refusal = "coefficients in groups know nothing between their frequencies";
}

}  // namespace

const char* name_of(Form form) noexcept {
    constexpr std::array<const char*, 4> kNames{"auto", "flat", "groups", "resonance"};
    return kNames[static_cast<std::size_t>(form)];
}

bool Analysis::resonant() const { return std::ranges::any_of(gyros, &Mixture::resonant); }

Analysis analyse(const Settings& settings, const SpectralTable& table, Form form,
                 const std::vector<Sweep>& sweeps) {
    Analysis out;
    const uncertainty::DwellTable times = uncertainty::dwell_table(table.rows());
    const MatrixXd prior = prior_sigmas(settings);
    const Index n = table.dwells(), columns = table.grouped(0).cols();
    const bool twice = std::any_of(table.list().begin(), table.list().end(),
                                   [](const auto& dwell) { return dwell.relative_error > 0; });
    out.vibration_rates = MatrixXd::Zero(n, 3);
    out.groups.value.resize(columns, 3);
    out.groups.sigma.resize(columns, 3);
    std::array<GyroProblem, 3> problems;
    std::array<uncertainty::DriftAverage, 3> groups;
    std::array<MatrixXd, 3> noise, if_flat, gains;
    bool scattered = false;
    for (std::size_t j = 0; j < 3; ++j) {
        const auto g = static_cast<Index>(j);
        const VectorXd sigma = grouped_prior(prior.col(g), columns);
        // What a level's error does is known once the coefficients are.
        for (int pass = 0; pass < (twice ? 2 : 1); ++pass) {
            auto gyro = rates_of(table, times, sigma, j, out.vibration_rates);
            gyro.breaks = uncertainty::breaks_of(times, settings.drift);
            const auto& average = groups[j] = uncertainty::average_drift(gyro, settings.drift);
            out.vibration_rates.col(g) = vibration_part(table, j, average.value);
            out.groups.value.col(g) = average.value;
            out.groups.sigma.col(g) = average.covariance.diagonal().cwiseSqrt();
            scattered |= average.weights.scatter > 0.5;
            noise[j] = gyro.variance.asDiagonal();
            problems[j] = {gyro.rate, uncertainty::mean_covariance(gyro, average), prior.col(g)};
            for (const Sweep& sweep : sweeps) problems[j].swept.emplace_back(settings, sweep, j);
            if (table.kinds().size() > 1)
                if_flat[j] =
                    covariance_if_flat(gyro, average, table.base(j), prior.col(g), settings.drift);
        }
    }
    const DeclaredRates declared =
        declared_rates(settings, table, out.groups.value, out.vibration_rates);
    const auto covariance = [&](const std::array<MatrixXd, 3>& gyros) {
        return joint_covariance(table, gyros, out.vibration_rates, declared.root);
    };
    const VectorXd rates = uncertainty::all_rates(times);
    out.fit = fit_groups(table, rates, covariance(noise), prior);
    if (table.kinds().size() > 1)
        out.flat = test_flatness(table, rates, covariance(if_flat), prior, scattered);
    for (std::size_t j = 0; j < 3; ++j) {
        problems[j].declared = of_gyro(declared.root, static_cast<Index>(j));
        settle(table, j, problems[j], form, out);
    }
    out.form = form == Form::groups ? Form::groups : out.resonant() ? Form::resonance : Form::flat;
    for (std::size_t j = 0; j < 3; ++j)
        gains[j] = form == Form::groups ? MatrixXd(groups[j].gain.topRows(kBase))
                                        : gain(table, j, problems[j], out.gyros[j].list.front());
    put_noise(table, gains, declared.root, out);
    const MatrixXd effect = add_effects(gains, declared, out);
    form == Form::groups ? put_groups(groups, effect, out) : put_together(table, effect, out);
    set_reach(settings, table, out);
    if (form == Form::flat && out.flat.alarm)
        out.model.refusal = "quadratic coefficients depend on the frequency, and are taken as flat";
    return out;
}

}  // namespace vibrig::estimator::spectrum
