#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "estimator/spectrum/table.hpp"

namespace vibrig::estimator::spectrum {

/// A platform at an attitude under a vibration.
struct Situation {
    Eigen::Vector3d gimbal_rad{};
    Eigen::Matrix3d moment;  ///< level frame, g^2
    std::vector<Band> bands;
    double duration_s = 0;  ///< of which the drift is the mean; 0: for ever
    bool realised = false;  ///< `moment` is what happened: only the bands' shares in it vary
    /// What each band has of `moment`, whose sum it is; empty: its share, along one line.
    std::vector<Eigen::Matrix3d> moments = {};
};

/// What the gyros' models see of a situation (docs/theory/spectrum.md, "Prediction").
class Exposure {
  public:
    using Row = Eigen::Matrix<double, kElastic, 1>;

    Exposure(const Settings& settings, Situation in);

    [[nodiscard]] const Situation& situation() const { return in_; }
    /// Columns of gyro j: those of base, and of the vibration's whole second moment.
    [[nodiscard]] const Eigen::Matrix<double, kBase, 1>& base(std::size_t j) const {
        return at_.base[j];
    }
    [[nodiscard]] const Row& vibration(std::size_t j) const { return at_.vibration[j]; }
    /// The columns of the elastic part: each band times what the mass's response adds.
    [[nodiscard]] Row elastic(std::size_t j, const Resonance& of) const;
    /// Those of what lies above a frequency.
    [[nodiscard]] Row above(std::size_t j, double hz) const;
    /// Variance of the mean drift of gyro j over the situation's time, (deg/h)^2, by how a random
    /// vibration happens to be: a band has 2 df T degrees of freedom. `x`: static coefficients,
    /// then for each of `resonances` the elastic ones.
    [[nodiscard]] double realisation(std::size_t j, const Eigen::VectorXd& x,
                                     const std::vector<Resonance>& resonances) const;

  private:
    template <class Weight>
    [[nodiscard]] Row weighed(std::size_t j, const Weight& weight) const;
    [[nodiscard]] double along_axes(std::size_t j, const Eigen::VectorXd& x,
                                    const std::vector<Resonance>& resonances) const;

    Situation in_;
    Attitude at_;
    /// Columns of a second moment (NN UU EE NU NE UE), where each band has its own.
    std::array<Eigen::Matrix<double, kElastic, 6>, 3> of_moment_;
};

}  // namespace vibrig::estimator::spectrum
