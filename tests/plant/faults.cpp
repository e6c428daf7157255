#include "tests/plant/faults.hpp"

#include <algorithm>

namespace vibrig::plant {
namespace {

bool in_force(const Fault& fault, double time_s) noexcept {
    return time_s >= fault.from_s && time_s < fault.to_s;
}

double& value_of(Sample& sample, std::size_t channel) noexcept {
    return channel < 3 ? sample.readings.encoder_deg[channel] : sample.readings.raw_g[channel - 3];
}

}  // namespace

const Fault* Faults::active(FaultKind kind, double time_s) const noexcept {
    for (const Fault& fault : faults_) {
        if (fault.kind == kind && in_force(fault, time_s)) return &fault;
    }
    return nullptr;
}

ShakerLies lies_at(double time_s, ShakerLies lies, const Faults& faults) noexcept {
    const auto yes = [&](FaultKind kind, bool& lie) {
        if (faults.active(kind, time_s) != nullptr) lie = true;
    };
    const auto value = [&](FaultKind kind, double& lie) {
        if (const Fault* fault = faults.active(kind, time_s)) lie = fault->value;
    };
    yes(FaultKind::ack_without_stop, lies.ack_without_stop);
    yes(FaultKind::timeout_ignored, lies.timeout_ignored);
    value(FaultKind::timeout_scaled, lies.timeout_scaled);
    yes(FaultKind::timeout_if_linked, lies.timeout_if_linked);
    yes(FaultKind::timeout_if_unlinked, lies.timeout_if_unlinked);
    yes(FaultKind::estop_contact_only, lies.estop_contact_only);
    yes(FaultKind::estop_unseen, lies.estop_unseen);
    yes(FaultKind::estop_restarts, lies.estop_restarts);
    value(FaultKind::amplitude_scaled, lies.amplitude_scaled);
    yes(FaultKind::readback_echo, lies.readback_echo);
    yes(FaultKind::stuck_contactor, lies.stuck_contactor);
    value(FaultKind::slow_ramp, lies.slow_ramp);
    yes(FaultKind::unit_rms, lies.unit_rms);
    yes(FaultKind::unit_mps2, lies.unit_mps2);
    yes(FaultKind::dead_table, lies.dead_table);
    yes(FaultKind::frequency_ignored, lies.frequency_ignored);
    if (const Fault* fault = faults.active(FaultKind::wrong_profile, time_s))
        lies.wrong_profile = static_cast<std::uint16_t>(fault->value);
    value(FaultKind::profile_level_wrong, lies.profile_level_wrong);
    yes(FaultKind::no_abort_bands, lies.no_abort_bands);
    value(FaultKind::profile_tilted, lies.profile_tilted);
    yes(FaultKind::psd_stale, lies.psd_stale);
    yes(FaultKind::psd_nan, lies.psd_nan);
    value(FaultKind::psd_scaled, lies.psd_scaled);
    yes(FaultKind::psd_refused, lies.psd_refused);
    value(FaultKind::sweep_rate_scaled, lies.sweep_rate_scaled);
    yes(FaultKind::actual_as_told, lies.actual_as_told);
    if (const Fault* fault = faults.active(FaultKind::timeout_register, time_s))
        lies.timeout_register = static_cast<std::uint16_t>(fault->value);
    yes(FaultKind::latched_fault, lies.latched_fault);
    return lies;
}

void Faults::spoil(Sample& sample, double time_s) {
    std::array<bool, kChannels> stuck{};
    for (const Fault& fault : faults_) {
        if (!in_force(fault, time_s)) continue;
        for (std::size_t c = 0; c < kChannels; ++c) {
            if (fault.channel && *fault.channel != c) continue;
            if (fault.kind == FaultKind::spike && c < 3 && hit(fault.rate)) {
                value_of(sample, c) = quantise_angle(value_of(sample, c) + fault.value, 20);
            } else if (fault.kind == FaultKind::out_of_range) {
                value_of(sample, c) = 1e9;  // the encoder of the frame clamps it to all bits set
            } else if (fault.kind == FaultKind::flag) {
                sample.valid[c] = false;
            } else if (fault.kind == FaultKind::stuck) {
                stuck[c] = true;
            }
        }
    }
    for (std::size_t c = 0; c < kChannels; ++c) {
        if (!stuck[c] || !held_[c]) held_[c] = value_of(sample, c);
        value_of(sample, c) = *held_[c];
    }
}

void Faults::spoil(std::vector<can_frame>& frames, double time_s) {
    std::vector<can_frame> out;
    out.reserve(2 * frames.size() + delayed_.size());
    while (!delayed_.empty() && delayed_.front().due_s <= time_s + 1e-9) {
        out.push_back(delayed_.front().frame);
        delayed_.pop_front();
    }
    const auto rate_of = [&](FaultKind kind) {
        const Fault* fault = active(kind, time_s);
        return fault == nullptr ? 0.0 : fault->value;
    };
    const double lose = rate_of(FaultKind::lose);
    const double duplicate = rate_of(FaultKind::duplicate);
    const double reorder = rate_of(FaultKind::reorder);
    const double shorten = rate_of(FaultKind::shorten);
    const Fault* late = active(FaultKind::late, time_s);
    for (can_frame& frame : frames) {
        if (lose > 0 && hit(lose)) {
            ++lost_;
            continue;
        }
        if (shorten > 0 && hit(shorten)) frame.len = 3;
        if (late != nullptr && hit(late->rate)) {
            delayed_.push_back({time_s + late->value * 1e-3, frame});
            continue;
        }
        out.push_back(frame);
        if (duplicate > 0 && hit(duplicate)) out.push_back(frame);
    }
    if (reorder > 0) {
        for (std::size_t i = 0; i + 1 < out.size(); ++i) {
            if (hit(reorder)) std::swap(out[i], out[i + 1]);
        }
    }
    if (active(FaultKind::bus_silent, time_s) != nullptr) {
        lost_ += out.size();
        out.clear();
    }
    frames = std::move(out);
}

}  // namespace vibrig::plant
