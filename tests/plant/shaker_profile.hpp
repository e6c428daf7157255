#pragma once

#include <cstdint>
#include <utility>
#include <vector>

namespace vibrig::plant {

/// A random vibration that the shaker's controller knows by its number.
struct ShakerProfile {
    std::uint16_t number = 1;
    /// Hz and g^2/Hz, one-sided, straight between the points on logarithmic scales, 0 outside.
    std::vector<std::pair<double, double>> psd;

    /// g^2 between two frequencies.
    [[nodiscard]] double power(double from_hz, double to_hz) const noexcept;
    /// Of the whole, g.
    [[nodiscard]] double rms_g() const noexcept;
    /// Of the table's displacement, mm.
    [[nodiscard]] double rms_mm() const noexcept;
    /// CRC-32 (zlib's) over the points, hz and g^2/Hz of each as big-endian IEEE 754 floats.
    [[nodiscard]] std::uint32_t checksum() const;
};

}  // namespace vibrig::plant
