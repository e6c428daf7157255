#pragma once

namespace vibrig {

/// Samples per second where the configuration does not state can.sample_rate_hz: of the daemon and
/// of the guard that reads the same file. Nothing else knows a rate that it was not given.
inline constexpr double kUnstatedSampleRate_hz = 40;

}  // namespace vibrig
