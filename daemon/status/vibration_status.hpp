#pragma once

#include <string>
#include <utility>
#include <vector>

namespace vibrig {

/// What shakes on a rig with several kinds of vibration: as it is commanded, read back and seen. g
/// are the table's, peak of a sine, rms of random vibration; negative: not known.
struct VibrationStatus {
    std::string kind;         ///< "rest", "sine", "sweep", "random"; empty: a rig with one sine
    double frequency_hz = 0;  ///< of a sine, and where a sweep is
    std::string profile;      ///< of random vibration
    int number = 0;           ///< of the profile in the controller
    double level_db = 0;      ///< about it
    std::string control;      ///< what the controller reports of random vibration
    double commanded_g = 0, controller_g = -1;
    double table_g = -1,
           platform_g = -1;  ///< by the accelerometers, the platform's as at the table
    /// Random: beyond them the interlock stops the shaker once its windows know it.
    double low_g = -1, high_g = -1;
    /// PSD of the profile as it stands, Hz and g^2/Hz, and where: "table" or "platform".
    std::vector<std::pair<double, double>> psd;
    std::string psd_at;
    double from_hz = 0, to_hz = 0;  ///< of a sweep
    /// Words for what has no one frequency: a sweep, random vibration.
    std::string words;
};

}  // namespace vibrig
