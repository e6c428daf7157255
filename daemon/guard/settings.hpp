#pragma once

#include <array>
#include <stdexcept>
#include <string>

#include "drivers/annunciator/annunciator.hpp"
#include "drivers/can/can_port.hpp"
#include "proto/register_map.hpp"
#include "proto/safety.hpp"

namespace vibrig::guard {

/// "file:line:column: key: found X, expected Y", one a line.
class SettingsError : public std::runtime_error {
  public:
    using std::runtime_error::runtime_error;
};

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
    double sample_rate_hz = 40;
    double transmission = 0.6667;  ///< platform over table
    double window_s = safety::kRestWindow_s;
    bool rig_time = false;  ///< the simulated rig owns the time and sends it
};

/// The shaker's controller, over Modbus/TCP.
struct ShakerLineSettings {
    std::string host = "127.0.0.1";
    int port = 502;
    int unit = 1;
    proto::Register run, measured_amplitude;  ///< scale in g peak
};

struct JudgeSettings {
    double rest_g = safety::kRest_g;
    double stop_deadline_s = safety::kStopDeadline_s;
    double limit_g = 12;  ///< of the shaker: an arming above it is not believed
};

/// What the guard takes from the daemon's configuration file.
struct Settings {
    std::string socket;  ///< where it listens for the daemon
    drivers::CanPortSettings can;
    WitnessSettings witness;
    ShakerLineSettings shaker;
    JudgeSettings judge;
    drivers::AnnunciatorSettings annunciator;
    std::string believed;  ///< every key that was read, as TOML with its origin
};

/// Throws SettingsError. Relative paths are relative to the file's folder.
[[nodiscard]] Settings read_settings(const std::string& path);
[[nodiscard]] Settings parse_settings(const std::string& text, const std::string& file);

}  // namespace vibrig::guard
