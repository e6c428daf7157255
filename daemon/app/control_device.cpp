// Which shaker's controller is at the other end: record and proofs are of one, and of no other.
#include <spdlog/fmt/fmt.h>

#include <utility>

#include "daemon/app/control_loop.hpp"

namespace vibrig {

using commission::Json;
using drivers::Time;

namespace {

constexpr const char* kSaysNothing = "says nothing of itself (function 17)";

}  // namespace

void ControlLoop::watch_device(Time now) {
    if (!configuration_.record_demanded()) return;
    const auto identity = shaker_->identity();
    if (!identity.known) return;
    // Of one that says nothing the plate as it is stated is a key like any other.
    const std::string device = identity.text.empty() ? kSaysNothing : identity.text;
    if (device == device_) return;
    const auto before = std::exchange(device_, device);
    const auto were = book_.standing(utc_now());
    book_.shaker_is(device);
    campaign_.shaker_is(device);
    log(before.empty() ? Severity::info : Severity::alarm, "shaker",
        before.empty() ? fmt::format("its controller: {}{}", device,
                                     identity.text.empty() && configuration_.shaker_plate.empty()
                                         ? ", and shaker.plate is not stated"
                                         : "")
                       : fmt::format("its controller: {}; it was: {}", device, before));
    for (const auto& part : book_.standing(utc_now())) {
        if (part.proven || !were[static_cast<std::size_t>(part.part)].proven) continue;
        log(Severity::alarm, "commissioning",
            fmt::format("{} is void: {}", name_of(part.part), part.why));
        commissioning_.enter(
            {name_of(part.part), "", "", "", "void", Json{{"why", part.why}}.dump()});
    }
    if (!before.empty() && !campaign_.armed_by().empty())
        static_cast<void>(campaign_.command(
            {CommandRequest::Kind::abort, "the daemon: another shaker's controller", ""}, now));
}

/// Why nothing is armed: whose record and proofs they are is not known. Empty: it is.
std::string ControlLoop::device_not_known() const {
    if (!configuration_.record_demanded() || shaker_->identity().known) return {};
    return "the shaker's controller was not asked yet who it is: it is, as soon as it is at rest";
}

}  // namespace vibrig
