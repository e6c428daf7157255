#pragma once

#include "tests/plant/random.hpp"
#include "tests/plant/truth.hpp"

namespace vibrig::plant {

/// What the instruments of the rig show at one moment.
struct Readings {
    Vec3 encoder_deg{};  ///< outer, inner, azimuth in [0, 360), quantised
    Vec3 raw_g{};        ///< platform accelerometers, before zeros and matrix are taken out
    double table_g = 0;  ///< table accelerometer: vibration only, it is AC-coupled
    double temperature_c = 0;
};

/// Resolvers, accelerometers, thermometer with their errors.
class Sensors {
  public:
    Sensors(const Truth& truth, std::uint64_t seed);

    /// `angles_deg` are encoder angles without errors, `force_g` is the specific force in platform
    /// axes.
    [[nodiscard]] Readings read(const Vec3& angles_deg, const Vec3& force_g, double table_g,
                                double time_s);

  private:
    Truth truth_;
    Mat3 platform_to_raw_;
    /// Error of a resolver at an angle, deg.
    [[nodiscard]] double resolver_error_deg(std::size_t axis, double angle_deg) const noexcept;

    Random resolver_noise_;
    Random accelerometer_noise_;
    Random table_noise_;
};

/// Encoder angle to [0, 360) in steps of 360 / 2^bits deg.
[[nodiscard]] double quantise_angle(double deg, int bits) noexcept;

}  // namespace vibrig::plant
