#pragma once

#include <boost/asio/basic_waitable_timer.hpp>
#include <boost/asio/io_context.hpp>
#include <chrono>
#include <memory>
#include <string>

#include "daemon/guard/alarm.hpp"
#include "daemon/guard/judge.hpp"
#include "daemon/guard/meeting.hpp"
#include "daemon/guard/settings.hpp"
#include "daemon/guard/shaker_line.hpp"
#include "daemon/guard/witnesses.hpp"
#include "drivers/can/can_port.hpp"

namespace vibrig::guard {

/// Joins the parts: one thread, one loop, a look twenty times a second. Only horn and pager have a
/// thread of their own, so that they hold up no stop.
class Guard {
  public:
    /// Throws SettingsError, DbcError, CanError, ShakerError, std::runtime_error.
    Guard(boost::asio::io_context& io, const Settings& settings);
    void start();
    void stop();
    /// By hand, where there is no daemon to acknowledge with.
    void acknowledge();
    [[nodiscard]] std::string words() const;

  private:
    using Timer = boost::asio::basic_waitable_timer<std::chrono::steady_clock>;
    void look();
    void look_later();
    void tell_findings();
    void tell_links(drivers::Time now);
    [[nodiscard]] proto::GuardWord word(drivers::Time now) const;

    Settings settings_;
    Timer timer_;
    std::unique_ptr<drivers::CanPort> port_;
    Witnesses witnesses_;
    ShakerLine shaker_;
    Meeting meeting_;
    Judge judge_;
    Alarm alarm_;
    Sight sight_;

    std::uint64_t reported_finding_ = 0;
    bool reported_disobeyed_ = false, reported_over_ = true;
    bool reported_table_stuck_ = false, reported_platform_stuck_ = false;
    bool reported_table_frozen_ = false, reported_platform_frozen_ = false;
    bool reported_silent_ = true, reported_blind_ = true, reported_shaker_ = true;
};

}  // namespace vibrig::guard
