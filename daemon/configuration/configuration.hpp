#pragma once

#include <cstdint>
#include <stdexcept>
#include <string>
#include <vector>

#include "daemon/campaign/settings.hpp"
#include "daemon/configuration/archive_settings.hpp"
#include "daemon/configuration/mqtt_settings.hpp"
#include "daemon/configuration/record_settings.hpp"
#include "daemon/interlock/interlock_table.hpp"
#include "daemon/interlock/random_witness.hpp"
#include "drivers/annunciator/annunciator.hpp"
#include "drivers/can/can_port.hpp"
#include "drivers/gimbal/gimbal.hpp"
#include "drivers/sample/assembler.hpp"
#include "drivers/shaker/shaker.hpp"
#include "estimator/filter/settings.hpp"
#include "estimator/spectrum/mount.hpp"
#include "estimator/spectrum/profile.hpp"
#include "proto/sample_rate.hpp"

namespace vibrig::configuration {

/// "file:line:column: key: found X, expected Y"; several at once, one per line.
class ConfigurationError : public std::runtime_error {
  public:
    using std::runtime_error::runtime_error;
};

inline constexpr const char* kCommissionFolder = "/var/lib/vibrig/commission";

/// Relative paths of the file (dbc, results, log file) are relative to its folder; here they are
/// resolved.
struct Configuration {
    estimator::Settings
        estimator;  ///< [site] [vibration] [platform] [accelerometer] [noise] [estimator]
    campaign::Settings campaign;   ///< [campaign], [shaker.limits]
    drivers::CanPortSettings can;  ///< [can]
    std::string dbc;               ///< [can] dbc; empty: the built-in rig.dbc
    /// [can.signals], [can] sample_rate_hz, deadlines
    drivers::AssemblerSettings assembler{
        .bindings = {},
        .sample_period = static_cast<drivers::Time>(drivers::kSecond / kUnstatedSampleRate_hz)};
    drivers::GimbalSettings gimbal;  ///< [gimbal]
    drivers::ShakerSettings
        shaker;  ///< [shaker], [shaker.registers]; scales in g peak, amplitude_unit folded in
    std::string shaker_plate;  ///< for the record
    /// [shaker] amplitude_unit: what the controller's amplitude registers count in.
    enum class AmplitudeUnit : std::uint8_t {
        g_peak,
        g_rms,
        mps2_peak
    } amplitude_unit = AmplitudeUnit::g_peak;
    enum class ClockKind : std::uint8_t { real, rig } clock = ClockKind::real;  ///< [clock] source
    /// [commission]: what is demanded before a rig may shake
    struct Commission {
        bool simulated = false;  ///< a simulated rig on the real clock
        bool enforce = false;    ///< a simulated rig is held to what a real one is held to
        std::string folder = kCommissionFolder;  ///< of the record
        double valid_days = 365;                 ///< so long a part of it counts
        double linear_sigma = 2;                 ///< of the gyros' linear drift terms, deg/h/g
        bool opening_check = true;  ///< before the first ramp, where the record is demanded
        /// A coefficient of the maker's certificate, by parameter_names(): deg/h, deg/h/g,
        /// deg/h/g^2.
        struct Coefficient {
            std::string name;
            double value = 0;
        };
        std::vector<Coefficient> certificate;
    } commission;
    /// Nothing that could hurt anybody: the rig is a program.
    [[nodiscard]] bool simulated() const { return clock == ClockKind::rig || commission.simulated; }
    [[nodiscard]] bool proofs_demanded() const { return !simulated() || commission.enforce; }
    /// A simulated rig has a record only where a folder for it is stated.
    [[nodiscard]] bool record_demanded() const {
        return !simulated() || (commission.enforce && commission.folder != kCommissionFolder);
    }
    /// [spectrum]: several frequencies
    struct Spectrum {
        bool mixed = false;         ///< mode
        bool hard = false;          ///< mount
        bool mount_stated = false;  ///< by a key; else as [vibration] transmission has it
        /// transmission: Hz and platform over table; empty: "pads"
        std::vector<std::pair<double, double>> transmission;
        double pads_damping = 0.2;
        /// Scatter of the mean square that a controller plays about its profile, 1 sigma.
        double controller_gain = 0.01;
        /// controller_psd: "nominal", "registers", "profile", or a file that becomes the profiles'
        /// when loaded.
        std::string controller_psd = "nominal";
        double highest_hz = 500;           ///< of what a survey plans
        double elastic_beyond = 1;         ///< see estimator::spectrum::PredictionOptions
        double tolerance_deg_h = 0;        ///< of a verification; 0: any
        estimator::spectrum::Mount mount;  ///< what follows of them
    } spectrum;
    /// [[profile]]
    struct NamedProfile {
        estimator::spectrum::Profile profile;
        std::string file;  ///< instead of psd; relative to the configuration's folder
        int number = 0;    ///< in the controller; 0: not stated
        bool at_table = false;
        bool states_at = false, states_direction = false;  ///< itself, perhaps beside a file
        /// At the table, as the controller reports it; empty: as `profile` has it.
        std::vector<std::pair<double, double>> controller_psd{};
    };
    std::vector<NamedProfile> profiles;
    /// Profiles that the plan plays: numbers, and abort bands; places as RandomStop::place
    /// less 1.
    std::vector<std::uint16_t> played_numbers;
    std::vector<rt::RandomWitness::Settings> abort_bands;
    std::string socket = "/run/vibrig/vibrigd.sock";  ///< [server] socket
    /// [server]: who may command at the socket, and where else is listened; empty: all, nowhere
    struct Server {
        std::string operator_group, status_socket, page, remote;
        std::string certificate, key, clients_ca, revoked;
    } server;
    std::string guard_socket;                  ///< [guard] socket; empty: there is no guard
    drivers::AnnunciatorSettings annunciator;  ///< [annunciator]
    MqttSettings mqtt;                         ///< [mqtt]
    std::string log_level = "info";            ///< [log] level
    std::string log_file;                      ///< [log] file; empty: standard error
    /// [journal] file; empty: journal.sqlite3 in results, and none without results
    std::string journal;
    std::string results;  ///< [campaign] results: folder for result.json; empty: none written
    std::vector<rt::Rule> interlock = rt::default_interlock();  ///< [[interlock]]
    RecordSettings record;                                      ///< [record]
    Paperwork paperwork;                                        ///< [unit], [[instrument]]
    ArchiveSettings archive;                                    ///< [archive]
    int acquisition_priority = 60;  ///< [threads] SCHED_FIFO; 0: ordinary scheduling
    int estimator_priority = 50;
    int acquisition_cpu = -1;  ///< [threads] keeps to this one; -1: any
    int estimator_cpu = -1;
    bool lock_memory = true;  ///< [threads]
};

/// One effective value as --check prints it.
struct EffectiveValue {
    std::string key, value, unit, origin, doc;  ///< origin: "default" or "file:line"
};

struct Loaded {
    std::string path;  ///< of the file; empty: none
    Configuration configuration;
    std::vector<EffectiveValue> effective;
};

/// Throws ConfigurationError. Empty path: all defaults. `daemon`: also checks what only the daemon
/// needs (a watchdog register, the rig clock only with a simulated bus and Modbus on loopback,
/// shaker limits).
[[nodiscard]] Loaded load(const std::string& path, bool daemon);
[[nodiscard]] Loaded parse(const std::string& text, const std::string& name, bool daemon);
/// The table of --check.
[[nodiscard]] std::string format_effective(const Loaded& loaded);
/// Every key with type, unit, default, bounds and doc, as --help and the manual show it.
[[nodiscard]] std::string format_schema();

}  // namespace vibrig::configuration
