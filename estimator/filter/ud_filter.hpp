#pragma once

#include <array>
#include <cstddef>

#include "estimator/filter/ud_kernel.hpp"

namespace vibrig::estimator {

/// Kalman filter of 3 angles and 30 constants in the form P = U diag(d) U^T (Bierman, Thornton),
/// angles first. Only the angle rows of U change in the time update. Plain arrays, no heap; angles
/// in arcsec.
class UdFilter {
  public:
    static constexpr std::size_t kAngles = kUdAngles;
    static constexpr std::size_t kConstants = kUdConstants;
    static constexpr std::size_t kStates = kAngles + kConstants;

    using Vector3 = std::array<double, 3>;
    using Transition = UdTransition;

    /// Constants at zero with these standard deviations (0: fixed), angles at zero, variance zero.
    /// The instruction set is the one in use now.
    explicit UdFilter(const std::array<double, kConstants>& sigma) noexcept;

    /// The angles start afresh at `angles`; constants keep mean and covariance.
    void start_angles(const Vector3& angles, double variance) noexcept;
    /// The first three constants have moved, each by itself with this variance: U and d of their
    /// block by Agee and Turner's rank-one update. start_angles() has to follow, since what the
    /// angles have in common with them is not kept.
    void let_first_move(double variance) noexcept;
    void predict(const Transition& transition) noexcept { kernel_->predict(memory_, transition); }

    struct Update {
        double nis = 0;  ///< squared length of the innovation in its own covariance, P_angles + R;
                         ///< chi-square with 3 degrees
        bool done = false;
    };
    /// Three scalar updates, unless `nis` is above the gate: then nothing changes.
    Update update(const Vector3& measured, double variance, double gate) noexcept {
        Update result;
        result.done = kernel_->update(memory_, measured.data(), variance, gate, &result.nis);
        return result;
    }

    [[nodiscard]] Vector3 angles() const noexcept {
        return {memory_.x_angle[0], memory_.x_angle[1], memory_.x_angle[2]};
    }
    [[nodiscard]] const double* constants() const noexcept { return memory_.x_constant; }
    /// sqrt of the diagonal of the constants' covariance.
    void sigma(std::array<double, kConstants>& out) const noexcept;
    /// Row-major 30 x 30 covariance of the constants.
    void covariance(double* out) const noexcept;

  private:
    UdMemory memory_{};
    const UdKernel* kernel_;
};

}  // namespace vibrig::estimator
