#include "tests/plant/random_drive.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <unsupported/Eigen/FFT>

namespace vibrig::plant {

void RandomDrive::shape(const ShakerProfile& profile) {
    const double line_hz = this->line_hz(), rms = profile.rms_g();
    amplitude_.assign(kFrame / 2, 0);
    heard_.assign(kFrame / 2, 0);
    frames_ = 0;
    double all = 0;
    for (std::size_t k = 1; k < amplitude_.size(); ++k) {
        const double hz = static_cast<double>(k) * line_hz;
        const double power = profile.power(hz - line_hz / 2, hz + line_hz / 2) / (rms * rms);
        amplitude_[k] = std::sqrt(power);
        all += power;
    }
    // What lies beyond half the step rate is not played: the rest has all the power.
    for (double& one : amplitude_) one /= std::sqrt(all);
    ahead_.assign(kFrame, {});
    make_frame();
    at_ = kFrame / 2;  // the first half frame has no other below it
}

void RandomDrive::make_frame() {
    spectrum_.assign(kFrame, 0);
    frame_.resize(kFrame);
    for (std::size_t k = 1; k < amplitude_.size(); ++k) {
        if (amplitude_[k] > 0)
            spectrum_[k] = amplitude_[k] * std::complex(random_.normal(), random_.normal());
        heard_[k] += std::norm(spectrum_[k]) / 2;
    }
    ++frames_;
    Eigen::FFT<double> fft(Eigen::default_fft_impl<double>(), Eigen::FFT<double>::Unscaled);
    fft.inv(frame_, spectrum_);
    constexpr std::size_t kHalf = kFrame / 2;
    for (std::size_t i = 0; i < kFrame; ++i) {
        if (i < kHalf) ahead_[i] = ahead_[i + kHalf];
        if (i >= kHalf) ahead_[i] = {};
        // Squares of two windows half a frame apart add up to 1.
        const double window = std::sin(std::numbers::pi * (static_cast<double>(i) + 0.5) /
                                       static_cast<double>(kFrame));
        // A quarter period later the cosine of a line is less its sine.
        ahead_[i].in_phase += window * frame_[i].real();
        ahead_[i].quadrature -= window * frame_[i].imag();
    }
    at_ = 0;
}

void RandomDrive::next(std::span<Shake> out) {
    for (Shake& shake : out) {
        if (at_ == kFrame / 2) make_frame();
        shake = ahead_[at_++];
    }
}

std::vector<double> RandomDrive::heard() const {
    if (frames_ == 0) return {};
    std::vector<double> mean = heard_;
    for (double& one : mean) one /= static_cast<double>(frames_);
    return mean;
}

void RandomDrive::forget() noexcept {
    std::ranges::fill(heard_, 0.0);
    frames_ = 0;
}

}  // namespace vibrig::plant
