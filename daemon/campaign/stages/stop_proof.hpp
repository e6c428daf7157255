#pragma once

#include <cstdint>
#include <string>

#include "daemon/campaign/stages/small_level.hpp"

namespace vibrig::campaign {

/// The safe-state proof on the rig: the table, vibrating at the loop check's level, is stopped by
/// order, then by starving its watchdog, and if a person presses it by the emergency stop; each is
/// timed by those who can tell, never by the controller's word alone.
class StopProof : public Stage {
  public:
    explicit StopProof(SmallLevel& level) : level_(level) {}

    /// Whether what begins next has the emergency stop pressed, too.
    void with_press(bool wanted) {
        press_wanted_ = wanted;
        pressed_ = Pressed::no;
    }
    [[nodiscard]] bool wants_press() const { return press_wanted_; }
    void begin(drivers::Time now) override;
    /// After the run at 0 g: the emergency stop alone, pressed while the controller runs there.
    void begin_at_zero(drivers::Time now);
    [[nodiscard]] StageStep step(drivers::Time now) override;
    void leave() override { part_ = Part::none; }
    [[nodiscard]] double table_g() const override;

    /// A person is asked to press it.
    [[nodiscard]] bool waits_for_press() const { return part_ == Part::press; }
    /// It was: the trip has ended the check, and this goes on beside it, by look(), until the chain
    /// was closed again.
    void begin_pressed(drivers::Time now);
    [[nodiscard]] bool pressed() const { return pressed_ != Pressed::no; }
    /// After the trip: those who can tell, the button's own latch, and that closing the chain
    /// starts nothing. `tripped`: the campaign still is; `reason`: its.
    void look(bool tripped, const std::string& reason, drivers::Time now);
    void end_pressed(const std::string& why);
    /// What a person is to do now; empty: nothing.
    [[nodiscard]] std::string asks_for() const;

    /// The proof is over; `why` it was not completed, else empty.
    void conclude(const std::string& why);

  private:
    enum class Part : std::uint8_t {
        none,
        stop,        ///< by order
        again,       ///< up to the level once more
        watchdog,    ///< is not fed
        clear,       ///< its fault
        press_ramp,  ///< up to the level for
        press,       ///< the emergency stop
        rest
    };
    /// The emergency stop: not pressed, rest is awaited, the chain is still open, closed again.
    enum class Pressed : std::uint8_t { no, rest, open, closed };

    void go_on_to(Part part, drivers::Time now);
    // One for each part; why it was not proved, else empty.
    [[nodiscard]] std::string stopped(drivers::Time now);
    [[nodiscard]] std::string climb(Part then, drivers::Time now);
    [[nodiscard]] std::string starved(drivers::Time now);
    [[nodiscard]] std::string cleared(drivers::Time now);
    [[nodiscard]] std::string press(drivers::Time now);
    void see_pressed(drivers::Time now);
    void keep_ring_down();

    SmallLevel& level_;
    Part part_ = Part::none;
    bool begun_ = false;  ///< the part's own act is done
    StopTimes times_;
    bool press_wanted_ = false;
    Pressed pressed_ = Pressed::no;
    drivers::Time pressed_at_ = 0;    ///< when that began
    drivers::Time asked_steady_ = 0;  ///< when a person was asked, by the steady clock
    bool press_felt_ = false;         ///< by the controller, too
    bool press_seen_ = false;         ///< by the chain's register
};

}  // namespace vibrig::campaign
