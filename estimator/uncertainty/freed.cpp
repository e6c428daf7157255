#include "estimator/uncertainty/freed.hpp"

#include <cmath>

#include "estimator/filter/linear_algebra.hpp"
#include "estimator/filter/mapped.hpp"
#include "estimator/uncertainty/fit.hpp"

namespace vibrig::estimator::uncertainty {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kPriorSizes = 16;

void append_columns(MatrixXd& to, const MatrixXd& columns) {
    to.conservativeResize(columns.rows(), to.cols() + columns.cols());
    to.rightCols(columns.cols()) = columns;
}

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

Freed determine_freed(const Settings& settings, const DwellTable& table, const ForwardModel& model,
                      const VectorXd& prior_information) {
    Freed out;
    out.z.resize(3 * table.dwells(), 0);
    out.prior = out.z;
    if (settings.free.empty()) return out;
    std::vector<double> sizes;
    for (const Misfit misfit : settings.free) {
        const Signatures of = signatures(misfit, table, model, 1);
        append_columns(out.z, of.z);
        for (const std::string& element : of.elements) {
            out.list.push_back(
                {kStructuralNames[static_cast<std::size_t>(misfit)], element, 0, 0, of.unit});
            sizes.push_back(of.size);
        }
    }
    out.prior = kPriorSizes * out.z;
    const NullFit fit(table, MatrixXd(3 * table.dwells(), 0), prior_information);
    MatrixXd information = fit.project(out.z).f;
    information.diagonal().array() += 1 / (kPriorSizes * kPriorSizes);
    const Index unknowns = out.z.cols();
    out.covariance = linear_algebra::positive_inverse(information);
    out.gain = out.covariance * fit.weights(out.z).transpose();
    out.determined = static_cast<int>(std::lround(
        static_cast<double>(unknowns) - out.covariance.trace() / (kPriorSizes * kPriorSizes)));
    const VectorXd found = out.gain * all_rates(table);
    for (std::size_t i = 0; i < out.list.size(); ++i) {
        const auto k = static_cast<Index>(i);
        out.list[i].value = sizes[i] * found[k];
        out.list[i].sigma = sizes[i] * std::sqrt(out.covariance(k, k));
    }
    const VectorXd rates = out.z * found;
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
