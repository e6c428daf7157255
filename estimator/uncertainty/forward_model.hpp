#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "estimator/filter/drift_model.hpp"
#include "estimator/filter/kinematics.hpp"
#include "estimator/identification/dwell_row.hpp"

namespace vibrig::estimator::uncertainty {

/// What may be wrong with a rig or with what is known of it; all zero: nothing.
struct Disturbance {
    double cross_north = 0, cross_east = 0;  ///< share of the vertical vibration, beyond Gamma
    double azimuth_rad = 0, latitude_rad = 0;
    double time_base = 0;  ///< the clock runs so much too fast
    std::array<double, 3> encoder_zero_rad{};
    std::array<double, 2> non_orthogonality_rad{};  ///< outer-inner, inner-azimuth
    /// e cos(order theta + phase) of the three resolvers, as cosine and sine part.
    struct Resolver {
        int order = 1;
        std::array<std::array<double, 2>, 3> rad{};
    };
    std::vector<Resolver> resolvers;
    [[nodiscard]] double& resolver_rad(int order, std::size_t axis, std::size_t part);
    double accelerometer_gain = 0;  ///< at f over that for gravity, less 1
    std::array<double, 3> accelerometer_zero_g{};
    std::array<double, 6> accelerometer_cross{};  ///< xy, xz, yx, yz, zx, zy, rad
};

/// The drift rates that a dwell would show with a disturbance, by the whole model of rig and
/// instruments.
class ForwardModel {
  public:
    /// `coefficients`: filter order.
    ForwardModel(const Settings& settings, const ParameterArray& coefficients);

    /// Apparent rates less those of the coefficients, deg/h, with the row's angles and vibration.
    [[nodiscard]] Eigen::Vector3d apparent(const DwellRow& row, const Disturbance& d) const;

  private:
    Kinematics kinematics_;
    DriftModel model_;
    ParameterArray coefficients_;
    double latitude_rad_, azimuth_rad_;
};

}  // namespace vibrig::estimator::uncertainty
