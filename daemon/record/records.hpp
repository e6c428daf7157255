#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "daemon/domain/status.hpp"
#include "daemon/rt/dwell_order.hpp"
#include "daemon/rt/frame_record.hpp"
#include "drivers/sample/sample.hpp"
#include "estimator/identification/identification.hpp"

namespace vibrig::record {

using rt::FrameRecord;

/// What the head of a campaign's file says.
struct Head {
    std::string name, started_by;
    std::int64_t utc_ns = 0;
    std::int64_t utc_offset_ns = 0;  ///< UTC of the beginning minus the daemon's clock, whole us
    std::string clock;               ///< "real" or "rig"
    std::string version, compiler, instruction_set;
    std::string configuration;  ///< effective, TOML
    std::string configuration_hash;
    std::string dbc;
    std::string plan;  ///< JSON: positions and levels; empty when chosen one by one
    std::string interface;
    std::string campaign;           ///< its folder's name when it began: the same in all parts
    int part = 1;                   ///< a campaign's files, in order
    bool restart = false;           ///< this part goes on after the daemon's restart
    std::size_t dwells_before = 0;  ///< that the filter then had
};

/// A dwell as it was ordered from the estimator.
struct Order {
    drivers::Time announced = 0;
    drivers::Time from = 0, to = 0;
    int run = 0, position = 0;
    double table_g = 0;
    bool cancel = false;
    std::array<double, 3> zero_g{};  ///< taken off the raw specific force
    double level_sigma_g = 0;
    estimator::NoiseLevels noise{};  ///< that the filter takes in it; angle 0: not known
};

/// dwells.csv beside the raw log: orders in the log's times.
inline constexpr const char* kDwellsHeader =
    "run,position,table_g,from_s,to_s,cancelled_s,utc_offset_us,zero_x_g,zero_y_g,zero_z_g,"
    "level_sigma_g,noise_angle_arcsec,noise_walk_x,noise_walk_y,noise_walk_z";
/// In it, with a number: the daemon was started again and went on after so many dwells.
inline constexpr const char* kRestartLine = "# restart after dwells: ";

/// A dwell that is over, and what was known after it.
struct Dwell {
    drivers::Time time = 0;
    estimator::DwellSummary summary;
    std::string reason;  ///< of the summary's flag
    std::array<double, estimator::kParameters> value{}, sigma{};
    std::array<bool, estimator::kParameters> observable{};
    std::vector<double> covariance;  ///< 30 x 30, row-major
};

/// How a campaign ended.
struct Ended {
    std::string state, reason;
    std::string mark;  ///< why the campaign is marked; empty: it is not
    std::string result_json;
    std::int64_t utc_ns = 0;
};

/// The state of the filter, about once a second.
struct EstimateRow {
    drivers::Time time = 0;
    double amplitude_g = 0, frequency_hz = 0, kappa = 1, nis_per_dof = 0;
    std::array<double, 3> innovation_arcsec{};
    std::array<double, estimator::kParameters> value{}, sigma{};
};

/// Something that should be in the recording and is not.
struct Gap {
    drivers::Time from = 0, to = 0;
    std::string stream;  ///< "samples", "frames", "sent frames", ...
    std::uint64_t lost = 0;
    std::string reason;
};

}  // namespace vibrig::record
