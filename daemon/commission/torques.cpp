// G torques: what each torquer turns, which way and by how much.
#include "estimator/commissioning/torques.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "daemon/commission/procedure.hpp"

namespace vibrig::commission {

namespace room = estimator::commissioning;

namespace {

constexpr double kTorque_deg_h = 60;
constexpr double kFree_s = 15, kTorqued_s = 12;
// A torquer, and the frame that commands it, take their time.
constexpr double kFollows_s = 3;
// Twice what is commanded, and 30 deg/h of drift, turn by 0.55 deg while one torque lasts.
constexpr double kTurns_deg = 1;
constexpr std::array<const char*, 3> kAxis{"x", "y", "z"}, kCommand{"X", "Y", "Z"};

std::string axes_of(const room::TorqueFinding& f) {
    return fmt::format("{} {} {}", kAxis[static_cast<std::size_t>(f.axis[0])],
                       kAxis[static_cast<std::size_t>(f.axis[1])],
                       kAxis[static_cast<std::size_t>(f.axis[2])]);
}

}  // namespace

void Procedure::ask_torques() {
    if (by_hand_ || !rig_->has_torquers()) return ask_turns();
    torque_deg_h_ = std::min(kTorque_deg_h, stated_.torque_limit_deg_h);
    ask({"permit.torque",
         fmt::format("I will let the platform go and torque it by {:g} deg/h, one axis after the "
                     "other, both ways: it turns by less than {:g} deg. May I?",
                     torque_deg_h_, kTurns_deg),
         "yes or no; no: the torquers stay unproven", "", yes_or_no},
        [this](const std::string& value) {
            if (value == "yes") return plan_torques();
            tell("G  not torqued: levelling.torque_sign stays as stated, unproven");
            ask_turns();
        });
}

void Procedure::plan_torques() {
    torque_plan_ = {Vec3{}};
    for (std::size_t k = 0; k < 3; ++k) {
        for (const double way : {1.0, -1.0}) {
            Vec3 command{};
            command[k] = way * torque_deg_h_;
            torque_plan_.push_back(command);
        }
    }
    torqued_.clear();
    // With the inner gimbal at 0 every axis turns the readings alike; 45 deg mixes them.
    const auto nearest = [this](std::size_t gimbal) {
        double best = HUGE_VAL;
        for (const double angle : {45.0, -45.0, 135.0, -135.0})
            if (const double travel = travel_to(gimbal, angle); std::abs(travel) < std::abs(best))
                best = travel;
        return best;
    };
    Vec3 to{};
    to[slot_of(0)] = nearest(0);
    to[slot_of(1)] = travel_to(1, 0);
    to[slot_of(2)] = nearest(2);
    torquing_ = true;
    tell(fmt::format("G  torque of {:g} deg/h about each axis, {:g} s each way", torque_deg_h_,
                     kTorqued_s));
    move(to, [this] {
        release();
        average(kLetGo_s, [this] { next_torque(); });
    });
}

void Procedure::next_torque() {
    const bool over = torqued_.size() == torque_plan_.size();
    torque(over ? Vec3{} : torque_plan_[torqued_.size()]);
    average(kFollows_s, [this, over] {
        if (over) return decide_torques();
        const bool free = torqued_.empty();
        average(free ? kFree_s : kTorqued_s, [this] {
            room::Torqued one{torque_, {mean_.angle, drift_slope()}};
            torqued_.push_back(one);
            next_torque();
        });
    });
}

/// Sends it, and again with each step: a frame may be lost.
void Procedure::torque(const Vec3& deg_per_h) {
    if (deg_per_h != torque_) note("torque", {{"deg_per_h", deg_per_h}});
    torque_ = deg_per_h;
    torque_from_ = rig_->sample();
    if (!replaying_) rig_->torque(torque_);
}

/// A torquer that turns the platform too far, or a channel that is silent, ends it.
void Procedure::watch_torque(drivers::Time now) {
    if (!torquing_) return;
    rig_->torque(torque_);
    if (torque_ == Vec3{} || doing_ != Doing::averaging) return;
    const Look seen = rig_->sample();
    if (!seen.good || now - seen.to > drivers::kSecond / 2)
        return stop("a channel is silent or not good", now);
    const Vec3 angle = unwrapped(seen.angle, torque_from_.angle);
    for (std::size_t c = 0; c < 3; ++c) {
        const double turned =
            std::abs(angle[c] - torque_from_.angle[c]) / std::max(std::abs(ratio_[c]), 1e-12);
        if (turned <= kTurns_deg) continue;
        const auto axis = std::ranges::find_if(torque_, [](double v) { return v != 0; });
        return conclude(
            Verdict::refused,
            fmt::format("torque command {} of {:g} deg/h: {} has turned by {:.2f} deg "
                        "in {:.1f} s, stopped",
                        kCommand[static_cast<std::size_t>(axis - torque_.begin())], *axis,
                        names_.angle[c], turned, drivers::to_seconds(seen.to - torque_from_.to)),
            {"levelling.torque_message"});
    }
}

void Procedure::decide_torques() {
    torquing_ = false;
    room::TorqueFinding as_is, renamed;
    try {
        as_is = room::find_by_torque(earth_.description, earth_.rate, torqued_);
        renamed = room::named_by_torquers(earth_.description, earth_.rate, torqued_);
    } catch (const std::invalid_argument& wrong) {
        return conclude(Verdict::refused, wrong.what());
    }
    if (as_is.verdict != Verdict::decided)
        return conclude(Verdict::refused, as_is.why + " (no torque: answer no)",
                        {"levelling.torque_sign", "levelling.torque_message"});
    if (!renamed.named()) return take_torques(as_is);
    if (as_is.named()) return take_torques(renamed);
    const auto text =
        fmt::format("Torques X Y Z turn platform axes {}, if {}, {}, {} are x, y, z.",
                    axes_of(as_is), names_.force[0], names_.force[1], names_.force[2]);
    ask({"names", text + " By the drawing, whose names are the platform's axes?",
         "torquers, accelerometers or - (not known)", "-",
         [](std::string& value) {
             return value == "torquers" || value == "accelerometers" || value == "-"
                        ? ""
                        : "torquers, accelerometers or - (not known)";
         }},
        [this, text, as_is, renamed](const std::string& value) {
            if (value == "-")
                return conclude(Verdict::undecided,
                                text +
                                    " One of both is misnamed: what would "
                                    "tell: the maker's drawing",
                                {"accelerometer.matrix", "levelling.torque_message"});
            take_torques(value == "torquers" ? renamed : as_is);
        });
}

void Procedure::take_torques(const room::TorqueFinding& f) {
    earth_.description = f.description;
    tell(fmt::format("G  torques X Y Z turn platform {}, scale {:+.3f} {:+.3f} {:+.3f} +- {:.3f}",
                     axes_of(f), f.sign[0] * f.scale[0], f.sign[1] * f.scale[1],
                     f.sign[2] * f.scale[2], f.sigma));
    for (const auto& odd : f.warnings) tell("   " + odd);
    finding_.evidence["torquers"] = {{"sign", f.sign},
                                     {"scale", f.scale},
                                     {"axes", axes_of(f)},
                                     {"turn_arcmin", f.turn_arcmin},
                                     {"told", f.warnings}};
    finding_.sigma["torquer_scale"] = f.sigma;
    for (std::size_t k = 0; k < 3; ++k)
        if (const auto turns = static_cast<std::size_t>(f.axis[k]); turns != k)
            finding_.corrections.push_back(
                fmt::format("{}: its {} turns platform axis {}, expected {}: exchange the signals' "
                            "names",
                            names_.torque, kCommand[k], kAxis[turns], kAxis[k]));
    if (f.named()) {
        tell("   gyros x y z drift about the axes of their torquers: input axes x, y, z");
        finding_.keys.push_back({"levelling.torque_sign",
                                 fmt::format("[{}, {}, {}]", f.sign[0], f.sign[1], f.sign[2]),
                                 fmt::format("rates under {:g} deg/h: scale {:.3f} {:.3f} {:.3f}",
                                             torque_deg_h_, f.scale[0], f.scale[1], f.scale[2])});
    }
    ask_turns();
}

}  // namespace vibrig::commission
