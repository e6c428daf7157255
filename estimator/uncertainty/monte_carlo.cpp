#include "estimator/uncertainty/monte_carlo.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <random>
#include <vector>

#include "estimator/filter/linear_algebra.hpp"
#include "estimator/filter/parameters.hpp"
#include "estimator/uncertainty/coverage.hpp"

namespace vibrig::estimator::uncertainty {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kFewestBlocks = 2, kForLinearity = 200;
/// JCGM 101, 8.2: what is to tell whether an end is within the tolerance is known to a fifth of it.
constexpr double kFiner = 5;
constexpr auto kTogether = static_cast<Index>(kParameters);

/// A draw of unit standard uncertainty.
double unit_draw(const Declared& of, std::mt19937_64& random) {
    std::uniform_real_distribution<double> uniform;
    switch (of.shape) {
        case Shape::rectangular:
            return std::sqrt(3.0) * (2 * uniform(random) - 1);
        case Shape::triangular:
            return std::sqrt(6.0) * (uniform(random) + uniform(random) - 1);
        case Shape::arcsine:
            return std::sqrt(2.0) * std::cos(2 * kPi * uniform(random));
        case Shape::normal:
            break;
    }
    // JCGM 101, 6.4.9: a finite sample gives a scaled and shifted t-distribution.
    if (std::isfinite(of.dof)) return std::student_t_distribution<double>(of.dof)(random);
    return std::normal_distribution<double>()(random);
}

/// Draws the inputs, in the units of their keys.
class InputDraws {
  public:
    InputDraws(const Settings& settings, const Assessment& assessed)
        : list_(assessed.inputs),
          covariance_(input_covariance(settings.uncertainty, list_)),
          root_(linear_algebra::semidefinite_root(covariance_)) {
        MatrixXd off = covariance_;
        off.diagonal().setZero();
        correlated_ = off.cwiseAbs().rowwise().sum();
    }

    void draw(std::mt19937_64& random, VectorXd& out) {
        std::normal_distribution<double> normal;
        VectorXd xi(out.size());
        for (double& one : xi) one = normal(random);
        out = root_ * xi;
        for (Index i = 0; i < out.size(); ++i) {
            if (correlated_[i] > 0) continue;
            const InputSignature& input = list_[static_cast<std::size_t>(i)];
            const double u = input.declared.u;
            if (input.with_next && !(correlated_[i + 1] > 0)) {
                const double phase = 2 * kPi * uniform_(random), a = std::sqrt(2.0) * u;
                out[i] = a * std::cos(phase);
                out[i + 1] = a * std::sin(phase);
                ++i;
                continue;
            }
            out[i] = u * unit_draw(input.declared, random);
        }
    }

  private:
    const std::vector<InputSignature>& list_;
    MatrixXd covariance_, root_;
    VectorXd correlated_;
    std::uniform_real_distribution<double> uniform_;
};

struct DrawModel {
    MatrixXd sensitivity;  ///< 30 x m
    Declared gravity;
    VectorXd local_g;  ///< what its standard uncertainty does
    MatrixXd type_a;   ///< root of the covariance
    VectorXd value;
    double sync = 0;  ///< half width on the quadratic coefficients
};

DrawModel model_of(const Settings& settings, const Assessment& assessed) {
    DrawModel m;
    m.sensitivity = assessed.sensitivity;
    m.type_a = linear_algebra::semidefinite_root(assessed.covariance_type_a);
    m.value = VectorXd::Zero(kTogether);
    for (Index g = 0; g < static_cast<Index>(kGroups); ++g) {
        for (Index j = 0; j < 3; ++j)
            m.value[3 * g + j] = assessed.drift[static_cast<std::size_t>(j)].value[g];
    }
    m.gravity = settings.uncertainty.local_g;
    m.local_g = settings.uncertainty.local_g.u * per_gravity(m.value);
    if (settings.uncertainty.sync_motion == SyncMotionOf::platform) m.sync = assessed.sync_bound;
    return m;
}

/// Mean, standard deviation and the ends of the symmetric interval, 30 each.
using Block = Eigen::Matrix<double, Eigen::Dynamic, 4>;

MatrixXd draws_of(const DrawModel& model, InputDraws& inputs, int count, std::mt19937_64& random) {
    std::normal_distribution<double> normal;
    std::uniform_real_distribution<double> uniform(-1, 1);
    MatrixXd x(count, kTogether);
    VectorXd xi(kTogether), p(model.sensitivity.cols());
    for (Index i = 0; i < count; ++i) {
        for (double& one : xi) one = normal(random);
        inputs.draw(random, p);
        VectorXd here = model.type_a * xi + model.sensitivity * p +
                        unit_draw(model.gravity, random) * model.local_g;
        if (model.sync > 0) {
            for (Index k = 12; k < kTogether; ++k) here[k] += model.sync * uniform(random);
        }
        x.row(i) = here.transpose();
    }
    return x;
}

Block one_block(const DrawModel& model, InputDraws& inputs, int count, double coverage,
                std::mt19937_64& random) {
    MatrixXd x = draws_of(model, inputs, count, random);
    Block out(kTogether, 4);
    const auto place = static_cast<std::ptrdiff_t>(0.5 * (1 - coverage) * count);
    for (Index k = 0; k < kTogether; ++k) {
        auto column = x.col(k);
        const double mean = column.mean();
        const double square = (column.array() - mean).square().sum() / (count - 1);
        double* begin = column.data();
        double* end = begin + count;
        std::nth_element(begin, begin + place, end);
        const double low = begin[place];
        std::nth_element(begin, end - 1 - place, end);
        out.row(k) << mean, std::sqrt(square), low, *(end - 1 - place);
    }
    return out;
}

/// Of sorted values.
DrawnBlock::Coefficient intervals_of(const double* sorted, int count, double coverage) {
    DrawnBlock::Coefficient out;
    const auto place = static_cast<std::ptrdiff_t>(0.5 * (1 - coverage) * count);
    out.low = sorted[place];
    out.high = sorted[count - 1 - place];
    const auto within = static_cast<std::ptrdiff_t>(std::lround(coverage * count));
    double shortest = std::numeric_limits<double>::infinity();
    for (std::ptrdiff_t i = 0; i + within < count; ++i) {
        if (sorted[i + within] - sorted[i] >= shortest) continue;
        shortest = sorted[i + within] - sorted[i];
        out.shortest_low = sorted[i];
        out.shortest_high = sorted[i + within];
    }
    return out;
}

/// Relative rms of what the inputs do together over what the linear model says.
double nonlinearity(const Settings& settings, const Result& result, const Assessment& assessed,
                    const DrawModel& model, InputDraws& inputs, std::mt19937_64& random) {
    const DwellTable table = dwell_table(result.rows);
    ParameterArray coefficients{};
    for (std::size_t i = 0; i < kParameters; ++i)
        coefficients[i] = model.value[static_cast<Index>(i)];
    const ForwardModel forward(settings, coefficients);
    const auto apparent = [&](const Disturbance& d) {
        VectorXd z(3 * table.dwells());
        for (Index k = 0; k < table.dwells(); ++k)
            z.segment<3>(3 * k) = forward.apparent(table.rows[static_cast<std::size_t>(k)], d);
        return z;
    };
    const VectorXd none = apparent({});
    VectorXd p(model.sensitivity.cols());
    double off = 0, all = 0;
    for (int draw = 0; draw < kForLinearity; ++draw) {
        inputs.draw(random, p);
        Disturbance together;
        VectorXd linear = VectorXd::Zero(kTogether);
        for (std::size_t i = 0; i < assessed.inputs.size(); ++i) {
            const auto k = static_cast<Index>(i);
            if (!assessed.inputs[i].set) continue;
            assessed.inputs[i].set(together, p[k]);
            linear += model.sensitivity.col(k) * p[k];
        }
        const VectorXd full = assessed.gain * (apparent(together) - none);
        for (Index k = 0; k < kTogether; ++k) {
            const double scale = assessed.covariance_type_a(k, k);
            off += (full[k] - linear[k]) * (full[k] - linear[k]) / scale;
            all += linear[k] * linear[k] / scale;
        }
    }
    return all > 0 ? std::sqrt(off / all) : 0;
}

/// The standard error of the blocks' mean, twice, within a fifth of the tolerance everywhere.
bool settled(const std::vector<Block>& blocks, const Block& sum, const VectorXd& delta) {
    const auto h = static_cast<double>(blocks.size());
    if (blocks.size() < kFewestBlocks) return false;
    const Block mean = sum / h;
    Block square = Block::Zero(kTogether, 4);
    for (const Block& block : blocks) square += (block - mean).cwiseAbs2();
    const Block error = (square / (h * (h - 1))).cwiseSqrt();
    for (Index k = 0; k < kTogether; ++k) {
        if (delta[k] > 0 && 2 * error.row(k).maxCoeff() > delta[k] / kFiner) return false;
    }
    return true;
}

/// With all that it draws from.
class BlockDrawer {
  public:
    BlockDrawer(const Settings& settings, const Assessment& of)
        : assessed_(of),
          coverage_(settings.uncertainty.coverage),
          inputs_(settings, assessed_),
          model_(model_of(settings, assessed_)) {}

    DrawnBlock draw(std::uint64_t seed, int count) {
        std::mt19937_64 random(seed);
        MatrixXd x = draws_of(model_, inputs_, count, random);
        DrawnBlock out;
        for (std::size_t i = 0; i < kParameters; ++i) {
            if (!(assessed_.coefficients[i].u > 0)) continue;
            auto column = x.col(static_cast<Index>(internal_of(i)));
            const double mean = column.mean();
            const double square = (column.array() - mean).square().sum() / (count - 1);
            std::sort(column.data(), column.data() + count);
            out.coefficients[i] = intervals_of(column.data(), count, coverage_);
            out.coefficients[i].mean = mean;
            out.coefficients[i].u = std::sqrt(square);
        }
        return out;
    }

  private:
    Assessment assessed_;
    double coverage_;
    InputDraws inputs_;
    DrawModel model_;
};

}  // namespace

double numerical_tolerance(double u, int digits) {
    return 0.5 * std::pow(10.0, std::floor(std::log10(u)) + 1 - digits);
}

BlockDrawing block_drawing(const Settings& settings, const Assessment& assessed) {
    if (!assessed.done)
        throw SettingsError(
            "found nothing to draw from, expected two dwells at least and estimator.method = "
            "\"joint\"");
    const auto drawer = std::make_shared<BlockDrawer>(settings, assessed);
    return [drawer](std::uint64_t seed, int count) { return drawer->draw(seed, count); };
}

MonteCarlo propagate_distributions(const Settings& settings, const Result& result,
                                   const Assessment& assessed, const MonteCarloSettings& how,
                                   const std::function<void(int)>& progress) {
    if (!assessed.done)
        throw SettingsError(
            "--monte-carlo: found nothing to draw from, expected two dwells at "
            "least and estimator.method = \"joint\"");
    std::mt19937_64 random(how.seed);
    InputDraws inputs(settings, assessed);
    const DrawModel model = model_of(settings, assessed);
    VectorXd delta = VectorXd::Zero(kTogether);
    for (std::size_t i = 0; i < kParameters; ++i) {
        const double u = assessed.coefficients[i].u;
        if (u > 0) delta[static_cast<Index>(internal_of(i))] = numerical_tolerance(u, how.digits);
    }
    MonteCarlo out;
    out.digits = how.digits;
    std::vector<Block> blocks;
    Block sum = Block::Zero(kTogether, 4);
    while (!out.stable && out.blocks < how.most_blocks) {
        blocks.push_back(
            one_block(model, inputs, how.block, settings.uncertainty.coverage, random));
        sum += blocks.back();
        out.blocks = static_cast<int>(blocks.size());
        out.stable = settled(blocks, sum, delta);
        if (progress) progress(out.blocks);
    }
    const Block mean = sum / out.blocks;
    out.gum_confirmed = true;
    for (std::size_t i = 0; i < kParameters; ++i) {
        const Coefficient& of = assessed.coefficients[i];
        if (!(of.u > 0)) continue;
        const auto k = static_cast<Index>(internal_of(i));
        MonteCarlo::Coefficient& found = out.coefficients[i];
        found.u = mean(k, 1);
        found.low = of.value + mean(k, 2);
        found.high = of.value + mean(k, 3);
        const double off =
            std::max(std::abs(-of.expanded - mean(k, 2)), std::abs(of.expanded - mean(k, 3))) /
            delta[k];
        found.confirmed = off <= 1;
        out.largest_difference = std::max(out.largest_difference, off);
        out.gum_confirmed = out.gum_confirmed && found.confirmed;
    }
    out.nonlinearity = nonlinearity(settings, result, assessed, model, inputs, random);
    return out;
}

}  // namespace vibrig::estimator::uncertainty
