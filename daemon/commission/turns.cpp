// G increments: what the gyros count while one gimbal after the other is slewed, where the bus has
// their increments; each gyro's axis, and its own sign.
#include "estimator/commissioning/turns.hpp"

#include <spdlog/fmt/fmt.h>

#include <stdexcept>

#include "daemon/commission/procedure.hpp"

namespace vibrig::commission {

namespace room = estimator::commissioning;

namespace {

constexpr double kTurn_deg = 20;
constexpr std::array<const char*, 3> kAxisNames{"x", "y", "z"};

}  // namespace

void Procedure::ask_turns() {
    if (by_hand_ || !rig_->has_increments()) return name_rig();
    ask({"permit.turns",
         fmt::format("I will turn each gimbal by {:g} deg while the gyros count. May I?",
                     kTurn_deg),
         "yes or no; no: the gyros' own signs stay unproven", "", yes_or_no},
        [this](const std::string& value) {
            if (value == "yes") {
                turning_ = true;
                tell(fmt::format("G  increments: each gimbal turns by {:g} deg", kTurn_deg));
                return next_turn();
            }
            tell("G  increments not counted: the gyros' own signs stay as stated, unproven");
            name_rig();
        });
}

void Procedure::next_turn() {
    counting_ = false;
    if (turns_.size() == 3) return decide_turns();
    move({}, [this] {
        average(1, [this] {
            turn_from_ = mean_.angle;
            const std::size_t slot = turns_.size();
            Vec3 to{};
            const auto& [least, most] = limits_deg_[slot];
            to[slot] = most >= -least ? std::min(kTurn_deg, most) : -std::min(kTurn_deg, -least);
            if (!replaying_) rig_->count();
            counting_ = true;
            move(to, [this] {
                average(1, [this] {
                    turns_.push_back({turn_from_, mean_.angle, counted_deg_});
                    next_turn();
                });
            });
        });
    });
}

void Procedure::decide_turns() {
    turning_ = false;
    room::TurnFinding f;
    try {
        f = room::find_by_turns(earth_.description, turns_);
    } catch (const std::invalid_argument& wrong) {
        return conclude(Verdict::refused, wrong.what(), {"zeroing.gyro_message"});
    }
    if (f.verdict != Verdict::decided)
        return conclude(Verdict::refused, f.why + " (not counted: answer no)",
                        {"zeroing.gyro_message"});
    std::string axes, counts;
    for (std::size_t k = 0; k < 3; ++k) {
        const auto axis = static_cast<std::size_t>(f.axis[k]);
        axes +=
            fmt::format("{}{}{}", k == 0 ? "" : " ", f.sign[k] < 0 ? "-" : "+", kAxisNames[axis]);
        counts += fmt::format(" {:.3f}", f.scale[k]);
    }
    finding_.evidence["increments"] = {{"axes", axes}, {"sign", f.sign}, {"scale", f.scale}};
    tell(fmt::format("   gyro increments X Y Z count turns about {}, scale{}", axes, counts));
    if (!f.named())
        return conclude(Verdict::undecided,
                        fmt::format("gyro increments X Y Z count about platform axes {}, if {}, "
                                    "{}, {} are x, y, z: gyro x is the platform's x. What would "
                                    "tell whose names are wrong: the maker's drawing",
                                    axes, names_.force[0], names_.force[1], names_.force[2]),
                        {"accelerometer.matrix", "zeroing.gyro_message"});
    name_rig();
}

}  // namespace vibrig::commission
