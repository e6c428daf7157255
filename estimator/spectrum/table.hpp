#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <span>
#include <vector>

#include "estimator/identification/dwell_row.hpp"
#include "estimator/identification/identification.hpp"
#include "estimator/spectrum/elastic.hpp"
#include "estimator/spectrum/kind.hpp"

namespace vibrig::estimator::spectrum {

/// A dwell with what it shook with. At rest there is no kind.
struct SpectralDwell {
    DwellRow row;
    std::optional<std::size_t> kind = {};  ///< of SpectralTable::kinds
    double relative_error = 0;             ///< of the mean square of its vibration, 1 sigma
    /// Of a random one whose PSD is known, and of a sine whose harmonics the samples tell: in place
    /// of its kind's.
    std::vector<Band> bands = {};
};

/// What a dwell shook with: `of_kind`, and of a sine the harmonics that its samples tell.
[[nodiscard]] std::vector<Band> bands_of(const Settings& settings, const DwellRow& row,
                                         const std::vector<Band>& of_kind);

/// Elastic and static columns of a gyro: the base model, and its quadratic part once more.
inline constexpr Eigen::Index kBase = kGroups, kElastic = kGroups - kDii,
                              kColumns = kBase + kElastic;

/// The dwells of a campaign as the analysis takes them.
class SpectralTable {
  public:
    /// Kinds without dwells are dropped, the others ordered by their frequency.
    SpectralTable(const Settings& settings, std::vector<SpectralDwell> dwells,
                  std::vector<Kind> kinds);

    [[nodiscard]] Eigen::Index dwells() const { return static_cast<Eigen::Index>(dwells_.size()); }
    [[nodiscard]] const std::vector<SpectralDwell>& list() const { return dwells_; }
    [[nodiscard]] const std::vector<Kind>& kinds() const { return kinds_; }
    [[nodiscard]] std::span<const DwellRow> rows() const { return rows_; }
    /// Of gyro j: n x 10, and of the vibration's second moment alone n x 6 (II SS OO IS IO OS).
    [[nodiscard]] const Eigen::MatrixXd& base(std::size_t j) const { return base_[j]; }
    [[nodiscard]] const Eigen::MatrixXd& vibration(std::size_t j) const { return vibration_[j]; }
    /// Weights of all dwells.
    [[nodiscard]] Eigen::VectorXd elastic_weights(const Resonance& of) const;
    /// Of gyro j, n x (4 + 6 F): six quadratic coefficients for every kind, gravity's with the
    /// first.
    [[nodiscard]] Eigen::MatrixXd grouped(std::size_t j) const;
    [[nodiscard]] std::size_t dwells_of(std::size_t kind) const;

  private:
    std::vector<SpectralDwell> dwells_;
    std::vector<Kind> kinds_;
    std::vector<DwellRow> rows_;
    std::array<Eigen::MatrixXd, 3> base_, vibration_;
};

/// Second moment of a vibration, level frame, g^2.
[[nodiscard]] Eigen::Matrix3d level_moment(const VibrationMoment& vibration);

/// The model's columns for an attitude: the base's under gravity and `moment` (level frame, g^2),
/// and the six of `moment` alone; [gyro].
struct Attitude {
    std::array<Eigen::Matrix<double, kBase, 1>, 3> base;
    std::array<Eigen::Matrix<double, kElastic, 1>, 3> vibration;
};
[[nodiscard]] Attitude attitude(const Settings& settings, const Eigen::Vector3d& gimbal_rad,
                                const Eigen::Matrix3d& moment);

}  // namespace vibrig::estimator::spectrum
