// Columns of the tables of a campaign's file: names, units and what they mean, in the order in
// which CampaignWriter puts a row.
#pragma once

#include <vector>

#include "daemon/record/hdf5.hpp"

namespace vibrig::record {

[[nodiscard]] std::vector<hdf5::ColumnSpec> sample_columns();
/// `rows`: of the interlock's table; none, no columns for them.
[[nodiscard]] std::vector<hdf5::ColumnSpec> condition_columns(std::size_t rows);
[[nodiscard]] std::vector<hdf5::ColumnSpec> gap_columns();
[[nodiscard]] std::vector<hdf5::ColumnSpec> order_columns();
[[nodiscard]] std::vector<hdf5::ColumnSpec> swept_columns();
[[nodiscard]] std::vector<hdf5::ColumnSpec> played_columns();
[[nodiscard]] std::vector<hdf5::ColumnSpec> psd_columns();
[[nodiscard]] std::vector<hdf5::ColumnSpec> dwell_columns();
[[nodiscard]] std::vector<hdf5::ColumnSpec> estimate_columns();
[[nodiscard]] std::vector<hdf5::ColumnSpec> event_columns();

}  // namespace vibrig::record
