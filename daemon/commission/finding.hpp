#pragma once

#include <array>
#include <string>
#include <vector>

#include "daemon/commission/record.hpp"

namespace vibrig::estimator::commissioning {
struct Description;
struct EarthRate;
struct GravityFinding;
struct Statements;
}  // namespace vibrig::estimator::commissioning

namespace vibrig::commission {

using Vec3 = std::array<double, 3>;

inline constexpr std::array<const char*, 3> kGimbalNames{"outer", "inner", "azimuth"};
inline constexpr std::array<const char*, 3> kLoudNames{"OUTER", "INNER", "AZIMUTH"};

/// What the bus calls things, in the order of the channels.
struct Names {
    std::array<std::string, 3> angle;  ///< "Resolvers.Outer"
    std::array<std::string, 3> force;  ///< "AccelerometersXY.X"
    std::string command = "GimbalCommand", torque = "TorqueCommand";
    std::vector<std::string> coarse{};  ///< of fewer than 12 bits by the DBC, with how many
    std::string dbc{}, sample_rate{};   ///< can.dbc, can.sample_rate_hz, as the file has them
};

/// What the configuration says that cannot be measured.
struct Stated {
    double latitude_deg = 0;
    double linear_sigma = 2;
    bool simulated = false;  ///< the rig: it cannot hurt, whatever its commands count in
    double torque_limit_deg_h = 60;
};

/// A key and its value as the file has it, with what speaks for it.
struct FoundKey {
    std::string key, value, evidence;
};

struct Finding {
    enum class Outcome : std::uint8_t { unfinished, decided, undecided, refused };
    Outcome outcome = Outcome::unfinished;
    std::string why;
    std::vector<std::string> suspects;     ///< not decided: keys that may be wrong, likeliest first
    bool second_person = false;            ///< asked for, before it is accepted
    std::vector<FoundKey> keys;            ///< decided
    std::vector<std::string> corrections;  ///< of the DBC, before anything is accepted
    Json evidence = Json::object();
    Json hypotheses = Json::array(), witnesses = Json::array(), would_separate;
    Json sigma = Json::object();
};
/// The whole text is a number, and within the bounds.
[[nodiscard]] bool number_in(const std::string& text, double low, double high, double& value);
[[nodiscard]] const char* name_of(Finding::Outcome outcome) noexcept;
[[nodiscard]] Json to_json(const Finding& finding);
/// The keys of a decided finding as a configuration file has them, each with its evidence.
[[nodiscard]] std::string to_toml(const Finding& finding, bool simulated);

/// Hypotheses of the classes that gravity leaves, best first, five at most.
[[nodiscard]] Json hypotheses_of(const estimator::commissioning::GravityFinding& gravity);

/// Keys of the bus, whatever was found of it: DBC, names of angles and accelerometers, samples/s as
/// they are measured.
void fill_bus_keys(Finding& finding, const Names& names, double measured_hz);

/// What is known of the commands: reading per commanded deg by channel, 0: not known, and the
/// travel in readings.
struct Commanded {
    Vec3 ratio{};
    std::array<std::array<double, 2>, 3> travel{};
    std::array<bool, 3> free{};         ///< turns as far as it likes, by channel
    std::array<std::size_t, 3> slot{};  ///< of the command, by channel
    bool known = false, met_a_stop = false;
};
/// The keys of a decided description.
void fill_keys(Finding& finding, const estimator::commissioning::Description& description,
               const estimator::commissioning::EarthRate& rate, const Names& names,
               const estimator::commissioning::Statements& said, const Commanded& commanded);

}  // namespace vibrig::commission
