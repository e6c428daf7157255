#pragma once

#include <Eigen/Core>

namespace vibrig::estimator {

/// a b in the order of Eigen 3.4 on x86-64, but without its loops and calls, which at this size
/// take longer than the products.
[[nodiscard]] inline Eigen::Matrix3d product(const Eigen::Matrix3d& a,
                                             const Eigen::Matrix3d& b) noexcept {
    Eigen::Matrix3d out;
    for (Eigen::Index c = 0; c < 3; ++c) {
        const double x = b(0, c), y = b(1, c), z = b(2, c);
        out(0, c) = a(0, 0) * x + a(0, 1) * y + a(0, 2) * z;
        out(1, c) = a(1, 0) * x + a(1, 1) * y + a(1, 2) * z;
        out(2, c) = a(2, 0) * x + (a(2, 1) * y + a(2, 2) * z);
    }
    return out;
}

}  // namespace vibrig::estimator
