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
/// known as declared (Noise::misalignment, scale_factor). What is shown of the level axes, which a
/// unit off level has in its zeros, is one unknown in all runs, known as declared, or, where the
/// misalignments that are found are larger than declared, as large as those.
[[nodiscard]] ZerosApart together(const std::vector<CalibrationResult>& runs);

}  // namespace vibrig::estimator::zeros
