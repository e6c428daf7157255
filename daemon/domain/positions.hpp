#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <vector>

namespace vibrig {

/// Number that distinguishes a sweep from others, beside frequencies, which are small numbers.
[[nodiscard]] constexpr double kind_of_sweep(double from_hz, double to_hz) noexcept {
    return 1e9 + 1e5 * from_hz + to_hz;
}

/// What an adaptive campaign needs of a position that is done to go on after a restart.
struct StopDone {
    std::array<double, 3> position_deg{};
    double table_g = 0;
    std::int32_t repeats = 0;  ///< of the position so far, because it was flagged
    double used_s = 0;         ///< of the campaign's time
    /// When its dwell began: since the campaign's first, NaN: not known; and UTC.
    double begin_s = std::numeric_limits<double>::quiet_NaN();
    std::int64_t begun_utc_ns = 0;
    double frequency_hz = 0;  ///< 0: the configuration's
    bool held_out = false;
    std::uint16_t profile = 0;  ///< of random vibration, its number in the controller; 0: none
    /// A sweep's ends, 0: none; and what the controller reported of its frequency meanwhile,
    /// s since the dwell began and Hz.
    double sweep_from_hz = 0, sweep_to_hz = 0;
    std::vector<std::array<double, 2>> swept_hz{};
    /// Random vibration as the controller reports it as played, Hz and g^2/Hz at the table.
    std::vector<std::array<double, 2>> psd{};
    /// As campaign::Stop::kind().
    [[nodiscard]] double kind() const {
        if (sweep_to_hz > 0) return kind_of_sweep(sweep_from_hz, sweep_to_hz);
        return profile > 0 ? -static_cast<double>(profile) : frequency_hz;
    }
};

/// What the platform drifted by at the end of a levelling, which torqued it out.
struct LevelDrift {
    int run = 0, position = 0;
    std::array<double, 3> encoder_rad{};
    std::array<std::array<double, 3>, 2> direction{};  ///< platform axes, across the vertical
    std::array<double, 2> rate_deg_h{};                ///< along them, relative to the Earth
    double sigma_deg_h = 0;                            ///< of either
};

}  // namespace vibrig
