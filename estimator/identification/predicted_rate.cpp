#include "estimator/identification/predicted_rate.hpp"

#include "estimator/filter/drift_model.hpp"
#include "estimator/filter/second_moment.hpp"

namespace vibrig::estimator {

PredictedRate predicted_rate(const Settings& settings,
                             const std::array<double, kParameters>& coefficients,
                             const std::vector<double>& covariance,
                             const std::array<double, 3>& encoder_rad,
                             const VibrationMoment& vibration) {
    const Kinematics kinematics(settings);
    const DriftModel model(settings);
    ParameterArray parameters{};
    for (std::size_t i = 0; i < kParameters; ++i) parameters[internal_of(i)] = coefficients[i];
    const Pose pose = kinematics.pose(kinematics.gimbal_angles(encoder_rad));
    const Regressors h = model.regressors(pose.up, second_moment(pose, vibration));
    const Eigen::Vector3d rate = model.platform_rate(pose, h, parameters.data());
    // Gyro j holds platform axis j, with its own ten coefficients: parameter 10 j + k.
    std::array<std::array<double, kGroups>, kGyros> row{};
    for (std::size_t i = 0; i < kParameters; ++i) {
        const std::size_t flat = internal_of(i);
        row[i / kGroups][i % kGroups] = h[flat / kGyros][flat % kGyros];
    }
    PredictedRate predicted;
    for (std::size_t a = 0; a < kGyros; ++a) {
        predicted.rate_deg_h[a] = rate[static_cast<Eigen::Index>(a)];
        for (std::size_t b = 0; b < kGyros; ++b) {
            for (std::size_t i = 0; i < kGroups; ++i) {
                for (std::size_t k = 0; k < kGroups; ++k) {
                    predicted.covariance[a][b] +=
                        row[a][i] * row[b][k] *
                        covariance[(kGroups * a + i) * kParameters + kGroups * b + k];
                }
            }
        }
    }
    return predicted;
}

}  // namespace vibrig::estimator
