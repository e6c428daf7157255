#pragma once

#include <cstdint>
#include <string>

#include "daemon/campaign/stages/small_level.hpp"

namespace vibrig::campaign {

/// Before anything shakes: a controller that nobody has seen run yet is run at 0 g, stopped by
/// order, then left to its watchdog twice, once while it is read on, once with the link closed.
/// What it reports of itself is timed, and that neither table nor platform feels anything of it.
class ZeroRun : public Stage {
  public:
    explicit ZeroRun(SmallLevel& level) : level_(level) {}

    /// Who has what begins next done; `brief`: one run, as for a button that is to be pressed.
    void aim(const std::string& by, bool brief) {
        by_ = by;
        brief_ = brief;
    }
    void begin(drivers::Time now) override;
    [[nodiscard]] StageStep step(drivers::Time now) override;
    void leave() override { part_ = Part::none; }
    /// Nobody reads the controller: it is on its own for a while.
    [[nodiscard]] bool hung_up() const { return part_ == Part::ends && round_ == Round::closed; }
    /// At what it was, for a person: "; at 0 g, ..."; empty: not under way.
    [[nodiscard]] std::string where() const;

  private:
    enum class Part : std::uint8_t {
        none,
        look,   ///< at rest, before
        start,  ///< run = 1
        runs,
        ends,   ///< by order, or because nobody feeds its watchdog
        stays,  ///< as it is then
        clear,  ///< the watchdog's fault
        rest
    };
    /// Stopped by order; starved while it is read on; starved with the link closed.
    enum class Round : std::uint8_t { ordered, starved, closed };

    void go_on_to(Part part, drivers::Time now);
    // One for each part; why it was not proved, else empty.
    [[nodiscard]] std::string look(drivers::Time now);
    [[nodiscard]] std::string start(drivers::Time now);
    [[nodiscard]] std::string run(drivers::Time now);
    [[nodiscard]] std::string judge_run();
    [[nodiscard]] std::string stopped(drivers::Time now);
    [[nodiscard]] std::string starved(drivers::Time now);
    [[nodiscard]] std::string stay(drivers::Time now);
    [[nodiscard]] std::string cleared(drivers::Time now);
    /// Empty if the newest row of the proof has passed.
    [[nodiscard]] std::string unless_passed(const std::string& why) const;
    [[nodiscard]] drivers::Time length() const;

    SmallLevel& level_;
    Part part_ = Part::none;
    Round round_ = Round::ordered;
    std::string by_;
    bool brief_ = false;
    StopTimes times_;
    double measured_g_ = 0;  ///< by the controller, the highest of a run
};

}  // namespace vibrig::campaign
