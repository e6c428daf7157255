#pragma once

#include <array>
#include <complex>
#include <stdexcept>

/// Levelling of one horizontal channel by external damping with a forward path: Zha et al. 2019,
/// "A Fast Damping Algorithm for INS with External Velocity Reference".
namespace vibrig::estimator::levelling {

inline constexpr double kMostStep = 0.05;  ///< sigma T of the sampled loop

/// Names the quantity, the value found and what was expected.
class DesignError : public std::invalid_argument {
  public:
    using std::invalid_argument::invalid_argument;
};

struct Earth {
    double gravity_mps2 = 9.80665;
    double radius_m = 6378137;

    [[nodiscard]] double schuler_squared() const noexcept { return gravity_mps2 / radius_m; }
};

/// H(s) = ((1 + k2) s + k3) / (s + k1). All zero: H = 1, undamped.
struct Gains {
    double k1 = 0;  ///< 1/s
    double k2 = 0;
    double k3 = 0;  ///< 1/s
};

struct Specification {
    double settling_s = 100;
    double residual = 0.005;  ///< fraction of the initial tilt left after settling_s
    double damping = 0.7;     ///< xi
};

struct Design {
    Gains gains;
    double x = 0;      ///< sigma t at which the tilt stays below the residual
    double sigma = 0;  ///< 1/s; roots at -sigma and -sigma +- j wd
};

/// Tilt over initial tilt after x = sigma t of the loop with these roots (eq. 15), v_w and z
/// starting at zero.
[[nodiscard]] double initial_response(double x, double damping) noexcept;
/// Smallest x from which on the response stays within the fraction.
[[nodiscard]] double settling_product(double residual, double damping);
/// Eqs. 11-14. Throws DesignError.
[[nodiscard]] Design design(const Specification& specification, const Earth& earth = {});
[[nodiscard]] Gains gains_of(double sigma, double damping, const Earth& earth = {});

/// Characteristic polynomial s^3 + k1 s^2 + (1 + k2) ws^2 s + k3 ws^2: Routh's conditions. Throws
/// DesignError with the inequality, its two numbers and the smallest k2 that would do.
void check_stable(const Gains& gains);
[[nodiscard]] std::array<std::complex<double>, 3> roots(const Gains& gains,
                                                        const Earth& earth = {});
/// Mean decay of the three roots, 1/s: sigma where they were placed as above.
[[nodiscard]] inline double mean_decay(const Gains& gains) noexcept { return gains.k1 / 3; }
/// Throws DesignError with the longest period allowed.
void check_period(double period_s, double sigma, double settling_s);

/// Steady tilt, rad, of a drift (rad/s) and an accelerometer zero (m/s^2): eqs. 8 and 9.
[[nodiscard]] double steady_tilt(const Gains& gains, double drift, double zero,
                                 const Earth& earth = {}) noexcept;

}  // namespace vibrig::estimator::levelling
