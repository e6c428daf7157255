// A proof that vibrig commission began is ended where its tool is gone: nobody watches the table.
#include <spdlog/fmt/fmt.h>

#include <string_view>

#include "daemon/app/control_loop.hpp"
#include "daemon/commission/procedure.hpp"

namespace vibrig {

using drivers::Time;

namespace {

constexpr std::string_view kAttended = "attended";

}  // namespace

/// Of a self-test's argument, which the campaign does not know of. One that is under way keeps its
/// person, whoever asks for another.
void ControlLoop::take_attendance(CommandRequest& request) {
    if (request.kind != CommandRequest::Kind::selftest) return;
    std::string& asked = request.argument;
    const bool attended = asked.starts_with(kAttended);
    if (attended) {
        asked.erase(0, kAttended.size());
        asked.erase(0, asked.find_first_not_of(' '));
    }
    if (arming_ || campaign_.checking()) return;
    attendance_.reset();
    if (!attended) return;
    attendance_ = Attendance{request.by, drivers::steady_now()};
}

void ControlLoop::watch_attendance(Time now) {
    if (!attendance_) return;
    if (arming_) {  // it is being written to disk, and its tool waits for that
        attendance_->steady = drivers::steady_now();
        return;
    }
    if (!campaign_.checking()) return attendance_.reset();
    constexpr Time kAbsent = commission::Procedure::kAbsent;
    if (drivers::steady_now() - attendance_->steady <= kAbsent) return;
    const std::string by = attendance_->by;
    attendance_.reset();
    static_cast<void>(campaign_.command(
        {CommandRequest::Kind::abort,
         fmt::format("vibrigd, since nobody has been at the tool of {} for {:.0f} s", by,
                     drivers::to_seconds(kAbsent)),
         ""},
        now));
}

/// Nothing is armed by it, and nothing shakes: gimbals move, while somebody stands beside them.
void ControlLoop::begin_rest_check(WaitingCommand& waiting, Time now) {
    const CommandRequest& request = waiting.request;
    std::string why;
    if (!attendance_)
        why = "opening check: found nobody at its tool, expected vibrig selftest --rest at the rig";
    // Before it is known which way they turn only commissioning moves gimbals.
    if (why.empty()) why = book_.refusal(utc_now(), commission::Part::gimbals);
    if (why.empty()) why = outside_.refuses(request);
    answer(waiting, why.empty() ? campaign_.command(request, now) : CommandReply{false, why});
}

}  // namespace vibrig
