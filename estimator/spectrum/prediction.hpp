#pragma once

#include <Eigen/Core>
#include <array>
#include <functional>
#include <string>
#include <vector>

#include "estimator/spectrum/exposure.hpp"
#include "estimator/spectrum/resonance.hpp"
#include "estimator/uncertainty/budget.hpp"

namespace vibrig::estimator::spectrum {

/// What one standard uncertainty of a declared input does to the coefficients of the heaviest
/// hypothesis, gyro by gyro.
struct Effect {
    std::string input, element;
    std::array<Eigen::VectorXd, 3> change;
    uncertainty::Declared declared = {};
};

/// What one unit of each of a hypothesis' unknowns does to m quantities that are linear in its
/// coefficients: `columns` gives m x (10 + 6 r) for r resonances. Of a linearised hypothesis with
/// ln hz and ln damping of each, as its covariance has them.
[[nodiscard]] Eigen::MatrixXd gradient(
    const Hypothesis& of,
    const std::function<Eigen::MatrixXd(const std::vector<Resonance>&)>& columns);

/// A quadratic coefficient at a frequency over a mixture, deg/h/g^2: mean, and standard deviation
/// within and between the hypotheses; declared inputs are not in it. `term`: II, SS, OO, IS, IO,
/// OS.
struct AtFrequency {
    double value = 0, sigma = 0;
};
[[nodiscard]] AtFrequency at_frequency(const std::vector<Hypothesis>& mixture, Eigen::Index term,
                                       double hz);

/// All that a prediction needs of a campaign.
struct Model {
    Settings frame;  ///< of it platform.up, the gyros' axes and site.elevation_deg count
    std::array<std::vector<Hypothesis>, 3> mixture;
    std::vector<Effect> effects;
    std::vector<uncertainty::Correlated> correlated;  ///< of the effects
    double lowest_hz = 0;                             ///< of the campaign's vibrations
    double highest_hz = 0;  ///< up to which an elastic part would have been seen
    std::string refusal;    ///< why it predicts nothing; empty: it does
};

struct PredictionOptions {
    double elastic_beyond = 1;         ///< of the static coefficients, beyond what was measured
    bool same_accelerometers = false;  ///< the profile was measured with those of the campaign
};

/// Drift of three gyros in m situations, deg/h. Parts: standard uncertainties, m x 3.
struct Prediction {
    Eigen::MatrixXd drift;       ///< m x 3
    Eigen::MatrixXd covariance;  ///< 3 m x 3 m, element 3 k + j
    Eigen::MatrixXd coefficients, resonance, gain, realisation, outside;
    Eigen::MatrixXd vibration;  ///< of the drift, what is due to the vibration, m x 3
    double power_outside = 0;   ///< largest share of a vibration's power that was not covered

    [[nodiscard]] double u(Eigen::Index situation, Eigen::Index gyro) const;
    [[nodiscard]] bool covered() const { return power_outside <= 0.2; }
};
[[nodiscard]] Prediction predict(const Model& model, const std::vector<Situation>& situations,
                                 const PredictionOptions& options = {});

/// Drift measured in those situations against the prediction.
struct Verification {
    double chi_square = 0, p = 0;
    int degrees = 0;
    bool confirmed = false, tight = true;
    double least_p = 1;                ///< of one dwell
    double largest_z = 0;              ///< with its sign
    Eigen::Index dwell = 0, gyro = 0;  ///< where
    std::string part;                  ///< of the budget, that is largest there
    double larger = 1;  ///< so many times, and it would be within two standard deviations
    Eigen::MatrixXd z;  ///< m x 3
};
/// `measured`: m x 3, deg/h; `variances`: of the measurement, 3 x 3 each; `relative_errors`: of the
/// realised mean squares. `tolerance`: 2 standard deviations that a tight test stays below; 0: any.
[[nodiscard]] Verification verify(const Prediction& prediction, const Eigen::MatrixXd& measured,
                                  const std::vector<Eigen::Matrix3d>& variances,
                                  const std::vector<double>& relative_errors, double tolerance = 0);

}  // namespace vibrig::estimator::spectrum
