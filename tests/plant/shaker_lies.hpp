#pragma once

#include <cstdint>
#include <optional>

namespace vibrig::plant {

/// What the shaker's controller does otherwise than its registers say. The emergency stop cuts the
/// power whatever the controller does, but with the lies of the chain itself.
struct ShakerLies {
    bool ack_without_stop = false;     ///< run = 0 is taken and read back, the table shakes on
    bool timeout_ignored = false;      ///< the watchdog never fires
    double timeout_scaled = 1;         ///< it fires after so many times its register
    bool timeout_if_linked = false;    ///< its time passes only while somebody is connected
    bool timeout_if_unlinked = false;  ///< only while nobody is
    bool estop_contact_only = false;   ///< the open chain is shown, and cuts nothing
    bool estop_unseen = false;         ///< it cuts, and its register shows it closed
    bool estop_restarts = false;       ///< once the chain is closed again it runs as before
    double amplitude_scaled = 1;       ///< the table does so many times what the registers say
    bool readback_echo = false;  ///< the measured amplitude is the set-point, or 0 with run = 0
    /// A stop leaves the table as it is: the controller believes itself at rest and says so.
    bool stuck_contactor = false;
    double slow_ramp = 1;            ///< ramps take so many times their time, a stop's too
    bool unit_rms = false;           ///< amplitudes are rms, set-point and measured
    bool unit_mps2 = false;          ///< amplitudes are m/s^2 peak
    bool dead_table = false;         ///< the table does not move; the measured amplitude is 0
    bool frequency_ignored = false;  ///< a new frequency is taken and read back, not done
    /// Of random vibration: this profile is loaded, whatever number is written and read back; the
    /// checksum is of what is loaded.
    std::optional<std::uint16_t> wrong_profile{};
    double profile_level_wrong =
        0;                      ///< dB, the table does so much more than is commanded and measured
    double profile_tilted = 0;  ///< dB an octave, about the profile, at the same rms
    bool psd_stale = false;     ///< the measured PSD stays what it was
    bool psd_nan = false;       ///< a line of it is no number
    double psd_scaled = 1;      ///< it is so many times what was measured
    bool psd_refused = false;   ///< it cannot be read: exception 4
    bool no_abort_bands = false;  ///< the controller has none, and says so
    /// Sweeps go so many times as fast as is commanded: 0 not at all, below 0 the other way.
    double sweep_rate_scaled = 1;
    bool actual_as_told =
        false;  ///< the register of the frequency shows the sweep that was commanded
    /// Another master keeps this in the watchdog's timeout register, which obeys it; ms, 0: off.
    std::optional<std::uint16_t> timeout_register{};
    bool latched_fault = false;  ///< trips by itself when this begins
};

}  // namespace vibrig::plant
