// dwells.csv beside the raw log, in its times: which frames belong to which dwell, and what else is
// needed to identify from the log alone. Lines that the recorder appends, and their reader.
#pragma once

#include <cstdint>
#include <string>

#include "daemon/record/campaign_file.hpp"
#include "daemon/record/records.hpp"

namespace vibrig::record {

/// Header of the orders. Older files end before sweep_from_hz, profile, frequency_hz, power_lost or
/// begin_s.
inline constexpr const char* kDwellsHeader =
    "run,position,table_g,from_s,to_s,cancelled_s,utc_offset_us,zero_x_g,zero_y_g,zero_z_g,"
    "level_sigma_g,noise_angle_arcsec,noise_walk_x,noise_walk_y,noise_walk_z,begin_s,"
    "power_lost,frequency_hz,held_out,profile,level_db,random_mean_square_g2,random_bandwidth_hz,"
    "random_gain_error,random_highest_hz,sweep_from_hz,sweep_to_hz,sweep_s";
[[nodiscard]] std::string order_line(Order order, std::int64_t utc_offset_ns);
/// The daemon was started again and went on after so many dwells.
[[nodiscard]] std::string restart_line(std::size_t dwells);
/// What the controller reported of a sweep's frequency, as JSON [run, position, [[us, ns beyond
/// them, Hz], ..]].
[[nodiscard]] std::string swept_line(const Swept& swept, std::int64_t utc_offset_ns);
/// Behind the order of a random dwell what the controller reports as played, as JSON [run,
/// position, word, mean_square_g2, bandwidth_hz, gain_error, highest_hz, share seen, its error,
/// [[Hz, g^2/Hz], ..]].
[[nodiscard]] std::string played_line(const Played& played);
/// At the end: the result is not the live one, but identified anew, with this noise.
[[nodiscard]] std::string anew_line(const noise::Found& found);

/// Orders, sweeps, what was played, and the clock's offset. Throws std::runtime_error with place,
/// value and what was expected.
void read_dwells(const std::string& path, Campaign& to);

}  // namespace vibrig::record
