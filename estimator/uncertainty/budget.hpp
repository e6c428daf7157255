#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <functional>
#include <string>
#include <vector>

#include "estimator/filter/declared.hpp"
#include "estimator/uncertainty/signatures.hpp"

namespace vibrig::estimator::uncertainty {

/// One declared input that moves the rates.
struct InputSignature {
    std::string input, element;  ///< key, and which of several
    Declared declared;           ///< in the unit of the key
    /// Cosine and sine of one amplitude are drawn together.
    bool with_next = false;
    /// Gives it a size, in the unit of the key; none: it is linear.
    std::function<void(Disturbance&, double)> set = {};

    /// "encoder_zero.inner", as correlations name it.
    [[nodiscard]] std::string name() const;
};

struct InputSignatures {
    std::vector<InputSignature> list;
    Eigen::MatrixXd rates;  ///< of each per unit, 3 n x m
};
[[nodiscard]] InputSignatures input_signatures(const Inputs& inputs, const Drift& drift,
                                               const DwellTable& table, const ForwardModel& model);

/// What the accelerometers' skew leaves unknown of the vibration's second moment, (pi f tau)^2
/// relative (DwellRow::relative_error of a sine), in all dwells alike: one input more, none without
/// a skew. Per unit the second moment is larger by 1.
void add_skew(const DwellTable& table, const ForwardModel& model, InputSignatures& to);

/// Covariance of the inputs; throws SettingsError when correlations name no input, or two that
/// cannot be correlated so.
[[nodiscard]] Eigen::MatrixXd input_covariance(const Inputs& inputs,
                                               const std::vector<InputSignature>& list);

/// Two inputs of a list, by their places.
struct Correlated {
    std::size_t first = 0, second = 0;
    double value = 0;  ///< their correlation
};
/// Those that a covariance holds.
[[nodiscard]] std::vector<Correlated> correlated(const Eigen::MatrixXd& covariance);

}  // namespace vibrig::estimator::uncertainty
