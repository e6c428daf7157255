#pragma once

#include <Eigen/Core>

#include "estimator/zeros/error_model.hpp"

namespace vibrig::estimator::zeros {

/// Rotation by the vector v (rad).
[[nodiscard]] Eigen::Matrix3d rotation(const Eigen::Vector3d& v);

/// Navigation in local east, north, up axes from increments; position in metres from the azimuth
/// axis.
class Strapdown {
  public:
    Strapdown(const Site& site, const Eigen::Matrix3d& c, const Eigen::Vector3d& position)
        : site_(site), c_(c), p_(position) {}

    /// Increments over dt: turn in rad, velocity in m/s, both in body axes, already corrected.
    void advance(const Eigen::Vector3d& turn, const Eigen::Vector3d& velocity, double dt_s);

    [[nodiscard]] const Eigen::Matrix3d& c() const noexcept { return c_; }
    [[nodiscard]] const Eigen::Vector3d& velocity() const noexcept { return v_; }
    [[nodiscard]] const Eigen::Vector3d& position() const noexcept { return p_; }
    /// Takes the errors off: true C = (1 + [phi x]) C.
    void correct(const Eigen::Vector3d& phi, const Eigen::Vector3d& velocity,
                 const Eigen::Vector3d& position);

  private:
    Site site_;
    Eigen::Matrix3d c_;  ///< body to navigation
    Eigen::Vector3d v_ = Eigen::Vector3d::Zero();
    Eigen::Vector3d p_;
};

}  // namespace vibrig::estimator::zeros
