#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "daemon/campaign/stages/small_level.hpp"

namespace vibrig::campaign {

/// The loop check on the rig: a look at rest, up to a small level, by a ladder where that is asked
/// for, and what table and platform make of it; before that, from rest each, at every further
/// frequency of the plan, and where it climbs 1 Hz above: an alias moves the other way, and pads
/// answer by their law. Leaves the table vibrating: the proof stops it.
/// Asks once, at the level, for the orders that have to be refused while the table moves.
class LoopChecking : public Stage {
  public:
    explicit LoopChecking(SmallLevel& level) : level_(level) {}

    /// Who has what begins next done, and whether it goes up by a ladder from 0.03 g, each rung
    /// held against the command before the next.
    void aim(const std::string& by, bool climbs);
    void begin(drivers::Time now) override;
    [[nodiscard]] StageStep step(drivers::Time now) override;
    void leave() override { part_ = Part::none; }
    [[nodiscard]] double table_g() const override;
    /// What the amplitude has to do with the command where the check ended before it was steady.
    [[nodiscard]] std::string suspect_unit() const;

  private:
    enum class Part : std::uint8_t {
        none,
        look,
        climb,  ///< to the next rung of the ladder
        rung,   ///< there
        rest,   ///< to it, before another frequency
        ramp,
        settle,
        measure
    };
    void go_on_to(Part part, drivers::Time now);
    [[nodiscard]] StageStep look(drivers::Time now);
    [[nodiscard]] StageStep ramp(Part then, drivers::Time now);
    [[nodiscard]] StageStep stand_on_rung(drivers::Time now);
    [[nodiscard]] StageStep measured();
    [[nodiscard]] StageStep come_to_rest(drivers::Time now);
    /// At rest: up to the level, at the next frequency.
    void next_frequency(drivers::Time now);
    void measured_further();
    /// 1 Hz above against the frequency itself; why not, else empty.
    [[nodiscard]] std::string compare();
    [[nodiscard]] bool at_further() const { return further_at_ < further_.size(); }

    SmallLevel& level_;
    Part part_ = Part::none;
    std::string by_;
    std::vector<double> rungs_;  ///< g at the table
    std::size_t rung_ = 0;
    bool rung_counts_ = false;
    std::vector<Stop> further_;  ///< frequencies, each once
    std::size_t further_at_ = 0;
    double above_hz_ = 0;  ///< one of them: 1 Hz above; 0: it does not climb
    double above_transmission_ = 0;
};

}  // namespace vibrig::campaign
