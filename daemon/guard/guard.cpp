#include "daemon/guard/guard.hpp"

#include <string_view>
#include <utility>

namespace vibrig::guard {

namespace {

constexpr auto kLook = std::chrono::milliseconds(50);

/// A number no earlier life has given: the clock's, in ms.
std::uint64_t first_finding() {
    return static_cast<std::uint64_t>(std::chrono::duration_cast<std::chrono::milliseconds>(
                                          std::chrono::system_clock::now().time_since_epoch())
                                          .count());
}

}  // namespace

Guard::Guard(boost::asio::io_context& io, const Settings& settings)
    : settings_(settings),
      timer_(io),
      port_(drivers::make_can_port(io, settings.can)),
      witnesses_(settings.witness),
      shaker_(settings.shaker),
      meeting_(settings.socket),
      judge_(settings.judge, first_finding()),
      alarm_(settings.alarm) {}

void Guard::start() {
    port_->start(
        [this](std::span<const drivers::ReceivedFrame> frames) { witnesses_.take(frames); },
        [](drivers::PortState, const char* text) { say("info", text); },
        [](const drivers::ReceivedFrame&) {});
    look();
}

void Guard::stop() {
    timer_.cancel();
    port_->stop();
}

void Guard::look_later() {
    timer_.expires_after(kLook);
    timer_.async_wait([this](const boost::system::error_code& error) {
        if (!error) look();
    });
}

void Guard::look() {
    const auto now = drivers::steady_now();
    const bool asked = meeting_.attend(now);
    const auto shaker = shaker_.word(now);
    witnesses_.doubt(now, shaker.known ? shaker.measured_g : 0);
    sight_ = witnesses_.sight(now);
    judge_.judge({now, witnesses_.time(now), sight_, shaker, meeting_.word(), meeting_.heard()});
    alarm_.show(judge_.tune());
    // Before the shaker, whose answer may take its time.
    if (asked) meeting_.tell(word(now));
    tell_findings();
    shaker_.step(now, judge_.stop_wanted());
    tell_links(now);
    look_later();
}

void Guard::acknowledge() {
    if (judge_.acknowledge()) {
        say("info", "acknowledged by hand");
    } else {
        say("warning", "not acknowledged: the table is not measured to be at rest");
    }
}

void Guard::tell_findings() {
    if (judge_.cause() != proto::GuardCause::none && judge_.finding() != reported_finding_) {
        reported_finding_ = judge_.finding();
        reported_disobeyed_ = reported_over_ = false;
        const std::string text = std::string(proto::name_of(judge_.cause())) + ": " +
                                 proto::text_of(judge_.cause()) + "; " + words();
        say("alarm", text);
        if (judge_.cause() != proto::GuardCause::stop_disobeyed) alarm_.page(Tune::stop, text);
    }
    if (judge_.disobeyed() && !std::exchange(reported_disobeyed_, true)) {
        const std::string text = proto::text_of(proto::GuardCause::stop_disobeyed);
        say("alarm", text);
        alarm_.page(Tune::disobeyed, text);
    }
    if (judge_.cause() == proto::GuardCause::none && !std::exchange(reported_over_, true))
        say("info", "acknowledged, watching");
}

void Guard::tell_links(drivers::Time now) {
    const bool silent = !meeting_.word() ||
                        drivers::to_seconds(now - meeting_.heard()) > safety::kHeartbeatDeadline_s;
    if (std::exchange(reported_silent_, silent) != silent)
        say(silent ? "warning" : "info", silent ? "vibrigd is silent" : "vibrigd is heard");
    if (std::exchange(reported_blind_, !sight_.known()) != !sight_.known())
        say(sight_.known() ? "info" : "warning",
            sight_.known() ? "an accelerometer is seen" : "no accelerometer is seen");
    const auto tell_stuck = [](bool& reported, bool stuck, const std::string& where) {
        if (std::exchange(reported, stuck) == stuck) return;
        say(stuck ? "warning" : "info",
            "accelerometer of the " + where +
                (stuck ? " is stuck: it does not move although the table shakes, and its "
                         "stillness is not taken for rest"
                       : " moves again"));
    };
    tell_stuck(reported_table_stuck_, sight_.table_stuck, "table");
    tell_stuck(reported_platform_stuck_, sight_.platform_stuck, "platform");
    const auto tell_frozen = [](bool& reported, bool frozen, const std::string& where) {
        if (std::exchange(reported, frozen) == frozen) return;
        say(frozen ? "warning" : "info",
            "accelerometer of the " + where +
                (frozen ? " is frozen: its noise is gone, and what it shows is not believed"
                        : " shows its noise again"));
    };
    tell_frozen(reported_table_frozen_, sight_.table_frozen, "table");
    tell_frozen(reported_platform_frozen_, sight_.platform_frozen, "platform");
    const bool unreached = !shaker_.word(now).known;
    if (std::exchange(reported_shaker_, unreached) != unreached)
        say(unreached ? "warning" : "info",
            unreached ? "the shaker is not reached: " + shaker_.note() : "the shaker is reached");
}

proto::GuardWord Guard::word(drivers::Time now) const {
    proto::GuardWord word;
    word.sequence = meeting_.word() ? meeting_.word()->sequence : 0;
    word.cause = judge_.cause();
    word.finding = judge_.finding();
    word.disobeyed = judge_.disobeyed();
    word.sees = sight_.known();
    word.rest = judge_.rests();
    word.reaches_shaker = shaker_.word(now).known;
    word.horn_confirms = alarm_.confirms();
    word.table_g = sight_.table_g;
    std::string_view(VIBRIG_VERSION).copy(word.version.data(), word.version.size() - 1);
    return word;
}

std::string Guard::words() const {
    const auto now = drivers::steady_now();
    const auto shaker = shaker_.word(now);
    const auto of = [](bool there, const Motion& motion, bool stuck, bool frozen) {
        if (!there) return std::string("none");
        if (stuck) return std::string("stuck");
        if (frozen) return std::string("frozen");
        return motion.known ? std::to_string(motion.rest_g) + " g rms" : std::string("not seen");
    };
    return "table accelerometer " +
           of(sight_.has_table, sight_.table, sight_.table_stuck, sight_.table_frozen) +
           ", platform " +
           of(sight_.has_platform, sight_.platform, sight_.platform_stuck, sight_.platform_frozen) +
           ", shaker " + (shaker.known ? (shaker.runs ? "runs" : "does not run") : "not reached") +
           ", vibrigd " +
           (!meeting_.word() ? "never heard"
            : meeting_.word()->armed
                ? meeting_.word()->excitation ? "says armed" : "says armed, no excitation"
            : meeting_.word()->excitation ? "says excitation"
                                          : "says disarmed");
}

}  // namespace vibrig::guard
