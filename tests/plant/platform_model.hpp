#pragma once

#include <span>

#include "tests/plant/elasticity.hpp"
#include "tests/plant/frame.hpp"
#include "tests/plant/truth.hpp"
#include "tests/plant/vibration_shape.hpp"

namespace vibrig::plant {

/// The inertial platform in its gimbals: Tang et al. 2009, original model, the vibration explicit
/// at every step of the integration. Reference frame north, up, east; gimbals outer about x, inner
/// about y, azimuth about z. Written from the geometry of the gimbals, not from the matrices the
/// estimator uses, so that an error cannot cancel.
class PlatformModel {
  public:
    explicit PlatformModel(const Truth& truth);

    /// Angles of the gimbals: alpha, beta, gamma in rad; they are not wrapped while the platform
    /// drifts.
    [[nodiscard]] const Vec3& angles() const noexcept { return angles_; }
    void set_angles(const Vec3& rad) noexcept {
        angles_ = rad;
        here_ = Turn(rad);
    }

    /// Cosines and sines of the three gimbal angles: they are what most of a tick's time went into.
    struct Turn {
        double ca, sa, cb, sb, cg, sg;
        explicit Turn(const Vec3& angles) noexcept;
        /// At angles that are further by so much, by the addition theorems.
        [[nodiscard]] Turn further(const Vec3& by) const noexcept;
    };

    /// A vector of the reference frame seen in platform axes, through gimbals that are square.
    [[nodiscard]] static Vec3 to_platform(const Vec3& angles, const Vec3& reference) noexcept;
    /// The same through the gimbals of this platform.
    [[nodiscard]] Vec3 seen(const Vec3& angles, const Vec3& reference) const noexcept {
        return seen(Turn(angles), reference);
    }
    [[nodiscard]] Vec3 seen(const Turn& turn, const Vec3& reference) const noexcept;
    [[nodiscard]] Vec3 up_in_platform() const noexcept { return seen(here_, up_); }
    [[nodiscard]] Vec3 up_at(const Vec3& angles) const noexcept { return seen(angles, up_); }
    /// Rate of the Earth in platform axes, deg/h.
    [[nodiscard]] Vec3 earth_rate_in_platform(const Vec3& angles) const noexcept {
        return seen(angles, earth_);
    }
    /// Specific force that the platform feels now, in its axes, g. `gain` multiplies what vibrates.
    [[nodiscard]] Vec3 force(const Shake& shake, double gain = 1) const noexcept;
    /// What turns the resolvers besides the angles: rocking of the platform and of its base, rad.
    [[nodiscard]] Vec3 rocking(const Shake& shake) const noexcept;
    /// Drift of the three gyros in deg/h, without drift_sign. `a1` is the platform's vibration
    /// along up in g.
    [[nodiscard]] Vec3 gyro_drift(const Vec3& up_platform, double a1) const noexcept {
        return drift_under((1 + a1) * up_platform);
    }
    /// The same under any specific force in platform axes, g.
    [[nodiscard]] Vec3 drift_under(const Vec3& force) const noexcept {
        Moments moments;
        moments.add(1, force);
        return drift_under(moments);
    }
    /// From now on.
    void set_coefficients(const std::array<GyroCoefficients, 3>& all) noexcept {
        coefficients_ = all;
    }
    /// Rocking and what goes across the vertical, over the truth's, from now on.
    void grow(double rocking, double across) noexcept { shape_.grow(rocking, across); }
    /// Rate of the Earth in the reference frame, deg/h.
    [[nodiscard]] const Vec3& earth_rate() const noexcept { return earth_; }
    /// d angles / dt in rad/s; `extra` is a rate of the platform in its axes, deg/h (noise,
    /// torquing).
    [[nodiscard]] Vec3 angle_rates(const Vec3& angles, double a1,
                                   const Vec3& extra) const noexcept {
        return rates_of(Turn(angles), drift_sign_ * gyro_drift(up_at(angles), a1) + extra);
    }

    /// Goes on by dt. `shakes` is the vibration at equal steps from beginning to end of it, an odd
    /// number (one: it does not change); the angles change so little in a tick of the rig, 2e-6
    /// rad, that the gyros' drift is summed over it at those of its middle.
    void advance(double dt_s, std::span<const Shake> shakes, const Vec3& extra) noexcept;

  private:
    /// Weighted sums of a force's first and second powers, and of its components' third.
    struct Moments {
        Vec3 first{}, third{};
        Mat3 second{};  ///< on and above the diagonal

        void add(double weight, const Vec3& f) noexcept {
            for (std::size_t i = 0; i < 3; ++i) {
                const double w = weight * f[i];
                first[i] += w;
                third[i] += w * f[i] * f[i];
                for (std::size_t j = i; j < 3; ++j) second[i][j] += w * f[j];
            }
        }
    };
    [[nodiscard]] Vec3 drift_under(const Moments& force) const noexcept;
    /// Mean powers of the vibration: x, y; xx, xy, yy; xxx, xxy, xyy, yyy.
    struct Powers {
        double p = 0, q = 0, pp = 0, pq = 0, qq = 0, ppp = 0, ppq = 0, pqq = 0, qqq = 0;
    };
    template <bool kThird>
    [[nodiscard]] static Powers powers(std::span<const Shake> shakes) noexcept;
    /// Of up + x a + y b over the vibration x, y.
    [[nodiscard]] static Moments swept(const Vec3& up, const Vec3& a, const Vec3& b,
                                       const Powers& powers) noexcept;
    /// Change of the gimbal angles when the platform turns against its base, both small or rates.
    [[nodiscard]] Vec3 gimbal_turn(const Turn& at, const Vec3& turn) const noexcept;
    /// d angles / dt, rad/s, for a rate of the platform in inertial space, deg/h.
    [[nodiscard]] Vec3 rates_of(const Turn& at, const Vec3& rate) const noexcept;
    [[nodiscard]] Vec3 mean_rate(const Turn& at, double dt_s,
                                 std::span<const Shake> shakes) const noexcept;

    /// Drift of the elastic parts beyond that of the coefficients at rest, deg/h.
    [[nodiscard]] Vec3 yielding(const Turn& at, double dt_s,
                                std::span<const Shake> shakes) noexcept;

    Vec3 angles_{};
    Turn here_{Vec3{}};  ///< of the angles
    Vec3 rate_{};        ///< of the last step, due to drift and rocking, deg/h
    VibrationShape shape_;
    Elasticity elasticity_;
    Vec3 up_{};     ///< against gravity, in the reference frame
    Vec3 earth_{};  ///< in the reference frame, deg/h
    std::array<GyroCoefficients, 3> coefficients_;
    Mat3 cubic_;
    std::array<std::array<Axis, 3>, 3> gyro_axes_;
    double drift_sign_;
    struct Skew {
        double sine, cosine;
    };
    std::array<Skew, 2> skew_;  ///< between outer and inner, inner and azimuth
};

}  // namespace vibrig::plant
