#include "tests/plant/isolator.hpp"

#include <cmath>
#include <numbers>

#include "tests/plant/truth.hpp"

namespace vibrig::plant {
namespace {

constexpr double kTwoPi = 2 * std::numbers::pi;

// |T|^2 = (1 + z x) / ((1 - x)^2 + z x) with x = (f/fn)^2, z = (2 zeta)^2, solved for the larger x.
double natural_omega(double transmission, double frequency_hz, double damping) {
    const double z = 4 * damping * damping;
    const double a = transmission * transmission;
    const double b = a * (z - 2) - z;
    const double discriminant = b * b - 4 * a * (a - 1);
    const double x = discriminant < 0 ? 0 : (-b + std::sqrt(discriminant)) / (2 * a);
    if (!(x > 0)) {
        throw PlantError("isolator.transmission: " + std::to_string(transmission) +
                         " cannot be reached with this damping, expected a smaller one");
    }
    return kTwoPi * frequency_hz / std::sqrt(x);
}

using Complex = std::complex<double>;

// The library's product looks for infinities.
Complex times(const Complex& a, const Complex& b) noexcept {
    return {a.real() * b.real() - a.imag() * b.imag(), a.real() * b.imag() + a.imag() * b.real()};
}

/// One Newton step keeps the length at 1 for ever.
Complex turned(const Complex& phasor, const Complex& turn) noexcept {
    const Complex next = times(phasor, turn);
    const double norm = 1.5 - 0.5 * (next.real() * next.real() + next.imag() * next.imag());
    return {next.real() * norm, next.imag() * norm};
}

}  // namespace

Isolator::Isolator(double transmission, double frequency_hz, double damping, double step_s)
    : Isolator(natural_omega(transmission, frequency_hz, damping), damping, step_s) {}

Isolator Isolator::hard(double step_s) { return {kTwoPi * 20000, 0.5, step_s}; }

Isolator::Isolator(double omega0, double damping, double step_s)
    : omega0_(omega0), damping_(damping), step_s_(step_s) {
    const double sigma = damping_ * omega0_;
    const double omega_d = omega0_ * std::sqrt(1 - damping_ * damping_);
    const double decay = std::exp(-sigma * step_s);
    const double c = decay * std::cos(omega_d * step_s);
    const double s = decay * std::sin(omega_d * step_s) / omega_d;
    transition_ = {{{c + sigma * s, s}, {-omega0_ * omega0_ * s, c - sigma * s}}};
    // The motion under a constant force is the one towards its rest; under one that grows, the
    // mean of those.
    const double stiff = omega0_ * omega0_, lag = 2 * damping_ / omega0_;
    held_ = {(1 - transition_[0][0]) / stiff, -transition_[1][0] / stiff};
    risen_ = {(step_s - lag * (1 - transition_[0][0]) - transition_[0][1]) / (stiff * step_s),
              held_[0] / step_s};
}

double Isolator::natural_frequency_hz() const noexcept { return omega0_ / kTwoPi; }

std::complex<double> Isolator::transfer(double frequency_hz) const noexcept {
    const Complex s{0, kTwoPi * frequency_hz};
    const Complex top = 2 * damping_ * omega0_ * s + omega0_ * omega0_;
    return top / (s * s + top);
}

void Isolator::set_drive(double frequency_hz, const Harmonics& harmonics) noexcept {
    used_ = 1;
    for (std::size_t n = 0; n < harmonics_.size(); ++n) {
        harmonics_[n].relative = n == 0 ? 1 : harmonics[n - 1];
        harmonics_[n].phasor = {1, 0};
        if (harmonics_[n].relative != 0) used_ = n + 1;
    }
    retune(frequency_hz);
    steady_ = true;
    leap_.ahead.clear();
}

void Isolator::retune(double frequency_hz) noexcept {
    steady_ = false;
    for (std::size_t n = 0; n < harmonics_.size(); ++n) {
        Harmonic& h = harmonics_[n];
        const Complex s{0, kTwoPi * frequency_hz * static_cast<double>(n + 1)};
        // Steady answer v exp(i w t) of the state; one step adds v exp(i w step) - transition v.
        const Complex v0 = 1.0 / (s * s + 2 * damping_ * omega0_ * s + omega0_ * omega0_);
        const Complex v1 = s * v0;
        h.turn = std::exp(s * step_s_);
        h.input = {v0 * h.turn - (transition_[0][0] * v0 + transition_[0][1] * v1),
                   v1 * h.turn - (transition_[1][0] * v0 + transition_[1][1] * v1)};
    }
}

void Isolator::step(double amplitude_g) noexcept {
    const auto& t = transition_;
    const auto moved = [&t](const std::array<double, 2>& m) {
        return std::array<double, 2>{t[0][0] * m[0] + t[0][1] * m[1],
                                     t[1][0] * m[0] + t[1][1] * m[1]};
    };
    motion_ = {moved(motion_.sine), moved(motion_.cosine)};
    for (Harmonic& h : std::span(harmonics_).first(used_)) {
        if (h.relative == 0) continue;
        const double g = amplitude_g * h.relative;
        for (std::size_t i = 0; i < 2; ++i) {
            const Complex push = times(h.phasor, h.input[i]);
            motion_.sine[i] += g * push.imag();
            motion_.cosine[i] += g * push.real();
        }
        h.phasor = turned(h.phasor, h.turn);
    }
}

void Isolator::advance(double amplitude_g) noexcept { step(amplitude_g); }

void Isolator::advance(double begin_g, double slope_g, std::span<Shake> after) {
    if (after.empty()) return;
    // A frequency that drifts is another drive with each call.
    if (steady_ && used_ == 1) {
        if (leap_.ahead.size() != after.size()) prepare_leap(after.size());
        leap(begin_g, slope_g, after);
        return;
    }
    for (std::size_t i = 0; i < after.size(); ++i) {
        step(begin_g + slope_g * (static_cast<double>(i + 1) - 0.5));
        after[i] = shake();
    }
}

void Isolator::prepare_leap(std::size_t steps) {
    const double stiff = omega0_ * omega0_, damp = 2 * damping_ * omega0_;
    const Harmonic& line = harmonics_[0];
    const auto& t = transition_;
    const auto moved = [&t](std::array<Complex, 2>& m) {
        m = {t[0][0] * m[0] + t[0][1] * m[1], t[1][0] * m[0] + t[1][1] * m[1]};
    };
    const auto both = [](double x) { return Pair{x, x}; };
    const auto felt = [&](const std::array<Complex, 2>& m) {
        const Complex g = stiff * m[0] + damp * m[1];
        return std::array<Pair, 2>{both(g.real()), both(g.imag())};
    };
    Leap& all = leap_;
    all = {};
    all.transition = {{{1, 0}, {0, 1}}};
    for (std::size_t i = 0; i < steps; ++i) {
        moved(all.amplitude);
        moved(all.slope);
        for (std::size_t k = 0; k < 2; ++k) {
            const Complex push = times(all.turn, line.input[k]);
            all.amplitude[k] += push;
            all.slope[k] += (static_cast<double>(i) + 0.5) * push;
        }
        all.turn = turned(all.turn, line.turn);
        const Transition before = all.transition;
        for (std::size_t r = 0; r < 2; ++r) {
            for (std::size_t c = 0; c < 2; ++c)
                all.transition[r][c] = t[r][0] * before[0][c] + t[r][1] * before[1][c];
        }
        const auto of_motion = [&](std::size_t c) {
            return both(stiff * all.transition[0][c] + damp * all.transition[1][c]);
        };
        all.ahead.push_back({{of_motion(0), of_motion(1)}, felt(all.amplitude), felt(all.slope)});
    }
}

void Isolator::leap(double begin_g, double slope_g, std::span<Shake> after) noexcept {
    const Pair m0{motion_.sine[0], motion_.cosine[0]}, m1{motion_.sine[1], motion_.cosine[1]};
    // Imaginary and real part of the phasor times what it meets.
    Complex& phasor = harmonics_[0].phasor;
    const Pair by_real{phasor.imag(), phasor.real()}, by_imag{phasor.real(), -phasor.imag()};
    const Pair g0 = begin_g * by_real, g1 = begin_g * by_imag;
    const auto store = [&after](std::size_t i, Pair felt) { after[i] = {felt[0], felt[1]}; };
    if (slope_g == 0) {
        for (std::size_t i = 0; i < after.size(); ++i) {
            const Ahead& a = leap_.ahead[i];
            store(i, (a.motion[0] * m0 + a.motion[1] * m1) +
                         (a.amplitude[0] * g0 + a.amplitude[1] * g1));
        }
    } else {
        const Pair s0 = slope_g * by_real, s1 = slope_g * by_imag;
        for (std::size_t i = 0; i < after.size(); ++i) {
            const Ahead& a = leap_.ahead[i];
            store(i, (a.motion[0] * m0 + a.motion[1] * m1) +
                         (a.amplitude[0] * g0 + a.amplitude[1] * g1) +
                         (a.slope[0] * s0 + a.slope[1] * s1));
        }
    }
    for (std::size_t k = 0; k < 2; ++k) {
        const Complex push = times(phasor, begin_g * leap_.amplitude[k] + slope_g * leap_.slope[k]);
        const Pair next = leap_.transition[k][0] * m0 + leap_.transition[k][1] * m1 +
                          Pair{push.imag(), push.real()};
        motion_.sine[k] = next[0];
        motion_.cosine[k] = next[1];
    }
    phasor = turned(phasor, leap_.turn);
}

void Isolator::follow(std::span<const Shake> table, std::span<Shake> after) noexcept {
    steady_ = false;
    const auto moved = [this](std::array<double, 2>& m, double begin, double end) {
        const auto& t = transition_;
        m = {t[0][0] * m[0] + t[0][1] * m[1] + held_[0] * begin + risen_[0] * (end - begin),
             t[1][0] * m[0] + t[1][1] * m[1] + held_[1] * begin + risen_[1] * (end - begin)};
    };
    for (std::size_t i = 0; i < after.size(); ++i) {
        moved(motion_.sine, table[i].in_phase, table[i + 1].in_phase);
        moved(motion_.cosine, table[i].quadrature, table[i + 1].quadrature);
        after[i] = shake();
    }
}

void Isolator::kick(double g) noexcept { motion_.sine[0] += g / (omega0_ * omega0_); }

Shake Isolator::shake() const noexcept {
    const double stiff = omega0_ * omega0_;
    const double damp = 2 * damping_ * omega0_;
    return {stiff * motion_.sine[0] + damp * motion_.sine[1],
            stiff * motion_.cosine[0] + damp * motion_.cosine[1]};
}

double Isolator::table_g(double amplitude_g) const noexcept {
    double g = 0;
    for (const Harmonic& h : harmonics_) g += h.relative * h.phasor.imag();
    return amplitude_g * g;
}

bool Isolator::at_rest() const noexcept {
    const auto small = [this](const std::array<double, 2>& s) {
        return std::abs(s[0]) * omega0_ * omega0_ < 1e-9 && std::abs(s[1]) * omega0_ < 1e-9;
    };
    return small(motion_.sine) && small(motion_.cosine);
}

}  // namespace vibrig::plant
