#include "estimator/commissioning/rig.hpp"

#include <algorithm>
#include <cmath>

#include "estimator/filter/angles.hpp"
#include "estimator/filter/kinematics.hpp"

namespace vibrig::estimator::commissioning {

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

Matrix3d diagonal(double x, double y, double z) { return Vector3d(x, y, z).asDiagonal(); }

double wrapped_deg(double deg) { return std::remainder(deg, 360.0); }

/// The platform's axes turned by 90 deg about its z: p' = Rot(-90) p.
Description quarter_turned(Description d) {
    Matrix3d back;  // p = back * p'
    back << 0, -1, 0, 1, 0, 0, 0, 0, 1;
    d.accelerometers *= back;
    d.zero_deg[2] = wrapped_deg(d.zero_deg[2] + 90 * d.sign[2]);
    return d;
}

/// Platform x and z the other way: outer - 180, -inner, 180 - azimuth.
Description z_reversed(Description d) {
    d.accelerometers *= diagonal(-1, 1, -1);
    for (const std::size_t k : {1U, 2U}) d.sign[k] = -d.sign[k];
    for (const std::size_t k : {0U, 2U}) d.zero_deg[k] = wrapped_deg(d.zero_deg[k] + 180);
    return d;
}

/// North at the other end of the outer axis: 180 - outer, -inner, azimuth - 180.
Description end_reversed(Description d) {
    for (const std::size_t k : {0U, 1U}) d.sign[k] = -d.sign[k];
    for (const std::size_t k : {0U, 2U}) d.zero_deg[k] = wrapped_deg(d.zero_deg[k] + 180);
    d.elevation_deg = -d.elevation_deg;
    return d;
}

/// All accelerometers inverted: the vertical the other way.
Description inverted(Description d) {
    d.accelerometers = -d.accelerometers;
    d.zero_deg[0] = wrapped_deg(d.zero_deg[0] + 180);
    d.elevation_deg = -d.elevation_deg;
    return d;
}

}  // namespace

const std::vector<AngleUnit>& angle_units() {
    static const std::vector<AngleUnit> units{{"deg", 1},
                                              {"turn", 360},
                                              {"rad", kDegPerRad},
                                              {"arcmin", 1 / 60.0},
                                              {"gon", 0.9},
                                              {"half degrees", 0.5},
                                              {"double degrees", 2},
                                              {"2^8 counts", 360.0 / 256},
                                              {"2^9 counts", 360.0 / 512},
                                              {"2^10 counts", 360.0 / 1024},
                                              {"2^11 counts", 360.0 / 2048},
                                              {"2^12 counts", 360.0 / 4096},
                                              {"2^13 counts", 360.0 / 8192},
                                              {"2^14 counts", 360.0 / 16384},
                                              {"2^15 counts", 360.0 / 32768},
                                              {"2^16 counts", 360.0 / 65536},
                                              {"2^17 counts", 360.0 / 131072},
                                              {"2^18 counts", 360.0 / 262144},
                                              {"2^19 counts", 360.0 / 524288},
                                              {"2^20 counts", 360.0 / 1048576},
                                              {"2^21 counts", 360.0 / 2097152},
                                              {"2^22 counts", 360.0 / 4194304},
                                              {"2^23 counts", 360.0 / 8388608},
                                              {"2^24 counts", 360.0 / 16777216}};
    return units;
}

Vector3d Description::angles(const Vec3& reading) const {
    Vector3d angle;
    for (std::size_t k = 0; k < 3; ++k) {
        const double degrees = angle_units()[static_cast<std::size_t>(unit[k])].degrees *
                               reading[static_cast<std::size_t>(channel[k])];
        angle[static_cast<int>(k)] = kRadPerDeg * wrapped_deg(sign[k] * (degrees - zero_deg[k]));
    }
    return angle;
}

Vector3d up_at(const Vector3d& angles, double elevation) {
    const double ca = std::cos(angles[0]), sa = std::sin(angles[0]);
    const double cb = std::cos(angles[1]), sb = std::sin(angles[1]);
    const double cg = std::cos(angles[2]), sg = std::sin(angles[2]);
    const double ce = std::cos(elevation), se = std::sin(elevation);
    const double x = cb * se + sb * sa * ce, y = ca * ce, z = -sb * se + cb * sa * ce;
    return {cg * x - sg * y, sg * x + cg * y, z};
}

Vector3d Description::up(const Vec3& reading) const {
    return up_at(angles(reading), kRadPerDeg * elevation_deg);
}

Vector3d Description::force(const Vec3& reading) const {
    return accelerometers * up(reading) + zero_g;
}

Matrix3d Description::wiring() const {
    return *std::ranges::max_element(signed_permutations(), {}, [this](const Matrix3d& s) {
        return (s.transpose() * accelerometers).trace();
    });
}

const std::vector<Matrix3d>& signed_permutations() {
    static const std::vector<Matrix3d> all = [] {
        std::vector<Matrix3d> list;
        std::array<int, 3> order{0, 1, 2};
        do {
            for (int signs = 0; signs < 8; ++signs) {
                Matrix3d s = Matrix3d::Zero();
                for (int i = 0; i < 3; ++i)
                    s(i, order[static_cast<std::size_t>(i)]) = (signs >> i) % 2 == 0 ? 1 : -1;
                list.push_back(s);
            }
        } while (std::ranges::next_permutation(order).found);
        return list;
    }();
    return all;
}

std::vector<Description> family_of(const Description& one) {
    std::vector<Description> all;
    for (const bool parity : {false, true}) {
        Description p = parity ? inverted(one) : one;
        for (const bool end : {false, true}) {
            for (const bool z : {false, true}) {
                Description d = p;
                if (end) d = end_reversed(d);
                if (z) d = z_reversed(d);
                for (int turns = 0; turns < 4; ++turns) {
                    all.push_back(d);
                    d = quarter_turned(d);
                }
            }
        }
    }
    return all;
}

Description preferred_of(const Description& one) {
    const auto family = family_of(one);
    const auto half = static_cast<std::ptrdiff_t>(family.size() / 2);
    return *std::max_element(family.begin(), family.begin() + half,
                             [](const Description& a, const Description& b) {
                                 if (a.sign[0] != b.sign[0]) return a.sign[0] < b.sign[0];
                                 return a.accelerometers.trace() < b.accelerometers.trace();
                             });
}

}  // namespace vibrig::estimator::commissioning
