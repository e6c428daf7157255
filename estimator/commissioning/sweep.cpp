// One gimbal alone turned against gravity: each accelerometer sees a cosine of the angle, all of
// them together a circle, which only the right unit makes round.
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "estimator/commissioning/gravity.hpp"
#include "estimator/filter/angles.hpp"
#include "estimator/filter/kinematics.hpp"
#include "estimator/filter/linear_algebra.hpp"

namespace vibrig::estimator::commissioning {

namespace {

constexpr double kSigma_g = 3e-3, kRoundness = 0.03;

double score_of(const std::vector<Stop>& sweep, std::size_t channel, double degrees) {
    Eigen::Matrix3d normal = Eigen::Matrix3d::Identity() * 1e-12;
    Eigen::Matrix3d right = Eigen::Matrix3d::Zero();  // columns: accelerometers
    double all = 0;
    for (const Stop& stop : sweep) {
        const double angle =
            degrees * kRadPerDeg * (stop.reading[channel] - sweep.front().reading[channel]);
        const Eigen::Vector3d row(1, std::cos(angle), std::sin(angle));
        const Eigen::Vector3d force(stop.force[0], stop.force[1], stop.force[2]);
        normal += row * row.transpose();
        right += row * force.transpose();
        all += force.squaredNorm();
    }
    const Eigen::Matrix3d c =
        linear_algebra::PivotedCholesky(normal).solve(right);  // rows: constant, cosine, sine
    const double rest = std::max(0.0, all - (right.cwiseProduct(c)).sum());
    const Eigen::Vector3d c1 = c.row(1), c2 = c.row(2);
    const double rho2 = std::max(c1.norm() * c2.norm(), 1e-12);
    const double round = (c1.norm() - c2.norm()) / (kRoundness * std::sqrt(rho2));
    const double square = c1.dot(c2) / (kRoundness * rho2);
    return rest / (kSigma_g * kSigma_g) + round * round + square * square;
}

}  // namespace

std::vector<double> unit_scores(const std::vector<Stop>& sweep, std::size_t channel) {
    std::vector<double> scores;
    for (const AngleUnit& unit : angle_units())
        scores.push_back(score_of(sweep, channel, unit.degrees));
    const double best = *std::ranges::min_element(scores);
    for (double& score : scores) score -= best;
    return scores;
}

}  // namespace vibrig::estimator::commissioning
