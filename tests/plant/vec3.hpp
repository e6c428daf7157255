#pragma once

#include <array>

namespace vibrig::plant {

using Vec3 = std::array<double, 3>;
using Mat3 = std::array<Vec3, 3>;  ///< rows

[[nodiscard]] constexpr double dot(const Vec3& a, const Vec3& b) noexcept {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
[[nodiscard]] constexpr Vec3 operator+(const Vec3& a, const Vec3& b) noexcept {
    return {a[0] + b[0], a[1] + b[1], a[2] + b[2]};
}
[[nodiscard]] constexpr Vec3 operator-(const Vec3& a, const Vec3& b) noexcept {
    return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}
[[nodiscard]] constexpr Vec3 operator*(double k, const Vec3& a) noexcept {
    return {k * a[0], k * a[1], k * a[2]};
}
[[nodiscard]] constexpr Vec3 operator*(const Mat3& m, const Vec3& v) noexcept {
    return {dot(m[0], v), dot(m[1], v), dot(m[2], v)};
}
[[nodiscard]] constexpr Vec3 cross(const Vec3& a, const Vec3& b) noexcept {
    return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
/// By cofactors; the caller knows that m is regular.
[[nodiscard]] constexpr Mat3 inverse(const Mat3& m) noexcept {
    const Vec3 c0 = cross(m[1], m[2]);
    const Vec3 c1 = cross(m[2], m[0]);
    const Vec3 c2 = cross(m[0], m[1]);
    const double k = 1.0 / dot(m[0], c0);
    return {{{k * c0[0], k * c1[0], k * c2[0]},
             {k * c0[1], k * c1[1], k * c2[1]},
             {k * c0[2], k * c1[2], k * c2[2]}}};
}
[[nodiscard]] constexpr double determinant(const Mat3& m) noexcept {
    return dot(m[0], cross(m[1], m[2]));
}

}  // namespace vibrig::plant
