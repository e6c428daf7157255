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

void Isolator::set_drive(double frequency_hz, const Harmonics& harmonics) noexcept {
    for (std::size_t n = 0; n < harmonics_.size(); ++n) {
        harmonics_[n].relative = n == 0 ? 1 : harmonics[n - 1];
        harmonics_[n].phasor = {1, 0};
    }
    retune(frequency_hz);
}

void Isolator::retune(double frequency_hz) noexcept {
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

void Isolator::advance(double amplitude_g) noexcept {
    const auto& t = transition_;
    std::array<double, 2> sine{t[0][0] * state_[0] + t[0][1] * state_[1],
                               t[1][0] * state_[0] + t[1][1] * state_[1]};
    std::array<double, 2> cosine{t[0][0] * ahead_[0] + t[0][1] * ahead_[1],
                                 t[1][0] * ahead_[0] + t[1][1] * ahead_[1]};
    for (Harmonic& h : harmonics_) {
        if (h.relative == 0) continue;
        const double g = amplitude_g * h.relative;
        const double re = h.phasor.real();
        const double im = h.phasor.imag();
        for (std::size_t i = 0; i < 2; ++i) {
            sine[i] += g * (re * h.input[i].imag() + im * h.input[i].real());
            cosine[i] += g * (re * h.input[i].real() - im * h.input[i].imag());
        }
        const double next_re = re * h.turn.real() - im * h.turn.imag();
        const double next_im = re * h.turn.imag() + im * h.turn.real();
        // One Newton step keeps the length at 1 for ever.
        const double norm = 1.5 - 0.5 * (next_re * next_re + next_im * next_im);
        h.phasor = {next_re * norm, next_im * norm};
    }
    state_ = sine;
    ahead_ = cosine;
}

void Isolator::kick(double g) noexcept { state_[0] += g / (omega0_ * omega0_); }

Shake Isolator::shake() const noexcept {
    const double stiff = omega0_ * omega0_;
    const double damp = 2 * damping_ * omega0_;
    return {stiff * state_[0] + damp * state_[1], stiff * ahead_[0] + damp * ahead_[1]};
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
    return small(state_) && small(ahead_);
}

}  // namespace vibrig::plant
