#pragma once

#include <span>
#include <string>
#include <vector>

#include "daemon/commission/book.hpp"
#include "daemon/commission/finding.hpp"

namespace vibrig::commission {

/// Why the gyros' axes of the file are not what their increments were counted about; empty: they
/// are, or nobody has counted them.
[[nodiscard]] std::string not_as_counted(const Json& increments, const configuration::Loaded& file);
/// "A. Person" of "A. Person (uid 1000)".
[[nodiscard]] std::string name_of_person(const std::string& by);

/// Why these are not two persons; empty: they are.
[[nodiscard]] std::string not_two(const std::string& by, const std::string& second);

/// What a file says that is not what was found; empty: it says all of it.
[[nodiscard]] std::string not_as_found(const Finding& finding, const configuration::Loaded& file);

/// What a file says of these parts that is neither what was found nor what the daemon runs with,
/// the DBC's contents included: nobody has measured it. Empty: nothing.
[[nodiscard]] std::string not_as_running(const std::vector<Part>& parts, const Finding& finding,
                                         const Book& running, const configuration::Loaded& file);

/// Why a file's levelling.torque_sign is not that of the torquers as they were measured
/// (Finding::evidence); empty: it is, or nothing was measured.
[[nodiscard]] std::string not_as_torqued(const Json& torquers, const configuration::Loaded& file);

/// Coefficients of the certificate that a campaign has found with the other sign at more than 5
/// sigma, in words; empty: none. Values and sigmas by estimator::parameter_names(); NaN: not known.
[[nodiscard]] std::string against_certificate(
    const std::vector<configuration::Configuration::Commission::Coefficient>& certificate,
    std::span<const double> value, std::span<const double> sigma);

/// What a person says a positive drift coefficient is, and where that is written.
struct SignStatement {
    std::string by, source;
    /// 1: the gyro's output at zero input; 2: the rate at which the platform turns; 3: the torque
    /// that stops it.
    int says = 0;
};
/// Statements from {"by", "says", "source"} each; what is none of it is left at nothing.
[[nodiscard]] std::vector<SignStatement> sign_statements(const Json& json);

/// Why platform.drift_sign is not what these two say, who have answered apart; empty: it is.
[[nodiscard]] std::string doubt_of_drift_sign(const std::vector<SignStatement>& statements,
                                              const std::string& by, const std::string& second,
                                              const configuration::Loaded& file);

}  // namespace vibrig::commission
