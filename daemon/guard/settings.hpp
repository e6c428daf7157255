#pragma once

#include <array>
#include <map>
#include <stdexcept>
#include <string>

#include "daemon/guard/alarm.hpp"
#include "drivers/can/can_port.hpp"
#include "proto/register_map.hpp"
#include "proto/safety.hpp"

namespace vibrig::guard {

/// "file:line:column: key: found X, expected Y", one a line.
class SettingsError : public std::runtime_error {
  public:
    using std::runtime_error::runtime_error;
};

/// "key: found X, expected Y"
[[nodiscard]] std::string key_error(const std::string& key, const std::string& found,
                                    const std::string& expected);

/// Where the accelerometers are on the bus, as "Message.Signal"; empty: there is none.
struct WitnessSettings {
    std::string dbc;  ///< empty: the built-in rig.dbc
    std::array<std::string, 3> platform{"AccelerometersXY.X", "AccelerometersXY.Y",
                                        "AccelerometerZ.Z"};
    std::array<std::string, 3> platform_valid{"AccelerometersXY.XValid", "AccelerometersXY.YValid",
                                              "AccelerometerZ.ZValid"};
    std::string table = "TableAccelerometer.Axial";
    std::array<double, 3> zero_g{};  ///< subtracted, then the matrix: raw to platform axes
    std::array<std::array<double, 3>, 3> matrix{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
    double sample_rate_hz = 0;     ///< to be stated
    int samples_per_frame = 1;     ///< signal S has the first one's value, S_1, S_2, .. the others'
    double transmission = 0.6667;  ///< platform over table
    double seen = 1;               ///< by the platform's accelerometers, of a vibration's amplitude
    double window_s = safety::kRestWindow_s;
    bool rig_time = false;                        ///< the simulated rig owns the time and sends it
    std::string file{};                           ///< of the keys
    std::map<std::string, std::string> places{};  ///< "file:line:column" by key, where it is stated
};

/// The shaker's controller, over Modbus/TCP.
struct ShakerLineSettings {
    std::string host = "127.0.0.1";
    int port = 502;
    int unit = 1;
    proto::Register ramp_time, run;
    proto::Register measured_amplitude;  ///< scale in g peak
    std::string host_place{};            ///< "file:line:column"; empty: it is not stated
};

struct JudgeSettings {
    double rest_g = safety::kRest_g;
    double stop_deadline_s = safety::kStopDeadline_s;
    double limit_g = 12;  ///< of the shaker: an arming above it is not believed
    /// Of the level the platform may show so many times what it shows at the reference frequency.
    double most_ratio = 1;
};

/// What the guard takes from the daemon's configuration file.
struct Settings {
    std::string socket;  ///< where it listens for the daemon
    drivers::CanPortSettings can;
    WitnessSettings witness;
    ShakerLineSettings shaker;
    JudgeSettings judge;
    AlarmSettings alarm;
    std::string believed;  ///< every key that was read, as TOML with its origin
};

/// Throws SettingsError. Relative paths are relative to the file's folder.
[[nodiscard]] Settings read_settings(const std::string& path);
[[nodiscard]] Settings parse_settings(const std::string& text, const std::string& file);

}  // namespace vibrig::guard
