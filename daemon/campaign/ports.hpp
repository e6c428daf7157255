#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "daemon/campaign/safety_proof.hpp"
#include "daemon/campaign/settings.hpp"
#include "daemon/domain/commands.hpp"
#include "daemon/domain/events.hpp"
#include "daemon/interlock/interlock.hpp"
#include "daemon/rt/dwell_order.hpp"
#include "daemon/rt/stage_feed.hpp"
#include "daemon/status/status.hpp"
#include "drivers/gimbal/gimbal.hpp"
#include "drivers/gimbal/torquer.hpp"
#include "drivers/shaker/shaker.hpp"
#include "estimator/spectrum/sweep.hpp"

namespace vibrig::campaign {

/// What an adaptive campaign does next.
struct Next {
    bool more = false;  ///< else it ends
    Stop stop;
    std::size_t left = 0;  ///< runs, this one included, to be expected
    std::string words;
};

/// What the controller answered when asked what it played in a random dwell that is over.
struct ReportedPsd {
    std::vector<std::array<double, 2>> pairs;  ///< Hz and g^2/Hz at the table, as they came
    std::string why_not;                       ///< why there are none
    double measured_g_rms = 0;  ///< by the controller over the dwell; 0: it reported none
    double power_ratio = 1;     ///< at the platform, of what is configured: Excitation
};
/// And what the dwell is with it; a summary without samples: as it was.
struct Played {
    estimator::DwellSummary summary;
    estimator::PlayedRandom random;
};

/// A stop that is made to happen, by order or by not feeding the watchdog: the amplitude may fall
/// as it likes, and the controller may report a fault; unlinked: and nobody talks to it.
enum class Proving : std::uint8_t { nothing, stop, watchdog, unlinked };

/// What the campaign moves, what it measures of it, and who watches meanwhile. Like the other two
/// ports it is called by the control thread only; a call that has a body may be left out.
class Rig {
  public:
    Rig(drivers::Gimbal& moved, drivers::Shaker& excited) : gimbal(moved), shaker(excited) {}
    Rig(const Rig&) = delete;
    Rig& operator=(const Rig&) = delete;
    virtual ~Rig() = default;

    drivers::Gimbal& gimbal;
    drivers::Shaker& shaker;
    /// What levelling and zeroing act on and are fed from; null: no such stage.
    drivers::Torquer* torquer = nullptr;
    rt::StageFeed* feed = nullptr;

    [[nodiscard]] virtual drivers::PlatformStatus platform() const = 0;
    /// What the accelerometers measure; as it is here, nothing is ever at rest.
    [[nodiscard]] virtual rt::Rest rest(drivers::Time) const { return {}; }
    /// The newest second of force and angles; none: nobody measures it, ever.
    [[nodiscard]] virtual std::optional<rt::MeanMotion> second() const { return {}; }
    /// Why what is measured is not fit to arm on; empty: it is.
    [[nodiscard]] virtual std::string unfit() const { return {}; }

    /// What the interlock has to watch.
    virtual void guard(rt::Guard level) = 0;
    /// What the table is to do (0: nothing, or on its way) and where the gimbals are to be, deg.
    virtual void commanded(double /*table_g*/, const std::array<double, 3>& /*position_deg*/) {}
    /// This is commanded, at the moment it is.
    virtual void ramping(const rt::Ramp&) {}
    /// Platform over table as a loop check in band has measured it.
    virtual void transmission(double) {}
    /// A stop was not obeyed in its time; or was, and all is at rest.
    virtual void disobeyed(bool) {}
    /// The table moves though nothing was asked for.
    virtual void uncommanded() {}
    /// While it shakes the gimbals follow somebody else.
    virtual void gimbals_led() {}
    /// While it shakes nobody says what the gimbals do.
    virtual void gimbals_silent() {}
    /// It moves otherwise than asked for.
    virtual void wrong_vibration() {}
    /// Motion in step and motion across, times what the loop check found; none: not looked for.
    virtual void grown(std::optional<std::array<double, 2>>) {}
    /// How many times is too much, of each.
    [[nodiscard]] virtual std::array<double, 2> grown_limits() const { return {3, 3}; }
    /// What is being proved by making it happen.
    virtual void proving(Proving) {}
};

/// Who measures during a dwell, identifies, and says what comes next.
class Dwells {
  public:
    Dwells() = default;
    Dwells(const Dwells&) = delete;
    Dwells& operator=(const Dwells&) = delete;
    virtual ~Dwells() = default;

    /// A new campaign: earlier dwells are forgotten.
    virtual void begin() {}
    /// False: it cannot be taken.
    [[nodiscard]] virtual bool order(const rt::DwellOrder& order) = 0;
    /// What a sweep has left, before its dwell is done.
    virtual void swept(const estimator::spectrum::Sweep&,
                       const std::vector<std::array<double, 2>>& /*readings*/) {}
    /// After the random dwell that was done last, where Settings::read_psd asks for it: once for
    /// each, and before the next one is ordered.
    [[nodiscard]] virtual Played played(const ReportedPsd&) { return {}; }
    /// No dwell is with the estimator.
    [[nodiscard]] virtual bool free() const { return true; }
    /// A position was levelled, and this is what was torqued out.
    virtual void levelled(const LevelDrift&) {}
    /// Adaptive campaigns: what to do next, at these gimbal angles, after so many s of campaign.
    /// Nothing while it is thought over: to be asked again.
    [[nodiscard]] virtual std::optional<Next> next(const std::array<double, 3>& /*here_deg*/,
                                                   double /*elapsed_s*/) {
        return Next{};
    }
    /// Before an interrupted campaign goes on: why not, else empty.
    [[nodiscard]] virtual std::string resume_gate() const { return {}; }
    /// It goes on, by this person, with the filter as it was.
    virtual void resume(const std::string& /*by*/) {}
    /// The result of what there is.
    virtual void end(bool /*complete*/) {}
};

/// What has to be known afterwards, and people's time.
class Log {
  public:
    Log() = default;
    Log(const Log&) = delete;
    Log& operator=(const Log&) = delete;
    virtual ~Log() = default;

    virtual void event(Severity severity, const std::string& text) = 0;
    /// A position is done, its data with the estimator.
    virtual void position_done(const estimator::DwellInfo&, const estimator::DwellSummary&,
                               const StopDone&) {}
    /// A loop check has its verdict; empty: all in band.
    virtual void loop_checked(const std::string& /*by*/, const std::string& /*out_of_band*/) {}
    /// A proof is over, passed or not.
    virtual void proved(const ProofRecord&) {}
    [[nodiscard]] virtual std::int64_t utc_ns() const { return 0; }
    /// CLOCK_MONOTONIC, whatever clock the rig has: an arming expires in people's time.
    [[nodiscard]] virtual drivers::Time steady_now() const { return drivers::steady_now(); }
};

struct Ports {
    Rig& rig;
    Dwells& dwells;
    Log& log;
};

}  // namespace vibrig::campaign
