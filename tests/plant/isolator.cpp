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

}  // namespace

Isolator::Isolator(double transmission, double frequency_hz, double damping, double step_s)
    : omega0_(natural_omega(transmission, frequency_hz, damping)),
      damping_(damping),
      step_s_(step_s) {
    const double sigma = damping_ * omega0_;
    const double omega_d = omega0_ * std::sqrt(1 - damping_ * damping_);
    const double decay = std::exp(-sigma * step_s);
    const double c = decay * std::cos(omega_d * step_s);
    const double s = decay * std::sin(omega_d * step_s) / omega_d;
    transition_ = {{{c + sigma * s, s}, {-omega0_ * omega0_ * s, c - sigma * s}}};
}

double Isolator::natural_frequency_hz() const noexcept { return omega0_ / kTwoPi; }

std::complex<double> Isolator::transfer(double frequency_hz) const noexcept {
    const Complex s{0, kTwoPi * frequency_hz};
    const Complex top = 2 * damping_ * omega0_ * s + omega0_ * omega0_;
    return top / (s * s + top);
}

void Isolator::set_drive(double frequency_hz, double second_harmonic) noexcept {
    harmonics_[0].relative = 1;
    harmonics_[1].relative = second_harmonic;
    for (std::size_t n = 0; n < 2; ++n) {
        Harmonic& h = harmonics_[n];
        const Complex s{0, kTwoPi * frequency_hz * static_cast<double>(n + 1)};
        // Steady answer v exp(i w t) of the state; one step adds v exp(i w step) - transition v.
        const Complex v0 = 1.0 / (s * s + 2 * damping_ * omega0_ * s + omega0_ * omega0_);
        const Complex v1 = s * v0;
        h.phasor = {1, 0};
        h.turn = std::exp(s * step_s_);
        h.input = {v0 * h.turn - (transition_[0][0] * v0 + transition_[0][1] * v1),
                   v1 * h.turn - (transition_[1][0] * v0 + transition_[1][1] * v1)};
    }
}

void Isolator::advance(double amplitude_g) noexcept {
    std::array<double, 2> next{transition_[0][0] * state_[0] + transition_[0][1] * state_[1],
                               transition_[1][0] * state_[0] + transition_[1][1] * state_[1]};
    for (Harmonic& h : harmonics_) {
        if (h.relative == 0) continue;
        const double g = amplitude_g * h.relative;
        next[0] += g * (h.phasor.real() * h.input[0].imag() + h.phasor.imag() * h.input[0].real());
        next[1] += g * (h.phasor.real() * h.input[1].imag() + h.phasor.imag() * h.input[1].real());
        const double re = h.phasor.real() * h.turn.real() - h.phasor.imag() * h.turn.imag();
        const double im = h.phasor.real() * h.turn.imag() + h.phasor.imag() * h.turn.real();
        const double norm =
            1.5 - 0.5 * (re * re + im * im);  // one Newton step keeps the length at 1 for ever
        h.phasor = {re * norm, im * norm};
    }
    state_ = next;
}

void Isolator::kick(double g) noexcept { state_[0] += g / (omega0_ * omega0_); }

double Isolator::platform_g() const noexcept {
    return omega0_ * omega0_ * state_[0] + 2 * damping_ * omega0_ * state_[1];
}

double Isolator::table_g(double amplitude_g) const noexcept {
    double g = 0;
    for (const Harmonic& h : harmonics_) g += h.relative * h.phasor.imag();
    return amplitude_g * g;
}

bool Isolator::at_rest() const noexcept {
    return std::abs(state_[0]) * omega0_ * omega0_ < 1e-9 && std::abs(state_[1]) * omega0_ < 1e-9;
}

}  // namespace vibrig::plant
