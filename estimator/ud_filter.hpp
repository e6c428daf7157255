#pragma once

#include <array>
#include <cstddef>

namespace vibrig::estimator {

/// Kalman filter of 3 angles and 30 constants in the form P = U diag(d) U^T (Bierman, Thornton),
/// angles first. Only the angle rows of U change in the time update. Plain arrays, no heap; angles
/// in arcsec.
class UdFilter {
  public:
    static constexpr std::size_t kAngles = 3;
    static constexpr std::size_t kConstants = 30;
    static constexpr std::size_t kStates = kAngles + kConstants;
    /// Columns are padded to whole vectors.
    static constexpr std::size_t kPadded = 32;

    using Vector3 = std::array<double, 3>;
    using Matrix3 = std::array<std::array<double, 3>, 3>;

    /// One time step: angles' = f angles + g_rate (sum over groups h[3 group + j] D[3 group +
    /// j])_j.
    struct Transition {
        Vector3 angle_increment{};  ///< of the mean, arcsec
        Matrix3 f{};                ///< I + dt/RAD * Jacobian
        Matrix3 g{};                ///< drift_sign * dt * M
        alignas(64) std::array<double, kPadded> h{};
        Matrix3 noise_map{};  ///< M
        double noise = 0;     ///< q dt, arcsec^2
    };

    /// Constants at zero with these standard deviations (0: fixed), angles at zero, variance zero.
    explicit UdFilter(const std::array<double, kConstants>& sigma) noexcept;

    /// The angles start afresh at `angles`; constants keep mean and covariance.
    void start_angles(const Vector3& angles, double variance) noexcept;
    void predict(const Transition& transition) noexcept;
    /// Squared length of the innovation in its own covariance, P_angles + variance; chi-square with
    /// 3 degrees.
    [[nodiscard]] double nis(const Vector3& measured, double variance) const noexcept;
    /// Three scalar updates, one sweep over the columns.
    void update(const Vector3& measured, double variance) noexcept;

    [[nodiscard]] Vector3 angles() const noexcept { return {x_[0], x_[1], x_[2]}; }
    [[nodiscard]] const double* constants() const noexcept { return &x_[kAngles]; }
    [[nodiscard]] Matrix3 angle_covariance() const noexcept;
    /// sqrt of the diagonal of the constants' covariance.
    void sigma(std::array<double, kConstants>& out) const noexcept;
    /// Row-major 30 x 30 covariance of the constants.
    void covariance(double* out) const noexcept;

  private:
    // Column c belongs to constant c: its rows of angles, then of constants (unit upper triangular,
    // zero padded).
    alignas(64) std::array<std::array<double, kPadded>, kConstants> column_{};
    std::array<Vector3, kConstants> angle_rows_{};
    Matrix3 angle_block_{};  ///< [column][row], unit upper triangular
    std::array<double, kStates> d_{};
    std::array<double, kStates> x_{};
};

}  // namespace vibrig::estimator
