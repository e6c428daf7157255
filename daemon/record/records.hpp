#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "daemon/rt/dwell_order.hpp"
#include "daemon/rt/frame_record.hpp"
#include "daemon/status.hpp"
#include "drivers/sample.hpp"
#include "estimator/identification.hpp"

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
    std::size_t dwells_before = 0;  ///< of a campaign that goes on after a restart
};

/// A dwell as it was ordered from the estimator.
struct Order {
    drivers::Time announced = 0;
    drivers::Time from = 0, to = 0;
    int run = 0, position = 0;
    double table_g = 0;
    bool cancel = false;
};

/// A dwell that is over, and what was known after it.
struct Dwell {
    drivers::Time time = 0;
    estimator::DwellSummary summary;
    std::string reason;  ///< of the summary's flag
    std::array<double, estimator::kParameters> value{}, sigma{};
    std::array<bool, estimator::kParameters> observable{};
    std::vector<double> covariance;  ///< 30 x 30, row-major
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
