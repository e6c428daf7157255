// A proof that vibrig commission began is ended where its tool is gone: nobody watches the table.
#include <spdlog/fmt/fmt.h>

#include <string_view>

#include "daemon/app/control_loop.hpp"

namespace vibrig {

using drivers::Time;

namespace {

constexpr std::string_view kAttended = "attended";

}  // namespace

/// Of a self-test's argument, which the campaign does not know of.
void ControlLoop::take_attendance(CommandRequest& request) {
    if (request.kind != CommandRequest::Kind::selftest) return;
    attendance_.reset();
    std::string& asked = request.argument;
    if (!asked.starts_with(kAttended)) return;
    asked.erase(0, kAttended.size());
    asked.erase(0, asked.find_first_not_of(' '));
    attendance_ = Attendance{request.by, rt::wall_clock()};
}

void ControlLoop::watch_attendance(Time now) {
    if (!attendance_) return;
    if (arming_) {  // it is being written to disk, and its tool waits for that
        attendance_->wall = rt::wall_clock();
        return;
    }
    if (!campaign_.checking()) return attendance_.reset();
    constexpr Time kAbsent = commission::Procedure::kAbsent;
    if (rt::wall_clock() - attendance_->wall <= kAbsent) return;
    const std::string by = attendance_->by;
    attendance_.reset();
    static_cast<void>(campaign_.command(
        {CommandRequest::Kind::abort,
         fmt::format("vibrigd, since nobody has been at the tool of {} for {:.0f} s", by,
                     drivers::to_seconds(kAbsent)),
         ""},
        now));
}

}  // namespace vibrig
