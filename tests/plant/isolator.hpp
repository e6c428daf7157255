#pragma once

#include <array>
#include <complex>
#include <span>
#include <vector>

namespace vibrig::plant {

/// The platform's vibration at one instant, peak g: along up, and what that will be a quarter
/// period of each harmonic later.
struct Shake {
    double in_phase = 0;
    double quadrature = 0;
};

/// Isolation pads under the platform: m X'' + k1 X' + k0 X = k1 Y' + k0 Y, driven by the table's
/// acceleration. The acceleration of the platform answers that of the table with the same transfer
/// function, so accelerations (g) go in and come out. For a sine of constant amplitude the
/// discretisation is exact at every step length.
class Isolator {
  public:
    /// The natural frequency is chosen such that |T| at `frequency_hz` equals `transmission`, above
    /// the resonance. Throws PlantError if no such frequency exists.
    Isolator(double transmission, double frequency_hz, double damping, double step_s);

    /// None: the platform is bolted to the table, and follows it to 4e-5 up to 125 Hz.
    [[nodiscard]] static Isolator hard(double step_s);

    [[nodiscard]] double natural_frequency_hz() const noexcept;
    /// a0/a and phase at a frequency; Tang et al. 2009, eq. 3, and eq. 4 with its sign put right.
    [[nodiscard]] std::complex<double> transfer(double frequency_hz) const noexcept;

    /// Relative to the fundamental: second to fifth harmonic.
    using Harmonics = std::array<double, 4>;
    /// Fundamental and harmonics of the table in the following steps, from phase 0.
    void set_drive(double frequency_hz, const Harmonics& harmonics) noexcept;
    /// The frequency from now on, the phase goes on.
    void retune(double frequency_hz) noexcept;
    /// One step under a table acceleration of this amplitude (g), constant over the step.
    void advance(double amplitude_g) noexcept;
    /// A step for each of `after`, under an amplitude that grows by `slope_g` with each. The motion
    /// is linear in what it is before, so that for a drive of one line each step follows from
    /// numbers found once for a drive and not from the step before it.
    void advance(double begin_g, double slope_g, std::span<Shake> after);
    /// A step for each of `after` under any motion of the table, which is given at the ends of the
    /// steps (one more than of `after`) and straight in between.
    void follow(std::span<const Shake> table, std::span<Shake> after) noexcept;
    /// The platform gets a push: its acceleration jumps by this much and then rings down.
    void kick(double g) noexcept;

    [[nodiscard]] double platform_g() const noexcept { return shake().in_phase; }  ///< A1, along up
    [[nodiscard]] Shake shake() const noexcept;
    [[nodiscard]] double table_g(double amplitude_g) const noexcept;  ///< at the present phase
    [[nodiscard]] bool at_rest() const noexcept;                      ///< below 1e-9 g

  private:
    Isolator(double omega0, double damping, double step_s);

    using Complex = std::complex<double>;
    struct Harmonic {
        double relative = 0;
        Complex phasor{1, 0};            ///< exp(i w t)
        Complex turn{1, 0};              ///< exp(i w step)
        std::array<Complex, 2> input{};  ///< of one step
    };

    using Transition = std::array<std::array<double, 2>, 2>;
    /// Driven by the sines and by the cosines; acceleration = omega0^2 s0 + 2 zeta omega0 s1.
    struct Motion {
        std::array<double, 2> sine{}, cosine{};
    };
    void step(double amplitude_g) noexcept;

    /// Sine and cosine side by side.
    typedef double Pair __attribute__((vector_size(16)));
    /// What the acceleration after so many steps has of the motion, the amplitude and the slope
    /// before them; the same in both lanes.
    struct Ahead {
        std::array<Pair, 2> motion;
        std::array<Pair, 2> amplitude, slope;  ///< real and imaginary part
    };
    /// Many steps at once, for a drive of one line; empty: step by step.
    struct Leap {
        std::vector<Ahead> ahead;
        Transition transition{};
        std::array<Complex, 2> amplitude{}, slope{};  ///< in the motion
        Complex turn{1, 0};
    };
    void prepare_leap(std::size_t steps);
    void leap(double begin_g, double slope_g, std::span<Shake> after) noexcept;

    double omega0_;
    double damping_;
    double step_s_;
    Transition transition_{};
    std::array<double, 2> held_{}, risen_{};  ///< of one step under a force that is 1, or gets so
    Motion motion_;
    std::array<Harmonic, 5> harmonics_{};
    std::size_t used_ = harmonics_.size();  ///< those behind are not there
    bool steady_ = false;                   ///< the drive is as set_drive() left it
    Leap leap_;
};

}  // namespace vibrig::plant
