#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "estimator/identification/identification.hpp"

namespace vibrig::archive {

/// A campaign's or an index' trouble, in words that name the place.
class ArchiveError : public std::runtime_error {
  public:
    using std::runtime_error::runtime_error;
};

/// What is not archived as it is, however often it is tried.
class Refused : public ArchiveError {
  public:
    using ArchiveError::ArchiveError;
};

/// Of quadratic coefficients that several frequencies share though they differ there, or of which
/// the recording does not say it.
inline constexpr double kAtNoFrequency = -1;

/// One coefficient of a campaign's result; deg/h, deg/h/g, deg/h/g^2.
struct Coefficient {
    double value = 0;
    double sigma = 0;  ///< of noise alone
    double u_a = 0;    ///< of what differs from campaign to campaign; sigma without an assessment
    double u = 0;      ///< combined standard uncertainty, likewise
    double expanded = 0;
    /// Of which vibration a quadratic one is: its frequency, Hz; 0: static; kAtNoFrequency.
    /// Nothing: a linear one, or noted before the index kept it.
    std::optional<double> at_hz = {};
};
/// Nothing where it is not determined, in the order of parameter_names().
using Coefficients = std::array<std::optional<Coefficient>, estimator::kParameters>;

struct Instrument {
    std::string name, serial, certificate, due;
};

/// Temperature of one sensor over a campaign, degC.
struct Temperature {
    std::string sensor;
    double mean = 0, low = 0, high = 0;
};

struct File {
    std::string name;
    std::int64_t bytes = 0;
    std::string sha256;
};

/// What the index has of a campaign.
struct Entry {
    std::string key;   ///< its folder, seen from that of the index
    std::string hash;  ///< of its recording files, SHA-256: what makes it this campaign
    std::string rig;
    std::string name, started_by, state, reason, mark;
    std::int64_t started_utc_ns = 0, ended_utc_ns = 0;
    std::string unit_type, unit_serial;
    bool simulated = false;
    std::string version, compiler, instruction_set, configuration_hash;
    std::string verdict;  ///< "valid", "doubtful", "not valid"; empty: there is none
    std::string sentence;
    double nis = 0;  ///< per degree of freedom; 0: none
    std::int64_t dwells = 0;
    bool superseded = false;  ///< it went on later: another entry has all of it
    Coefficients coefficients;
    std::vector<double> covariance;  ///< lower triangle, row by row; NaN: not determined
    std::vector<std::pair<std::string, double>> noise;  ///< name with unit, value
    std::vector<Instrument> instruments;
    std::vector<Temperature> temperatures;
    std::vector<File> files;
};

/// Reads a campaign's folder, but not its samples. Throws ArchiveError, hdf5::Error or
/// std::runtime_error; for a campaign that is still being recorded as well.
[[nodiscard]] Entry read_entry(const std::string& folder);
/// The same but for its files and their hash.
[[nodiscard]] Entry read_recorded(const std::string& folder);
/// The result's part of it. `frequency_hz`: of the configuration, where the result says no other.
void take_result(const std::string& result_json, double frequency_hz, Entry& to);

}  // namespace vibrig::archive
