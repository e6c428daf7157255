#pragma once

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <cmath>
#include <map>
#include <optional>
#include <sstream>

#include "daemon/commission/procedure.hpp"
#include "tests/plant/platform_model.hpp"
#include "tests/unit/estimator/commissioning/unknown_rig.hpp"

namespace vibrig::commission {

using drivers::kSecond;
using drivers::Time;
using estimator::commissioning::UnknownRig;

inline constexpr std::array<const char*, 3> kGimbals{"outer", "inner", "azimuth"};

/// A rig of which nobody knows anything, and people who answer truly; virtual time.
class Commissioned : public ::testing::Test {
  protected:
    void rig_of(std::uint64_t seed) {
        rig = std::make_unique<UnknownRig>(seed);
        based = false;
        travel = {};
        drifting_since = 0;
        // A reading near its zero may wrap within a second's mean, here as on a rig.
        procedure = std::make_unique<Procedure>(names(), Stated{0, 2, true}, wired, wired);
    }

    static Names names() {
        Names n{{"A", "B", "C"}, {"X", "Y", "Z"}, "Command"};
        n.dbc = "\"rig.dbc\"";
        n.sample_rate = "40";
        return n;
    }

    /// The fixture, as the procedure acts on it.
    class Wired final : public Rig, public Keeper {
      public:
        explicit Wired(Commissioned& of) : of_(of) {}

        Look sample() override { return of_.seen(of_.now - kSecond / 40, 5 / 3600.0); }
        Look second() override {
            return of_.seen(of_.now / kSecond * kSecond - kSecond, 1 / 3600.0);
        }
        std::optional<SampleRate> rate() override { return of_.sample_rate; }
        drivers::GimbalState gimbal() override {
            return of_.now >= of_.arrives ? drivers::GimbalState::in_position
                                          : drivers::GimbalState::slewing;
        }
        void slew(const Vec3& command, Time) override { of_.slew(command); }
        void release(Time) override { of_.let_go(); }
        bool has_torquers() const override { return of_.torquers.has_value(); }
        void torque(const Vec3& command) override {
            if (command != of_.torque) of_.torque_to(command);
            ++of_.torques;
        }
        bool has_increments() const override { return of_.counts.has_value(); }
        void count() override { of_.counted_from = of_.rig->angle_deg(); }
        Vec3 counted() override { return of_.counted(); }
        void slew_counting(const Vec3& command, Time) override {
            ++of_.counting_slews;
            of_.slew(command);
        }

        void event(const std::string& text) override { of_.events.push_back(text); }
        void note(const Note& note) override { of_.notes.push_back(note); }
        void keep(const Json& log) override { of_.kept = log; }

      private:
        Commissioned& of_;
    };

    void let_go() {
        ++released;
        drift = rig->drift(turned_by(torque));
        drifting_since = now;
        if (!ends_ahead_deg) return;
        ends = drift.reading;
        for (std::size_t i = 0; i < 3; ++i)
            (*ends)[static_cast<std::size_t>(rig->channel[i])] += *ends_ahead_deg / rig->degrees[i];
    }

    /// What gyros along the platform's true axes have counted, of a turn below 90 deg.
    [[nodiscard]] Vec3 counted() const {
        using plant::operator*;
        const plant::PlatformModel model(rig->truth);
        Vec3 turn{};
        for (std::size_t axis = 0; axis < 3; ++axis) {
            plant::Vec3 reference{};
            reference[axis] = 1;
            const auto before = model.seen((M_PI / 180) * counted_from, reference);
            const auto after = model.seen((M_PI / 180) * rig->angle_deg(), reference);
            for (std::size_t i = 0; i < 3; ++i)
                turn[i] += 0.5 * (after[(i + 1) % 3] * before[(i + 2) % 3] -
                                  after[(i + 2) % 3] * before[(i + 1) % 3]);
        }
        const double sine = std::hypot(turn[0], turn[1], turn[2]);
        for (std::size_t i = 0; i < 3; ++i)
            turn[i] *= (*counts)[i] * 180 / M_PI * (sine > 0 ? std::asin(sine) / sine : 1);
        return turn;
    }

    [[nodiscard]] Vec3 turned_by(const Vec3& command) const {
        if (!torquers) return {};
        const Eigen::Vector3d turn = *torquers * Eigen::Vector3d(command.data());
        return {turn[0], turn[1], turn[2]};
    }

    void torque_to(const Vec3& command) {
        torque = command;
        for (std::size_t i = 0; i < 3; ++i)
            most_torque = std::max(most_torque, std::abs(torque[i]));
        if (drifting_since == 0) return;
        const double hours = drivers::to_seconds(now - drifting_since) / 3600;
        auto next = rig->drift(turned_by(command));
        for (std::size_t c = 0; c < 3; ++c)
            next.reading[c] = drift.reading[c] + hours * drift.slope[c];
        drift = next;
        drifting_since = now;
    }

    void slew(const Vec3& command) {
        ++slews;
        drifting_since = 0;
        for (std::size_t i = 0; !based && i < 3; ++i) base[i] = command[i] - travel[i] / gain;
        based = true;
        double farthest = 0;
        for (std::size_t i = 0; i < 3; ++i) {
            const double to = gain * (command[i] - base[i]) + offset_deg;
            farthest = std::max(farthest, std::abs(to - travel[i]));
            if (i == 2 && to != travel[i])
                azimuth_grew = rig->sign[2] * rig->direction[2] * (to - travel[i]) > 0;
            EXPECT_LT(std::abs(to - travel[i]), 170) << "there are two ways round";
            travel[i] = to;
            most_travel[i] = std::max(most_travel[i], std::abs(to));
            if (std::abs(to) > rig->travel_deg[i] + 1) ++beyond[to > 0 ? 1 : 0];
        }
        rig->go(travel);
        arrives = now + drivers::from_seconds(farthest / 5);
    }

    Look seen(Time from, double noise_deg) {
        Look look{from, from + kSecond, {}, rig->force_at(rig->angle_deg()), good};
        look.to = now;
        look.angle = rig->reading_at(rig->angle_deg());
        for (std::size_t i = 0; i < 3; ++i) {
            const auto c = static_cast<std::size_t>(rig->channel[i]);
            look.angle[c] += noise_deg / rig->degrees[i] * rig->random.normal();
            look.force[i] += 1e-5 * rig->random.normal();
            if (sticks == static_cast<int>(i)) look.force[i] = 0.0031;
            if (drifting_since == 0) continue;
            look.angle[c] = drift.reading[c] +
                            drift.slope[c] * drivers::to_seconds(from - drifting_since) / 3600;
            // An encoder's whole turns are nothing that it reads.
            const double turn = 360 / rig->degrees[i];
            if (ends) look.angle[c] -= turn * std::ceil((look.angle[c] - (*ends)[c]) / turn);
        }
        return look;
    }

    /// A hand: by the reading, deg of the gimbal.
    void turn(std::size_t gimbal, double to) {
        travel[gimbal] = rig->sign[gimbal] * rig->direction[gimbal] * to;
        rig->go(travel);
        drift = rig->drift();  // a hand holds nothing
        drifting_since = now;
    }

    std::string answer_to(const std::string& id, const std::string& text) {
        if (const auto it = answers.find(id); it != answers.end()) return it->second;
        if (id == "travel") {
            std::ostringstream out;
            for (const double most : rig->travel_deg)
                out << -std::min(most, 175.0) << ' ' << std::min(most, 175.0) << ' ';
            return out.str();
        }
        if (id == "latitude") return std::to_string(rig->truth.latitude_deg);
        if (id == "compass") return std::to_string(rig->truth.azimuth_deg + 8);
        if (id == "drawing") return rig->right_handed() ? "yes" : "no";
        if (id == "anticlockwise") return azimuth_grew == rig->grows_anticlockwise() ? "yes" : "no";
        if (id == "turn") {
            turn(2, by_hand_deg[2] + (rig->grows_anticlockwise() ? 20 : -20));
            return "done";
        }
        for (std::size_t i = 0; i < 3; ++i)
            if (id == std::string("hand.") + kGimbals[i]) turn(i, 9);
        if (id == "hand") {
            constexpr std::array<const char*, 3> kLoud{"OUTER to ", "INNER to ", "AZIMUTH to "};
            for (std::size_t i = 0; i < 3; ++i)
                if (const auto at = text.find(kLoud[i]); at != std::string::npos)
                    turn(i, by_hand_deg[i] = std::stod(text.substr(text.find("to ", at) + 3)));
        }
        if (id.starts_with("permit") || id == "power" || id == "go_on") return "yes";
        return "";
    }

    /// To the end, or until `until` is asked. Wall and rig's time go together.
    Json run(bool by_hand = false, const std::string& until = {}) {
        if (!procedure->active()) {
            procedure->begin("Ada", by_hand, now);
        }
        for (int n = 0; n < 200'000 && procedure->active(); ++n) {
            now += kSecond / 10;
            if (attended) procedure->attend("Ada", now);
            procedure->step(now, now);
            const Question* question = procedure->asks();
            if (question == nullptr) continue;
            const std::string id = question->id;
            if (id == until) return procedure->state(0);
            asked.push_back(id);
            EXPECT_EQ(procedure->answer("Ada", id, answer_to(id, question->text)), "") << id;
        }
        return procedure->state(0);
    }

    /// Time passes, with somebody there; what is asked waits.
    void pass(double seconds, const std::string& who = "Ada") {
        for (const Time end = now + drivers::from_seconds(seconds); now < end;) {
            now += kSecond / 20;
            if (!who.empty()) procedure->attend(who, now);
            procedure->step(now, now);
        }
    }

    /// Answers what is asked until `done`; nothing is asked then.
    template <class Done>
    void run_until(Done done) {
        for (int n = 0; n < 200'000 && procedure->active(); ++n) {
            now += kSecond / 20;
            procedure->attend("Ada", now);
            procedure->step(now, now);
            const Question* question = procedure->asks();
            if (question == nullptr && done()) return;
            if (question == nullptr) continue;
            const std::string id = question->id;
            ASSERT_EQ(procedure->answer("Ada", id, answer_to(id, question->text)), "");
        }
        FAIL() << procedure->state(0).dump(1);
    }

    [[nodiscard]] std::string question() const {
        const Question* asked_now = procedure->asks();
        return asked_now == nullptr ? "" : asked_now->id;
    }

    Wired wired{*this};
    std::unique_ptr<UnknownRig> rig;
    std::optional<std::array<int, 3>> counts;  ///< the gyros' signs; none: no increments
    plant::Vec3 counted_from{};
    int counting_slews = 0;
    std::optional<SampleRate> sample_rate;  ///< none: nobody measures it
    std::unique_ptr<Procedure> procedure;
    std::map<std::string, std::string> answers;
    std::vector<std::string> asked, events;
    std::vector<Note> notes;
    Time now = 100 * kSecond, arrives = 0, drifting_since = 0;
    bool based = false, good = true, attended = true, azimuth_grew = false;
    double gain = 1, offset_deg = 0;
    Vec3 base{}, travel{}, most_travel{}, by_hand_deg{};
    estimator::commissioning::FreeDrift drift;
    std::optional<Eigen::Matrix3d> torquers;  ///< truth's platform rate over the command
    std::optional<double> ends_ahead_deg;     ///< each encoder's turn, of where it is let go
    std::optional<Vec3> ends;                 ///< by channel
    Vec3 torque{};
    double most_torque = 0;
    int sticks = -1;  ///< accelerometer that shows the same all the time
    int slews = 0, released = 0, torques = 0;
    std::array<int, 2> beyond{};  ///< commands into a stop, to lower and to higher angles
    Json kept;                    ///< what is on disk
};

}  // namespace vibrig::commission
