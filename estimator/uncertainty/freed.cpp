#include "estimator/uncertainty/freed.hpp"

#include <cmath>
#include <utility>

#include "estimator/filter/linear_algebra.hpp"
#include "estimator/filter/mapped.hpp"
#include "estimator/uncertainty/fit.hpp"

namespace vibrig::estimator::uncertainty {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kPriorSizes = 16;
constexpr int kMostSteps = 20;
constexpr double kSettled = 1e-3;  ///< of a sigma

/// All unknowns of what is freed, with their effect about given coefficients.
class Unknowns {
  public:
    MatrixXd z;  ///< 3 n x m, of the size of each
    std::vector<FreedUnknown> list;
    std::vector<double> sizes;

    Unknowns(const Settings& settings, const DwellTable& table, ForwardModel model)
        : z(3 * table.dwells(), 0), table_(table), model_(std::move(model)) {
        for (const Misfit misfit : settings.free) {
            Signatures of = signatures(misfit, table, model_, 1);
            z.conservativeResize(z.rows(), z.cols() + of.z.cols());
            z.rightCols(of.z.cols()) = of.z;
            for (std::size_t i = 0; i < of.elements.size(); ++i) {
                list.push_back({kStructuralNames[static_cast<std::size_t>(misfit)], of.elements[i],
                                0, 0, of.unit});
                sizes.push_back(of.size);
                sets_.push_back(std::move(of.sets[i]));
            }
        }
    }

    /// What the rates show of them, `unknowns` in sizes: all at once, as large as they are.
    [[nodiscard]] VectorXd rates(const VectorXd& unknowns) const {
        VectorXd out = VectorXd::Zero(z.rows());
        Disturbance together;
        for (Index k = 0; k < unknowns.size(); ++k) {
            if (const auto& set = sets_[static_cast<std::size_t>(k)])
                set(together, unknowns[k]);
            else
                out += unknowns[k] * z.col(k);
        }
        for (Index k = 0; k < table_.dwells(); ++k)
            out.segment<3>(3 * k) +=
                model_.apparent(table_.rows[static_cast<std::size_t>(k)], together);
        return out;
    }

  private:
    const DwellTable& table_;
    ForwardModel model_;
    std::vector<std::function<void(Disturbance&, double)>> sets_;
};

template <std::size_t N>
void forget(std::array<Declared, N>& inputs) {
    for (Declared& one : inputs) one.u = 0;
}

void forget_harmonic(Inputs& inputs, int order) {
    std::erase_if(inputs.resolver_harmonics,
                  [order](const Harmonic& one) { return one.order == order; });
}

}  // namespace

void Freed::put_into(MatrixXd& of_coefficients, MatrixXd& their_covariance) const {
    if (list.empty()) return;
    const MatrixXd effect = of_coefficients * z;
    their_covariance += effect * covariance * effect.transpose();
    of_coefficients -= effect * gain;
}

Freed determine_freed(const Settings& settings, const DwellTable& table,
                      const ParameterArray& coefficients, const VectorXd& prior_information) {
    Freed out;
    out.z.resize(3 * table.dwells(), 0);
    out.prior = out.z;
    if (settings.free.empty()) return out;
    const NullFit fit(table, MatrixXd(3 * table.dwells(), 0), prior_information);
    const VectorXd measured = all_rates(table);
    ParameterArray beside = coefficients;
    std::vector<double> sizes;
    VectorXd found, sigma, rates = VectorXd::Zero(measured.size());
    // They multiply the coefficients and one another: once more about what was found, until
    // nothing moves.
    for (int step = 0; step < kMostSteps && !out.settled; ++step) {
        const Unknowns of(settings, table, ForwardModel(settings, beside));
        out.z = of.z;
        MatrixXd information = fit.project(of.z).f;
        information.diagonal().array() += 1 / (kPriorSizes * kPriorSizes);
        out.covariance = linear_algebra::positive_inverse(information);
        out.gain = out.covariance * fit.weights(of.z).transpose();
        if (step == 0) found = VectorXd::Zero(of.z.cols());
        const VectorXd next = out.gain * (measured - rates + of.z * found);
        sigma = out.covariance.diagonal().cwiseSqrt();
        out.settled = ((next - found).array().abs() < kSettled * sigma.array()).all();
        found = next;
        rates = of.rates(found);
        mapped(beside) = mapped(coefficients) - fit.change(rates);
        out.list = of.list;
        sizes = of.sizes;
    }
    out.prior = kPriorSizes * out.z;
    out.determined = static_cast<int>(std::lround(
        static_cast<double>(found.size()) - out.covariance.trace() / (kPriorSizes * kPriorSizes)));
    for (Index k = 0; k < found.size(); ++k) {
        FreedUnknown& one = out.list[static_cast<std::size_t>(k)];
        const double size = sizes[static_cast<std::size_t>(k)];
        one.value = size * found[k];
        one.sigma = size * sigma[k];
    }
    out.rows.assign(table.rows.begin(), table.rows.end());
    for (std::size_t k = 0; k < out.rows.size(); ++k)
        mapped(out.rows[k].rate) -= rates.segment<3>(3 * static_cast<Index>(k));
    return out;
}

Inputs without(Inputs inputs, const std::vector<Misfit>& freed) {
    for (const Misfit misfit : freed) {
        switch (misfit) {
            case Misfit::cross_axis:
                forget(inputs.cross_axis);
                break;
            case Misfit::azimuth:
                inputs.azimuth_arcsec.u = 0;
                break;
            case Misfit::latitude:
                inputs.latitude_arcsec.u = 0;
                break;
            case Misfit::time_base:
                inputs.time_base.u = 0;
                break;
            case Misfit::encoder_zero:
                forget(inputs.encoder_zero_arcsec);
                break;
            case Misfit::non_orthogonality:
                forget(inputs.non_orthogonality_arcsec);
                break;
            case Misfit::resolver_1:
                forget_harmonic(inputs, 1);
                break;
            case Misfit::resolver_2:
                forget_harmonic(inputs, 2);
                break;
            case Misfit::resolver_16:
                forget_harmonic(inputs, 16);
                break;
            default:
                break;  // nothing is declared of it
        }
    }
    return inputs;
}

}  // namespace vibrig::estimator::uncertainty
