#include "daemon/app/balance.hpp"

#include <spdlog/fmt/fmt.h>

namespace vibrig {

namespace {
// What the estimator takes from its ring at once, before it frees it.
constexpr std::uint64_t kAtOnce = 32;

std::uint64_t offered(const rt::RingCounts& ring) { return ring.pushed + ring.dropped; }

std::uint64_t ended(const drivers::ShakerCounters& s) {
    return s.replies + s.timeouts + s.exceptions + s.wrong_replies + s.lost;
}
}  // namespace

std::string Balance::look(const Counted& now) {
    std::string found;
    const auto equal = [&found](const char* what, std::uint64_t left, std::uint64_t right) {
        if (left != right) found += fmt::format("{}: {} is not {}; ", what, left, right);
    };
    const auto within = [&found](const char* what, std::uint64_t low, std::uint64_t value,
                                 std::uint64_t high) {
        if (value < low || value > high)
            found += fmt::format("{}: {} is not {} to {}; ", what, value, low, high);
    };
    const auto& a = now.acquisition;
    const auto& e = now.estimator;
    equal("frames received", a.port.received,
          a.port.delivered + a.port.own + a.port.error_frames + a.port.malformed);
    equal("frames delivered", a.port.delivered,
          a.assembler.received + a.rig_ticks + a.increments + a.in_hand);
    equal("frames for samples", a.assembler.received,
          a.assembler.used + a.assembler.unknown + a.assembler.duplicate + a.assembler.late +
              a.assembler.wrong_length);
    equal("samples offered", a.samples_offered, a.assembler.samples);
    within("samples for the estimator", offered(before_.ring), a.samples_offered,
           offered(now.ring));
    if (now.recorder)
        within("samples for the recorder", offered(before_.recorder.value_or(rt::RingCounts{})),
               a.samples_offered, offered(*now.recorder));
    equal("samples taken", e.taken, e.in_dwell + e.idle);
    within("samples out of the ring", 0, e.taken, now.ring.popped + kAtOnce);
    // One may be in flight.
    within("requests to the shaker",
           before_.shaker.requests - (before_.shaker.requests > 0 ? 1 : 0), ended(now.shaker),
           now.shaker.requests);
    equal("entries of the journal", now.journal.taken, now.journal.written + now.journal.waiting);
    equal("lines logged", now.log.taken, now.log.written + now.log.dropped + now.log.waiting);
    before_ = now;
    return found;
}

}  // namespace vibrig
