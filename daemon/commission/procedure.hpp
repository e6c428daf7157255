#pragma once

#include <array>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "daemon/commission/finding.hpp"
#include "daemon/commission/rig.hpp"
#include "estimator/commissioning/torques.hpp"
#include "estimator/commissioning/turns.hpp"

namespace vibrig::commission {

using estimator::commissioning::Verdict;

/// What an earlier daemon kept of a procedure.
struct Kept {
    Json log = Json::array();
    std::string why_not;  ///< it does not count; empty: it does
    std::string again;    ///< asked once more: "latitude", "compass", "drawing" or "sense"
};

/// Something that a person is asked.
struct Question {
    std::string id, text, expected;
    std::string usual;  ///< what an empty answer means; empty: there has to be one
    /// Why the answer is none; empty: it is. It may be changed into another form.
    std::function<std::string(std::string&)> wrong;
};

/// For Question::wrong; y and n become yes and no.
[[nodiscard]] std::string yes_or_no(std::string& answer);
[[nodiscard]] std::string done_alone(std::string& answer);

/// Steps A to G (docs/commissioning.md): looks, moves one gimbal at a time, names the rig by
/// gravity, the Earth's rate and torques. What moves is decided here: nothing moves without a
/// permission, beyond the travel that was stated, or while nobody is there. Control thread only;
/// never waits.
class Procedure {
  public:
    /// `rig` and `keeper` outlive it.
    Procedure(Names names, Stated stated, Rig& rig, Keeper& keeper)
        : names_(std::move(names)), stated_(stated), rig_(&rig), keeper_(&keeper) {}

    /// `by_hand`: a person moves the gimbals, and nothing is commanded.
    void begin(const std::string& by, bool by_hand, drivers::Time now);
    /// The same, from where another one was, without moving: what it kept is answered and measured
    /// already. Nothing moves before a new permission, and the last position is measured anew
    /// first: where it is another, all begins anew.
    void begin_again(const std::string& by, bool by_hand, const Kept& kept, drivers::Time now);
    /// Answers by question, a list for one that comes again: what is asked is answered at once, so
    /// that a script's rig does not wait for a tool. Simulated rigs only.
    void answer_all(Json answers) { script_ = std::move(answers); }
    /// Why it is not taken; empty: it is. The person who began it answers, nobody else.
    [[nodiscard]] std::string answer(const std::string& by, const std::string& id,
                                     std::string value);
    /// The tool of the person who began is there, at this time of CLOCK_MONOTONIC; another's does
    /// not count.
    void attend(const std::string& by, drivers::Time wall);
    /// A person's stop: it goes on with a new permission.
    void stop(const std::string& why, drivers::Time now);
    /// It is over, for this reason.
    void halt(const std::string& why, drivers::Time now);
    /// Returns when to be called next at the latest.
    drivers::Time step(drivers::Time now, drivers::Time wall);

    [[nodiscard]] bool active() const noexcept { return doing_ != Doing::nothing; }
    [[nodiscard]] const std::string& by() const noexcept { return by_; }
    [[nodiscard]] bool by_hand() const noexcept { return by_hand_; }
    /// What is asked; null: nothing.
    [[nodiscard]] const Question* asks() const noexcept {
        return doing_ == Doing::asking ? &question_ : nullptr;
    }
    [[nodiscard]] bool moves() const noexcept {
        return doing_ == Doing::moving || doing_ == Doing::settling;
    }
    /// Who does what, on one line, for those who only watch.
    [[nodiscard]] std::string progress() const;
    [[nodiscard]] const Finding& finding() const noexcept { return finding_; }
    /// Question, lines from number `after` on, and what was found.
    [[nodiscard]] Json state(std::size_t after) const;

    static constexpr drivers::Time kAbsent = 2 * drivers::kSecond;  ///< no tool: nothing moves

  private:
    static constexpr double kHolds_deg = 0.5;  ///< where nothing is to move
    static constexpr double kDrift_s = 25;     ///< of one free drift
    static constexpr double kLetGo_s = 3;      ///< what follows a release is not yet its drift

    enum class Doing : std::uint8_t { nothing, asking, moving, settling, averaging };
    using Then = std::function<void()>;

    // procedure.cpp: what asking, moving and averaging are
    void open(const std::string& by, bool by_hand, drivers::Time now);
    void ask(Question question, std::function<void(const std::string&)> then);
    void ask_yes(const std::string& id, const std::string& text, const std::string& no, Then then,
                 const std::string& usual = {});
    void move(const Vec3& travel_deg, Then then);
    void next_leg();
    void average(double seconds, Then then);
    void tell(const std::string& line);
    void note(const char* what, const Json& data) const;
    [[nodiscard]] std::string step_name() const;
    void conclude(Verdict verdict, const std::string& why, std::vector<std::string> suspects = {});
    /// The key of an angle channel.
    [[nodiscard]] static std::string key_of(std::size_t channel) {
        return std::string("can.signals.") + (channel < 3 ? kGimbalNames[channel] : "outer");
    }
    [[nodiscard]] std::vector<std::string> keys_of_moving() const;
    void watch_move(drivers::Time now);
    void arrive(drivers::Time now);
    [[nodiscard]] std::string stopped_short() const;
    void keep_within(const std::string& why);
    void take_second(drivers::Time now);
    void stand();
    void release();
    void command_to(const Vec3& command);
    void go_on_after_stop();
    void answer_by_script();
    void take_said(const std::string& value);
    /// Where the gimbals whose readings are understood stand, as travel from the start.
    [[nodiscard]] Vec3 read_travel(const Vec3& near) const;
    [[nodiscard]] std::string contradiction(const Look& seen) const;
    [[nodiscard]] Vec3 within_travel(Vec3 travel_deg) const;
    [[nodiscard]] double whole_turn(std::size_t channel) const;
    [[nodiscard]] Vec3 unwrapped(const Vec3& angle, const Vec3& near) const;

    // progress.cpp: what is kept, and gone on from
    void take_answer(const std::string& value);
    void keep(Json entry);
    void keep_mean();
    void replay(const Json& log);
    [[nodiscard]] bool replay_mean(const Json& entry);
    void replay_stop(const Json& entry);
    void leave_answers(const Json& log, std::size_t from);
    void permit_again();
    void measure_again();
    [[nodiscard]] std::string moved_since() const;

    // steps.cpp: A to D
    void ask_degrees();
    void ask_travel();
    void ask_stop_means();
    void look();
    void looked();
    [[nodiscard]] std::string rate_text();
    [[nodiscard]] std::vector<std::string> stuck_channels() const;
    void hold_still();
    void held_still();
    void try_gimbal();
    void nudge();
    void nudged();
    void small_move(std::size_t index);
    void small_moved();
    void confirm_name();
    void name_gimbal(std::size_t gimbal);
    void next_gimbal();
    void hand_moved();
    /// Which command moves a gimbal, as a person says; and a travel by gimbal as one by command.
    [[nodiscard]] std::size_t slot_said(std::size_t gimbal) const;
    [[nodiscard]] Vec3 by_slot(const Vec3& by_gimbal) const;
    void plan_sweeps();
    void next_stop();

    // naming.cpp: what follows from them
    void decide_gravity();
    [[nodiscard]] std::string wrong_name() const;
    [[nodiscard]] std::vector<std::string> gravity_suspects() const;
    void separate();
    void plan_drifts();
    void next_drift();
    void drifted();
    void watch_azimuth();
    void azimuth_turned();
    void after_sense();
    void ask_people();
    void ask_sense_again();
    void ask_latitude();
    void ask_drawing();
    void decide();
    void name_rig();
    [[nodiscard]] std::string why_not_torqued() const;
    [[nodiscard]] Vec3 drift_slope() const;
    /// Travel that brings a gimbal of the description to an angle, the shorter way.
    [[nodiscard]] double travel_to(std::size_t gimbal, double angle_deg) const;
    [[nodiscard]] std::size_t slot_of(std::size_t gimbal) const;
    /// Least and most that its encoder reads within the limits of its travel, deg.
    [[nodiscard]] std::array<double, 2> readings_of(std::size_t slot) const;

    // turns.cpp: G, of the gyros' increments
    void ask_turns();
    void next_turn();
    void decide_turns();

    // torques.cpp: G
    void ask_torques();
    void plan_torques();
    void next_torque();
    void torque(const Vec3& deg_per_h);
    void watch_torque(drivers::Time now);
    void decide_torques();
    void take_torques(const estimator::commissioning::TorqueFinding& f);

    Names names_;
    Stated stated_;
    Rig* rig_;
    Keeper* keeper_;
    std::string by_;
    bool by_hand_ = false;
    drivers::Time now_ = 0, attended_ = 0;

    Doing doing_ = Doing::nothing;
    Then then_;
    std::function<void(const std::string&)> answered_;
    Question question_;
    struct Interrupted {
        Doing doing = Doing::nothing;
        Then then;
        bool drifted = false;  ///< it was let go for a measurement
        bool unkept = false;
        Vec3 torque{};
    };
    std::optional<Interrupted> interrupted_;  ///< by a stop, or the end of a daemon

    // what is kept
    Json log_ = Json::array(), script_;
    Json left_ = Json::object();  ///< answers that stand, behind one that is asked again
    std::string again_;
    bool replaying_ = false;  ///< nothing is commanded, nothing is printed
    bool unkept_ = false;     ///< the mean being taken is one of a kept position
    struct Held {
        Vec3 travel{};
        Look mean;
    };
    Held held_;  ///< the last position that was measured while commanded
    struct Waiting {
        Question question;
        std::function<void(const std::string&)> answered;
    };
    std::optional<Waiting> waiting_;  ///< asked when the daemon ended

    // moving
    std::vector<Vec3> legs_;                 ///< to come, travel from the start, deg
    Vec3 travel_{}, asked_{}, command_0_{};  ///< where it is; where it goes; the start as commanded
    Look before_;                            ///< of the leg
    drivers::Time since_ = 0;
    std::size_t moving_slot_ = 3;  ///< the only gimbal that moves; 3: several
    bool careful_ = true;          ///< B: what is not known yet moves
    bool commanded_ = false;       ///< since the beginning; before, nothing is even released
    bool released_ = false;        ///< since the last slew: what is let go may stand elsewhere
    // averaging
    double wanted_s_ = 0;
    std::vector<Look> seconds_;
    Look mean_;

    // what is known
    std::array<std::array<double, 2>, 3> limits_deg_{{{-130, 130}, {-30, 30}, {-175, 175}}};
    bool met_a_stop_ = false;     ///< a travel ends where a gimbal did
    std::array<bool, 3> free_{};  ///< cables limit nothing
    bool hold_ = true;            ///< what "stop" is on this rig
    bool holds_ = false;          ///< commanded where they are, the gimbals stay
    std::vector<std::string> lines_;
    Vec3 noise_{}, start_{};
    std::vector<Look> samples_;
    std::size_t slot_ = 0;
    double amount_deg_ = 0;
    std::vector<Look> small_;
    std::array<std::size_t, 3> channel_of_{3, 3, 3};  ///< of a command; 3: not known
    Vec3 ratio_{};                         ///< reading per commanded deg, by channel; 0: not known
    std::array<int, 3> said_{-1, -1, -1};  ///< gimbal that a command moves, as a person says
    Vec3 respond_{};                       ///< gravity's turn over the gimbal's, of the first moves
    double outer_deg_ = 0;                 ///< where inner and azimuth are swept
    struct Planned {
        Vec3 travel{};
        int slot = -1;  ///< swept
    };
    std::vector<Planned> plan_;
    std::size_t at_ = 0;
    int extra_ = 0;
    std::vector<estimator::commissioning::Stop> stops_;
    std::vector<estimator::commissioning::FreeDrift> drifts_;
    estimator::commissioning::GravityFinding gravity_;
    estimator::commissioning::Description named_;
    estimator::commissioning::Statements said_of_rig_;
    estimator::commissioning::EarthFinding earth_;
    double torque_deg_h_ = 0;
    bool torquing_ = false;  ///< step G, whatever is commanded now
    Vec3 torque_{};          ///< commanded, or to be commanded once it goes on
    Look torque_from_;       ///< when it was
    std::vector<Vec3> torque_plan_;
    std::vector<estimator::commissioning::Torqued> torqued_;
    bool turning_ = false;   ///< the gyros are looked at
    bool counting_ = false;  ///< they count
    Vec3 turn_from_{}, counted_deg_{};
    std::vector<estimator::commissioning::CountedTurn> turns_;
    Look sense_before_;
    bool sense_again_ = false;  ///< asked when all was measured
    Finding finding_;
};

}  // namespace vibrig::commission
