#include "estimator/spectrum/declared_rates.hpp"

#include "estimator/filter/linear_algebra.hpp"
#include "estimator/filter/parameters.hpp"
#include "estimator/filter/text.hpp"
#include "estimator/uncertainty/budget.hpp"
#include "estimator/uncertainty/signatures.hpp"

namespace vibrig::estimator::spectrum {

DeclaredRates declared_rates(const Settings& settings, const SpectralTable& table,
                             const Eigen::MatrixXd& groups, const Eigen::MatrixXd& shaken) {
    const uncertainty::DwellTable times = uncertainty::dwell_table(table.rows());
    ParameterArray coefficients{};
    for (std::size_t g = 0; g < kGroups; ++g) {
        for (std::size_t j = 0; j < kGyros; ++j)
            coefficients[internal_index(g, j)] =
                groups(static_cast<Eigen::Index>(g), static_cast<Eigen::Index>(j));
    }
    uncertainty::InputSignatures inputs =
        uncertainty::input_signatures(settings.uncertainty, settings.drift, times,
                                      uncertainty::ForwardModel(settings, coefficients));
    Eigen::VectorXd of_vibration(3 * table.dwells());
    for (Eigen::Index k = 0; k < table.dwells(); ++k)
        of_vibration.segment<3>(3 * k) = shaken.row(k).transpose();
    // What a gain does depends on the coefficients at the frequency of each dwell.
    for (std::size_t i = 0; i < inputs.list.size(); ++i) {
        if (inputs.list[i].input == "accelerometer_gain")
            inputs.rates.col(static_cast<Eigen::Index>(i)) = -2 * of_vibration;
    }
    const Eigen::MatrixXd u = uncertainty::input_covariance(settings.uncertainty, inputs.list);
    DeclaredRates out;
    out.rates = inputs.rates * u.diagonal().cwiseSqrt().asDiagonal();
    out.correlated = uncertainty::correlated(u);
    out.root = inputs.rates * linear_algebra::padded_root(u);
    for (const auto& input : inputs.list)
        out.effects.push_back({input.input, input.element, {}, input.declared});
    const uncertainty::Declared& scatter = settings.uncertainty.gain_between_frequencies;
    const double between = scatter.u;
    if (table.kinds().size() < 2 || !(between > 0)) return out;
    for (std::size_t kind = 0; kind < table.kinds().size(); ++kind) {
        Eigen::VectorXd z = Eigen::VectorXd::Zero(of_vibration.size());
        for (Eigen::Index k = 0; k < table.dwells(); ++k) {
            if (table.list()[static_cast<std::size_t>(k)].kind == kind)
                z.segment<3>(3 * k) = 2 * between * of_vibration.segment<3>(3 * k);
        }
        for (Eigen::MatrixXd* columns : {&out.rates, &out.root}) {
            columns->conservativeResize(Eigen::NoChange, columns->cols() + 1);
            columns->rightCols<1>() = z;
        }
        const Kind& of = table.kinds()[kind];
        out.effects.push_back({"gain_between_frequencies",
                               of.profile.empty() ? text("%g Hz", of.hz()) : of.profile,
                               {},
                               scatter});
    }
    return out;
}

}  // namespace vibrig::estimator::spectrum
