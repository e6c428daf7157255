#pragma once

#include <string>
#include <vector>

namespace vibrig::v1 {
class Event;
class Status;
}  // namespace vibrig::v1

/// The status as people read it in a terminal. Pure: message in, text out; no line is wider than
/// `width` columns. Of a simulated rig every line ends with SIMULATED.
namespace vibrig::serve {

/// From two statuses of one daemon. Per second of the daemon's clock, since a simulated rig may run
/// faster.
struct Rates {
    bool known = false;
    double samples_per_s = 0;
    double frames_per_s = 0;
    double speed = 1;  ///< daemon's time over wall time, 1
};
/// Unknown when the daemon has started anew in between or its clock stood still.
[[nodiscard]] Rates rates_between(const v1::Status& before, const v1::Status& after, double wall_s);

using Lines = std::vector<std::string>;

/// State, place, progress, shaker, links, losses: a screenful without the coefficients.
[[nodiscard]] Lines render_summary(const v1::Status& status, const Rates& rates, int width);
/// 10 kinds by 3 gyros with 1 sigma; fewer columns where the terminal is narrow.
[[nodiscard]] Lines render_coefficients(const v1::Status& status, int width);
/// Both, as `vibrig watch` shows them.
[[nodiscard]] Lines render_table(const v1::Status& status, const Rates& rates, int width);
/// One line for logs and pipes.
[[nodiscard]] std::string render_line(const v1::Status& status);
/// True where render_line would tell nothing new: same state, place, reason and links.
[[nodiscard]] bool same_place(const v1::Status& a, const v1::Status& b);
[[nodiscard]] std::string render_event(const v1::Event& event);

/// "1 h 02 min", "12 min 30 s", "4 s".
[[nodiscard]] std::string render_duration(double seconds);
/// Without control characters (a text from the wire must not steer the terminal), at most `width`
/// columns.
[[nodiscard]] std::string clipped(const std::string& text, int width);

}  // namespace vibrig::serve
