#include "tests/plant/shaker_profile.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <boost/crc.hpp>
#include <cmath>
#include <numbers>

namespace vibrig::plant {
namespace {

/// Of c f^slope from a to b.
double integral(double c, double slope, double a, double b) noexcept {
    const double power = slope + 1;
    if (std::abs(power) < 1e-9) return c * std::log(b / a);
    return c / power * (std::pow(b, power) - std::pow(a, power));
}

}  // namespace

double ShakerProfile::power(double from_hz, double to_hz) const noexcept {
    double sum = 0;
    for (std::size_t i = 1; i < psd.size(); ++i) {
        const auto& [f0, s0] = psd[i - 1];
        const auto& [f1, s1] = psd[i];
        const double a = std::max(f0, from_hz), b = std::min(f1, to_hz);
        const double slope = std::log(s1 / s0) / std::log(f1 / f0);
        if (b > a) sum += integral(s0 * std::pow(f0, -slope), slope, a, b);
    }
    return sum;
}

double ShakerProfile::rms_g() const noexcept {
    return std::sqrt(power(psd.front().first, psd.back().first));
}

double ShakerProfile::rms_mm() const noexcept {
    double sum = 0;
    for (std::size_t i = 1; i < psd.size(); ++i) {
        const auto& [f0, s0] = psd[i - 1];
        const auto& [f1, s1] = psd[i];
        const double slope = std::log(s1 / s0) / std::log(f1 / f0);
        sum += integral(s0 * std::pow(f0, -slope), slope - 4, f0, f1);
    }
    return 1e3 * 9.80665 / std::pow(2 * std::numbers::pi, 2) * std::sqrt(sum);
}

std::uint32_t ShakerProfile::checksum() const {
    boost::crc_32_type crc;
    for (const auto& [hz, density] : psd) {
        for (const double value : {hz, density}) {
            const auto bits = std::bit_cast<std::uint32_t>(static_cast<float>(value));
            for (const int shift : {24, 16, 8, 0})
                crc.process_byte(static_cast<unsigned char>(bits >> shift));
        }
    }
    return crc.checksum();
}

}  // namespace vibrig::plant
