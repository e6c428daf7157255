#include "estimator/commissioning/turns.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include "estimator/filter/angles.hpp"
#include "estimator/filter/kinematics.hpp"
#include "estimator/filter/text.hpp"

namespace vibrig::estimator::commissioning {

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
constexpr double kScale = 0.05, kSkew_deg = 3;

/// In platform axes, deg.
Vector3d turn_of(const Description& d, const CountedTurn& one) {
    const Vector3d before = d.angles(one.before);
    Vector3d moved = d.angles(one.after) - before;
    for (double& angle : moved) angle = std::remainder(angle, 2 * std::numbers::pi);
    const Vector3d middle = before + 0.5 * moved;
    return kDegPerRad * (Kinematics{Settings{}}.pose(middle).m.inverse() * moved);
}

}  // namespace

TurnFinding find_by_turns(const Description& d, const std::vector<CountedTurn>& turns) {
    if (turns.size() != 3)
        throw std::invalid_argument("commissioning: expected a slew of each gimbal, one at a time");
    Matrix3d turned, counted;
    for (int k = 0; k < 3; ++k) {
        const auto& one = turns[static_cast<std::size_t>(k)];
        turned.col(k) = turn_of(d, one);
        counted.col(k) = Vector3d(one.counted_deg.data());
    }
    if (!turned.allFinite() || !counted.allFinite())
        throw std::invalid_argument("commissioning: a turn or a count is not finite");
    if (!(std::abs(turned.determinant()) >
          0.1 * turned.col(0).norm() * turned.col(1).norm() * turned.col(2).norm()))
        throw std::invalid_argument("commissioning: the slews turn the platform about two axes");
    TurnFinding f;
    f.response = counted * turned.inverse();
    f.verdict = Verdict::refused;
    for (int gyro = 0; gyro < 3; ++gyro) {
        const auto g = static_cast<std::size_t>(gyro);
        const Vector3d row = f.response.row(gyro);
        int axis = 0;
        row.cwiseAbs().maxCoeff(&axis);
        f.axis[g] = axis;
        f.sign[g] = row[axis] < 0 ? -1 : 1;
        f.scale[g] = row.norm();
        if (!(std::abs(f.scale[g] - 1) <= kScale)) {
            f.why = text(
                "gyro increments %c count %.3f of what the platform turns, 1 expected: "
                "frames are lost, or its factor in the DBC is wrong",
                "XYZ"[g], f.scale[g]);
            return f;
        }
        const double skew = kDegPerRad * std::acos(std::min(1.0, std::abs(row[axis]) / row.norm()));
        if (!(skew <= kSkew_deg)) {
            f.why = text("gyro increments %c count about an axis %.1f deg off platform %c",
                         "XYZ"[g], skew, "xyz"[axis]);
            return f;
        }
        if (std::find(f.axis.begin(), f.axis.begin() + gyro, axis) != f.axis.begin() + gyro) {
            f.why = text("gyro increments %c count about platform %c, as another gyro's do",
                         "XYZ"[g], "xyz"[axis]);
            return f;
        }
    }
    f.verdict = Verdict::decided;
    return f;
}

}  // namespace vibrig::estimator::commissioning
