#pragma once

#include <cstddef>
#include <deque>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "daemon/campaign/settings.hpp"
#include "daemon/rt/dwell_order.hpp"
#include "daemon/rt/interlock.hpp"
#include "daemon/status.hpp"
#include "drivers/gimbal.hpp"
#include "drivers/shaker.hpp"

namespace vibrig::campaign {

/// What a campaign acts on and reports to. All calls come from the control thread.
struct Ports {
    drivers::Gimbal& gimbal;
    drivers::Shaker& shaker;
    std::function<drivers::PlatformStatus()> platform;
    std::function<bool(const rt::DwellOrder&)> order_dwell;
    std::function<void(rt::Guard)> guard;    ///< what the interlock has to watch
    std::function<bool()> estimator_free;    ///< no dwell is with the estimator
    std::function<void()> begin;             ///< a new campaign: forget earlier dwells
    std::function<void(bool complete)> end;  ///< write what there is
    std::function<void(Severity, const std::string&)> event;
};

/// The campaign as a state machine: for each run and position slew, ramp, settle, record, rest.
/// Moved on by step(), which never waits. The shaker moves only between a named person's arm() and
/// the end of that campaign; gimbals slew only while it is at rest. Control thread only.
class Campaign {
  public:
    Campaign(const Settings& settings, Ports ports);

    CommandReply command(const CommandRequest& request, drivers::Time now);
    /// Does what is due at `now`; returns when to be called next at the latest.
    drivers::Time step(drivers::Time now);
    void on_dwell_done(const estimator::DwellSummary& summary);
    /// An interlock has ordered the stop; latches until acknowledged.
    void on_trip(const std::string& cause, drivers::Time now);
    /// Ramps down and ends; step() goes on until done() is true.
    void shut_down(drivers::Time now);
    [[nodiscard]] bool done() const;
    void fill(StatusData& status, drivers::Time now) const;

  private:
    struct Place {
        std::size_t run = 0, position = 0;  ///< from 0
    };

    drivers::Time step_once(drivers::Time now);
    drivers::Time wait_for_platform(drivers::Time now);
    drivers::Time slew(drivers::Time now);
    drivers::Time ramp(drivers::Time now);
    drivers::Time record(drivers::Time now);
    drivers::Time rest(drivers::Time now);
    void enter(CampaignState state, drivers::Time now);
    void next_position(drivers::Time now);
    void start_position(drivers::Time now);
    void abort(const std::string& why, drivers::Time now);
    void end(CampaignState state, const std::string& why, drivers::Time now);
    void leave_dwell();
    [[nodiscard]] std::string not_fit_to_excite() const;
    [[nodiscard]] bool vibrating_as_commanded(const drivers::ShakerReading& reading) const;
    [[nodiscard]] double table_g() const { return settings_.table_g[place_.run]; }
    [[nodiscard]] bool active() const;

    Settings settings_;
    Ports ports_;
    CampaignState state_ = CampaignState::idle;
    drivers::Time entered_ = 0;  ///< when state_ began
    drivers::Time started_ = 0;  ///< when the campaign began
    Place place_;
    std::string armed_by_;
    std::string reason_;
    bool pause_asked_ = false;
    bool shutting_down_ = false;
    bool stop_sent_ = false;  ///< within rest(): the ramp down took too long
    bool requested_ = false;  ///< within ramp() and rest(): the set-point was accepted
    bool may_move_ = false;   ///< a level was asked for and rest has not been read back since
    bool dwell_ordered_ = false;
    bool dwell_done_ = false;
    drivers::Time dwell_from_ = 0;
    drivers::Time dwell_to_ = 0;
    std::size_t positions_done_ = 0;
    std::vector<estimator::DwellSummary> dwells_;
    std::deque<std::pair<drivers::Time, double>> temperatures_;
};

}  // namespace vibrig::campaign
