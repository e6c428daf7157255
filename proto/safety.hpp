#pragma once

// What rest, motion, too much and too late mean: one place for the daemon and for the guard that
// does not trust it.
namespace vibrig::safety {

/// At rest: rms of the norm of the specific force less its mean, g, over a window, s.
inline constexpr double kRest_g = 0.02;
inline constexpr double kRestWindow_s = 0.5;
/// Above this rms it moves; in between nothing is concluded. A hand on the table stays below.
inline constexpr double kMoving_g = 0.05;
/// From the order to stop until table and controller are at rest, s; bounds of the key.
inline constexpr double kStopDeadline_s = 3;
inline constexpr double kLeastStopDeadline_s = 1, kMostStopDeadline_s = 30;
/// What a platform on its pads may take longer than the table below it, s.
inline constexpr double kRingDown_s = 3;

/// Over the armed level by so much for so long is a trip.
inline constexpr double kOverArmed_dB = 1;
inline constexpr double kOverArmed_s = 0.5;
/// Motion that nobody armed is a trip after this, s.
inline constexpr double kUnarmedMotion_s = 1;

/// Daemon and guard hear from each other so often, s, and count as gone after so long.
inline constexpr double kHeartbeat_s = 0.2;
inline constexpr double kHeartbeatDeadline_s = 1;
/// A stage of the daemon that makes no progress for so long hangs, s.
inline constexpr double kProgressDeadline_s = 2;

}  // namespace vibrig::safety
