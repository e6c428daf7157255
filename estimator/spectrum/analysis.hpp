#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "estimator/spectrum/flatness.hpp"
#include "estimator/spectrum/prediction.hpp"
#include "estimator/spectrum/resonance.hpp"
#include "estimator/spectrum/table.hpp"

namespace vibrig::estimator::spectrum {

/// What the quadratic coefficients are taken to be over frequency.
enum class Form { automatic, flat, groups, resonance };
[[nodiscard]] const char* name_of(Form form) noexcept;

/// All that a campaign says of its coefficients over frequency.
struct Analysis {
    Form form = Form::flat;  ///< what is in force
    Flatness flat;
    GroupedFit fit;  ///< by noise and declared inputs alone, as if no bias had moved
    Groups groups;
    std::array<Mixture, 3> gyros;
    std::array<double, 3> lack_of_fit{1, 1, 1};  ///< p
    std::array<bool, 3> second{};                ///< a second resonance was added
    Model model;
    Eigen::MatrixXd vibration_rates;  ///< of the dwells, due to their vibration, n x 3, deg/h
    /// Of all 30 together, filter order: noise and drift states, and with the declared inputs.
    /// Means over a gyro's whole mixture: of the static coefficients where a resonance is the
    /// likelier, else of those under the lowest kind of vibration; in groups those of the lowest.
    Eigen::VectorXd value;
    Eigen::MatrixXd covariance_a, covariance;
    /// What of covariance_a the dwells' noise alone leaves in the likeliest hypothesis, as standard
    /// deviations; filter order.
    Eigen::VectorXd noise;
    Eigen::MatrixXd rate_sigma;  ///< of the rates, noise and declared inputs, n x 3, deg/h

    /// For some gyro a resonance is likelier than none.
    [[nodiscard]] bool resonant() const;
};

/// A pure function of its arguments; some tenths of a second, some seconds with sweeps, which tell
/// of a resonance and are no dwells of the table. Needs two dwells or more.
[[nodiscard]] Analysis analyse(const Settings& settings, const SpectralTable& table, Form form,
                               const std::vector<Sweep>& sweeps = {});

}  // namespace vibrig::estimator::spectrum
