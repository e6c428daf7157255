#pragma once

#include <vector>

#include "estimator/zeros/calibration.hpp"

namespace vibrig::estimator::zeros {

/// Zeros and misalignments of several runs.
struct ZerosApart {
    Triple zero_mg{};
    std::array<Triple, 3> covariance_mg2{};
    /// Row i, column k: what accelerometer i shows of 1 g along axis k: misalignment towards the
    /// axis of the slews as the gyros see it, rad; on the diagonal scale error, 1. Sigma 0: axis k
    /// was never upright.
    std::array<Triple, 3> share{}, share_sigma{};
};

/// Least squares over the runs: with axis k up accelerometer i shows b_i + m_ik g, with it down
/// b_i - m_ik g. An axis taken both ways needs nothing else; of one taken one way only, m_ik is
/// known as declared (Noise::misalignment, scale_factor).
[[nodiscard]] ZerosApart together(const std::vector<CalibrationResult>& runs);

}  // namespace vibrig::estimator::zeros
