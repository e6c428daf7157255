#pragma once

#include <map>
#include <string>
#include <vector>

namespace vibrig::study {

/// A key of the simulated rig's truth, "platform.slew_error_deg".
struct RigKey {
    bool number = false;                ///< or a list of numbers
    bool whole = false;                 ///< whole ones only
    std::vector<std::size_t> elements;  ///< of the list, outside in; empty: one value
    double low = 0, high = 0;
};

/// A list of six: accelerometer axes xy, xz, yx, yz, zx, zy, on top of the matrix. The truth has
/// only the matrix.
inline constexpr const char* kMisalignment = "accelerometer.misalignment_arcsec";

/// All that a study may set; the seed is not among them.
[[nodiscard]] const std::map<std::string, RigKey>& rig_keys();

}  // namespace vibrig::study
