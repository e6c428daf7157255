#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <string>

#include "daemon/app/parts.hpp"
#include "daemon/app/supervisor.hpp"
#include "daemon/watch/guard_link.hpp"

namespace vibrig {

/// Who watches from outside: vibrig-guard, and the people that horn and pager reach. Control
/// thread, once it runs.
class Outside {
  public:
    Outside(Parts& parts, const Supervisor& supervisor);
    ~Outside() { events_.page_by(nullptr); }
    Outside(const Outside&) = delete;
    Outside& operator=(const Outside&) = delete;

    /// Horn and pager from now on; the guard once it is started.
    void open();
    void start() {
        if (guard_link_) guard_link_->start();
    }
    void stop() {
        if (guard_link_) guard_link_->stop();
    }
    /// Hears the guard, tells the interlock, and shows people how it stands: `tripped`, a trip is
    /// latched; `alarm`, a row of the table alarms.
    void watch(bool tripped, bool alarm);
    /// Why the guard lets nothing be armed; empty: it does.
    [[nodiscard]] std::string refuses(const CommandRequest& request) const;
    /// What the guard has found and nobody has acknowledged; empty: nothing.
    [[nodiscard]] std::string guard_found() const;
    /// Why the guard does not watch, as "is not heard"; empty: it does, or there is none.
    [[nodiscard]] const std::string& guard_lacks() const noexcept { return guard_lacks_; }
    /// What the guard has found was seen by a person.
    void acknowledge();
    /// For the guard: by a named person, up to this level, peak at the table; 0: nothing is.
    void armed(bool by_somebody, double highest_g, double platform_ratio) noexcept;
    /// Any thread.
    void fill(StatusData& status) const;

  private:
    /// What vibrig-guard gets of this daemon; its link's thread.
    [[nodiscard]] proto::DaemonWord word();
    void show(bool tripped, bool alarm);

    Parts& parts_;
    const Supervisor& supervisor_;
    Events& events_ = parts_.events;

    std::unique_ptr<watch::GuardLink> guard_link_;  ///< null: there is no guard
    std::unique_ptr<drivers::Annunciator> annunciator_;
    watch::GuardEyes guard_eyes_;
    std::string guard_lacks_;
    bool guard_was_heard_ = false, guard_was_disobeyed_ = false;
    std::uint64_t guard_finding_ = 0;  ///< the one that tripped
    std::atomic<bool> armed_{false};
    std::atomic<double> armed_g_{0}, platform_ratio_{1};
    std::array<std::uint64_t, 2> marks_{};  ///< guard link's thread
};

}  // namespace vibrig
