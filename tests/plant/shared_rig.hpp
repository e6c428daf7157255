#pragma once

#include <mutex>
#include <optional>

#include "tests/plant/faults.hpp"
#include "tests/plant/rig.hpp"

namespace vibrig::plant {

/// The rig as the bus thread and the Modbus thread share it. Everything under one mutex: a request
/// is applied at the present simulated time.
struct SharedRig {
    explicit SharedRig(const Truth& truth) : rig(truth), faults(truth.seed) {}

    [[nodiscard]] double now_s() const noexcept {
        return 1e-6 * static_cast<double>(rig.time_us());
    }

    /// What the faults do to the rig itself, as from now.
    void apply_faults() noexcept {
        const double now = now_s();
        const Fault* noise = faults.active(FaultKind::gyro_noise, now);
        rig.gyro_noise_times(noise == nullptr ? 1 : noise->value);
        const double hz = rig.shaker().table_hz();
        const auto times = [&](FaultKind kind) {
            const Fault* fault = faults.active(kind, now);
            return fault != nullptr && fault->at(hz) ? fault->value : 1;
        };
        rig.grow(times(FaultKind::sync_growth), times(FaultKind::cross_growth));
        const Fault* distorted = faults.active(FaultKind::distorted, now);
        rig.distort(distorted == nullptr ? 0 : distorted->value,
                    distorted == nullptr ? 0 : distorted->hz);
        rig.shaker().lie(lies_at(now, rig.truth().shaker_lies, faults));
        rig.shaker().open_emergency_stop(emergency_stop_by_hand ||
                                         faults.active(FaultKind::estop, now) != nullptr);
    }

    std::mutex mutex;
    Rig rig;
    Faults faults;
    bool emergency_stop_by_hand = false;
    /// In lockstep the rig's time stands there until it is released.
    std::optional<double> hold_at_s;
    /// In lockstep: at most so many times real time from now on; 0: no limit. None: as begun.
    std::optional<double> speed;
};

}  // namespace vibrig::plant
