#include "estimator/identification/two_step.hpp"

namespace vibrig::estimator {

ParameterArray two_step_prior(const ParameterArray& prior) noexcept {
    ParameterArray fixed = prior;
    for (std::size_t gyro = 0; gyro < kGyros; ++gyro) fixed[internal_index(kDoo, gyro)] = 0.0;
    return fixed;
}

std::string two_step_obstacle(const std::map<int, KappaSpread>& runs) {
    const std::string needs =
        "the two-step route needs exactly two runs of different vibration level, found ";
    if (runs.size() > 2) return needs + "more than two";
    std::size_t good = 0;
    for (const auto& [run, levels] : runs) good += levels.dwells > 0 ? 1 : 0;
    if (good != 2) return needs + std::to_string(good) + " with good dwells";
    const double first = runs.begin()->second.mean, second = runs.rbegin()->second.mean;
    KappaSpread both;
    both.add(first);
    both.add(second);
    if (!both.one_level()) return {};
    return needs + "kappa " + std::to_string(first) + " and " + std::to_string(second);
}

bool recover(const RunSolution& first, const RunSolution& second, RunSolution& out) noexcept {
    const RunSolution& one = first.kappa >= second.kappa ? first : second;
    const RunSolution& two = first.kappa >= second.kappa ? second : first;
    const double difference = one.kappa - two.kappa;
    if (!(difference > 1e-9 * one.kappa)) return false;

    // Linear in (30 parameters of run 1, 3 constants of run 2): with q = (Dt1 - Dt2) / (kappa1 -
    // kappa2), Dt = (kappa1 Dt2 - kappa2 Dt1) / (kappa1 - kappa2); q is added to Dii, Dss and Doo.
    Covariance from_one = Covariance::Identity();
    Eigen::Matrix<double, kParameters, kGyros> from_two =
        Eigen::Matrix<double, kParameters, kGyros>::Zero();
    Eigen::Matrix3d constants = Eigen::Matrix3d::Zero();
    Eigen::Vector3d value_two;
    for (std::size_t gyro = 0; gyro < kGyros; ++gyro) {
        const auto j = static_cast<Eigen::Index>(gyro);
        const auto t = static_cast<Eigen::Index>(internal_index(kDt, gyro));
        from_one(t, t) = -two.kappa / difference;
        from_two(t, j) = one.kappa / difference;
        for (const std::size_t square : {kDii, kDss, kDoo}) {
            const auto s = static_cast<Eigen::Index>(internal_index(square, gyro));
            from_one(s, t) = 1.0 / difference;
            from_two(s, j) = -1.0 / difference;
        }
        value_two[j] = two.value[internal_index(kDt, gyro)];
        for (std::size_t other = 0; other < kGyros; ++other) {
            constants(j, static_cast<Eigen::Index>(other)) =
                two.covariance(t, static_cast<Eigen::Index>(internal_index(kDt, other)));
        }
    }
    using ValueVector = Eigen::Matrix<double, kParameters, 1>;
    const Eigen::Map<const ValueVector> value_one(one.value.data());
    const ValueVector value = from_one * value_one + from_two * value_two;
    const Covariance covariance = from_one * one.covariance * from_one.transpose() +
                                  from_two * constants * from_two.transpose();
    for (std::size_t i = 0; i < kParameters; ++i)
        out.value[i] = value[static_cast<Eigen::Index>(i)];
    out.covariance = covariance;
    out.kappa = one.kappa;
    return true;
}

}  // namespace vibrig::estimator
